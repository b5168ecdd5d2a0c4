"""Runs of a valve in a gas: a steady start, and what is said of supersonic ones."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.flow.energy import GAS_BOOKS, LINE_BOOKS
from dbvfiv.studies.transient.run import beyond_model

from .runs import SHORT, transient

AIR = {"fluid.density": 1.2, "fluid.continuity": "storage", "fluid.sound_speed": 343.0, "drive.pressure": 6e3}

LINE = {f"upstream.{name}": value for name, value in {"length": 3.0, "wave_speed": 300.0, "elements": 6}.items()}
LINE_ENERGIES = "line_kinetic_energy", "line_elastic_energy"


@pytest.mark.slow
def test_a_steady_start_stays(valve):
    keys = SHORT | AIR | {"transient.duration": 2e-3, "transient.step": 5e-4, "transient.start": "steady"}
    run = transient(valve(keys))
    for name in ("mass_flow", "inlet_mass_flow", "gas_energy"):
        assert np.ptp(run.history[name]) < 1e-7 * np.abs(run.history[name]).max(), name
    assert run.history["mass_flow"][0] == pytest.approx(run.history["inlet_mass_flow"][0], rel=1e-9)


@pytest.mark.parametrize("fluid", ["air", pytest.param("water behind an elastic line", marks=pytest.mark.slow)])
def test_energies_close_where_faces_shut_and_part(valve, tmp_path, fluid):
    """A blow parts the faces of a bill that is moulded shut; before and after it they let nothing pass."""
    keys, names, held = (AIR, GAS_BOOKS, ("gas_energy",)) if fluid == "air" else (LINE, LINE_BOOKS, LINE_ENERGIES)
    table = tmp_path / "blow.csv"
    table.write_text("time [ms], pressure [Pa]\n0, 300\n5, 300\n15, 3000\n35, 3000\n40, 300\n")
    keys = keys | {"valve.sealing_pressure": 800.0, "damping.alpha": 5.0, "drive.pressure": 300.0}
    times = {"transient.duration": 0.08, "transient.step": 1e-3, "transient.start": "steady"}
    history = transient(valve(keys | times | {"transient.drive_table": str(table)})).history
    flow, energy = history["mass_flow"], sum(history[name] for name in held)
    assert flow[0] == flow[5] == 0.0 and flow.max() > 0.02 and np.count_nonzero(flow == 0.0) > 10
    supply, *gone = (history[name] for name in names)
    left = energy - energy[0] - supply + sum(gone)
    assert np.abs(left).max() < 1e-12 * np.abs(supply).max()


def test_a_run_faster_than_sound_is_told():
    history = {"time": np.arange(4.0), "station_pressure": np.zeros((4, 3)), "mach": np.array([0.3, 0.9, 1.1, 0.2])}
    said = beyond_model(history, -101325.0)
    assert "faster than sound in the valve from 2 s on, in 25 % of the steps and up to Mach 1.1" in said
    assert beyond_model(history | {"mach": np.full(4, 0.9)}, -101325.0) is None
