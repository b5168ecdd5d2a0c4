"""Runs of a valve behind an elastic line: files, resuming, starts, and what is kept without one."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import dbvfiv
from dbvfiv.record.record import StoredRecord
from dbvfiv.studies.case import Case
from dbvfiv.studies.transient.history import HISTORY, LINE, rows_to_keep, tables_of
from tests.observers import Stop

from .runs import SHORT, transient

WAVES = {
    "upstream.length": 6.0,
    "upstream.wave_speed": 600.0,
    "upstream.loss": 1.5,
    "upstream.elements": 2,
    "drive.pressure": 6e3,
}


@pytest.mark.parametrize("adaptive", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_resumed_run_gives_the_same_numbers(tmp_path, valve, adaptive, all_restart_points):
    changes = SHORT | WAVES | {"transient.duration": 0.03, "transient.adaptive": adaptive, "transient.step": 5e-4}
    model = valve(changes | {"fluid.density": 1.2, "transient.local_error": 1e-5, "transient.numerical_damping": 0.1})
    whole = transient(model, output=tmp_path / "whole.h5")
    assert whole.complete and whole.history["line_supply"].shape == whole.history["time"].shape
    for after in (1, 40):
        stopped = transient(model, output=tmp_path / "parts.h5", observer=Stop(after))
        assert not stopped.complete
        known = StoredRecord(tmp_path / "parts.h5", tables_of, Case)
        assert rows_to_keep(known, model.case)[HISTORY] == 1 + 7 * (after // 7)
        resumed = dbvfiv.resume(tmp_path / "parts.h5")
        for name in whole.history:
            assert np.array_equal(resumed.history[name], whole.history[name]), name


def test_nothing_is_stored_of_a_rigid_column(tmp_path, valve):
    rigid = {name: value for name, value in WAVES.items() if "wave" not in name and "elements" not in name}
    run = transient(valve(SHORT | rigid | {"transient.duration": 0.005}), output=tmp_path / "rigid.h5")
    assert not {c.name for c in LINE} & set(run.history) and not len(run.mesh.line_places)
    with h5py.File(tmp_path / "rigid.h5") as file:
        assert "line_places" not in file["mesh"] and "line" not in file["tables/restart"]


@pytest.mark.parametrize("law", [pytest.param("quasi-steady", marks=pytest.mark.slow), "storage"])
def test_from_rest_a_wave_has_to_arrive_first(valve, law):
    """Nothing moves for L/c; then the wave is thrown back by a valve that is all but shut: twice the pressure."""
    step = 5e-5
    keys = {"transient.duration": 280 * step, "transient.step": step, "fluid.density": 100.0, "fluid.continuity": law}
    run = transient(valve(SHORT | WAVES | keys | {"upstream.elements": 8}))
    time, flange = run.history["time"], run.history["station_pressure"][:, -1]
    arrival = 6.0 / 600.0
    assert np.abs(flange[time < 0.7 * arrival]).max() < 0.05 * 6e3
    # walls that take up fluid soften the blow
    thrown = 1.1 if law == "quasi-steady" else 0.6
    assert flange[(time > 1.05 * arrival) & (time < 1.4 * arrival)].max() > thrown * 6e3
    stored = run.history["line_kinetic_energy"] + run.history["line_elastic_energy"]
    books = run.history["line_supply"] - run.history["line_dissipation"] - run.history["line_work"]
    assert stored[-1] > 0 and stored[0] == 0.0 and np.all(stored <= books + 1e-9 * stored.max())


def test_a_steady_start_stays(valve):
    keys = {"transient.duration": 0.02, "transient.step": 1e-3, "transient.start": "steady", "fluid.density": 100.0}
    run = transient(valve(SHORT | WAVES | keys | {"upstream.friction": 0.02, "drive.at": "line"}))
    flow = run.history["mass_flow"]
    assert np.abs(flow / flow[0] - 1).max() < 1e-8
