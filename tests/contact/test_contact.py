"""The contact law and the contact of inner faces: potentials, forces and tangents agree; what starts beyond the plane
is not pushed back.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.contact import ContactLaw, PlaneContact, tributary_area
from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.shell.mesh import nodal_thickness
from tests.shell.structures import grid, mixed_section
from tests.systems.pressed import ShellOnPlane

LAWS = [ContactLaw(1e9), ContactLaw(1e9, 2e-4)]


def _shell(free=None) -> Shell:
    """A curved patch that stands a little above the plane y = 0, its inner side down."""
    patch = grid(5, 4, lambda u, v: (0.3 * u, 0.008 + 0.02 * (u - 0.4) ** 2 + 0.01 * v, -0.25 * v))
    return Shell(ShellMesh.build(patch.nodes, patch.quads, np.linspace(0.01, 0.014, 20)), mixed_section(), free)


def _pressed(law: ContactLaw, depth=None, least_gap=0.0) -> ShellOnPlane:
    free = np.ones((30, 5), bool)
    free[:5] = False
    free[10:14, 4] = False
    shell = _shell(free)
    depth = 0.5 * nodal_thickness(shell.mesh) if depth is None else depth
    contact = PlaneContact(shell, np.arange(30), depth, tributary_area(shell), law, axis=1, least_gap=least_gap)
    return ShellOnPlane(shell, contact)


def _state(pressed: ShellOnPlane, seed=3) -> np.ndarray:
    """Displacements of millimetres towards the plane, rotations of tenths: some points in contact, some not."""
    generator = np.random.default_rng(seed)
    nodal = np.concatenate([2e-3 * generator.uniform(-1, 1, (30, 3)), 0.3 * generator.uniform(-1, 1, (30, 2))], axis=1)
    nodal[:, 1] -= 6e-3
    return pressed.shell.dofs.restrict(nodal)


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_pressure_and_stiffness_are_derivatives_of_the_potential(law):
    gap = np.linspace(-1e-3, 1e-3, 41) + 1.3e-5
    h = 1e-8
    up, down = law.respond(gap + h), law.respond(gap - h)
    _, pressure, stiffness = law.respond(gap)
    assert pressure == pytest.approx(-(up[0] - down[0]) / (2 * h), rel=1e-6, abs=1e-3)
    assert stiffness == pytest.approx(-(up[1] - down[1]) / (2 * h), rel=1e-6, abs=1e-3)
    assert pressure.min() == 0.0 and np.all(np.diff(pressure) <= 0)


def test_the_rounded_law_has_no_jumps_and_ends_exactly():
    law = ContactLaw(1e9, 2e-4)
    for edge in (-2e-4, 2e-4):
        before, after = (law.respond(np.array([edge + s * 1e-12])) for s in (-1, 1))
        for a, b in zip(before, after):
            assert a == pytest.approx(b, rel=1e-6, abs=10.0)  # of a penalty of 1e9
    assert [float(v[0]) for v in law.respond(np.array([2.0001e-4]))] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("given", [{"penalty": 0.0}, {"penalty": 1e9, "rounding": -1e-6}])
def test_a_law_that_makes_no_sense_is_refused(given):
    with pytest.raises(ValueError, match="contact"):
        ContactLaw(**given)


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_force_is_the_derivative_of_the_energy(law):
    pressed = _pressed(law)
    q = _state(pressed)
    assert 3 < pressed.contact.touching(q) < pressed.contact.count
    shell_force = pressed.shell.force(q)
    force = pressed.structure(q)[0] - shell_force
    direction = np.random.default_rng(5).standard_normal(len(q))
    h = 1e-8
    change = (pressed.contact.energy(q + h * direction) - pressed.contact.energy(q - h * direction)) / (2 * h)
    assert force @ direction == pytest.approx(change, rel=1e-5)


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_tangent_is_the_derivative_of_the_residual_and_its_structure_is_symmetric(law):
    pressed = _pressed(law)
    q, p = _state(pressed), 2e4
    tangent = pressed.tangent(q, p)
    assert tangent.residual == pytest.approx(
        pressed.residual(q, p), rel=1e-12, abs=1e-9 * np.abs(tangent.residual).max()
    )
    matrix = pressed.shell.dofs.matrix(tangent.structure)
    assert abs(matrix - matrix.T).max() <= 1e-13 * abs(matrix).max()
    direction = np.random.default_rng(5).standard_normal(len(q))
    h = 1e-8
    change = (pressed.residual(q + h * direction, p) - pressed.residual(q - h * direction, p)) / (2 * h)
    assert pressed.apply(tangent, direction) == pytest.approx(change, rel=1e-5, abs=1e-6 * np.abs(change).max())


def test_second_derivatives_agree_with_differences_of_the_tangent():
    pressed = _pressed(ContactLaw(1e9, 2e-3))
    q = _state(pressed)
    generator = np.random.default_rng(9)
    a, b = generator.standard_normal((2, len(q)))
    h = 1e-7

    def contact_only(q):
        whole, bare = pressed.structure(q)[1], pressed.shell.force_and_tangent(q)[1]
        return pressed.shell.dofs.matrix(whole - bare) @ a

    change = (contact_only(q + h * b) - contact_only(q - h * b)) / (2 * h)
    exact = pressed.contact.form(q, a, b)
    assert exact == pytest.approx(change, rel=1e-4, abs=1e-5 * np.abs(change).max())


def test_a_contact_force_passes_through_the_touching_point():
    """Force and moment about the origin of the nodal contact force equal those of forces at the face."""
    pressed = _pressed(ContactLaw(1e9))
    shell = Shell(pressed.shell.mesh, mixed_section())
    contact = PlaneContact(
        shell, np.arange(30), 0.5 * nodal_thickness(shell.mesh), tributary_area(shell), ContactLaw(1e9)
    )
    loose = ShellOnPlane(shell, contact)
    nodal = pressed.nodal(_state(pressed))
    q = nodal.ravel()
    force = (loose.structure(q)[0] - shell.force(q)).reshape(30, 5)
    state = loose.contact.state(q)
    d, d1, _ = shell.directors(nodal)
    assert -force[:, 1].sum() == pytest.approx(state.total)
    # virtual work of a small rigid rotation: the nodes move by w x x and the directors by w x d
    spin = np.array([0.3, -0.2, 0.5])
    rotate = np.cross(spin, d)
    rates = np.stack([np.linalg.lstsq(d1[n].T, rotate[n], rcond=None)[0] for n in range(30)])
    work = -np.sum(force[:, :3] * np.cross(spin, shell.mesh.nodes + nodal[:, :3])) - np.sum(force[:, 3:] * rates)
    at_face = np.cross(spin, contact.points(nodal, d))[:, 1] @ state.force
    assert work == pytest.approx(at_face, rel=1e-10)


def test_points_that_start_beyond_the_plane_are_pushed_only_when_they_close_further():
    pressed = _pressed(ContactLaw(1e9), depth=np.full(30, 0.0095), least_gap=1e-4)
    contact = pressed.contact
    assert 0 < np.count_nonzero(contact.start < 0) < contact.count
    assert np.count_nonzero(contact.lifted) >= np.count_nonzero(contact.start < 0)
    rest = pressed.contact.state(pressed.rest())
    assert not rest.touching.any() and rest.gap.min() == pytest.approx(1e-4)
    nodal = np.zeros((30, 5))
    nodal[:, 1] = -1.5e-4
    down = pressed.contact.state(pressed.shell.dofs.restrict(nodal))
    assert down.gap[contact.lifted] == pytest.approx(-0.5e-4)


def test_nodal_thickness_and_area():
    shell = _shell()
    h, quads = nodal_thickness(shell.mesh), shell.mesh.quads
    corner, middle = quads[0, 0], quads[0, 2]
    assert h[corner] == shell.mesh.thickness[0]
    assert h[middle] == pytest.approx(np.mean([shell.mesh.thickness[e] for e in range(20) if middle in quads[e]]))
    assert tributary_area(shell).sum() == pytest.approx(shell.geometry.area.sum())
