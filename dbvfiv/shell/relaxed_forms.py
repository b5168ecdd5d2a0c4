"""Higher derivatives of the internal force of a wall that relaxes.

The force is B(u)' S with B the slope of the strains and S the stresses, and S alone remembers. Along motions
a_i exp(s_i t) the part of S that belongs to a set of them changes as exp(sum of their s t), so its memory is one factor
for each layer; B belongs to the instant.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from .energy import (
    EnergyFunctions,
    material_strains,
    point_energies,
    point_volumes,
    shape,
    strains_of_shape,
)


def relaxed_force_form(energies: EnergyFunctions, unknowns, directions, factors) -> np.ndarray:
    """Derivative (ne, 4 c), complex, of the internal force along k directions.

    Parameters
    ----------
    energies : EnergyFunctions
    unknowns : (ne, 4, c) array
        The state about which it is taken.
    directions : sequence of k complex (ne, 4, c) arrays
    factors : (2**k, nl) complex array
        On the stress of each layer, for each set of directions: bit i of the row's number says whether direction i is
        one of the set. Row 0 is that of the steady stress.
    """
    points = len(energies.kinds) // factors.shape[1]
    share = jnp.repeat(jnp.asarray(factors, complex), points, axis=1)
    fields = tuple(jnp.asarray(x, complex) for x in (unknowns, *directions))
    return np.asarray(_forms(energies.kinds, energies.metric, fields, share, energies.elements, energies.layers))


def _along_sets(function, count):
    """Derivatives of a function along all sets of `count` directions, from those of its argument.

    Both are tuples numbered as `factors` of `relaxed_force_form` are.
    """
    if count == 0:
        return lambda parts: (function(parts[0]),)
    fewer = _along_sets(function, count - 1)

    def along(parts):
        half = len(parts) // 2
        values, slopes = jax.jvp(fewer, (parts[:half],), (parts[half:],))
        return (*values, *slopes)

    return along


def _element_form(kinds, metric, fields, share, element, layers):
    count = len(fields) - 1
    weight = point_volumes(metric, element, layers)

    def strains(place):
        return material_strains(strains_of_shape(place, element, layers, metric), layers)

    def stress(e):
        energy = lambda x: jnp.sum(weight * point_energies(kinds, layers["parameters"], x))  # noqa: E731
        return jax.grad(energy, holomorphic=True)(e)

    def force(parts):
        unknowns, pull = parts
        return jax.vjp(lambda u: shape(u, element), unknowns)[1](pull)[0].ravel()

    single = {1 << i: field for i, field in enumerate(fields[1:])} | {0: fields[0]}
    unknowns = tuple(single.get(i, jnp.zeros_like(fields[0])) for i in range(1 << count))
    places = _along_sets(lambda u: shape(u, element), count)(unknowns)
    # strains are quadratic in the places and forces on them bilinear in places and stresses: sums over pairs of sets
    half_change = lambda a, b: 0.5 * jax.jvp(strains, (a,), (b,))[1]  # noqa: E731
    strained = _products(half_change, places, places, count)
    strained = (strains(places[0]), *strained[1:])
    stresses = _along_sets(stress, count)(strained)
    remembered = tuple(factor[:, None] * s for factor, s in zip(share, stresses))
    pulls = _products(lambda a, s: jax.vjp(strains, a)[1](s)[0], places, remembered, count)
    return _along_sets(force, count)(tuple(zip(unknowns, pulls)))[-1]


def _products(form, left, right, count):
    """Derivatives along all sets of directions of form(a, b), linear in each, from those of a and b."""
    pairs = np.array([(whole, part) for whole in range(1 << count) for part in range(whole + 1) if part & ~whole == 0])
    stacked = lambda parts, rows: jax.tree.map(lambda *x: jnp.stack(x)[rows], *parts)  # noqa: E731
    values = jax.vmap(form)(stacked(left, pairs[:, 1]), stacked(right, pairs[:, 0] - pairs[:, 1]))
    summed = jax.tree.map(lambda x: jax.ops.segment_sum(x, pairs[:, 0], 1 << count), values)
    return tuple(jax.tree.map(lambda x, i=i: x[i], summed) for i in range(1 << count))


@partial(jax.jit, static_argnums=(0, 1))
def _forms(kinds, metric, fields, share, elements, layers):
    one = lambda field, element: _element_form(kinds, metric, field, share, element, layers)  # noqa: E731
    return jax.vmap(one)(fields, elements)
