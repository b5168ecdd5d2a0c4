"""Steady states of the 12-inch valve: discharge, place of the largest displacement, grids, and the trends of the
thesis.

Published (Th. 7, four quarters): 47.88, 75.52, 90.82 kg/s at 18, 29, 36 kPa, 10 % rubber set. A first, independent
implementation of the same model on 28 x 48 elements gave 42.0, 67.4, 82.0 kg/s with the 10 % set and 48.8, 77.4, 93.8
with the 20 % set. The published flows are met within 4 % by the 20 % set and within 13 % by the 10 % set; the saddle's
shape, lost with its key points, and the folding side edge are of that size.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath, SteadyOptions
from dbvfiv.studies.case import thesis_case
from tests.shell.structures import richardson
from tests.small_valves import FORMER

PRESSURES = (18e3, 29e3, 36e3)
PUBLISHED = np.array([47.88, 75.52, 90.82])
FIRST_MODEL = {"10 %": np.array([42.0, 67.4, 82.0]), "20 %": np.array([48.8, 77.4, 93.8])}


def states(pressures, around=28, along=48, **changes):
    case = thesis_case(
        {"mesh.around": around, "mesh.along": along} | {k.replace("__", "."): v for k, v in changes.items()}
    )
    path = LoadPath(ValveModel(case), SteadyOptions.of(case))
    return [path.go_to(float(pressure)) for pressure in pressures]


@cache
def reference(level: str):
    return states(PRESSURES, materials__strain_level=level)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["10 %", pytest.param("20 %", marks=pytest.mark.slow)])
def test_discharge(level):
    """Within 2 % of the first model; the 20 % set within 4 % and the 10 % set within 14 % of the published flow."""
    found = np.array([state.mass_flow for state in reference(level)])
    print(f"\n{level}: kPa   kg/s    first model      published")
    for p, flow, first, thesis in zip(PRESSURES, found, FIRST_MODEL[level], PUBLISHED):
        print(
            f"      {p / 1e3:4.0f}  {flow:7.3f}  {first:6.1f} ({flow / first - 1:+.1%})  {thesis:6.2f} "
            f"({flow / thesis - 1:+.1%})"
        )
    assert found == pytest.approx(FIRST_MODEL[level], rel=0.02)
    assert found == pytest.approx(PUBLISHED, rel=0.04 if level == "20 %" else 0.14)


@pytest.mark.parametrize("level", ["10 %", pytest.param("20 %", marks=pytest.mark.slow)])
def test_largest_displacement_is_at_the_joint(level):
    """In the middle (x = 0), close to the line z = 0.21 m where duckbill and saddle join (Th. 7): 15 mm before it, a
    distance that even rows of 12 mm could not resolve.
    """
    for state in reference(level):
        x, _, z = state.max_displacement_position
        print(
            f"\n{level} {state.pressure / 1e3:.0f} kPa: {state.max_displacement * 1e3:.2f} mm at x {x:.4f}, z {z:.4f} m"
        )
        assert x == 0.0
        assert 0.19 < z <= 0.21
    assert 0.055 < reference(level)[-1].max_displacement < 0.07  # 0.058 and 0.062 m at 36 kPa; published 0.069


TREND = {"around": 14, "along": 24}
TREND_PRESSURES = (6e3, 18e3, 36e3, 50e3)


def flows(**changes) -> np.ndarray:
    return np.array([state.mass_flow for state in states(TREND_PRESSURES, **TREND, **changes)])


@cache
def usual_flows() -> np.ndarray:
    return flows()


def layup(angle: float | None) -> list[dict]:
    layers = thesis_case().to_dict()["layers"]
    if angle is None:
        return [layer for layer in layers if layer["material"] != "fibre"]
    layers[2]["angle"], layers[3]["angle"] = angle, -angle
    return layers


def test_strain_level_adds_to_the_flow():
    """From the 10 to the 20 % set about +12 % (Th. 7.2); here 14 to 16 %."""
    found = [[s.mass_flow for s in states(PRESSURES, **TREND, materials__strain_level=x)] for x in ("10 %", "20 %")]
    ratio = np.divide(*found[::-1])
    print(f"\n20 % over 10 % set: {ratio}")
    assert np.all((ratio > 1.08) & (ratio < 1.18))


@pytest.mark.slow
def test_fibre_angle_orders_the_curves():
    """No fibre, 36, 45, 54 degrees: the larger the angle, the stiffer the lips (Th. Fig. 7-3)."""
    found = {angle: flows(layers=layup(angle)) for angle in (None, 36.0, 45.0, 54.0)}
    for angle, flow in found.items():
        print(f"\nfibre {angle}: {np.round(flow, 2)} kg/s at {TREND_PRESSURES}")
    for looser, stiffer in ((None, 36.0), (36.0, 45.0), (45.0, 54.0)):
        assert np.all(found[looser] > found[stiffer])


@pytest.mark.slow
def test_strain_levels_order_the_curves():
    """10, 20, 40, 60 %: rubber softens with the strain that its constants were fitted to (Th. Figs. 3-6, 7-2)."""
    found = [flows(materials__strain_level=level) for level in ("10 %", "20 %", "40 %", "60 %")]
    for level, flow in zip((10, 20, 40, 60), found):
        print(f"\n{level} % set: {np.round(flow, 2)} kg/s at {TREND_PRESSURES}")
    for softer, stiffer in zip(found[1:], found[:-1]):
        assert np.all(softer > stiffer)


@pytest.mark.parametrize(
    "changes, sign, low, high",
    [
        ({"valve__wall": "uniform"}, -1, 0.10, 0.25),
        ({"materials__fibre_constants": "table"}, 1, 0.002, 0.02),
        ({"valve__saddle": "smooth"}, -1, 0.05, 0.16),
    ],
    ids=str,
)
def test_what_walls_plies_and_saddles_add_to_the_flow(changes, sign, low, high):
    """A uniform wall of 14.38 mm stiffens the duckbill and takes off about 20 % (Th. 5.3); the ply constants of Table
    3-5, less stiff in the plane than the program's, add 0.3 to 2 %; a saddle that blends smoothly into duckbill and
    flange opens less, which is how much the lost shape matters.
    """
    share = sign * (flows(**changes) / usual_flows() - 1)
    print(f"\n{changes}: {np.round(100 * sign * share, 2)} % at {TREND_PRESSURES}")
    assert np.all((share > low) & (share < high))


def grid_study(pressures, **changes) -> np.ndarray:
    """Mass flow (3 grids, pressures) on 14 x 24, 28 x 48 and 56 x 96 elements, printed with order and limit."""
    found = np.array([[s.mass_flow for s in states(pressures, 14 * k, 24 * k, **changes)] for k in (1, 2, 4)])
    for p, (a, b, c) in zip(pressures, found.T):
        order, limit = richardson((a, b, c)) if (a - b) * (b - c) > 0 else (np.nan, np.nan)
        verdict = f"order {order:.2f}, limit {limit:.3f}" if order > 0.5 else f"order {order:.2f}: no limit to be had"
        print(f"\n  {p / 1e3:.0f} kPa: {a:.3f} {b:.3f} {c:.3f} kg/s, last change {c / b - 1:+.2%}, {verdict}")
    return found


@pytest.mark.slow
@pytest.mark.parametrize("level", ["10 %", "20 %"])
def test_grids(level):
    """Measured wall: from 28 x 48 to 56 x 96 the flow changes by 0.1 %; with even rows and columns and the plain
    element it was 0.3 %, and 1 % from 14 x 24 on.
    """
    print(f"\n{level} set")
    found = grid_study(PRESSURES, materials__strain_level=level)
    assert np.all(np.abs(found[2] / found[1] - 1) < 0.003)
    assert np.all(np.abs(found[2] / found[0] - 1) < 0.01)


STEP_ON_A_ROW = [
    {"to": 0.21, "thickness": 0.012},
    {"to": 0.28, "thickness": 0.015},  # instead of 0.30 m
    {"to": 0.49, "thickness": 0.019},
    {"to": 0.56, "thickness": 0.016},
]


@pytest.mark.slow
@pytest.mark.parametrize("wall", ["averaged", "step on a row"])
def test_grids_without_a_step_inside_elements(wall):
    """Even rows and the plain element, averaged wall or the step moved to 0.28 m: second order or better, with the fold
    of the side edge and the kinks of the saddle in place.
    """
    print(f"\n{wall}")
    changes = {"valve__wall": "uniform"} if wall == "averaged" else {"valve__wall_map": STEP_ON_A_ROW}
    former = {key.replace(".", "__"): value for key, value in FORMER.items()}
    for column in grid_study((18e3, 36e3), **changes, **former).T:
        order, limit = richardson(column)
        assert order > 1.6
        assert column[1] == pytest.approx(limit, rel=0.01)
