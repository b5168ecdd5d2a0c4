"""Compiled kinematics of one element and response of its wall to membrane strains, curvatures and shears.

An element's strains depend on numbers of its shape: the six in-plane products of `assumed_strain`, their change along
the directors (six), and the transverse shears at the edges (four); `energy.py` defines the same. Plies answer linearly
by their integrated stiffness; rubber is integrated over points through the thickness. Strains and resultants are
ordered membrane (3), bending (3), transverse shear (2).

Equations (T.2) and (T.5) of docs/theory.md.
"""

from __future__ import annotations

import numba
import numpy as np

from .assumed_strain import FACTORS, PAIRS, VECTORS
from .kernel_rubber import FAST, rubber_stress, rubber_tangent
from .reference import SHEAR_EDGES


@numba.njit(fastmath=FAST, inline="always")
def linear_response(stiffness, h, strain, stress):
    """Resultants (8,) of the linear layers of a wall of thickness h; `stiffness` is that of unit thickness."""
    h2 = h * h
    h3 = h2 * h
    for i in range(3):
        n = 0.0
        m = 0.0
        for j in range(3):
            n += h * stiffness[i, j] * strain[j] + h2 * stiffness[i, 3 + j] * strain[3 + j]
            m += h2 * stiffness[3 + i, j] * strain[j] + h3 * stiffness[3 + i, 3 + j] * strain[3 + j]
        stress[i] = n
        stress[3 + i] = m
    for i in range(2):
        stress[6 + i] = h * (stiffness[6 + i, 6] * strain[6] + stiffness[6 + i, 7] * strain[7])


@numba.njit(fastmath=FAST, inline="always")
def point_strain(zeta, h, scale, strain, e):
    """Strains e (5,) at the height zeta h; `scale` is that of the transverse shear."""
    t = zeta * h
    for i in range(3):
        e[i] = strain[i] + t * strain[3 + i]
    e[3] = scale * strain[6]
    e[4] = scale * strain[7]


@numba.njit(fastmath=FAST, inline="always")
def add_point_stress(point, constants, scale, h, strain, stress, e, s):
    """Add what one point of rubber contributes to the resultants (8,); e and s are workspace (5,)."""
    point_strain(point[0], h, scale, strain, e)
    rubber_stress(constants, e, s)
    w = point[1] * h
    t = point[0] * h
    for i in range(3):
        stress[i] += w * s[i]
        stress[3 + i] += w * t * s[i]
    stress[6] += w * scale * s[3]
    stress[7] += w * scale * s[4]


@numba.njit(fastmath=FAST, inline="always")
def section_stress(stiffness, points, constants, scales, h, strain, stress, e, s):
    """Resultants (8,) of all layers; e and s are workspace (5,)."""
    linear_response(stiffness, h, strain, stress)
    for l in range(points.shape[0]):
        add_point_stress(points[l], constants[l], scales[l], h, strain, stress, e, s)


@numba.njit(fastmath=FAST, inline="always")
def section_tangent(stiffness, points, constants, scales, h, strain, stress, tangent, e, s, t5):
    """Resultants (8,) of all layers and their derivative (8, 8) by the strains; e, s, t5 are workspace."""
    linear_response(stiffness, h, strain, stress)
    h2 = h * h
    h3 = h2 * h
    for i in range(3):
        for j in range(3):
            tangent[i, j] = h * stiffness[i, j]
            tangent[i, 3 + j] = h2 * stiffness[i, 3 + j]
            tangent[3 + i, 3 + j] = h3 * stiffness[3 + i, 3 + j]
        for j in range(2):
            tangent[i, 6 + j] = 0.0
            tangent[3 + i, 6 + j] = 0.0
    for i in range(2):
        for j in range(2):
            tangent[6 + i, 6 + j] = h * stiffness[6 + i, 6 + j]
    for l in range(points.shape[0]):
        k = scales[l]
        point_strain(points[l, 0], h, k, strain, e)
        rubber_tangent(constants[l], e, s, t5)
        w = points[l, 1] * h
        t = points[l, 0] * h
        wt = w * t
        wtt = wt * t
        for i in range(3):
            stress[i] += w * s[i]
            stress[3 + i] += wt * s[i]
            for j in range(i, 3):
                v = t5[i, j]
                tangent[i, j] += w * v
                tangent[3 + i, 3 + j] += wtt * v
                tangent[i, 3 + j] += wt * v
                if j > i:
                    tangent[j, 3 + i] += wt * v
            for j in range(2):
                v = k * t5[i, 3 + j]
                tangent[i, 6 + j] += w * v
                tangent[3 + i, 6 + j] += wt * v
        stress[6] += w * k * s[3]
        stress[7] += w * k * s[4]
        tangent[6, 6] += w * k * k * t5[3, 3]
        tangent[6, 7] += w * k * k * t5[3, 4]
        tangent[7, 7] += w * k * k * t5[4, 4]
    for i in range(8):
        for j in range(i):
            tangent[i, j] = tangent[j, i]


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
