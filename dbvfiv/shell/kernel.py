"""Compiled element loop: force and tangent of the first-order shell, the hot path of every solve.

The mechanics are defined once, by the energy in `energy.py`; this loop evaluates its first and second derivative with
the structure used: covariant strains are quadratic in positions and directors, so their first derivative is linear and
the second constant, and the layers integrate to an 8 x 8 section tangent before the strain-displacement product. It
agrees with automatic differentiation to rounding.

Element unknowns are node-major: three displacements and two rotations of each of the four nodes.
"""

from __future__ import annotations

import numba
import numpy as np

from .kernel_rubber import FAST
from .kernel_section import section_stress, section_tangent
from .kernel_strain import edge_shears, gather, strains_at
from .reference import SHEAR_EDGES, SHEAR_WEIGHTS, SLOPE

_SLOPE = np.ascontiguousarray(SLOPE)
_EDGES = np.ascontiguousarray(SHEAR_EDGES)
_EDGE_WEIGHTS = np.ascontiguousarray(SHEAR_WEIGHTS)


@numba.njit(fastmath=FAST, inline="always")
def _covariant_stress(q, qk, p, weight, stress, n, m, g):
    """Covariant counterparts of the section stresses: weights of the second derivatives of the covariant strains."""
    for j in range(3):
        total = 0.0
        bend = 0.0
        for i in range(3):
            total += q[i, j] * stress[i] - qk[i, j] * stress[3 + i]
            bend += q[i, j] * stress[3 + i]
        n[j] = weight * total
        m[j] = weight * bend
    for c in range(2):
        g[c] = weight * (p[0, c] * stress[6] + p[1, c] * stress[7])


@numba.njit(fastmath=FAST, inline="always")
def _add_forces(point, n, m, g, basis, turn, x, d, fx, fd):
    """Forces on positions and directors (4, 3) from covariant stresses at one point."""
    for a in range(4):
        s0 = _SLOPE[point, a, 0]
        s1 = _SLOPE[point, a, 1]
        x0 = n[0] * s0 + n[2] * s1
        x1 = n[1] * s1 + n[2] * s0
        d0 = m[0] * s0 + m[2] * s1
        d1 = m[1] * s1 + m[2] * s0
        for i in range(3):
            fx[a, i] += x0 * basis[0, i] + x1 * basis[1, i] + d0 * turn[0, i] + d1 * turn[1, i]
            fd[a, i] += d0 * basis[0, i] + d1 * basis[1, i]
    for e in range(4):
        w = 0.25 * _EDGE_WEIGHTS[point, e] * g[e // 2]
        a = _EDGES[e, 0]
        b = _EDGES[e, 1]
        for i in range(3):
            director = w * (d[a, i] + d[b, i])
            along = w * (x[b, i] - x[a, i])
            fx[b, i] += director
            fx[a, i] -= director
            fd[a, i] += along
            fd[b, i] += along


@numba.njit(inline="always")
def _workspace():
    """Positions, directors and forces on both (4, 3), bases (2, 3), shears (4,), strains and resultants (8,)."""
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    fx = np.empty((4, 3))
    fd = np.empty((4, 3))
    basis = np.empty((2, 3))
    turn = np.empty((2, 3))
    edge = np.empty(4)
    strain = np.empty(8)
    stress = np.empty(8)
    return x, d, fx, fd, basis, turn, edge, strain, stress


@numba.njit(cache=True, fastmath=FAST)
def shell_force(
    quads,
    nodes,
    q,
    director,
    director1,
    reference,
    wall,
    held,
    out,
):
    """Add the internal force to out (nn, 5); unknowns q (nn, 5).

    Parameters
    ----------
    reference : tuple of arrays
        The undeformed elements, as `dbvfiv.shell.shell.Shell` holds them.
    wall : tuple of arrays
        Linear stiffness, points, constants and shear scales, see `dbvfiv.shell.section.Section.wall`.
    held : (ne, 4, 8) array or None
        Resultants at each Gauss point on top of those of the layers.
    """
    mq, mqk, mp, area, thickness = reference[3:]
    stiffness, points, constants, scales = wall
    x, d, fx, fd, basis, turn, edge, strain, stress = _workspace()
    e = np.empty(5)
    s = np.empty(5)
    n = np.empty(3)
    m = np.empty(3)
    g = np.empty(2)
    for el in range(quads.shape[0]):
        quad = quads[el]
        gather(quad, nodes, q, director, x, d)
        edge_shears(x, d, edge)
        for a in range(4):
            for i in range(3):
                fx[a, i] = 0.0
                fd[a, i] = 0.0
        for point in range(4):
            strains_at(el, point, x, d, edge, reference, basis, turn, strain)
            section_stress(stiffness, points, constants, scales, thickness[el], strain, stress, e, s)
            if held is not None:
                for i in range(8):
                    stress[i] += held[el, point, i]
            _covariant_stress(mq[el, point], mqk[el, point], mp[el, point], area[el, point], stress, n, m, g)
            _add_forces(point, n, m, g, basis, turn, x, d, fx, fd)
        for a in range(4):
            node = quad[a]
            for i in range(3):
                out[node, i] += fx[a, i]
            for r in range(2):
                total = 0.0
                for i in range(3):
                    total += fd[a, i] * director1[node, r, i]
                out[node, 3 + r] += total


@numba.njit(cache=True, fastmath=FAST)
def shell_tangent(
    quads,
    nodes,
    q,
    director,
    director1,
    director2,
    reference,
    wall,
    held,
    geometric,
    slots,
    out,
    data,
):
    """Add the internal force to out (nn, 5) and the tangent to the matrix values data (nnz,).

    Parameters
    ----------
    held : (ne, 4, 8) array or None
        Resultants at each Gauss point on top of those of the layers; they do not change with the strains.
    geometric : bool
        False leaves out what the resultants add to the tangent: the material part remains.
    slots : (ne, 400) int array
        Where each entry of the 20 x 20 element matrix goes in `data`; negative for constrained unknowns.
    """
    mq, mqk, mp, area, thickness = reference[3:]
    stiffness, points, constants, scales = wall
    x, d, fx, fd, basis, turn, edge, strain, stress = _workspace()
    tangent = np.empty((8, 8))
    e = np.empty(5)
    s = np.empty(5)
    t5 = np.zeros((5, 5))
    n = np.empty(3)
    m = np.empty(3)
    g = np.empty(2)
    cov = np.empty((8, 20))  # covariant strain-displacement rows: c0 (3), c1 (3), gamma (2)
    rows = np.empty((8, 20))  # the same in local axes
    product = np.empty((8, 20))
    k = np.empty((20, 20))
    shear_rows = np.empty((4, 20))
    gxx = np.empty((4, 4))
    gxd = np.empty((4, 4))
    for el in range(quads.shape[0]):
        quad = quads[el]
        h = thickness[el]
        gather(quad, nodes, q, director, x, d)
        edge_shears(x, d, edge)
        for a in range(4):
            for i in range(3):
                fx[a, i] = 0.0
                fd[a, i] = 0.0
            for b in range(4):
                gxx[a, b] = 0.0
                gxd[a, b] = 0.0
        for i in range(20):
            for j in range(20):
                k[i, j] = 0.0
        for ed in range(4):
            for j in range(20):
                shear_rows[ed, j] = 0.0
            a = _EDGES[ed, 0]
            b = _EDGES[ed, 1]
            for i in range(3):
                total = 0.25 * (d[a, i] + d[b, i])
                shear_rows[ed, 5 * b + i] = total
                shear_rows[ed, 5 * a + i] = -total
            for r in range(2):
                ta = 0.0
                tb = 0.0
                for i in range(3):
                    along = 0.25 * (x[b, i] - x[a, i])
                    ta += along * director1[quad[a], r, i]
                    tb += along * director1[quad[b], r, i]
                shear_rows[ed, 5 * a + 3 + r] = ta
                shear_rows[ed, 5 * b + 3 + r] = tb
        for point in range(4):
            ql = mq[el, point]
            qkl = mqk[el, point]
            pl = mp[el, point]
            strains_at(el, point, x, d, edge, reference, basis, turn, strain)
            section_tangent(stiffness, points, constants, scales, h, strain, stress, tangent, e, s, t5)
            if held is not None:
                for i in range(8):
                    stress[i] += held[el, point, i]
            weight = area[el, point]
            _covariant_stress(ql, qkl, pl, weight, stress, n, m, g)
            _add_forces(point, n, m, g, basis, turn, x, d, fx, fd)
            for a in range(4):
                s0 = _SLOPE[point, a, 0]
                s1 = _SLOPE[point, a, 1]
                for i in range(3):
                    j = 5 * a + i
                    cov[0, j] = s0 * basis[0, i]
                    cov[1, j] = s1 * basis[1, i]
                    cov[2, j] = s0 * basis[1, i] + s1 * basis[0, i]
                    cov[3, j] = s0 * turn[0, i]
                    cov[4, j] = s1 * turn[1, i]
                    cov[5, j] = s0 * turn[1, i] + s1 * turn[0, i]
                node = quad[a]
                for r in range(2):
                    b0 = 0.0
                    b1 = 0.0
                    for i in range(3):
                        b0 += basis[0, i] * director1[node, r, i]
                        b1 += basis[1, i] * director1[node, r, i]
                    j = 5 * a + 3 + r
                    cov[0, j] = 0.0
                    cov[1, j] = 0.0
                    cov[2, j] = 0.0
                    cov[3, j] = s0 * b0
                    cov[4, j] = s1 * b1
                    cov[5, j] = s0 * b1 + s1 * b0
            w0 = _EDGE_WEIGHTS[point, 0]
            w1 = _EDGE_WEIGHTS[point, 1]
            w2 = _EDGE_WEIGHTS[point, 2]
            w3 = _EDGE_WEIGHTS[point, 3]
            for j in range(20):
                cov[6, j] = w0 * shear_rows[0, j] + w1 * shear_rows[1, j]
                cov[7, j] = w2 * shear_rows[2, j] + w3 * shear_rows[3, j]
            for i in range(3):
                for j in range(20):
                    rows[i, j] = ql[i, 0] * cov[0, j] + ql[i, 1] * cov[1, j] + ql[i, 2] * cov[2, j]
                    rows[3 + i, j] = (
                        ql[i, 0] * cov[3, j]
                        + ql[i, 1] * cov[4, j]
                        + ql[i, 2] * cov[5, j]
                        - qkl[i, 0] * cov[0, j]
                        - qkl[i, 1] * cov[1, j]
                        - qkl[i, 2] * cov[2, j]
                    )
            for i in range(2):
                for j in range(20):
                    rows[6 + i, j] = pl[i, 0] * cov[6, j] + pl[i, 1] * cov[7, j]
            for i in range(8):
                for j in range(20):
                    product[i, j] = 0.0
                for l in range(8):
                    v = weight * tangent[i, l]
                    for j in range(20):
                        product[i, j] += v * rows[l, j]
            for i in range(20):
                for l in range(8):
                    v = rows[l, i]
                    for j in range(20):
                        k[i, j] += v * product[l, j]
            if not geometric:
                continue
            # geometric stiffness: second derivatives of the covariant strains are scalars times the identity
            for a in range(4):
                a0 = _SLOPE[point, a, 0]
                a1 = _SLOPE[point, a, 1]
                for b in range(4):
                    b0 = _SLOPE[point, b, 0]
                    b1 = _SLOPE[point, b, 1]
                    mixed = a0 * b1 + a1 * b0
                    gxx[a, b] += n[0] * a0 * b0 + n[1] * a1 * b1 + n[2] * mixed
                    gxd[a, b] += m[0] * a0 * b0 + m[1] * a1 * b1 + m[2] * mixed
            for ed in range(4):
                w = 0.25 * _EDGE_WEIGHTS[point, ed] * g[ed // 2]
                a = _EDGES[ed, 0]
                b = _EDGES[ed, 1]
                gxd[b, a] += w
                gxd[b, b] += w
                gxd[a, a] -= w
                gxd[a, b] -= w
        for a in range(4):
            na = quad[a]
            for b in range(4):
                v = gxx[a, b]
                for i in range(3):
                    k[5 * a + i, 5 * b + i] += v
                v = gxd[a, b]
                nb = quad[b]
                for r in range(2):
                    for i in range(3):
                        value = v * director1[nb, r, i]
                        k[5 * a + i, 5 * b + 3 + r] += value
                        k[5 * b + 3 + r, 5 * a + i] += value
            if geometric:
                curve0 = 0.0
                curve1 = 0.0
                curve2 = 0.0
                for i in range(3):
                    curve0 += fd[a, i] * director2[na, 0, i]
                    curve1 += fd[a, i] * director2[na, 1, i]
                    curve2 += fd[a, i] * director2[na, 2, i]
                k[5 * a + 3, 5 * a + 3] += curve0
                k[5 * a + 4, 5 * a + 4] += curve1
                k[5 * a + 3, 5 * a + 4] += curve2
                k[5 * a + 4, 5 * a + 3] += curve2
            for i in range(3):
                out[na, i] += fx[a, i]
            for r in range(2):
                total = 0.0
                for i in range(3):
                    total += fd[a, i] * director1[na, r, i]
                out[na, 3 + r] += total
        slot = slots[el]
        for i in range(20):
            for j in range(20):
                where = slot[20 * i + j]
                if where >= 0:
                    data[where] += k[i, j]
