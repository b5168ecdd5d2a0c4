"""Sweeps, onsets, maps and sensitivities of a valve behind an elastic line."""

from __future__ import annotations

import pytest

import dbvfiv
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.model.state import describe_state
from dbvfiv.studies.case import load_case, thesis_case
from tests.small_valves import load_small, make_valve
from tests.studies.along import check_map, check_neutral, check_sensitivity, check_sweep

MESH = {"mesh.around": 8, "mesh.along": 12}
LINE = {"upstream.length": 6.0, "upstream.wave_speed": 600.0, "upstream.loss": 1.5, "upstream.elements": 3}
LIGHT = {"fluid.density": 10.0, "drive.pressure": "6 kPa", "damping.alpha": 0.0, "fluid.continuity": "storage"}


BASE = MESH | LINE | LIGHT


@pytest.mark.slow
@pytest.mark.parametrize("over", ["wave_speed=150:1200:3:log", "pipe_length=2:18:3:log", "density=2:50:3:log"])
def test_modes_along_a_parameter_are_those_of_each_value(over):
    name = {"wave_speed": "upstream.wave_speed", "pipe_length": "upstream.length", "density": "fluid.density"}
    check_sweep((BASE, {"sweep.checks": 2, "sweep.count": 4}), over, name[over.split("=")[0]], (1,))


@pytest.mark.slow
def test_no_door_calls_a_valve_stable_whose_line_is_too_coarse_for_its_modes():
    """Two elements resolve waves up to 3 Hz; the wall flutters at 46 Hz, as with sixty."""
    line = {"upstream.length": 120.0, "upstream.diameter": 0.3, "upstream.wave_speed": 400.0, "upstream.elements": 2}
    state = {"fluid.density": 30.0, "drive.pressure": 1500.0, "fluid.continuity": "quasi-steady", "damping.beta": 4e-4}
    valve = load_small(BASE, {"mesh.around": 6, "mesh.along": 8, "upstream.loss": 0.0}, line, state)
    told = [valve.modes().verdict.outcome]
    told += [verdict["outcome"] for verdict in valve.sweep("beta=4e-4,5e-4").summary()["verdict"]]
    told += [verdict["outcome"] for verdict in valve.sweep("pressure=1500,1600").summary()["verdict"]]
    told += [verdict["outcome"] for verdict in valve.onset("beta=4e-4:5e-4:3").summary()["scan"]["verdict"]]
    assert set(told) == {"undecided"}


@pytest.mark.parametrize(
    "case, keys",
    [
        (thesis_case(), {"modes.symmetry": "SA", "drive.pressure": "6 kPa"}),
        pytest.param(load_case("cases/dbv12-moulded.toml"), {"drive.pressure": "300 Pa"}, marks=pytest.mark.slow),
    ],
)
def test_motions_that_meet_no_waves_are_searched_beyond_those_that_are_resolved(case, keys):
    """Lips that sway together, and a bill that is sealed under the quasi-steady flow model, where the wall displaces
    nothing: the same modes behind a rigid line.
    """
    line = {"upstream.length": 40.0, "upstream.diameter": 0.3, "fluid.continuity": "quasi-steady"}
    waves = {"upstream.wave_speed": 400.0, "upstream.elements": 2}
    shared = MESH | line | keys | {"modes.count": 3, "damping.model": "rayleigh", "damping.alpha": 2.0}
    elastic, rigid = (dbvfiv.load(case, shared | changes).modes() for changes in (waves, {}))
    assert elastic.verdict.outcome == "stable" and elastic.modes[2].frequency > 20.0
    rates = [[(mode.growth_rate, mode.angular_frequency) for mode in found.modes] for found in (elastic, rigid)]
    assert rates[0] == [pytest.approx(pair, rel=1e-7) for pair in rates[1]]


@pytest.mark.slow
def test_maps_keep_the_wave_speed_over_the_density():
    """In every cell the compressibility is that of its own density."""
    axes = {"map.x": "pressure=3 kPa:6 kPa:2", "map.y": "density=2:50:4:log"}
    densities = {1: 2.0 * 25 ** (1 / 3), 3: 50.0}
    cells = {(i, 1): {"fluid.density": density, "drive.pressure": 6e3} for i, density in densities.items()}
    check_map((BASE,), axes, cells)


def test_the_head_lost_in_an_elastic_line_is_what_a_gas_loses_on_its_way():
    """From the enthalpy at the far end to that of the flange, by an isentropic gas, and its kinetic energy."""
    air = {"fluid.density": 1.2, "fluid.continuity": "storage", "fluid.sound_speed": 343.0, "drive.pressure": 20e3}
    line = {"upstream.length": 6.0, "upstream.wave_speed": 300.0, "upstream.elements": 2, "upstream.loss": 3.0}
    model = make_valve(air | line)
    found = {"converged": True, "iterations": 0, "load_steps": 0, "residual": 0.0, "rounding": 0.0, "reason": ""}
    state = describe_state(model, model.rest(), 20e3, **found)
    flange, whole = (1.0 + 1.4 * p / (1.2 * 343.0**2) for p in (state.flange_pressure, 20e3))
    enthalpy = 343.0**2 / 0.4 * (whole ** (2 / 7) - flange ** (2 / 7))
    lost = (enthalpy - 0.5 * state.station_velocity[-1] ** 2) / GRAVITY
    assert lost > 1e-3 and state.line_loss == pytest.approx(lost, rel=1e-3)


@pytest.mark.slow
def test_onset_behind_an_elastic_line():
    found = load_small(BASE, {"onset.coarse_mesh": 0}).onset("density=10:60:3:log")
    point = found.points[-1]
    assert point["confirmed"] and point["criticality"] in ("super", "sub")
    check_neutral((BASE,), "fluid.density", point["value"], 1e-5)


@pytest.mark.slow
def test_sensitivity_to_the_wave_speed():
    check_sensitivity((BASE,), "wave_speed", "upstream.wave_speed", 0.6)


def test_a_search_ends_where_waves_are_resolved():
    modes = load_small(BASE).modes(count=4)
    assert any("resolve waves up to 150 Hz" in note for note in modes.notes)
