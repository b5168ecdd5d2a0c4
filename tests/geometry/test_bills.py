"""Bills wider than the pipe, curved lips, cuffs and flared transitions: sections, surfaces, flow areas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbvfiv.case.valve import LipSizes
from dbvfiv.geometry.sections import lip_section
from dbvfiv.geometry.surface import surface_of
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.studies.case import Case

UNIFORM = {"valve.wall": "uniform", "valve.wall_thickness": 0.012}


def mesh_of(**valve):
    case = Case().replace(UNIFORM | {f"valve.{key}": value for key, value in valve.items()})
    return case.valve, valve_mesh(case.valve, case.mesh)


@settings(max_examples=12)
@given(
    half_width=st.floats(0.01, 2.0),
    radius=st.floats(1e-3, 0.1),
    share=st.just(0.0) | st.floats(1e-6, 0.99),
    wall=st.floats(0.05, 1.0),
)
def test_lip_is_a_bow_and_an_arc(half_width, radius, share, wall):
    """Length, height, width and area are those of the curve, which has no corner; the wall takes h L - pi h2 / 4."""
    lip = LipSizes(half_width, radius, share * half_width)
    s = np.linspace(0.0, 1.0, 4001)
    points = lip_section(lip)(s)
    assert points[0] == pytest.approx([0.0, lip.height], abs=1e-12)
    assert points[-1] == pytest.approx([lip.widest, 0.0], abs=1e-12)
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    assert lengths == pytest.approx(np.full(len(s) - 1, (lip.bow_length + lip.edge_length) / (len(s) - 1)), rel=2e-2)
    turned = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    assert np.abs(np.diff(turned)).max() <= 1.01 * lengths.max() / min(lip.radius, lip.bow)
    area = np.sum(0.5 * (points[1:, 1] + points[:-1, 1]) * steps[:, 0])
    assert area == pytest.approx(lip.area, rel=1e-3)
    half, length = wall * radius, lip.bow_length + lip.edge_length
    assert lip.wall_area(half, 0.0) == pytest.approx(half * length - 0.25 * np.pi * half**2, rel=1e-9)


def test_a_rise_of_nothing_is_a_straight_lip():
    s = np.linspace(0.0, 1.0, 41)
    almost = lip_section(LipSizes(0.125, 0.006, 1e-9))(s)
    assert almost == pytest.approx(lip_section(LipSizes(0.125, 0.006))(s), abs=1e-8)


@pytest.mark.parametrize("half_width", [0.05, 0.133, 0.2, 0.3])
def test_bills_narrower_and_wider_than_the_pipe(half_width):
    valve, mesh = mesh_of(lip_half_width=half_width)
    points = mesh.nodes[mesh.rows]
    assert points[0, -1, 0] == pytest.approx(half_width + 0.006)
    assert points[-1, -1, 0] == pytest.approx(0.13919)
    area = mesh.rest_area - mesh.wall_deduction
    assert area[0] == pytest.approx(half_width * 1e-4, rel=1e-4)
    assert area[-1] == pytest.approx(valve.rest_areas[1], rel=1e-6)
    assert np.all(np.diff(area) > -1e-9)


def test_curved_lips_leave_a_lens_open():
    """Faces that start apart: the lens between two arcs of rise 8 mm and half width 125 mm, 2/3 of rise times width."""
    valve, mesh = mesh_of(lip_rise=0.008)
    lens = 2.0 / 3.0 * 0.008 * 0.125 + 0.125 * 1e-4
    assert mesh.rest_area[0] - mesh.wall_deduction[0] == pytest.approx(lens, rel=2e-2)
    assert mesh.stands_apart and mesh.lip_gap == pytest.approx(1e-4 * (valve.lip.widest - 0.006), rel=1e-9)


def test_lips_in_touch_leave_the_passage_at_rest_or_the_gap_alone():
    for changes in ({}, {"lip_half_width": 0.3}, {"initial_gap": 5e-4}, {"sealing_pressure": 2e3}):
        _, mesh = mesh_of(**changes)
        assert not mesh.stands_apart and mesh.lip_gap == mesh.rest_area[0] - mesh.wall_deduction[0]
    _, mesh = mesh_of(lip_radius=0.008)
    assert mesh.rest_area[0] - mesh.wall_deduction[0] == pytest.approx(2.1e-3 * 0.125, rel=2e-2)
    assert mesh.stands_apart and mesh.lip_gap == pytest.approx(1e-4 * 0.125)


def test_cuff_and_flare():
    """A cuff of a smaller bore and a cone to the flange: sections, passage, rows on every joint."""
    valve, mesh = mesh_of(cuff_length=0.08, cuff_radius=0.11, flare_length=0.05)
    assert valve.length == pytest.approx(0.69)
    joints = np.cumsum([0.21, 0.28, 0.08, 0.05, 0.07])
    assert np.isin(np.round(joints, 9), np.round(mesh.z, 9)).all()
    assert np.allclose(surface_of(valve).breaks, [0.0, *joints])
    radius = np.interp(mesh.z, joints, [np.nan, 0.11, 0.11, 0.13919, 0.13919])
    behind = mesh.z > 0.491
    inner = radius - 0.006
    area = mesh.rest_area - mesh.wall_deduction
    assert area[behind] == pytest.approx(0.25 * np.pi * inner[behind] ** 2, rel=1e-6)


def test_a_cuff_of_no_length_changes_nothing():
    valve, mesh = mesh_of()
    again, same = mesh_of(cuff_length=0.0, flare_length=0.0, cuff_radius=0.13919)
    assert valve.cuff_radius == again.cuff_radius == 0.13919
    assert np.array_equal(mesh.nodes, same.nodes) and np.array_equal(mesh.wall_deduction, same.wall_deduction)


def test_the_cuff_follows_the_flange():
    assert Case().replace({"valve.flange_radius": 0.15}).valve.cuff_radius == 0.15
