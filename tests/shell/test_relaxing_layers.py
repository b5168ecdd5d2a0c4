"""The material part of the tangent, by groups of layers that relax alike."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dbvfiv.materials.prony import Prony
from dbvfiv.shell import Section, Shell
from dbvfiv.shell.energy import local_strains, material_strains, point_energies
from tests.shell.structures import mixed_section, random_state

FAST, SLOW = Prony((0.3, 0.1), (1e-3, 1e-2)), Prony((0.2,), (0.1,))


def relaxing_section(*series) -> Section:
    """The mixed wall with a series for each of its five layers."""
    plain = mixed_section()
    layers = tuple(replace(layer, relaxation=one) for layer, one in zip(plain.layers, series))
    return Section(layers, plain.points_per_layer)


def test_layers_with_the_same_series_are_one_group():
    section = relaxing_section(SLOW, FAST, SLOW, Prony((0.0,), (1.0,)), None)
    assert [(group.name, group.layers) for group in section.relaxing] == [("CR + ply +54", (0, 2)), ("SBR", (1,))]
    assert section.relaxing[1].series == FAST
    assert mixed_section().relaxing == ()


@partial(jax.jit, static_argnums=(0, 1))
@partial(jax.vmap, in_axes=(None, None, 0, 0, None))
def geometric_part(kinds, metric, unknowns, element, layers):
    """Hessian (20, 20) of an element less its material part: stresses times the second derivatives of the strains."""

    def strains(u):
        return material_strains(local_strains(u.reshape(4, 5), element, layers, metric), layers)

    weight = element["h"] * element["area"][:, None] * layers["weight"]
    flat = unknowns.reshape(20)
    stress = jax.grad(lambda e: jnp.sum(weight * point_energies(kinds, layers["parameters"], e)))(strains(flat))
    return jax.hessian(lambda u: jnp.sum(stress * strains(u)))(flat)


def test_all_groups_and_the_geometric_part_are_the_tangent(mesh):
    shell = Shell(mesh, relaxing_section(SLOW, FAST, SLOW, FAST, Prony((1.0,), (1.0,))))
    q = shell.dofs.restrict(random_state(mesh, 3, 0.1, 0.4))
    groups = shell.relaxing_tangents(q)
    assert len(groups) == 3
    _, tangent = shell.force_and_tangent(q)
    total, parts = sum(groups), shell.energies
    blocks = geometric_part(parts.kinds, shell.metric, shell.dofs.expand(q)[mesh.quads], parts.elements, parts.layers)
    shell._scatter_matrix(np.asarray(blocks), total)
    assert np.abs(total - tangent).max() < 1e-13 * np.abs(tangent).max()


def test_each_group_is_the_gauss_newton_form_of_its_energy(mesh):
    shell = Shell(mesh, relaxing_section(SLOW, FAST, SLOW, FAST, None))
    q = shell.dofs.restrict(random_state(mesh, 4, 0.1, 0.4))
    unknowns = shell.dofs.expand(q)[mesh.quads]
    for group, found in zip(shell.section.relaxing, shell.relaxing_tangents(q)):
        share = np.zeros(5)
        share[list(group.layers)] = 1.0
        expected = np.zeros_like(found)
        shell._scatter_matrix(np.asarray(shell.energies.material_tangent(unknowns, share)), expected)
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def test_at_rest_nothing_but_material_is_in_the_tangent(mesh):
    shell = Shell(mesh, relaxing_section(*[SLOW] * 5))
    (found,) = shell.relaxing_tangents(np.zeros(shell.size))
    _, whole = shell.force_and_tangent(np.zeros(shell.size))
    assert np.abs(found - whole).max() < 1e-12 * np.abs(whole).max()


@pytest.mark.parametrize("factors", [(1, 1, 1, 1, 1), (2, 0.5, 3, 0, 1)])
def test_a_wall_with_factors_is_that_of_scaled_laws(saddle_shell, factors):
    section = saddle_shell.section
    stiffness, points, constants, scales = section.wall(np.array(factors, float))
    whole = sum(section.wall(np.eye(5)[i] * factor)[0] for i, factor in enumerate(factors))
    assert np.allclose(stiffness, whole, rtol=1e-14, atol=1e-14 * np.abs(whole).max())
    assert len(points) == len(constants) == len(scales) == 2 * sum(factors[i] > 0 for i in (0, 1, 4))
    plain = section.wall()
    if set(factors) == {1}:
        for a, b in zip((stiffness, points, constants, scales), plain):
            assert np.array_equal(a, b)
