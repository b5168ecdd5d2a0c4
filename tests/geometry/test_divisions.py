"""Rows and columns on the breaks of shape, wall and load, and closer where the surface turns."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.case.model import Case
from dbvfiv.geometry.divisions import bend_of_lip, column_division, divide, kinks, row_division
from dbvfiv.geometry.surface import surface_of
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import model_warnings

SURFACE = surface_of(Case().valve)
JOINTS, STEP = (0.0, 0.21, 0.49, 0.56), 0.30


def rows_of(along, **mesh):
    case = Case().replace({"mesh.along": along} | {f"mesh.{key}": value for key, value in mesh.items()})
    return row_division(case.valve, case.mesh, surface_of(case.valve))


def is_on(positions, place) -> bool:
    return bool(np.min(np.abs(positions - place)) < 1e-12)


@pytest.mark.parametrize("rows", ["lip", "graded", "uniform"])
@pytest.mark.parametrize("along", [6, 7, 14, 24, 33, 48, 96])
def test_rows_lie_on_joints_and_steps(rows, along):
    found = rows_of(along, rows=rows)
    assert len(found.positions) == along + 1 and np.all(np.diff(found.positions) > 0)
    assert all(is_on(found.positions, joint) for joint in JOINTS)
    if rows != "uniform":
        assert is_on(found.positions, STEP) and len(found.missed) == 0


@pytest.mark.parametrize("count", [48, 96, 192])
def test_more_pieces_than_half_the_elements_get_one_each(count):
    places = np.linspace(0.0, 1.0, 30)[1:-1]
    found = divide([0.0, 1.0], places, count)
    assert len(found.positions) == count + 1 and len(found.missed) == 0
    assert all(is_on(found.positions, place) for place in places)


def test_uniform_rows_are_even():
    assert np.diff(rows_of(48, rows="uniform").positions) == pytest.approx(0.56 / 48, rel=1e-9)


def test_rows_close_up_at_joints_where_the_surface_turns():
    """The surface turns by atan(0.133 / 0.28) = 25.4 degrees at both ends of the saddle."""
    assert np.degrees(kinks(SURFACE)) == pytest.approx([25.41, 25.41], abs=0.01)
    z = rows_of(480, rows="graded", row_grading=0.25).positions
    length, middle = np.diff(z), 0.5 * (z[1:] + z[:-1])
    for joint in (0.21, 0.49):
        near, far = length[np.argmin(np.abs(middle - joint))], length[np.argmin(np.abs(middle - joint + 0.15))]
        assert near / far == pytest.approx(0.25, abs=0.03)
    pieces = np.split(rows_of(48, row_grading=1.0).positions, [18, 26, 42])
    for piece in pieces:  # 0 to 0.21, 0.30, 0.49 and 0.56 m
        assert np.ptp(np.diff(piece)) < 1e-12


def test_rows_close_up_at_the_lip():
    """By as much as at a joint at which the surface turns; those of earlier versions do not."""
    for rows, share in (("lip", 0.4), ("graded", 1.0)):
        z = rows_of(480, rows=rows).positions
        assert z[1] / np.diff(z)[np.searchsorted(z, 0.1)] == pytest.approx(share, abs=0.02)


def test_smooth_saddle_has_no_joint_to_close_up_at():
    case = Case().replace({"valve.saddle": "smooth"})
    graded = row_division(case.valve, case.replace({"mesh.rows": "graded"}).mesh, surface_of(case.valve)).positions
    assert graded == pytest.approx(rows_of(48, row_grading=1.0).positions, abs=1e-4)


def test_twice_the_rows_hold_the_former_ones():
    coarse, fine = rows_of(24), rows_of(48)
    assert fine.positions[::2] == pytest.approx(coarse.positions, abs=2e-6)


def test_rows_of_ones_own():
    assert is_on(rows_of(24, breaks=[0.1234]).positions, 0.1234)
    own = [0.0, 0.1, 0.2, 0.22, 0.24, 0.3, 0.4, 0.56]
    for rows in ("lip", "uniform"):
        assert np.array_equal(rows_of(7, rows=rows, row_positions=own).positions, own)
    spread = rows_of(14, row_positions=own).positions
    assert spread[::2] == pytest.approx(own, abs=1e-12)


def test_too_few_rows_for_all_breaks_are_told():
    wall = [{"to": 0.02 * k, "thickness": 0.012 + 0.0001 * k} for k in range(1, 29)]
    model = ValveModel(Case().replace({"mesh.around": 4, "mesh.along": 8, "valve.wall_map": wall}))
    assert len(model.mesh.missed_rows) > 15 and model.mesh.shape == (4, 8)
    told = [words for words in model_warnings(model) if "mesh.along" in words]
    assert len(told) == 1 and told[0].startswith("8 elements along are too few")
    assert not [w for w in model_warnings(ValveModel(Case().replace({"mesh.around": 4}))) if "mesh.along" in w]


def test_fewer_rows_than_pieces_are_refused():
    with pytest.raises(ValueError, match="mesh.along is 2"):
        divide([0.0, 0.2, 0.5, 0.6], (), 2)


def test_columns_lie_on_the_edges_of_load_and_stops():
    for around in (8, 14, 15, 28, 42, 56):
        mesh = Case().replace({"mesh.around": around}).mesh
        columns = column_division(mesh, SURFACE, (25 / 28, 0.5)).positions
        assert len(columns) == around + 1 and is_on(columns, 25 / 28) and is_on(columns, 0.5)
        assert np.all(np.diff(columns) > 0)
    even = Case().replace({"mesh.columns": "uniform"}).mesh
    assert column_division(even, SURFACE, (0.77,)).positions == pytest.approx(np.linspace(0, 1, 29))
    ungraded = Case().replace({"mesh.column_grading": 1.0}).mesh
    assert column_division(ungraded, SURFACE, (25 / 28, 0.5)).positions == pytest.approx(np.linspace(0, 1, 29))


def test_columns_close_up_in_the_bend():
    """The lip bends from s = W1/(W1 + pi R1/2) on: a third of the length there."""
    length = 0.125 + 0.5 * np.pi * 0.00619
    assert bend_of_lip(SURFACE) == pytest.approx((0.125 + np.radians(5) * 0.00619) / length, abs=1e-3)
    mesh = Case().replace({"mesh.around": 960}).mesh
    steps = np.diff(column_division(mesh, SURFACE, (25 / 28,)).positions)
    assert steps[-1] / steps[0] == pytest.approx(1 / 3, rel=0.05)


@given(
    count=st.integers(3, 60),
    breaks=st.lists(st.floats(0.001, 0.999), max_size=12),
    joint=st.floats(0.05, 0.95),
    power=st.floats(0.3, 3.0),
)
def test_any_division(count, breaks, joint, power):
    """Whatever is asked for: as many elements as said, in order, with both ends and the joint, and every break that is
    not told as missed.
    """
    z = np.linspace(0, 1, 101)
    found = divide([0.0, joint, 1.0], breaks, count, (z, z + z**power))
    assert len(found.positions) == count + 1 and np.all(np.diff(found.positions) > 0)
    assert found.positions[0] == 0.0 and found.positions[-1] == 1.0 and is_on(found.positions, joint)
    for place in breaks:
        near = np.min(np.abs(found.positions - place)) < 1e-6
        assert near != (place in found.missed)


def test_mesh_of_a_valve_with_any_wall():
    """The thickness of an element is that of the wall all over it."""
    case = Case().replace({"mesh.around": 4, "mesh.along": 24})
    mesh = valve_mesh(case.valve, case.mesh)
    for low, high, thickness in zip(mesh.z[:-1], mesh.z[1:], mesh.thickness.reshape(24, 4)[:, 0]):
        assert case.valve.thickness_at(low + 1e-9) == case.valve.thickness_at(high - 1e-9) == thickness
