"""Weight of a shell: what hangs and what sags in closed form, and its potential against its force and tangent."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from scipy.special import jn_zeros

from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.shell import Layer, Section, Shell, ShellMesh, Weight

from .structures import isotropic_section, random_state, rectangle, rigid_motion, rotation_about, solve_path

G = 9.80665
LENGTH, WIDTH = 1.0, 0.1


def strip(section, elements=16, held=True) -> Shell:
    """Strip along x, clamped at x = 0."""
    patch, thickness = rectangle(elements, 1, LENGTH, WIDTH), sum(layer.thickness for layer in section.layers)
    mesh = ShellMesh.build(
        patch.nodes, patch.quads, np.full(len(patch.quads), thickness), material_axis=(1.0, 0.0, 0.0)
    )
    free = np.ones((mesh.node_count, 5), bool)
    if held:
        free[patch.index[0]] = False
    return Shell(mesh, section, free)


def loaded(shell: Shell, weight: Weight, share=1.0) -> np.ndarray:
    """Equilibrium (n,) under the weight."""

    def load(q, factor):
        slope = np.zeros(len(shell.dofs.pattern[1]))
        weight.add_tangent(shell, q, slope, -factor)
        return -factor * weight.force(shell, q), slope

    return solve_path(shell, load, [share])[0].q


def tip(shell: Shell, q) -> np.ndarray:
    """Displacement (3,) of the end."""
    end = np.isclose(shell.mesh.nodes[:, 0], LENGTH)
    return shell.dofs.expand(q)[end, :3].mean(axis=0)


def test_a_hanging_bar_stretches_as_the_book_says():
    """u = (rho - rho_d) g L^2 / (2 E), at the nodes exactly but for the square of the strain."""
    shell = strip(isotropic_section(1e8, 0.0, 0.01, 1300.0))
    for displaced in (0.0, 1000.0):
        q = loaded(shell, Weight(shell, np.array([G, 0.0, 0.0]), displaced))
        assert tip(shell, q)[0] == pytest.approx((1300.0 - displaced) * G * LENGTH**2 / 2e8, rel=2e-4)


def test_a_cantilever_sags_as_the_book_says():
    """w = rho g h L^4 / (8 E h^3 / 12)."""
    h, e = 0.01, 1e10
    shell = strip(isotropic_section(e, 0.0, h, 1300.0), 32)
    q = loaded(shell, Weight(shell, np.array([0.0, 0.0, -G])))
    assert tip(shell, q)[2] == pytest.approx(-1300.0 * G * h * LENGTH**4 / (8 * e * h**3 / 12), rel=2e-3)


def test_a_heavy_chain_swings_as_bernoulli_found():
    """omega = j_0n / 2 sqrt(g / L) of a hanging strip all but without bending stiffness."""
    shell = strip(isotropic_section(1e7, 0.0, 2e-4, 1300.0), 40)
    q = loaded(shell, Weight(shell, np.array([G, 0.0, 0.0])))
    _, tangent = shell.force_and_tangent(q)
    stiffness, mass = (shell.dofs.matrix(values).toarray() for values in (tangent, shell.mass(q)))
    squares, shapes = la.eigh(stiffness, mass, subset_by_index=(0, 15))
    ends = np.isclose(shell.mesh.nodes[:, 0], LENGTH)
    left, right = np.array([shell.dofs.expand(shape)[ends, 2] for shape in shapes.T]).T
    swings = left * right > 0  # one element across has no stiffness against twisting under tension
    found = np.sqrt(squares[swings][:2])
    assert found == pytest.approx(0.5 * jn_zeros(0, 2) * np.sqrt(G / LENGTH), rel=2e-3)


def lopsided() -> Section:
    return Section(tuple(Layer(IsotropicElastic(1e6, 0.3, rho), 0.01) for rho in (3000.0, 1000.0)))


def test_a_turned_wall_gains_what_its_centre_of_gravity_climbs():
    """Layers of unequal densities put that off the mid-surface."""
    section, gravity = lopsided(), np.array([1.0, -2.0, 5.0])
    shell = strip(section, 4, held=False)
    mesh, h = shell.mesh, section.layers[0].thickness
    weight = Weight(shell, gravity, 500.0)
    turn, shift = rotation_about((1, 2, 3), 0.9), np.array([0.1, -0.2, 0.3])
    q = shell.dofs.restrict(rigid_motion(mesh, turn, shift))
    size = LENGTH * WIDTH * 2 * h
    middle = np.array([0.5 * LENGTH, 0.5 * WIDTH, 0.0])
    offset = (3000.0 - 1000.0) * h * 0.5 * h / ((3000.0 + 1000.0) * h)  # of the inner layer, towards -t
    centre = middle - offset * mesh.directors[0]
    force = (2000.0 * size) * (turn @ centre + shift - centre) - 500.0 * size * (turn @ middle + shift - middle)
    assert weight.energy(shell, q) == pytest.approx(-gravity @ force, rel=1e-10)


def test_force_and_tangent_are_derivatives_of_the_potential():
    section = lopsided()
    patch = rectangle(3, 2, 1.0, 0.5)
    mesh = ShellMesh.build(patch.nodes, patch.quads, np.full(len(patch.quads), 0.02), material_axis=(1.0, 0.0, 0.0))
    free = np.ones((mesh.node_count, 5), bool)
    free[patch.index[0], 3] = False
    shell = Shell(mesh, section, free)
    weight = Weight(shell, np.array([1.0, -2.0, 5.0]))
    q = shell.dofs.restrict(random_state(mesh, 3))
    one, other, third = np.random.default_rng(4).standard_normal((3, shell.size))
    h = 1e-5
    slope = (weight.energy(shell, q + h * one) - weight.energy(shell, q - h * one)) / (2 * h)
    assert slope == pytest.approx(weight.force(shell, q) @ one, rel=1e-7)
    data = np.zeros(len(shell.dofs.pattern[1]))
    weight.add_tangent(shell, q, data)
    matrix = shell.dofs.matrix(data)
    assert abs(matrix - matrix.T).max() == 0.0
    assert matrix @ one == pytest.approx(weight.form(shell, q, one), rel=1e-10, abs=1e-12)
    change = (weight.force(shell, q + h * one) - weight.force(shell, q - h * one)) / (2 * h)
    assert change == pytest.approx(matrix @ one, abs=1e-7 * np.abs(change).max())
    for directions in ((one, other), (one, other, third)):
        *before, last = directions
        ahead, behind = (weight.form(shell, q + s * h * last, *before) for s in (1, -1))
        found = weight.form(shell, q, *directions)
        assert (ahead - behind) / (2 * h) == pytest.approx(found, abs=1e-6 * np.abs(found).max())
