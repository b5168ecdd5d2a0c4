"""Two plates pressed on each other that move together."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.contact import ContactLaw, PlaneContact, tributary_area
from dbvfiv.shell import Shell, ShellMesh
from tests.shell.structures import grid, isotropic_section
from tests.systems.pressed import ShellOnPlane, class_matrices

WALL, SIDE, PRESSURE = 0.01, 0.2, 2e3


@pytest.fixture(scope="module")
def pressed():
    """A plate above y = 0 with its outer face up, pressed on its mirror image."""
    patch = grid(4, 4, lambda u, v: (SIDE * v - 0.05, 0.5 * WALL + 0 * u, SIDE * u))
    mesh = ShellMesh.build(patch.nodes, patch.quads, WALL)
    assert mesh.directors[:, 1] == pytest.approx(1.0)
    shell = Shell(mesh, isotropic_section(1e6, 0.3, WALL))
    law = ContactLaw(1e12)
    model = ShellOnPlane(shell, PlaneContact(shell, np.arange(mesh.node_count), 0.5 * WALL, tributary_area(shell), law))
    sunk = np.zeros((mesh.node_count, 5))
    sunk[:, 1] = -PRESSURE / law.penalty
    q = shell.dofs.restrict(sunk)
    assert np.abs(model.residual(q, PRESSURE)).max() < 1e-9 * PRESSURE * SIDE**2
    assert model.contact.state(q).total == pytest.approx(PRESSURE * SIDE**2, rel=1e-9)
    free = np.ones((mesh.node_count, 5), bool)
    return mesh, class_matrices(model, free, False, q, PRESSURE)[0]


def rotation(mesh, axis: int, turn: float = 1.0) -> np.ndarray:
    """Rigid rotation of the pair about an axis in the plane of contact, as nodal unknowns (nn, 5)."""
    about = turn * np.eye(3)[axis]
    nodal = np.zeros((mesh.node_count, 5))
    nodal[:, :3] = np.cross(about, mesh.nodes)
    nodal[:, 3:] = np.einsum("nri,ni->nr", mesh.frames, np.cross(about, mesh.directors))
    return nodal


@pytest.mark.parametrize("axis", [0, 2])
def test_a_pair_turns_freely(pressed, axis):
    mesh, stiffness = pressed
    motion = rotation(mesh, axis).ravel()
    assert np.abs(stiffness @ motion).max() < 1e-7 * np.abs(abs(stiffness) @ np.abs(motion)).max()
    across = np.zeros((mesh.node_count, 5))
    across[:, 1] = 1.0
    assert np.abs(stiffness @ across.ravel()).max() < 1e-9 * abs(stiffness).max()


@pytest.mark.parametrize("axis", [0, 2])
def test_plates_that_tilt_without_sliding_back_are_pushed_apart(pressed, axis):
    """Tilted by t with their middles in place, plates that touch stand b t^2 / 2 further apart each."""
    mesh, stiffness = pressed
    tilt = rotation(mesh, axis)
    tilt[:, [0, 2]] = 0.0
    b, force = 0.5 * WALL, PRESSURE * SIDE**2
    assert tilt.ravel() @ (stiffness @ tilt.ravel()) == pytest.approx(force * b, rel=1e-4)
