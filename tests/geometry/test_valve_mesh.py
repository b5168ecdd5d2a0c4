"""Sections, surface and graded mesh of the 12-inch valve (App. A) and of others."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest

from dbvfiv.case.model import Case
from dbvfiv.errors import CaseError
from dbvfiv.geometry.divisions import grading
from dbvfiv.geometry.surface import surface_of
from dbvfiv.geometry.valve_mesh import valve_mesh, wall_deduction
from dbvfiv.model.build import build_shell

VALVE = Case().valve


EVEN = MappingProxyType({"mesh.rows": "uniform", "mesh.columns": "uniform"})


def mesh_of(around=8, along=16, more=MappingProxyType({}), **valve):
    changes = {"mesh.around": around, "mesh.along": along} | dict(more)
    case = Case().replace(changes | {f"valve.{key}": value for key, value in valve.items()})
    return valve_mesh(case.valve, case.mesh)


def test_lip_and_flange_sections():
    surface = surface_of(VALVE)
    s = np.linspace(0, 1, 4001)
    lip, flange = surface.section(0.1, s), surface.section(0.52, s)
    assert lip[0] == pytest.approx([0, 0.00619, 0.1]) and lip[-1] == pytest.approx([0.13119, 0, 0.1], abs=1e-12)
    assert np.hypot(flange[:, 0], flange[:, 1]) == pytest.approx(0.13919, rel=1e-12)
    steps = np.linalg.norm(np.diff(lip, axis=0), axis=1)
    assert steps == pytest.approx(steps.mean(), rel=1e-3)  # equal normalised arc length
    assert steps.sum() == pytest.approx(0.125 + 0.5 * np.pi * 0.00619, rel=1e-6)


def test_areas_of_the_sections():
    surface = surface_of(VALVE)
    assert surface.area(0.0) == pytest.approx(0.125 * 0.00619 + 0.25 * np.pi * 0.00619**2, rel=1e-5)
    assert surface.area(0.56) == pytest.approx(0.25 * np.pi * 0.13919**2, rel=1e-6)


def test_ruled_saddle_is_straight_between_its_ends():
    surface = surface_of(VALVE)
    s = np.linspace(0, 1, 11)
    ends = surface.section(0.21, s), surface.section(0.49, s)
    assert surface.section(0.28, s) == pytest.approx(0.75 * ends[0] + 0.25 * ends[1], abs=1e-15)


def test_smooth_saddle_meets_its_ends_without_a_kink():
    surface = surface_of(Case().replace({"valve.saddle": "smooth"}).valve)
    s = np.linspace(0, 1, 11)
    for z, step in ((0.21, 1e-5), (0.49, -1e-5)):
        slope = (surface.section(z + step, s) - surface.section(z, s))[:, :2] / step
        assert np.abs(slope).max() < 1e-3
    ruled = surface_of(VALVE)
    assert surface.section(0.35, s) == pytest.approx(ruled.section(0.35, s), abs=1e-15)


def test_elements_shrink_to_half_towards_the_side_edge():
    mesh = mesh_of(28, 48, more={"mesh.columns": "uniform"})
    lip = mesh.nodes[mesh.rows[-1]]  # a circle: equal angles are equal lengths
    lengths = np.diff(np.arctan2(lip[:, 0], lip[:, 1]))
    ratios = lengths[1:] / lengths[:-1]
    assert ratios == pytest.approx(ratios[0], rel=1e-9)
    assert lengths[-1] / lengths[0] == pytest.approx(0.5 ** (27 / 28), rel=1e-9)


@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.0, 1.7])
def test_finer_meshes_hold_the_nodes_of_coarser_ones(ratio):
    coarse, fine = grading(np.linspace(0, 1, 8), ratio), grading(np.linspace(0, 1, 15), ratio)
    assert fine[::2] == pytest.approx(coarse, abs=1e-14)
    assert coarse[0] == 0.0 and coarse[-1] == pytest.approx(1.0, abs=1e-15)
    assert np.all(np.diff(fine) > 0)


def test_refined_valve_meshes_are_nested():
    meshes = [mesh_of(14 * k, 24 * k, more=EVEN) for k in (1, 2, 4)]
    for coarse, fine in zip(meshes[:-1], meshes[1:]):
        assert fine.z[::2] == pytest.approx(coarse.z, abs=1e-15)
        assert fine.nodes[fine.rows[::2, ::2]] == pytest.approx(coarse.nodes[coarse.rows], abs=1e-14)
        assert fine.rest_area[::2] == pytest.approx(coarse.rest_area, rel=1e-14)


def test_symmetry_planes_are_exact():
    mesh = mesh_of()
    assert np.all(mesh.nodes[mesh.rows[:, 0], 0] == 0.0)
    assert np.all(mesh.nodes[mesh.rows[:, -1], 1] == 0.0)


def test_normals_point_out_of_the_valve():
    mesh, shell = build_shell(Case().replace({"mesh.around": 8, "mesh.along": 16}))
    directors = shell.mesh.directors
    outward = mesh.nodes * [1, 1, 0]
    assert np.all(np.einsum("ni,ni->n", directors, outward) > 0)
    assert np.all(directors[mesh.rows[:, 0], 0] == 0.0) and np.all(directors[mesh.rows[:, -1], 1] == 0.0)
    # on the symmetry planes the first frame vector lies in the plane, so the second rotation is the one they fix
    frames = shell.mesh.frames
    assert np.abs(frames[mesh.rows[:, 0], 0, 0]).max() < 1e-15 and np.abs(frames[mesh.rows[:, -1], 0, 1]).max() < 1e-15


def test_wall_map():
    mesh = mesh_of(4, 48)
    expected = np.select(
        [mesh.element_z < 0.21, mesh.element_z < 0.30, mesh.element_z < 0.49], [0.012, 0.015, 0.019], 0.016
    )
    assert np.array_equal(mesh.thickness, expected)
    assert np.all(mesh_of(wall="uniform").thickness == 0.01438)
    assert mesh_of(4, 48, thickness_factor=0.5).thickness == pytest.approx(expected / 2)


def test_wall_deduction():
    """Th. 4.12-4.14 with the numbers of App. A."""
    deducted = wall_deduction(VALVE, np.array([0.0, 0.21, 0.35, 0.49, 0.56]), surface_of(VALVE))
    duckbill = np.pi * 0.00619**2 / 4 + 0.125 * (0.00619 - 1e-4)
    flange = np.pi * (0.13919**2 - (0.13919 - 0.00819) ** 2) / 4
    assert deducted == pytest.approx([duckbill, duckbill, (duckbill + flange) / 2, flange, flange], rel=1e-12)


@pytest.mark.parametrize("along", [48, 96])
@pytest.mark.parametrize(("half_width", "flange"), [(0.125, None), (0.07, None), (0.125, 0.015)])
def test_no_smooth_saddle_is_narrower_than_the_lips(along, half_width, flange):
    """Behind the duckbill its section gains nothing at first, and the wall takes no more of it."""
    sizes = {"lip_half_width": half_width, "flange_wall_deduction": flange, "initial_gap": 1e-4}
    smooth, ruled = (mesh_of(6, along, saddle=saddle, **sizes) for saddle in ("smooth", "ruled"))
    passage, straight = (mesh.rest_area - mesh.wall_deduction for mesh in (smooth, ruled))
    assert passage.min() == pytest.approx(half_width * 1e-4, rel=1e-4)
    assert passage[[0, -1]] == pytest.approx(straight[[0, -1]], rel=1e-12)
    middle = [np.interp(0.35, z, found) for z, found in ((smooth.z, passage), (ruled.z, straight))]
    assert middle[0] == pytest.approx(middle[1], rel=0.05)  # there both surfaces have one section


def test_a_wall_that_fills_a_section_is_refused(one_sentence):
    with pytest.raises(CaseError, match="leaves no flow area at z = ") as caught:
        mesh_of(6, 48, flange_wall_deduction=0.139, lip_half_width=0.0001, lip_radius=0.00601)
    assert one_sentence(str(caught.value).replace("0.", ""))


def key_point_file(path, surface, s):
    """Nine profiles on the parametric surface, at the joints and at even distances between them."""
    z = [0.0, 0.105, 0.21, 0.28, 0.35, 0.42, 0.49, 0.525, 0.56]
    assert len(z) == 9 and len(s) == 15
    with path.open("w") as file:
        file.write("# x y z\n")
        for level in z:
            for point in surface.section(level, s):
                file.write("{:.12g} {:.12g} {:.12g}\n".format(*point))
    return path


def given_valve(path):
    return Case().replace({"valve.key_points": str(path)}).valve


@pytest.mark.slow
def test_key_points_reproduce_the_parametric_surface(tmp_path):
    """Key points sampled from the parametric surface give it back, the lip's tight side edge as well as fifteen points
    allow.
    """
    surface = surface_of(VALVE)
    length = 0.125 + 0.5 * np.pi * 0.00619
    corner = 0.125 / length
    s = np.concatenate([np.linspace(0, corner, 8), np.linspace(corner, 1, 8)[1:]])
    path = key_point_file(tmp_path / "points.txt", surface, s)
    given = mesh_of(16, 32, EVEN, key_points=str(path))
    own = mesh_of(16, 32, EVEN)
    assert given.z == pytest.approx(own.z, abs=1e-12)
    # nodes may slide in the surface: a saddle profile is taken at its own equal arc lengths, a ruled one at those of
    # its ends
    fine = np.linspace(0, 1, 20001)
    radius = 0.00619
    distance = np.zeros(given.rows.shape)
    for k, level in enumerate(given.z):
        curve = surface.section(level, fine)
        for j, node in enumerate(given.nodes[given.rows[k]]):
            distance[k, j] = np.sqrt(((curve - node) ** 2).sum(axis=1).min())
    on_profile = np.isin(
        np.round(given.z, 9), np.round([profile.z for profile in surface_of(given_valve(path)).profiles], 9)
    )
    # the curvature of the lip jumps where straight and circle meet: a cubic spline with points R1 pi/14 apart rings by
    # a few per cent of R1
    assert distance[on_profile].max() < 0.03 * radius
    # between the profiles of the saddle the two correspondences differ, most near its tight end
    assert distance.max() < 0.06 * radius
    # the round flange is smooth: there the splines are far better
    assert distance[given.z > 0.489].max() < 2e-3 * radius
    assert given.rest_area[on_profile] == pytest.approx(own.rest_area[on_profile], rel=2e-3)
    assert given.rest_area == pytest.approx(own.rest_area, rel=2e-2)
    assert np.array_equal(given.thickness, own.thickness)
