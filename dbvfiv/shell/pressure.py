"""Follower pressure on the mid-surface, linear in a few station pressures, with its unsymmetric stiffness."""

from __future__ import annotations

import numba
import numpy as np

from .reference import SHAPE, SLOPE

_SHAPE = np.ascontiguousarray(SHAPE)
_SLOPE = np.ascontiguousarray(SLOPE)


@numba.njit(inline="always")
def _vectors(quad, nodes, q, point, g1, g2):
    for i in range(3):
        g1[i] = 0.0
        g2[i] = 0.0
        for a in range(4):
            x = nodes[quad[a], i] + q[quad[a], i]
            g1[i] += _SLOPE[point, a, 0] * x
            g2[i] += _SLOPE[point, a, 1] * x


@numba.njit(cache=True)
def pressure_force(quads, nodes, q, nodal, loaded, out):
    """Add the force of nodal pressures (nn,) to out (nn, c); positive along the outward normal.

    `loaded` (ne,) is the share of each element that carries pressure.
    """
    g1 = np.empty(3)
    g2 = np.empty(3)
    for el in range(quads.shape[0]):
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            p = 0.0
            for a in range(4):
                p += _SHAPE[point, a] * nodal[quad[a]]
            p *= loaded[el]
            f0 = p * (g1[1] * g2[2] - g1[2] * g2[1])
            f1 = p * (g1[2] * g2[0] - g1[0] * g2[2])
            f2 = p * (g1[0] * g2[1] - g1[1] * g2[0])
            for a in range(4):
                out[quad[a], 0] += _SHAPE[point, a] * f0
                out[quad[a], 1] += _SHAPE[point, a] * f1
                out[quad[a], 2] += _SHAPE[point, a] * f2


@numba.njit(cache=True)
def pressure_stiffness(quads, nodes, q, nodal, loaded, slots, factor, data):
    """Add factor times the derivative of the pressure force with respect to the displacements to the matrix values."""
    g1 = np.empty(3)
    g2 = np.empty(3)
    k = np.empty((4, 4, 3, 3))
    for el in range(quads.shape[0]):
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        k[:] = 0.0
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            p = 0.0
            for a in range(4):
                p += _SHAPE[point, a] * nodal[quad[a]]
            p *= loaded[el] * factor
            for b in range(4):
                # derivative of g1 x g2 along displacement e_j of node b: s1 e_j x g2 + s2 g1 x e_j
                s1 = _SLOPE[point, b, 0]
                s2 = _SLOPE[point, b, 1]
                v0 = p * (s1 * g2[0] - s2 * g1[0])
                v1 = p * (s1 * g2[1] - s2 * g1[1])
                v2 = p * (s1 * g2[2] - s2 * g1[2])
                for a in range(4):
                    n = _SHAPE[point, a]
                    # e_j x v, column j
                    k[a, b, 0, 1] += n * v2
                    k[a, b, 0, 2] -= n * v1
                    k[a, b, 1, 0] -= n * v2
                    k[a, b, 1, 2] += n * v0
                    k[a, b, 2, 0] += n * v1
                    k[a, b, 2, 1] -= n * v0
        for a in range(4):
            for i in range(3):
                for b in range(4):
                    for j in range(3):
                        where = slots[el, 20 * (5 * a + i) + 5 * b + j]
                        if where >= 0:
                            data[where] += k[a, b, i, j]


@numba.njit(cache=True)
def station_forces(quads, nodes, q, station, loaded, out):
    """Fill element force columns out (ne, 4, 3, 4): force on node a, component i, of unit pressure at node b."""
    g1 = np.empty(3)
    g2 = np.empty(3)
    for el in range(quads.shape[0]):
        out[el] = 0.0
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            f0 = loaded[el] * (g1[1] * g2[2] - g1[2] * g2[1])
            f1 = loaded[el] * (g1[2] * g2[0] - g1[0] * g2[2])
            f2 = loaded[el] * (g1[0] * g2[1] - g1[1] * g2[0])
            for a in range(4):
                for b in range(4):
                    n = _SHAPE[point, a] * _SHAPE[point, b]
                    out[el, a, 0, b] += n * f0
                    out[el, a, 1, b] += n * f1
                    out[el, a, 2, b] += n * f2
