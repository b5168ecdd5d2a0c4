"""Meshes and walls that the shell is tried on.

All meshes have 24 elements, so that what is compiled for one serves the others.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.studies.case import thesis_case
from tests.shell.structures import grid, isotropic_section, mixed_section


def _distorted_plate() -> ShellMesh:
    patch = grid(6, 4, lambda u, v: (0.4 * u + 0.06 * u * v, 0.3 * v + 0.05 * np.sin(3 * u) * v * (1 - v), 0 * u))
    return ShellMesh.build(patch.nodes, patch.quads, np.linspace(0.01, 0.02, 24), material_axis=(1.0, 0.2, 0.0))


def _saddle() -> ShellMesh:
    patch = grid(4, 6, lambda u, v: (0.4 * u, 0.5 * v + 0.05 * u**2, 0.4 * (u - 0.3) * (v - 0.6) + 0.1 * u**2))
    return ShellMesh.build(patch.nodes, patch.quads, 0.012, material_axis=(0.3, 1.0, 0.1))


def _cylinder() -> ShellMesh:
    patch = grid(6, 4, lambda u, v: (0.1 * np.cos(2.5 * u), 0.1 * np.sin(2.5 * u), 0.15 * v))
    return ShellMesh.build(patch.nodes, patch.quads, 0.02)


def _valve() -> ShellMesh:
    # even columns: random motions are measured in the mean element and would turn narrow ones inside out
    case = thesis_case({"mesh.around": 4, "mesh.along": 6, "mesh.rows": "uniform", "mesh.columns": "uniform"})
    mesh = valve_mesh(case.valve, case.mesh)
    planes = [(mesh.rows[:, 0], 0), (mesh.rows[:, -1], 1)]
    return ShellMesh.build(mesh.nodes, mesh.quads, mesh.thickness, planes=planes)


MESHES = {"distorted plate": _distorted_plate, "saddle": _saddle, "cylinder": _cylinder, "valve": _valve}


@pytest.fixture(params=sorted(MESHES))
def mesh(request) -> ShellMesh:
    """One mesh after the other."""
    return MESHES[request.param]()


@pytest.fixture
def mixed_shell(mesh) -> Shell:
    """A shell of rubbers and plies with nothing held."""
    return Shell(mesh, mixed_section())


@pytest.fixture
def saddle_shell() -> Shell:
    """A doubly curved patch of rubbers and plies with some unknowns held."""
    surface = _saddle()
    free = np.ones((surface.node_count, 5), bool)
    free[:5] = False
    free[7, 1] = False
    free[9, 4] = False
    return Shell(surface, mixed_section(), free)


@pytest.fixture
def cylinder_mesh() -> ShellMesh:
    return _cylinder()


@pytest.fixture
def one_layer():
    """Isotropic wall, 20 mm."""
    return isotropic_section(6e6, 0.4, 0.02, 1300.0)
