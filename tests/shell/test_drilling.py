"""Drilling rotations: the bows of the edges, what they strain, and what holds them."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.motion.kernels import strain_energy
from dbvfiv.shell import Shell
from dbvfiv.shell.assumed_strain import DRILLING, ENHANCED
from dbvfiv.shell.drilling import bow_strains, own_stiffness, saddle_pattern
from dbvfiv.shell.reference import GAUSS
from tests.shell.structures import (
    CORNERS,
    distorted_plate,
    isotropic_section,
    mixed_section,
    random_unknowns,
    rigid_motion,
    rotation_about,
    single_element,
)

EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


def place(r, s, corners, turns):
    """Point of an element whose edges are parabolas: in its middle the edge i to j moves by l/8 (w_j - w_i) to the
    right of the way from i to j, along it by 4 x (1 - x) of that.
    """
    low, high = 0.5 * (1 - np.array([r, s])), 0.5 * (1 + np.array([r, s]))
    shape = np.array([low[0] * low[1], high[0] * low[1], high[0] * high[1], low[0] * high[1]])
    fade = (low[1], high[0], high[1], low[0])
    across = (low[0] * high[0], low[1] * high[1]) * 2
    point = shape @ corners
    for (i, j), f, a in zip(EDGES, fade, across):
        way = corners[j] - corners[i]
        point = point + f * 4 * a * (turns[j] - turns[i]) / 8.0 * np.array([way[1], -way[0]])
    return point


@pytest.mark.parametrize("seed", [0, 1])
def test_strains_are_those_of_edges_that_bow(seed):
    """To first order: covariant strains from differences of the displaced points."""
    turns = np.random.default_rng(seed).uniform(-1, 1, 4)
    found = bow_strains(single_element())[0] @ turns
    step = 1e-4
    for point, strains in zip(GAUSS, found):

        def metric(size):
            slopes = [
                (place(*(point + d), CORNERS, size * turns) - place(*(point - d), CORNERS, size * turns)) / (2 * step)
                for d in step * np.eye(2)
            ]
            return 0.5 * np.array([slopes[0] @ slopes[0], slopes[1] @ slopes[1], 2 * slopes[0] @ slopes[1]])

        slope = (metric(step) - metric(-step)) / (2 * step)
        assert strains == pytest.approx(slope, abs=1e-7)


def test_patch_of_constant_strain():
    """Held at its edge as a homogeneous deformation of any size has it, with no bows there, a distorted patch deforms
    alike inside: bows that neighbours share do no work in all on constant stress.
    """
    mesh, inside = distorted_plate()
    shell = Shell(mesh, isotropic_section(1e6, 0.3, 0.01), element=DRILLING)
    for gradient in (np.array([[1.001, 2e-3], [0.0, 0.999]]), np.array([[1.2, 0.3], [-0.1, 0.9]])):
        nodal = np.zeros((mesh.node_count, 6))
        nodal[:, :2] = mesh.nodes[:, :2] @ (gradient - np.eye(2)).T
        force = shell.dofs.expand(shell.force(shell.dofs.restrict(nodal)))
        scale = np.abs(force).max(axis=0)  # of the edge
        assert np.abs(force[inside, :2]).max() < 1e-11 * scale[:2].max()
        assert np.abs(force[inside, 5]).max() < 1e-11 * scale[5]


def test_no_motion_is_free_but_rigid_ones_and_even_rotations():
    """Of a distorted patch, its drilling rotations among the unknowns; even ones are held by a millionth."""
    mesh, _ = distorted_plate()
    shell = Shell(mesh, isotropic_section(1e6, 0.3, 0.01), element=DRILLING)
    matrix = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).toarray()
    plane = np.zeros((mesh.node_count, 6), bool)
    plane[:, [0, 1, 5]] = True
    chosen = plane.ravel()
    values = np.linalg.eigvalsh(matrix[np.ix_(chosen, chosen)])
    assert np.abs(values[:3]).max() < 1e-12 * values[-1]
    assert 1e-9 * values[-1] < values[3] < 1e-3 * values[4]
    assert values[4] > 1e-5 * values[-1]


def test_saddle_patterns_are_held_as_much_as_they_strain():
    """Of a rectangle, where strains of the pattern are even at the points; linear fields are no part of the pattern."""
    corners = np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.2], [0.0, 0.2]])
    mesh, wall = single_element(corners), isotropic_section(1e6, 0.3, 0.01)
    shell = Shell(mesh, wall, element=ENHANCED)
    geometry, membrane = shell.geometry, wall.plane_stiffness[None, :3, :3] * 0.01
    pattern = saddle_pattern(mesh, geometry)[0]
    assert pattern == pytest.approx([1, -1, 1, -1])
    leaning = saddle_pattern(single_element(), geometry)[0]
    assert np.abs(leaning @ np.column_stack([np.ones(4), CORNERS])).max() < 1e-13
    covariant = bow_strains(mesh)[0] @ pattern  # (4, 3): along one side, along the other, and none sheared
    assert np.abs(covariant[:, 2]).max() < 1e-14
    strained = 0.0
    for k in range(2):
        strains = geometry.q[0][:, :, k] * covariant[:, [k]]
        strained += np.einsum("p,pi,ij,pj->", geometry.area[0], strains, membrane[0], strains)
    own = pattern @ own_stiffness(mesh, geometry, membrane)[0] @ pattern
    assert own == pytest.approx(strained, rel=1e-4)  # but for what holds even rotations


def test_energies_and_inertia(mesh):
    """The compiled energies are the defined one and that of the mass matrix, whose product inertia is at rest."""
    shell = Shell(mesh, mixed_section(), element=DRILLING)
    q, turned = random_unknowns(shell, 6, 0.02, 0.1), shell.dofs.index[:, 5]
    rate, acceleration = np.random.default_rng(5).uniform(-1, 1, (2, shell.size))
    nodal, part = shell.dofs.expand(q), shell.parts[0]
    found = strain_energy(part.quads, mesh.nodes, nodal, shell.directors(nodal)[0], part.reference, shell.wall[0])
    assert found == pytest.approx(shell.energy(q), rel=1e-11)
    mass = shell.dofs.matrix(shell.mass(q))
    assert shell.kinetic_energy(q, rate) == pytest.approx(0.5 * rate @ mass @ rate, rel=1e-12)
    inertia = shell.inertia(q, 0 * rate, acceleration)
    assert np.abs(inertia - mass @ acceleration).max() < 1e-12 * np.abs(inertia).max()
    assert mass.diagonal()[turned].min() > 0


def test_strains_count_from_the_turned_element(mesh):
    """The same drilling rotations strain the same wherever the shell has been moved to."""
    shell = Shell(mesh, mixed_section(), element=DRILLING)
    turned = shell.dofs.index[:, 5]
    moved = shell.dofs.restrict(rigid_motion(mesh, rotation_about((1, 2, -1), 2.5), (0.1, -0.2, 0.3)))
    still = np.zeros(shell.size)
    still[turned] = moved[turned] = 0.05 * np.random.default_rng(7).uniform(-1, 1, len(turned))
    expected = shell.strains(still)
    assert np.abs(expected).max() > 1e-3
    assert shell.strains(moved) == pytest.approx(expected, abs=2e-14)


@pytest.mark.slow
def test_forms_of_a_wall_that_relaxes(mesh):
    """With factors of one they are the derivatives of the force, by differences too."""
    shell = Shell(mesh, mixed_section(), element=DRILLING)
    q = random_unknowns(shell, 9, 0.01, 0.05, drilling=0.02)
    a, b = np.random.default_rng(8).uniform(-1, 1, (2, shell.size))
    second, ones = shell.second(q, a, b), np.ones((4, len(shell.section.layers)))
    form = shell.relaxed_form(q, (a, b), ones)
    assert np.abs(form - second).max() < 1e-11 * np.abs(second).max()
    step = 1e-6

    def along(x):
        return shell.dofs.matrix(shell.force_and_tangent(x)[1]) @ a

    slope = (along(q + step * b) - along(q - step * b)) / (2 * step)
    assert np.linalg.norm(second - slope) < 1e-6 * np.linalg.norm(slope)
