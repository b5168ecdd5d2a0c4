"""Compiled loops of walls that relax: what each group of layers answers by its slow law, and what its branches hold.

Arrays are by element and Gauss point: strains (ne, 4, 8), resultants of g groups (ne, 4, g, 8) and of b branches
(ne, 4, b, 8), ordered as `dbvfiv.shell.kernel_section` has them. Strains are total Lagrangian, so what a branch holds
can be integrated through the thickness once and for all.
"""

from __future__ import annotations

import numba
import numpy as np

from .kernel_rubber import FAST, rubber_stress
from .kernel_section import linear_response, point_strain
from .kernel_strain import bases, edge_shears, gather, strains
from .reference import SHEAR_EDGES, SHEAR_WEIGHTS

_EDGES = np.ascontiguousarray(SHEAR_EDGES)
_EDGE_WEIGHTS = np.ascontiguousarray(SHEAR_WEIGHTS)


@numba.njit(cache=True, fastmath=FAST)
def slow_resultants(
    quads,
    nodes,
    q,
    director,
    shear0,
    metric0,
    metric1,
    mq,
    mqk,
    mp,
    thickness,
    stiffness,
    points,
    constants,
    scales,
    member,
    strain_out,
    slow_out,
):
    """Fill strains (ne, 4, 8) and the slow law's resultants (ne, 4, g, 8) of each group; unknowns q (nn, 5).

    Parameters
    ----------
    stiffness : (g, 8, 8) array
        Of the linear layers of each group.
    points, constants, scales : (k, 2), (k, 3), (k,) arrays
        Of all points that carry rubber.
    member : (k,) int array
        The group of each of these points; negative for none.
    """
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    basis = np.empty((2, 3))
    turn = np.empty((2, 3))
    edge = np.empty(4)
    e = np.empty(5)
    s = np.empty(5)
    for el in range(quads.shape[0]):
        gather(quads[el], nodes, q, director, x, d)
        edge_shears(x, d, edge)
        h = thickness[el]
        for point in range(4):
            bases(point, x, d, basis, turn)
            strain = strain_out[el, point]
            strains(
                point,
                basis,
                turn,
                edge,
                shear0[el],
                metric0[el, point],
                metric1[el, point],
                mq[el, point],
                mqk[el, point],
                mp[el, point],
                strain,
            )
            slow = slow_out[el, point]
            for g in range(stiffness.shape[0]):
                linear_response(stiffness[g], h, strain, slow[g])
            for l in range(points.shape[0]):
                if member[l] < 0:
                    continue
                stress = slow[member[l]]
                point_strain(points[l, 0], h, scales[l], strain, e)
                rubber_stress(constants[l, 0], constants[l, 1], constants[l, 2], e, s)
                w = points[l, 1] * h
                t = points[l, 0] * h
                for i in range(3):
                    stress[i] += w * s[i]
                    stress[3 + i] += w * t * s[i]
                stress[6] += w * scales[l] * s[3]
                stress[7] += w * scales[l] * s[4]


@numba.njit(cache=True, fastmath=FAST)
def hold_resultants(branches, slow, kept, gained, out):
    """Fill out (ne, 4, 8): what branches (ne, 4, b, 8) keep of theirs by factors (b,), less factors (g,) of the slow
    law's resultants (ne, 4, g, 8).
    """
    for el in range(out.shape[0]):
        for point in range(4):
            for i in range(8):
                out[el, point, i] = 0.0
            for b in range(branches.shape[2]):
                for i in range(8):
                    out[el, point, i] += kept[b] * branches[el, point, b, i]
            for g in range(slow.shape[2]):
                for i in range(8):
                    out[el, point, i] -= gained[g] * slow[el, point, g, i]


@numba.njit(fastmath=FAST, inline="always")
def _strain_slopes(point, basis, turn, basis_way, turn_way, edge_way, q, qk, p, slope):
    """Derivative (8,) of the section strains along a way of positions and directors."""
    c00 = 0.0
    c01 = 0.0
    c02 = 0.0
    c10 = 0.0
    c11 = 0.0
    c12 = 0.0
    for i in range(3):
        c00 += basis[0, i] * basis_way[0, i]
        c01 += basis[1, i] * basis_way[1, i]
        c02 += basis[0, i] * basis_way[1, i] + basis[1, i] * basis_way[0, i]
        c10 += basis[0, i] * turn_way[0, i] + basis_way[0, i] * turn[0, i]
        c11 += basis[1, i] * turn_way[1, i] + basis_way[1, i] * turn[1, i]
        c12 += basis[0, i] * turn_way[1, i] + basis_way[0, i] * turn[1, i]
        c12 += basis[1, i] * turn_way[0, i] + basis_way[1, i] * turn[0, i]
    for i in range(3):
        slope[i] = q[i, 0] * c00 + q[i, 1] * c01 + q[i, 2] * c02
        slope[3 + i] = q[i, 0] * c10 + q[i, 1] * c11 + q[i, 2] * c12 - qk[i, 0] * c00 - qk[i, 1] * c01 - qk[i, 2] * c02
    g0 = _EDGE_WEIGHTS[point, 0] * edge_way[0] + _EDGE_WEIGHTS[point, 1] * edge_way[1]
    g1 = _EDGE_WEIGHTS[point, 2] * edge_way[2] + _EDGE_WEIGHTS[point, 3] * edge_way[3]
    slope[6] = p[0, 0] * g0 + p[0, 1] * g1
    slope[7] = p[1, 0] * g0 + p[1, 1] * g1


@numba.njit(fastmath=FAST, inline="always")
def _edge_ways(x, d, x_way, d_way, edge):
    for g in range(4):
        a = _EDGES[g, 0]
        b = _EDGES[g, 1]
        total = 0.0
        for i in range(3):
            total += (x_way[b, i] - x_way[a, i]) * (d[b, i] + d[a, i]) + (x[b, i] - x[a, i]) * (
                d_way[b, i] + d_way[a, i]
            )
        edge[g] = 0.25 * total


@numba.njit(cache=True, fastmath=FAST)
def branch_works(quads, nodes, q, director, way, director_way, mq, mqk, mp, area, branches, group, share, work):
    """Add to work (g,) a share of the work, J, that the resultants of branches do along a way.

    Parameters
    ----------
    q, director : (nn, 5), (nn, 3) arrays
        Unknowns and directors where strains follow the way.
    way, director_way : (nn, 5), (nn, 3) arrays
        Change of the unknowns, and of the directors with it to first order.
    branches : (ne, 4, b, 8) array
    group : (b,) int array
        The group of each branch.
    """
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    x_way = np.empty((4, 3))
    d_way = np.empty((4, 3))
    basis = np.empty((2, 3))
    turn = np.empty((2, 3))
    basis_way = np.empty((2, 3))
    turn_way = np.empty((2, 3))
    edge = np.empty(4)
    slope = np.empty(8)
    for el in range(quads.shape[0]):
        gather(quads[el], nodes, q, director, x, d)
        for a in range(4):
            n = quads[el, a]
            for i in range(3):
                x_way[a, i] = way[n, i]
                d_way[a, i] = director_way[n, i]
        _edge_ways(x, d, x_way, d_way, edge)
        for point in range(4):
            bases(point, x, d, basis, turn)
            bases(point, x_way, d_way, basis_way, turn_way)
            _strain_slopes(
                point,
                basis,
                turn,
                basis_way,
                turn_way,
                edge,
                mq[el, point],
                mqk[el, point],
                mp[el, point],
                slope,
            )
            weight = share * area[el, point]
            for b in range(branches.shape[2]):
                total = 0.0
                for i in range(8):
                    total += branches[el, point, b, i] * slope[i]
                work[group[b]] += weight * total


@numba.njit(cache=True, fastmath=FAST)
def advance_branches(
    branches, stretch, slow, slow_new, strain, strain_new, group, time, kept, gained, area, out, stretch_out, stored
):
    """Fill branches (ne, 4, b, 8) and their stretches (ne, 4, j, 8) at the end of a step; add to stored (g,) half of
    one times the other, J.

    Parameters
    ----------
    group, time : (b,) int arrays
        Group and relaxation time of each branch.
    kept, gained : (2, max(b, j)) arrays
        What stays of a branch, and the share of the change of resultants that it takes up; second row: of stretches.
    """
    for el in range(slow.shape[0]):
        for point in range(4):
            for j in range(stretch.shape[2]):
                for i in range(8):
                    change = strain_new[el, point, i] - strain[el, point, i]
                    stretch_out[el, point, j, i] = kept[1, j] * stretch[el, point, j, i] + gained[1, j] * change
            for b in range(branches.shape[2]):
                g = group[b]
                total = 0.0
                for i in range(8):
                    change = slow_new[el, point, g, i] - slow[el, point, g, i]
                    value = kept[0, b] * branches[el, point, b, i] + gained[0, b] * change
                    out[el, point, b, i] = value
                    total += value * stretch_out[el, point, time[b], i]
                stored[g] += 0.5 * area[el, point] * total
