"""Layers of their own length: curved bars of unlike layers against Winkler and Bach, where the first-order metric is
off by thickness over radius; walls that fold stay sound.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.materials.prony import Prony
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.reference import bounded_stretch
from tests.shell.structures import grid, isotropic_section, random_state, rigid_motion, rotation_about

RADIUS, HEIGHT, ANGLE, WIDTH = 0.1, 0.03, 2.0, 0.05
MODULI = (1e6, 1e7)


def bar(metric: str, count: int = 48, height: float = HEIGHT, moduli=MODULI) -> Shell:
    """A curved bar of layers of equal thickness, the first one inside, clamped at its first end."""
    patch = grid(count, 1, lambda u, v: (RADIUS * np.cos(ANGLE * u), RADIUS * np.sin(ANGLE * u), WIDTH * v))
    free = np.ones((len(patch.nodes), 5), bool)
    free[patch.index[0]] = False
    layers = tuple(Layer(IsotropicElastic(e, 0.0, 1.0), height / len(moduli), shear_correction=1.0) for e in moduli)
    mesh = ShellMesh.build(patch.nodes, patch.quads, height)
    return Shell(mesh, Section(layers, points_per_layer=4), free, metric)


def integrals(moduli=MODULI, height: float = HEIGHT) -> np.ndarray:
    """Integrals over the wall of E t^k/(1 + t/R), k = 0, 1, 2."""
    x, w = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(-0.5, 0.5, len(moduli) + 1) * height
    total = np.zeros(3)
    for e, low, high in zip(moduli, edges[:-1], edges[1:]):
        t = 0.5 * (low + high) + 0.5 * (high - low) * x
        total += [0.5 * (high - low) * e * (w * t**k / (1 + t / RADIUS)).sum() for k in range(3)]
    return total


def turned_by_a_moment(shell: Shell) -> float:
    """Rotation of the free end under a moment of one per width."""
    mesh = shell.mesh
    end = np.flatnonzero(np.isclose(np.arctan2(mesh.nodes[:, 1], mesh.nodes[:, 0]) % (2 * np.pi), ANGLE))
    along = np.array([-np.sin(ANGLE), np.cos(ANGLE), 0.0])
    slopes = shell.directors(np.zeros((mesh.node_count, 5)))[1][end] @ along  # of the directors by their rotations
    load = np.zeros((mesh.node_count, 5))
    load[end, 3:] = 0.5 * WIDTH * slopes
    tangent = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).tocsc()
    nodal = shell.dofs.expand(spsolve(tangent, shell.dofs.restrict(load)))
    return float(np.einsum("nr,nr->n", slopes, nodal[end, 3:]).mean())


@pytest.mark.slow
@pytest.mark.parametrize("moduli", [MODULI, MODULI[::-1]])
def test_a_curved_bar_of_unlike_layers(moduli):
    s0, s1, s2 = integrals(moduli)
    turn = np.linalg.solve([[s0, s1], [s1, s2]], [0.0, 1.0])[1] * RADIUS * ANGLE
    found = {metric: turned_by_a_moment(bar(metric, moduli=moduli)) for metric in ("first-order", "shifted")}
    assert found["shifted"] == pytest.approx(turn, rel=2e-3)
    assert abs(found["first-order"] / turn - 1.0) > 0.006


def test_a_ring_that_swells():
    """Every layer stretches by its own length: energy E w^2/2 ln(outer/inner radius) for each radian."""
    radii = RADIUS + HEIGHT * np.linspace(-0.5, 0.5, 3)
    wanted = 0.5 * WIDTH * ANGLE * sum(e * np.log(b / a) for e, a, b in zip(MODULI, radii[:-1], radii[1:]))
    energies = {}
    for metric in ("first-order", "shifted"):
        shell = bar(metric)
        mesh = shell.mesh
        whole = Shell(mesh, shell.section, metric=metric)
        nodal = np.zeros((mesh.node_count, 5))
        nodal[:, :2] = 1e-6 * mesh.nodes[:, :2] / RADIUS
        energies[metric] = whole.energy(whole.dofs.restrict(nodal)) / 1e-12
    assert energies["shifted"] == pytest.approx(wanted, rel=2e-3)
    assert abs(energies["first-order"] / wanted - 1.0) > 0.03


@pytest.mark.slow
def test_rigid_motions_and_derivatives(cylinder_mesh, one_layer):
    shell = Shell(cylinder_mesh, one_layer, metric="shifted")
    q = shell.dofs.restrict(rigid_motion(cylinder_mesh, rotation_about((1, 1, 0.2), 2.0)))
    assert np.abs(shell.strains(q)).max() < 1e-14
    q = shell.dofs.restrict(random_state(cylinder_mesh, 23, 0.05, 0.2))
    v = np.random.default_rng(1).standard_normal(shell.size)
    v *= 1e-5 / np.abs(v).max()
    force, data = shell.force_and_tangent(q)
    assert force @ v == pytest.approx(0.5 * (shell.energy(q + v) - shell.energy(q - v)), rel=1e-5)
    slope = 0.5 * (shell.force(q + v) - shell.force(q - v))
    assert np.linalg.norm(shell.dofs.matrix(data) @ v - slope) < 1e-6 * np.linalg.norm(slope)


def test_at_rest_nothing_but_material_is_in_the_tangent(cylinder_mesh, one_layer):
    section = Section((replace(one_layer.layers[0], relaxation=Prony((0.2,), (0.1,))),))
    shell = Shell(cylinder_mesh, section, metric="shifted")
    (found,) = shell.relaxing_tangents(np.zeros(shell.size))
    _, whole = shell.force_and_tangent(np.zeros(shell.size))
    assert np.abs(found - whole).max() < 1e-12 * np.abs(whole).max()


def test_metrics_agree_for_a_thin_wall():
    """Stiffness of a cylinder with both treatments: the difference goes with the square of thickness over radius, not
    faster.
    """
    differences = []
    for h in (0.02, 0.01, 0.005):
        patch = grid(12, 2, lambda u, v: (0.1 * np.cos(2 * u), 0.1 * np.sin(2 * u), 0.2 * v))
        surface = ShellMesh.build(patch.nodes, patch.quads, h)
        phi = np.linspace(0, 2, 13)[:, None] * np.ones(3)
        nodal = np.zeros((surface.node_count, 5))
        # uncurl: ring of radius R to radius 1.01 R by turning the directors only a little
        nodal[:, 0] = 1e-3 * np.cos(2 * phi).ravel()
        nodal[:, 1] = 1e-3 * np.sin(2 * phi).ravel()
        energies = []
        for metric in ("first-order", "shifted"):
            shell = Shell(surface, isotropic_section(1e6, 0.3, h), metric=metric)
            energies.append(shell.energy(shell.dofs.restrict(nodal)))
        differences.append(abs(energies[1] / energies[0] - 1))
    assert differences[0] < 0.01
    for coarse, fine in zip(differences[:-1], differences[1:]):
        assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.3)


@pytest.mark.slow
def test_a_wall_that_folds_stays_sound():
    """Lengths stay positive, and so does the stiffness."""
    shell = bar("shifted", 12, height=0.25)
    assert len(shell.folded_places())
    tangent = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).toarray()
    assert np.linalg.eigvalsh(tangent).min() > 0


def test_lengths_of_layers():
    x = np.linspace(-3.0, 3.0, 601)
    length = bounded_stretch(x)
    assert (length > 0).all() and length[x >= -0.5] == pytest.approx(1 + x[x >= -0.5])
    assert (np.diff(length) > 0).all() and np.abs(np.diff(length, 2)).max() < 1e-3


def test_a_flat_wall_does_not_know_the_metric():
    patch = grid(6, 4, lambda u, v: (0.3 * u, 0.3 * v, 0 * u))
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.02, material_axis=(1.0, 0.0, 0.0))
    one, other = (Shell(mesh, isotropic_section(1e6, 0.3, 0.02), metric=m) for m in ("first-order", "shifted"))
    q = one.dofs.restrict(random_state(mesh, 3, 0.05, 0.2))
    assert other.energy(q) == pytest.approx(one.energy(q), rel=1e-12)
