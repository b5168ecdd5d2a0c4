"""Runs of a valve in a gas: files, resuming, starts, what is kept, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.studies.transient.history import GAS
from dbvfiv.studies.transient.run import beyond_model
from tests.observers import Stop

from .runs import SHORT, transient

AIR = {"fluid.density": 1.2, "fluid.continuity": "storage", "fluid.sound_speed": 343.0, "drive.pressure": 6e3}


@pytest.mark.parametrize("adaptive", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_resumed_run_gives_the_same_numbers(tmp_path, valve, adaptive, all_restart_points):
    changes = SHORT | AIR | {"transient.duration": 0.012, "transient.adaptive": adaptive, "transient.step": 5e-4}
    model = valve(changes | {"transient.local_error": 1e-5, "transient.numerical_damping": 0.1})
    whole = transient(model, output=tmp_path / "whole.h5")
    assert whole.complete and whole.history["gas_supply"][-1] > 0.0
    stopped = transient(model, output=tmp_path / "parts.h5", observer=Stop(10))
    assert not stopped.complete
    resumed = dbvfiv.resume(tmp_path / "parts.h5")
    for name in whole.history:
        assert np.array_equal(resumed.history[name], whole.history[name]), name


def test_a_steady_start_stays_and_an_incompressible_run_keeps_nothing_of_it(valve):
    keys = SHORT | AIR | {"transient.duration": 2e-3, "transient.step": 5e-4, "transient.start": "steady"}
    run = transient(valve(keys))
    for name in ("mass_flow", "inlet_mass_flow", "gas_energy"):
        assert np.ptp(run.history[name]) < 1e-7 * np.abs(run.history[name]).max(), name
    assert run.history["mass_flow"][0] == pytest.approx(run.history["inlet_mass_flow"][0], rel=1e-9)
    plain = transient(valve({name: value for name, value in keys.items() if name != "fluid.sound_speed"}))
    assert not {c.name for c in GAS} & set(plain.history) and not len(plain.mesh.gas_unknowns)


def test_a_run_faster_than_sound_is_told():
    history = {"time": np.arange(4.0), "station_pressure": np.zeros((4, 3)), "mach": np.array([0.3, 0.9, 1.1, 0.2])}
    said = beyond_model(history)
    assert "faster than sound in the valve from 2 s on, in 25 % of the steps and up to Mach 1.1" in said
    assert beyond_model(history | {"mach": np.full(4, 0.9)}) is None
