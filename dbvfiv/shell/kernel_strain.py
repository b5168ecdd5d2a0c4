"""Compiled kinematics of one element: covariant bases, edge shears and strains, as `energy.py` defines them."""

from __future__ import annotations

import numba
import numpy as np

from .kernel_rubber import FAST
from .reference import SHEAR_EDGES, SHEAR_WEIGHTS, SLOPE

_SLOPE = np.ascontiguousarray(SLOPE)
_EDGES = np.ascontiguousarray(SHEAR_EDGES)
_EDGE_WEIGHTS = np.ascontiguousarray(SHEAR_WEIGHTS)


@numba.njit(fastmath=FAST, inline="always")
def gather(quad, nodes, displacement, director, x, d):
    """Positions x and directors d (4, 3) of the nodes of an element."""
    for a in range(4):
        n = quad[a]
        for i in range(3):
            x[a, i] = nodes[n, i] + displacement[n, i]
            d[a, i] = director[n, i]


@numba.njit(fastmath=FAST, inline="always")
def bases(point, x, d, basis, turn):
    """Covariant base vectors and director derivatives at one point, each (2, 3)."""
    for c in range(2):
        for i in range(3):
            basis[c, i] = 0.0
            turn[c, i] = 0.0
        for a in range(4):
            slope = _SLOPE[point, a, c]
            for i in range(3):
                basis[c, i] += slope * x[a, i]
                turn[c, i] += slope * d[a, i]


@numba.njit(fastmath=FAST, inline="always")
def edge_shears(x, d, edge):
    """Covariant transverse shears (4,) at the middles of the edges (MITC4)."""
    for g in range(4):
        a = _EDGES[g, 0]
        b = _EDGES[g, 1]
        total = 0.0
        for i in range(3):
            total += (x[b, i] - x[a, i]) * (d[b, i] + d[a, i])
        edge[g] = 0.25 * total


@numba.njit(fastmath=FAST, inline="always")
def strains(point, basis, turn, edge, shear0, metric0, metric1, q, qk, p, strain):
    """Section strains in local axes: membrane (3), bending (3), transverse shear (2)."""
    c00 = -metric0[0]
    c01 = -metric0[1]
    c02 = -metric0[2]
    c10 = -metric1[0]
    c11 = -metric1[1]
    c12 = -metric1[2]
    for i in range(3):
        c00 += 0.5 * basis[0, i] * basis[0, i]
        c01 += 0.5 * basis[1, i] * basis[1, i]
        c02 += basis[0, i] * basis[1, i]
        c10 += basis[0, i] * turn[0, i]
        c11 += basis[1, i] * turn[1, i]
        c12 += basis[0, i] * turn[1, i] + basis[1, i] * turn[0, i]
    for i in range(3):
        strain[i] = q[i, 0] * c00 + q[i, 1] * c01 + q[i, 2] * c02
        strain[3 + i] = q[i, 0] * c10 + q[i, 1] * c11 + q[i, 2] * c12 - qk[i, 0] * c00 - qk[i, 1] * c01 - qk[i, 2] * c02
    g0 = _EDGE_WEIGHTS[point, 0] * (edge[0] - shear0[0]) + _EDGE_WEIGHTS[point, 1] * (edge[1] - shear0[1])
    g1 = _EDGE_WEIGHTS[point, 2] * (edge[2] - shear0[2]) + _EDGE_WEIGHTS[point, 3] * (edge[3] - shear0[3])
    strain[6] = p[0, 0] * g0 + p[0, 1] * g1
    strain[7] = p[1, 0] * g0 + p[1, 1] * g1
