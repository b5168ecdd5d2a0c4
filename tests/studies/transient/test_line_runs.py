"""Runs of a valve behind an elastic line: starts from rest and from a steady flow."""

from __future__ import annotations

import numpy as np
import pytest

from .runs import SHORT, transient

WAVES = {
    "upstream.length": 6.0,
    "upstream.wave_speed": 600.0,
    "upstream.loss": 1.5,
    "upstream.elements": 2,
    "drive.pressure": 6e3,
}


@pytest.mark.slow
def test_a_line_at_rest_has_the_pressure_behind_the_valve(valve):
    """Nothing is drawn in before the wave of the far end arrives, after 10 ms."""
    keys = {"transient.duration": 5e-3, "transient.step": 2e-4, "fluid.density": 100.0, "downstream.pressure": 2e4}
    run = transient(valve(SHORT | WAVES | keys | {"drive.pressure": 2.6e4, "upstream.elements": 8}))
    assert np.abs(run.history["station_pressure"]).max() < 0.05 * 6e3


@pytest.mark.slow
@pytest.mark.parametrize("law", ["quasi-steady", "storage"])
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
    keys = {"transient.duration": 0.01, "transient.step": 1e-3, "transient.start": "steady", "fluid.density": 100.0}
    run = transient(valve(SHORT | WAVES | keys | {"upstream.friction": 0.02, "drive.at": "line"}))
    flow = run.history["mass_flow"]
    assert np.abs(flow / flow[0] - 1).max() < 1e-8
