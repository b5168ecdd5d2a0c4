"""Compiled kinematics of one element: its shape, the numbers its strains depend on, and strains from them.

The numbers are the six in-plane products of `assumed_strain`, their change along the directors (six), and the
transverse shears at the edges (four); `energy.py` defines the same.

Equation (T.2) of docs/theory.md.
"""

from __future__ import annotations

import numba
import numpy as np

from .assumed_strain import FACTORS, PAIRS, VECTORS
from .kernel_rubber import FAST
from .reference import SHEAR_EDGES

_VECTORS = np.ascontiguousarray(VECTORS)
_PAIRS = np.ascontiguousarray(PAIRS)
_FACTORS = np.ascontiguousarray(FACTORS)
_EDGES = np.ascontiguousarray(SHEAR_EDGES)


@numba.njit(fastmath=FAST, inline="always")
def gather(quad, nodes, displacement, director, x, d):
    """Positions x and directors d (4, 3) of the nodes of an element."""
    for a in range(4):
        n = quad[a]
        for i in range(3):
            x[a, i] = nodes[n, i] + displacement[n, i]
            d[a, i] = director[n, i]


@numba.njit(fastmath=FAST, inline="always")
def vectors(x, d, u, v):
    """Tangents and distortion (3, 3) of the positions and of the directors of an element."""
    for m in range(3):
        for i in range(3):
            u[m, i] = 0.0
            v[m, i] = 0.0
        for a in range(4):
            w = _VECTORS[m, a]
            for i in range(3):
                u[m, i] += w * x[a, i]
                v[m, i] += w * d[a, i]


@numba.njit(fastmath=FAST, inline="always")
def numbers(x, d, u, v, products, shear, z):
    """The sixteen numbers z less their values at rest, `products` (12,) and `shear` (4,)."""
    for k in range(6):
        a = _PAIRS[k, 0]
        b = _PAIRS[k, 1]
        product = 0.0
        change = 0.0
        for i in range(3):
            product += u[a, i] * u[b, i]
            change += u[a, i] * v[b, i] + v[a, i] * u[b, i]
        z[k] = _FACTORS[k] * product - products[k]
        z[6 + k] = _FACTORS[k] * change - products[6 + k]
    for g in range(4):
        a = _EDGES[g, 0]
        b = _EDGES[g, 1]
        total = 0.0
        for i in range(3):
            total += (x[b, i] - x[a, i]) * (d[b, i] + d[a, i])
        z[12 + g] = 0.25 * total - shear[g]


@numba.njit(fastmath=FAST, inline="always")
def strains(inplane, across, z, strain):
    """Section strains in local axes: membrane (3), bending (3), transverse shear (2), by the maps of one point."""
    for i in range(6):
        total = 0.0
        for k in range(12):
            total += inplane[i, k] * z[k]
        strain[i] = total
    for i in range(2):
        total = 0.0
        for g in range(4):
            total += across[i, g] * z[12 + g]
        strain[6 + i] = total


@numba.njit(fastmath=FAST, inline="always")
def numbers_of(el, quad, nodes, displacement, director, reference, x, d, u, v, z):
    """Shape and numbers z (16,) of an element; `reference` as `dbvfiv.shell.shell.Shell` holds it."""
    gather(quad, nodes, displacement, director, x, d)
    vectors(x, d, u, v)
    numbers(x, d, u, v, reference[0][el], reference[1][el], z)


@numba.njit(fastmath=FAST, inline="always")
def strains_at(el, point, reference, z, strain):
    """Section strains at one point of an element."""
    strains(reference[2][el, point], reference[3][el, point], z, strain)
