"""Rigid-body motions store no energy, leave no force and carry the right kinetic energy."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.mass import AVERAGED, MASSES
from tests.shell.structures import random_state, rectangle, rigid_motion, rotation_about, rotations_to

TURNS = [((0, 0, 1), 0.5), ((1, 0, 0), 1.5), ((1, 2, -1), 2.5), ((-1, 0.3, 0.2), 3.0)]


@pytest.mark.parametrize("axis, angle", TURNS)
def test_rotation_leaves_no_force(mixed_shell, axis, angle):
    shell = mixed_shell
    q = shell.dofs.restrict(rigid_motion(shell.mesh, rotation_about(axis, angle), (0.1, -0.2, 0.3)))
    force, data = shell.force_and_tangent(q)
    # what rounding of positions and directors leaves: machine epsilon times stiffness times size
    size = np.ones((shell.mesh.node_count, 5))
    size[:, :3] = np.abs(shell.mesh.nodes) + np.abs(q.reshape(-1, 5)[:, :3])
    rounding = np.finfo(float).eps * (abs(shell.dofs.matrix(data)) @ shell.dofs.restrict(size))
    assert np.abs(force).max() < rounding.max()
    assert abs(shell.energy(q)) < 1e-20 * abs(data).max()


@pytest.mark.parametrize("axis, angle", TURNS)
def test_strains_do_not_see_a_rotation(mixed_shell, axis, angle):
    """Strains of a deformed state stay the same when the deformed body is rotated."""
    shell = mixed_shell
    mesh = shell.mesh
    nodal = random_state(mesh, 4, 0.05, 0.2, rigid=0.0)
    directors, _, _ = shell.directors(nodal)
    turn = rotation_about(axis, angle)
    turned = np.zeros_like(nodal)
    turned[:, :3] = (mesh.nodes + nodal[:, :3]) @ turn.T - mesh.nodes
    turned[:, 3:] = rotations_to(mesh, directors @ turn.T)
    one, other = shell.strains(shell.dofs.restrict(nodal)), shell.strains(shell.dofs.restrict(turned))
    assert np.abs(one - other).max() < 1e-12


def test_director_turns_by_the_length_of_the_rotation(cylinder_mesh, one_layer):
    shell = Shell(cylinder_mesh, one_layer)
    theta = np.random.default_rng(0).uniform(-1.8, 1.8, (cylinder_mesh.node_count, 2))
    theta[0], theta[1], theta[2] = 0.0, (1e-9, 0.0), (0.0, 0.0999999)
    nodal = np.zeros((cylinder_mesh.node_count, 5))
    nodal[:, 3:] = theta
    directors, _, _ = shell.directors(nodal)
    assert np.linalg.norm(directors, axis=1) == pytest.approx(1.0, abs=1e-14)
    cosine = np.einsum("ni,ni->n", directors, cylinder_mesh.directors)
    assert cosine == pytest.approx(np.cos(np.linalg.norm(theta, axis=1)), abs=1e-14)


@pytest.mark.parametrize("radius", [1e-6, 0.0999, 0.1001, 1.0, 3.0])
def test_derivatives_of_the_director(cylinder_mesh, one_layer, radius):
    """Series and closed form meet, and both derivatives are those of the director."""
    shell = Shell(cylinder_mesh, one_layer)
    nodal = np.zeros((cylinder_mesh.node_count, 5))
    nodal[:, 3:] = radius * np.array([0.6, -0.8])
    _, d1, d2 = shell.directors(nodal)

    def shifted(*step):
        moved = nodal.copy()
        moved[:, 3:] += step
        return shell.directors(moved)

    h = 1e-3
    for r, unit in enumerate(np.eye(2)):
        parts = [shifted(*(k * h * unit)) for k in (-2, -1, 1, 2)]
        for order in (0, 1):
            a, b, c, d = (part[order] for part in parts)
            slope = (a - 8 * b + 8 * c - d) / (12 * h)
            if order == 0:
                assert np.abs(slope - d1[:, r]).max() < 1e-11
            else:
                assert np.abs(slope[:, r] - d2[:, r]).max() < 1e-11
                assert np.abs(slope[:, 1 - r] - d2[:, 2]).max() < 1e-11


def layered() -> Section:
    """Layers of unequal density, so that translation and rotation of the wall are coupled."""
    return Section((Layer(IsotropicElastic(1e6, 0.3, 1000.0), 0.03), Layer(IsotropicElastic(1e6, 0.3, 3000.0), 0.01)))


def rates(shell: Shell, nodal, velocity, spin):
    """Nodal velocities (nn, 5) of a rigid motion of a shell that has been rigidly moved to `nodal`."""
    directors, d1, _ = shell.directors(nodal)
    out = np.zeros_like(nodal)
    out[:, :3] = velocity + np.cross(spin, shell.mesh.nodes + nodal[:, :3])
    turning = np.cross(spin, directors)
    for n in range(len(out)):
        out[n, 3:] = np.linalg.lstsq(d1[n].T, turning[n], rcond=None)[0]
    return out


@pytest.mark.parametrize("mass_kind", MASSES)
@pytest.mark.parametrize("turn", [np.eye(3), rotation_about((1, 2, 3), 2.0)])
def test_kinetic_energy_of_a_rigid_plate(turn, mass_kind):
    """Against the exact mass and inertia of a layered box, rotary inertia included; lumped masses, which stand at the
    ends of an element of length a, have a^2/4 for its a^2/12, so the mean of both adds a^2/12 to the second moment.
    """
    length, width = 0.5, 0.3
    patch = rectangle(5, 3, length, width)
    surface = ShellMesh.build(patch.nodes, patch.quads, 0.04, material_axis=(1, 0, 0))
    shell = Shell(surface, layered(), mass_kind=mass_kind)
    nodal = rigid_motion(shell.mesh, turn, (0.2, 0.1, -0.3))
    velocity, spin = np.array([1.0, -2.0, 0.5]), np.array([3.0, 1.0, -2.0])
    rate = shell.dofs.restrict(rates(shell, nodal, velocity, spin))
    mass = shell.dofs.matrix(shell.mass(shell.dofs.restrict(nodal)))
    kinetic = 0.5 * rate @ (mass @ rate)
    # box integrals: second moments about the origin of the material points before they are moved
    rho = [1000.0, 3000.0]
    faces = np.array([-0.02, 0.01, 0.02])
    m0, m1, m2 = (
        sum(r * (b ** (k + 1) - a ** (k + 1)) / (k + 1) for r, a, b in zip(rho, faces[:-1], faces[1:]))
        for k in range(3)
    )
    area = length * width
    first = np.array([0.5 * length * area * m0, 0.5 * width * area * m0, area * m1])
    second = np.array(
        [
            [length**2 / 3 * area * m0, length * width / 4 * area * m0, length / 2 * area * m1],
            [length * width / 4 * area * m0, width**2 / 3 * area * m0, width / 2 * area * m1],
            [length / 2 * area * m1, width / 2 * area * m1, area * m2],
        ]
    )
    total = area * m0
    if mass_kind == AVERAGED:
        second += np.diag([(length / 5) ** 2, (width / 3) ** 2, 0.0]) * total / 12
    shift = np.array([0.2, 0.1, -0.3])
    first, second = turn @ first, turn @ second @ turn.T
    second = second + np.outer(first, shift) + np.outer(shift, first) + total * np.outer(shift, shift)
    first = first + total * shift
    inertia = np.trace(second) * np.eye(3) - second
    exact = 0.5 * total * velocity @ velocity + velocity @ np.cross(spin, first) + 0.5 * spin @ inertia @ spin
    assert kinetic == pytest.approx(exact, rel=1e-12)


def of_mass(shell: Shell, mass_kind: str) -> Shell:
    """The same shell with another mass."""
    return Shell(shell.mesh, shell.section, shell.dofs.free, mass_kind=mass_kind)


@pytest.mark.parametrize("mass_kind", MASSES)
def test_total_mass(mixed_shell, mass_kind):
    """That of the wall, and its first moment about the origin that of its mid-surface."""
    shell = of_mass(mixed_shell, mass_kind)
    section, mesh = shell.section, shell.mesh
    density = sum(layer.law.density * share for layer, share in zip(section.layers, section.fractions))
    by_point = density * shell.geometry.area * mesh.thickness[:, None]
    mass = shell.dofs.matrix(shell.mass())
    place = np.zeros((mesh.node_count, 5))
    place[:, :3] = mesh.nodes
    for axis in range(3):
        unit = np.zeros((mesh.node_count, 5))
        unit[:, axis] = 1.0
        unit = shell.dofs.restrict(unit)
        assert unit @ (mass @ unit) == pytest.approx(by_point.sum(), rel=1e-13)
        moment = np.sum(by_point * shell.geometry.position[..., axis])
        assert unit @ (mass @ shell.dofs.restrict(place)) == pytest.approx(moment, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("mass_kind", MASSES)
def test_mass_is_symmetric_and_positive(mixed_shell, mass_kind):
    shell = of_mass(mixed_shell, mass_kind)
    q = shell.dofs.restrict(random_state(shell.mesh, 8))
    mass = shell.dofs.matrix(shell.mass(q)).toarray()
    assert np.abs(mass - mass.T).max() <= 1e-15 * np.abs(mass).max()
    scale = 1 / np.sqrt(np.diag(mass))
    assert np.linalg.eigvalsh(mass * scale[:, None] * scale).min() > 1e-3


@pytest.mark.parametrize("mass_kind", MASSES)
def test_convective_inertia_is_that_of_lagranges_equations(saddle_shell, mass_kind):
    """d/dt (M v) - d/dq (v M v / 2) = M a + convective inertia, by differences."""
    shell = of_mass(saddle_shell, mass_kind)
    q = shell.dofs.restrict(random_state(shell.mesh, 9, 0.05, 0.8, rigid=0.0))
    v = shell.dofs.restrict(
        np.random.default_rng(10).standard_normal((shell.mesh.node_count, 5)) * np.array([0.1] * 3 + [1] * 2)
    )

    def mass(x):
        return shell.dofs.matrix(shell.mass(x))

    h = 1e-3
    steps, weights = (-2, -1, 1, 2), np.array([1, -8, 8, -1]) / (12 * h)
    momentum = sum(w * (mass(q + k * h * v) @ v) for k, w in zip(steps, weights))
    convective = shell.inertia(q, v, np.zeros(shell.size))
    checked = np.random.default_rng(1).choice(shell.size, 25, replace=False)
    for i in checked:
        unit = np.zeros(shell.size)
        unit[i] = 1.0
        gradient = sum(w * 0.5 * v @ (mass(q + k * h * unit) @ v) for k, w in zip(steps, weights))
        assert convective[i] == pytest.approx(momentum[i] - gradient, abs=1e-8 * np.abs(convective).max())
