"""Flow areas of the deforming rows."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.flow import RowAreas
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.shell import DofMap
from dbvfiv.studies.case import thesis_case


@pytest.fixture(scope="module")
def rows():
    case = thesis_case({"mesh.around": 8, "mesh.along": 14})
    mesh = valve_mesh(case.valve, case.mesh)
    dofs = DofMap(SYMMETRIES["SS"].free_unknowns(mesh), mesh.quads)
    return mesh, dofs, RowAreas(mesh, dofs.index)


def field(dofs, seed, size=0.01):
    return dofs.expand(size * np.random.default_rng(seed).standard_normal(dofs.size))


def test_areas_at_rest(rows):
    """The gap at the lips and the open flange of App. A (Th. 4.12-4.14), on any mesh."""
    mesh, dofs, areas = rows
    rest = areas.areas(np.zeros((len(mesh.nodes), 5)))
    assert rest[0] == pytest.approx(0.125 * 1e-4, rel=1e-3)
    assert rest[-1] == pytest.approx(0.25 * np.pi * (0.13919 - 0.00819) ** 2, rel=1e-6)
    assert rest == pytest.approx(mesh.rest_area - mesh.wall_deduction, rel=1e-12)
    assert np.all(np.diff(rest[mesh.z >= 0.21]) > -1e-12)


def test_jacobian(rows):
    """The areas are quadratic in the displacements, so a central difference is exact."""
    mesh, dofs, areas = rows
    at, along = field(dofs, 0), field(dofs, 1)
    slope = (areas.areas(at + along) - areas.areas(at - along)) / 2
    assert areas.jacobian(at) @ dofs.restrict(along) == pytest.approx(slope, rel=1e-10, abs=1e-14)


def test_second_derivative(rows):
    mesh, dofs, areas = rows
    at, a, b = (field(dofs, seed) for seed in range(3))
    other = (areas.jacobian(at + b) - areas.jacobian(at)) @ dofs.restrict(a)
    assert areas.second(a, b) == pytest.approx(other, rel=1e-10, abs=1e-14)
    assert areas.second(a, b) == pytest.approx(areas.second(b, a), rel=1e-12, abs=1e-16)


def test_lifting_the_lip(rows):
    """A uniform lift adds its height times the width of the row."""
    mesh, dofs, areas = rows
    lift = np.zeros((len(mesh.nodes), 5))
    lift[:, 1] = 0.003
    grown = areas.areas(lift) - areas.areas(0 * lift)
    assert grown == pytest.approx(0.003 * mesh.nodes[mesh.rows[:, -1], 0], rel=1e-12)


def test_crossed_lips_have_a_negative_area(rows):
    mesh, dofs, areas = rows
    sink = np.zeros((len(mesh.nodes), 5))
    sink[mesh.rows[0], 1] = -0.002
    assert areas.areas(sink)[0] < 0.0


def test_pattern_holds_free_unknowns_only(rows):
    mesh, dofs, areas = rows
    jacobian = areas.jacobian(np.zeros((len(mesh.nodes), 5)))
    assert jacobian.shape == (len(mesh.z), dofs.size)
    assert jacobian[-1].nnz == 0  # clamped flange
    assert jacobian.has_sorted_indices
