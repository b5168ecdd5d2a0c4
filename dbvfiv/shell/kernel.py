"""Compiled element loop: force and tangent of the first-order shell, the hot path of every solve.

The mechanics are defined once, by the energy in `energy.py`; this loop evaluates its first and second derivative with
the structure used: strains are constant maps of sixteen numbers z that are bilinear in positions and directors, so the
layers integrate to 8 x 8 section tangents, these to one 16 x 16 tangent by z, and only that meets the slope of z, which
is linear in the nodal positions; its second derivative is constant. It agrees with automatic differentiation to
rounding.

Element unknowns are node-major: three displacements and two rotations of each of the four nodes.
"""

from __future__ import annotations

import numba
import numpy as np

from .assumed_strain import FACTORS, PAIRS, PRODUCTS, VECTORS
from .kernel_rubber import FAST
from .kernel_section import numbers_of, section_stress, section_tangent, strains_at
from .reference import SHEAR_EDGES

_VECTORS = np.ascontiguousarray(VECTORS)
_PAIRS = np.ascontiguousarray(PAIRS)
_FACTORS = np.ascontiguousarray(FACTORS)
_PRODUCTS = np.ascontiguousarray(PRODUCTS)
_EDGES = np.ascontiguousarray(SHEAR_EDGES)


@numba.njit(fastmath=FAST, inline="always")
def _add_stress(inplane, across, weight, stress, w):
    """Add what one point of the given area contributes to the forces on the numbers in w (16,)."""
    for i in range(6):
        s = weight * stress[i]
        for k in range(12):
            w[k] += inplane[i, k] * s
    for i in range(2):
        s = weight * stress[6 + i]
        for g in range(4):
            w[12 + g] += across[i, g] * s


@numba.njit(fastmath=FAST, inline="always")
def _forces(w, u, v, x, d, fu, fv, fx, fd):
    """Forces on positions and directors (4, 3) from those on the numbers; fu and fv are workspace (3, 3)."""
    for m in range(3):
        for i in range(3):
            fu[m, i] = 0.0
            fv[m, i] = 0.0
    for k in range(6):
        a = _PAIRS[k, 0]
        b = _PAIRS[k, 1]
        membrane = _FACTORS[k] * w[k]
        bending = _FACTORS[k] * w[6 + k]
        for i in range(3):
            fu[a, i] += membrane * u[b, i] + bending * v[b, i]
            fu[b, i] += membrane * u[a, i] + bending * v[a, i]
            fv[a, i] += bending * u[b, i]
            fv[b, i] += bending * u[a, i]
    for a in range(4):
        for i in range(3):
            fx[a, i] = 0.0
            fd[a, i] = 0.0
        for m in range(3):
            share = _VECTORS[m, a]
            for i in range(3):
                fx[a, i] += share * fu[m, i]
                fd[a, i] += share * fv[m, i]
    for e in range(4):
        half = 0.25 * w[12 + e]
        a = _EDGES[e, 0]
        b = _EDGES[e, 1]
        for i in range(3):
            director = half * (d[a, i] + d[b, i])
            along = half * (x[b, i] - x[a, i])
            fx[b, i] += director
            fx[a, i] -= director
            fd[a, i] += along
            fd[b, i] += along


@numba.njit(fastmath=FAST, inline="always")
def _add_to_nodes(quad, fx, fd, director1, out):
    """Add the forces on positions and directors of an element to out (nn, 5)."""
    for a in range(4):
        node = quad[a]
        for i in range(3):
            out[node, i] += fx[a, i]
        for r in range(2):
            total = 0.0
            for i in range(3):
                total += fd[a, i] * director1[node, r, i]
            out[node, 3 + r] += total


@numba.njit(inline="always")
def _workspace():
    """Positions, directors and forces on both (4, 3), vectors and forces on them (3, 3), numbers and forces (16,),
    strains and resultants (8,).
    """
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    fx = np.empty((4, 3))
    fd = np.empty((4, 3))
    u = np.empty((3, 3))
    v = np.empty((3, 3))
    fu = np.empty((3, 3))
    fv = np.empty((3, 3))
    z = np.empty(16)
    w = np.empty(16)
    strain = np.empty(8)
    stress = np.empty(8)
    return x, d, fx, fd, u, v, fu, fv, z, w, strain, stress


@numba.njit(cache=True, fastmath=FAST)
def shell_force(quads, nodes, q, director, director1, reference, wall, held, out):
    """Add the internal force to out (nn, 5); unknowns q (nn, 5).

    Parameters
    ----------
    reference : tuple of arrays
        The undeformed elements, as `dbvfiv.shell.shell.Shell` holds them.
    wall : tuple of arrays
        Linear stiffness, points, constants and shear scales, see `dbvfiv.shell.section.Section.wall`.
    held : (ne, 4, 8) array, or (0, 4, 8) for none
        Resultants at each Gauss point on top of those of the layers.
    """
    inplane, across, area, thickness = reference[2:]
    stiffness, points, constants, scales = wall
    x, d, fx, fd, u, v, fu, fv, z, w, strain, stress = _workspace()
    e = np.empty(5)
    s = np.empty(5)
    for el in range(quads.shape[0]):
        quad = quads[el]
        numbers_of(el, quad, nodes, q, director, reference, x, d, u, v, z)
        for k in range(16):
            w[k] = 0.0
        for point in range(4):
            strains_at(el, point, reference, z, strain)
            section_stress(stiffness, points, constants, scales, thickness[el], strain, stress, e, s)
            if len(held):
                for i in range(8):
                    stress[i] += held[el, point, i]
            _add_stress(inplane[el, point], across[el, point], area[el, point], stress, w)
        _forces(w, u, v, x, d, fu, fv, fx, fd)
        _add_to_nodes(quad, fx, fd, director1, out)


@numba.njit(fastmath=FAST, inline="always")
def _add_tangent(inplane, across, weight, tangent, product, kz):
    """Add what one point contributes to the upper triangle of the tangent by the numbers, kz (16, 16);
    product (8, 16) is that of the strains, to be filled.
    """
    for i in range(8):
        for k in range(16):
            product[i, k] = 0.0
        for l in range(6):
            t = weight * tangent[i, l]
            for k in range(12):
                product[i, k] += t * inplane[l, k]
        for l in range(2):
            t = weight * tangent[i, 6 + l]
            for g in range(4):
                product[i, 12 + g] += t * across[l, g]
    for i in range(6):
        for k in range(12):
            t = inplane[i, k]
            for j in range(16):
                kz[k, j] += t * product[i, j]
    for i in range(2):
        for g in range(4):
            t = across[i, g]
            for j in range(12, 16):
                kz[12 + g, j] += t * product[6 + i, j]


@numba.njit(fastmath=FAST, inline="always")
def _slopes(quad, u, v, x, d, director1, by_x, by_d, bz):
    """Slope bz (16, 20) of the numbers by the element's unknowns; by_x and by_d (16, 4, 3) are workspace."""
    for a in range(4):
        for k in range(6):
            first = _PAIRS[k, 0]
            second = _PAIRS[k, 1]
            p = _FACTORS[k] * _VECTORS[first, a]
            q = _FACTORS[k] * _VECTORS[second, a]
            for i in range(3):
                by_x[k, a, i] = p * u[second, i] + q * u[first, i]
                by_x[6 + k, a, i] = p * v[second, i] + q * v[first, i]
                by_d[6 + k, a, i] = by_x[k, a, i]
        for e in range(12, 16):
            for i in range(3):
                by_x[e, a, i] = 0.0
                by_d[e, a, i] = 0.0
    for e in range(4):
        a = _EDGES[e, 0]
        b = _EDGES[e, 1]
        for i in range(3):
            director = 0.25 * (d[a, i] + d[b, i])
            along = 0.25 * (x[b, i] - x[a, i])
            by_x[12 + e, b, i] = director
            by_x[12 + e, a, i] = -director
            by_d[12 + e, a, i] = along
            by_d[12 + e, b, i] = along
    for a in range(4):
        node = quad[a]
        for k in range(16):
            for i in range(3):
                bz[k, 5 * a + i] = by_x[k, a, i]
            for r in range(2):
                total = 0.0
                if k >= 6:
                    for i in range(3):
                        total += by_d[k, a, i] * director1[node, r, i]
                bz[k, 5 * a + 3 + r] = total


@numba.njit(fastmath=FAST, inline="always")
def _add_geometric(quad, w, fd, director1, director2, k):
    """Add the second derivatives of the numbers and of the directors, weighed by the forces on them."""
    for a in range(4):
        na = quad[a]
        for b in range(4):
            xx = 0.0
            xd = 0.0
            for m in range(6):
                xx += w[m] * _PRODUCTS[m, a, b]
                xd += w[6 + m] * _PRODUCTS[m, a, b]
            for e in range(4):
                first = _EDGES[e, 0]
                second = _EDGES[e, 1]
                if b == first or b == second:
                    if a == second:
                        xd += 0.25 * w[12 + e]
                    elif a == first:
                        xd -= 0.25 * w[12 + e]
            nb = quad[b]
            for i in range(3):
                k[5 * a + i, 5 * b + i] += xx
                for r in range(2):
                    value = xd * director1[nb, r, i]
                    k[5 * a + i, 5 * b + 3 + r] += value
                    k[5 * b + 3 + r, 5 * a + i] += value
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


@numba.njit(cache=True, fastmath=FAST)
def shell_tangent(quads, nodes, q, director, director1, director2, reference, wall, held, geometric, slots, out, data):
    """Add the internal force to out (nn, 5) and the tangent to the matrix values data (nnz,).

    Parameters
    ----------
    held : (ne, 4, 8) array, or (0, 4, 8) for none
        Resultants at each Gauss point on top of those of the layers; they do not change with the strains.
    geometric : bool
        False leaves out what the resultants by themselves add to the tangent: the material part remains.
    slots : (ne, 400) int array
        Where each entry of the 20 x 20 element matrix goes in `data`; negative for constrained unknowns.
    """
    inplane, across, area, thickness = reference[2:]
    stiffness, points, constants, scales = wall
    x, d, fx, fd, u, v, fu, fv, z, w, strain, stress = _workspace()
    tangent = np.empty((8, 8))
    e = np.empty(5)
    s = np.empty(5)
    t5 = np.zeros((5, 5))
    section = np.empty((8, 16))
    kz = np.empty((16, 16))
    by_x = np.empty((16, 4, 3))
    by_d = np.empty((16, 4, 3))
    bz = np.empty((16, 20))
    product = np.empty((16, 20))
    k = np.empty((20, 20))
    for el in range(quads.shape[0]):
        quad = quads[el]
        numbers_of(el, quad, nodes, q, director, reference, x, d, u, v, z)
        for i in range(16):
            w[i] = 0.0
            for j in range(16):
                kz[i, j] = 0.0
        for point in range(4):
            strains_at(el, point, reference, z, strain)
            section_tangent(stiffness, points, constants, scales, thickness[el], strain, stress, tangent, e, s, t5)
            if len(held):
                for i in range(8):
                    stress[i] += held[el, point, i]
            _add_stress(inplane[el, point], across[el, point], area[el, point], stress, w)
            _add_tangent(inplane[el, point], across[el, point], area[el, point], tangent, section, kz)
        for i in range(12, 16):
            for j in range(12):
                kz[i, j] = kz[j, i]
        _forces(w, u, v, x, d, fu, fv, fx, fd)
        _slopes(quad, u, v, x, d, director1, by_x, by_d, bz)
        for i in range(16):
            for j in range(20):
                product[i, j] = 0.0
            for l in range(16):
                t = kz[i, l]
                for j in range(20):
                    product[i, j] += t * bz[l, j]
        for i in range(20):
            for j in range(20):
                k[i, j] = 0.0
            for l in range(16):
                t = bz[l, i]
                for j in range(20):
                    k[i, j] += t * product[l, j]
        if geometric:
            _add_geometric(quad, w, fd, director1, director2, k)
        _add_to_nodes(quad, fx, fd, director1, out)
        slot = slots[el]
        for i in range(20):
            for j in range(20):
                where = slot[20 * i + j]
                if where >= 0:
                    data[where] += k[i, j]
