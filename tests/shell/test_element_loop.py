"""The compiled element loop against automatic differentiation of the energy, and both against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbvfiv.materials.laws import IsotropicElastic, MooneyRivlin, Ogden, OrthotropicPly, SofteningRubber, Yeoh
from dbvfiv.shell import Layer, Section, Shell, StepWall
from dbvfiv.shell.assumed_strain import MITC4
from tests.differences import difference
from tests.shell.structures import mixed_section, random_state, random_unknowns


def assembled(shell, q):
    """Force and dense tangent from the automatically differentiated energy."""
    unknowns = shell.dofs.expand(q)[shell.mesh.quads]
    force, columns = np.zeros(shell.dofs.free.shape), 5
    np.add.at(force, shell.mesh.quads, np.asarray(shell.energies.force(unknowns)).reshape(-1, 4, columns))
    tangent = np.zeros((force.size,) * 2)
    dofs = (columns * shell.mesh.quads[:, :, None] + np.arange(columns)).reshape(-1, 4 * columns)
    for index, block in zip(dofs, np.asarray(shell.energies.tangent(unknowns))):
        tangent[np.ix_(index, index)] += block
    free = shell.dofs.free.ravel()
    return shell.dofs.restrict(force), tangent[np.ix_(free, free)]


def check_loop(shell, q, rigid=True):
    """Force and tangent of the loop are those of the energy.

    A nearly rigid motion leaves forces that are differences of much larger numbers: their scale is stiffness times
    size.
    """
    expected_force, expected_tangent = assembled(shell, q)
    force, data = shell.force_and_tangent(q)
    assert force.shape == (shell.size,)
    scale, size = np.abs(expected_force).max(), np.abs(expected_tangent).max()
    scale = max(scale, size * np.abs(shell.mesh.nodes).max() * 1e-2) if rigid else scale
    assert np.abs(force - expected_force).max() < 1e-12 * scale
    assert np.abs(shell.force(q) - expected_force).max() < 1e-12 * scale
    assert np.abs(shell.dofs.matrix(data).toarray() - expected_tangent).max() < 1e-12 * size


@pytest.mark.parametrize("seed, stretch, turn", [(0, 0.1, 0.4), (1, 0.15, 1.0), (2, 1e-5, 1e-5), (3, 0.05, 0.05)])
def test_force_and_tangent_are_those_of_the_energy(mixed_shell, seed, stretch, turn):
    check_loop(mixed_shell, random_unknowns(mixed_shell, seed, stretch, turn))


def test_loop_of_the_plain_element_is_its_energy(mesh):
    shell = Shell(mesh, mixed_section(), element=MITC4)
    check_loop(shell, random_unknowns(shell, 31, 0.02, 0.1), rigid=False)


RUBBER = MooneyRivlin(4e5, 1e5, 2e5, 1300.0)


def with_rubber(law, count: int = 1) -> Section:
    """The mixed wall with another rubber in its first layers, which needs no compilation of its own."""
    layers = mixed_section().layers
    return Section((*(replace(layer, law=law) for layer in layers[:count]), *layers[count:]))


SECTIONS = {
    "Yeoh rubber": with_rubber(Yeoh(4e5, -3e4, 2e4, 1300.0)),
    "softening rubber": with_rubber(SofteningRubber(2e5, 1e6, 3e-3, 9e6, 1300.0)),
    "rubbers only": Section(
        (
            Layer(Ogden((0.618e6, 1.18e3, -9.81e3), (1.3, 5.0, -2.0), 1000.0), 0.004),
            Layer(Ogden((3e5,), (4.0,), 1000.0), 0.004),
            Layer(RUBBER, 0.004),
        ),
        3,
    ),
    "ply only": Section((Layer(OrthotropicPly(25e6, 1e6, 0.25, 0.5e6, 0.5e6, 0.2e6, 1.0), 0.012, 30.0, 5 / 6),)),
    "one point a layer": Section((Layer(IsotropicElastic(1e6, 0.3, 1.0), 0.004), Layer(RUBBER, 0.008)), 1),
}


@pytest.mark.parametrize("name", sorted(SECTIONS))
def test_other_walls(cylinder_mesh, name):
    shell = Shell(cylinder_mesh, SECTIONS[name])
    q = shell.dofs.restrict(random_state(shell.mesh, 5, 0.1, 0.5))
    direction = unit_direction(shell, 6)
    expected = np.asarray(shell.energies.force(shell.dofs.expand(q)[shell.mesh.quads]))
    total = np.zeros((shell.mesh.node_count, 5))
    np.add.at(total, shell.mesh.quads, expected.reshape(-1, 4, 5))
    force, data = shell.force_and_tangent(q)
    for found in (force, shell.force(q)):
        assert np.abs(found - total.ravel()).max() < 1e-12 * np.abs(total).max()
    slope = difference(shell.force, q, direction, 1e-3)
    assert np.linalg.norm(shell.dofs.matrix(data) @ direction - slope) < 1e-7 * np.linalg.norm(slope)


@pytest.mark.parametrize("stretch, turn", [(0.1, 0.4), (1e-3, 1e-3), (1e-5, 1e-5)])
def test_softening_rubber_is_that_of_its_energy(cylinder_mesh, stretch, turn):
    shell = Shell(cylinder_mesh, with_rubber(SofteningRubber(2e4, 4e6, 1.2e-3, 69e6, 1300.0), 2))
    check_loop(shell, random_unknowns(shell, 7, stretch, turn))


def test_factor_on_a_softening_layer_is_one_on_its_stress(cylinder_mesh):
    """x_0 is a strain: the factor of a layer that relaxes leaves it as it is."""
    law = SofteningRubber(2e4, 4e6, 1.2e-3, 69e6, 1300.0)
    shell = Shell(cylinder_mesh, Section((Layer(law, 0.012),)))
    q = shell.dofs.restrict(random_state(shell.mesh, 7, 0.05, 0.2))
    twice = StepWall(shell.wall_of(np.array([2.0])), np.zeros((shell.mesh.element_count, 4, 8)))
    np.testing.assert_allclose(
        shell.force(q, twice), 2.0 * shell.force(q), rtol=0, atol=1e-12 * np.abs(shell.force(q)).max()
    )


def test_held_unknowns_drop_out(saddle_shell):
    check_loop(saddle_shell, saddle_shell.dofs.restrict(random_state(saddle_shell.mesh, 3, rigid=0.0)), rigid=False)


def unit_direction(shell, seed):
    """A direction in which displacements and rotations change by comparable strains."""
    generator = np.random.default_rng(seed)
    size = np.ptp(shell.mesh.nodes, axis=0).max()
    nodal = generator.standard_normal((shell.mesh.node_count, 5)) * np.array([size] * 3 + [1.0] * 2) * 0.05
    return shell.dofs.restrict(nodal)


def test_second_derivative(saddle_shell):
    shell = saddle_shell
    q = shell.dofs.restrict(random_state(shell.mesh, 16, 0.08, 0.3, rigid=0.0))
    a, b = unit_direction(shell, 17), unit_direction(shell, 18)
    slope = difference(lambda x: shell.dofs.matrix(shell.force_and_tangent(x)[1]) @ a, q, b, 1e-3)
    second = shell.second(q, a, b)
    assert np.linalg.norm(second - slope) < 1e-7 * np.linalg.norm(slope)
    assert np.linalg.norm(second - shell.second(q, b, a)) < 1e-12 * np.linalg.norm(second)


@pytest.mark.slow
def test_third_derivative(saddle_shell):
    shell = saddle_shell
    q = shell.dofs.restrict(random_state(shell.mesh, 19, 0.08, 0.3, rigid=0.0))
    a, b, c = (unit_direction(shell, seed) for seed in (20, 21, 22))
    slope = difference(lambda x: shell.second(x, a, b), q, c, 1e-3)
    third = shell.third(q, a, b, c)
    assert np.linalg.norm(third - slope) < 1e-7 * np.linalg.norm(slope)
    assert np.linalg.norm(third - shell.third(q, c, a, b)) < 1e-12 * np.linalg.norm(third)
