"""Studies of a valve behind a pipe: heads, modes, and sweeps, onsets, maps and sensitivities over its length, or that
of a pipe behind the valve.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.quantity import GRAVITY
from dbvfiv.errors import CaseError
from dbvfiv.studies.stability.place import is_surrounding
from tests.small_valves import FORMER, SMALL, load_small, settings
from tests.studies.along import check_map, check_neutral, check_sensitivity, check_sweep, check_walk

LINE = {"upstream.length": 20.0, "upstream.diameter": "300 mm", "upstream.loss": 1.5}
FRICTION = LINE | {"upstream.friction": 0.02}
AIR = {"fluid.density": 1.2, "fluid.sound_speed": 343.0, "fluid.continuity": "storage"}
LIGHT = {"fluid.density": 10.0, "drive.pressure": "6 kPa", "damping.alpha": 0.0}
TAIL = {"downstream.pipe_diameter": "305 mm", "downstream.length": 5.0, "downstream.loss": 1.5}
#: Keys of the lengths, and cases that have them.
KEYS = {"pipe_length": "upstream.length", "tail_length": "downstream.length"}
CASES = {"pipe_length": LIGHT | LINE, "tail_length": LIGHT | TAIL | {"fluid.density": 60.0, "drive.pressure": 2e3}}


@pytest.mark.parametrize("at, fluid", [("reservoir", {}), ("line", {}), ("line", AIR)])
def test_heads_along_the_line(at, fluid):
    state = load_small(FRICTION, fluid, {"drive.at": at}).steady(pressure="18 kPa")
    found, pipe = state.hydraulics, 0.25 * np.pi * 0.3**2
    speed = state.volume_flow / pipe
    lost = (0.02 * 20.0 / 0.3 + 1.5) * speed**2 / (2 * GRAVITY)
    assert state.line_loss == pytest.approx(lost, rel=1e-6)
    static = 18e3 / 1000.0
    if fluid:  # of a perfect gas, the enthalpy (Shapiro 1953)
        static = 343.0**2 / 0.4 * ((1.0 + 1.4 * 18e3 / (1.2 * 343.0**2)) ** (0.4 / 1.4) - 1.0)
    far = (static + (0.0 if at == "reservoir" else 0.5 * speed**2)) / GRAVITY
    assert found.supply_head == pytest.approx(far, rel=1e-6)
    assert found.total_head == pytest.approx(far - lost, rel=1e-6)
    assert state.flange_pressure == pytest.approx(state.station_pressure[-1], rel=1e-12)
    # the valve itself is that of its pressure at the flange
    alone = load_small(fluid).steady(pressure=state.flange_pressure)
    assert alone.mass_flow == pytest.approx(state.mass_flow, rel=1e-6)
    assert alone.hydraulics.kv == pytest.approx(found.kv, rel=1e-6)


def test_without_losses_a_gauge_at_the_far_end_shows_the_pressure_at_the_flange():
    bare = load_small().steady(pressure="18 kPa")
    behind = load_small({"upstream.length": 20.0, "drive.at": "line"}).steady(pressure="18 kPa")
    assert behind.mass_flow == pytest.approx(bare.mass_flow, rel=1e-9) and behind.line_loss == 0.0


@pytest.mark.parametrize("pipe, pressure", [(FRICTION, "flange_pressure"), (TAIL, "outlet_pressure")])
def test_equilibria_do_not_depend_on_density(pipe, pressure):
    water, light = (load_small(pipe, {"fluid.density": rho}).steady(pressure="18 kPa") for rho in (1000.0, 2.0))
    assert light.lip_opening == pytest.approx(water.lip_opening, rel=1e-9)
    assert getattr(light, pressure) == pytest.approx(getattr(water, pressure), rel=1e-9)


def test_printed_pressures_say_where_they_are(command_line):
    options = settings(SMALL | FRICTION)
    out = command_line("steady", *options, "-p", "18 kPa").out
    assert "reservoir" in out and "at the flange" in out and "line loss" in out and "Supply" in out
    out = command_line("steady", *options, "--set=drive.at=line", "-p", "18 kPa").out
    assert "far end" in out
    out = command_line("steady", *settings(SMALL), "-p", "18 kPa").out
    assert "reservoir" not in out and "line loss" not in out


@pytest.mark.slow
def test_verdicts_name_the_continuity_law(command_line):
    options = settings(SMALL | LIGHT | LINE)
    for law in ("quasi-steady", "storage"):
        out = command_line("modes", *options, f"--set=fluid.continuity={law}").out
        assert f"Flutters under {law} continuity: " in out
    assert "continuity" not in command_line("modes", *options, "--in-vacuo").out


@pytest.mark.slow
@pytest.mark.parametrize("name", KEYS)
def test_modes_over_the_length_are_those_of_each_length(name):
    check_sweep((CASES[name],), f"{name}=1:50:5:log", KEYS[name])


@pytest.mark.slow
def test_friction_moves_the_steady_state_with_the_length():
    moved, kept = (load_small(LIGHT, keys).case for keys in (FRICTION, LINE))
    assert not is_surrounding(moved, "pipe_length") and is_surrounding(kept, "pipe_length")
    swept = check_sweep((LIGHT, FRICTION), "pipe_length=2:80:3:log", "upstream.length", (0, 2))
    assert len(swept.points) == 3
    check_walk((LIGHT, FRICTION), swept, "upstream.length", (0, 2))


@pytest.mark.slow
def test_onset_over_the_length_whether_or_not_the_steady_state_is_found_anew():
    keys = {"drive.pressure": 2e3, "fluid.density": 100.0, "damping.alpha": 0.0, "damping.beta": 1e-3}
    keys |= {"onset.coarse_mesh": 0, **FORMER}  # the mesh that has its onset at these lengths
    found = [
        load_small(LINE, keys, more).onset("pipe_length=60:400:3:log") for more in ({}, {"upstream.friction": 1e-9})
    ]
    ((one,), (other,)) = (result.points for result in found)
    assert one["confirmed"] and other["confirmed"] and one["criticality"] == other["criticality"] is not None
    assert one["value"] == pytest.approx(other["value"], rel=1e-5)
    assert one["crossing_speed"] == pytest.approx(other["crossing_speed"], rel=1e-3)
    check_neutral((LINE, keys), "upstream.length", one["value"], 1e-5)


@pytest.mark.parametrize(
    "name, x, y, last",
    [
        ("pipe_length", "pressure=1 kPa:6 kPa:3:log", "5:100:3:log", {"upstream.length": 100.0, "drive.pressure": 6e3}),
        pytest.param(
            *("tail_length", "density=10:200:3:log", "1:20:3:log", {"downstream.length": 20.0, "fluid.density": 200.0}),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_map_over_the_length(name, x, y, last):
    check_map((CASES[name],), {"map.x": x, "map.y": f"{name}={y}"}, {(-1, -1): last})


@pytest.mark.slow
@pytest.mark.parametrize("name, more", [("pipe_length", {}), ("pipe_length", FRICTION), ("tail_length", {})])
def test_sensitivity_to_the_length(name, more):
    check_sensitivity((CASES[name], more), name, KEYS[name], 0.02)


@pytest.mark.parametrize("name, key", [("pipe_length", "upstream.length"), ("tail_length", "downstream.pipe_diameter")])
def test_a_case_without_a_pipe_has_no_length_to_change(name, key):
    with pytest.raises(CaseError, match=f"no {name} to change.*{key}"):
        load_small(LIGHT).onset(f"{name}=1:50:5:log")
