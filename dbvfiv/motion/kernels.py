"""Compiled loops of a time step: areas under the rows and the strain energy of the wall."""

from __future__ import annotations

import numba
import numpy as np

from ..materials.energy import OGDEN_FROM
from ..shell.kernel_rubber import FAST, first_invariant, has_more, ogden_terms
from ..shell.kernel_section import linear_response, numbers_of, point_strain, strains_at


@numba.njit(cache=True)
def row_motion(rows, nodes, nodal, rate, area, area_rate):
    """Areas (m,) under the deformed rows (m, k) of nodes and their rates; see `dbvfiv.flow.rows.RowAreas`, whose offset
    is not added.
    """
    for k in range(rows.shape[0]):
        total = 0.0
        change = 0.0
        a = rows[k, 0]
        x = nodes[a, 0] + nodal[a, 0]
        y = nodes[a, 1] + nodal[a, 1]
        for column in range(1, rows.shape[1]):
            b = rows[k, column]
            x_next = nodes[b, 0] + nodal[b, 0]
            y_next = nodes[b, 1] + nodal[b, 1]
            total += 0.5 * (y + y_next) * (x_next - x)
            change += 0.5 * ((rate[a, 1] + rate[b, 1]) * (x_next - x) + (y + y_next) * (rate[b, 0] - rate[a, 0]))
            a, x, y = b, x_next, y_next
        area[k] = total
        area_rate[k] = change


@numba.njit(fastmath=FAST, inline="always")
def _rubber_energy(constants, e):
    c10, c01, c11 = constants[0], constants[1], constants[2]
    a = 1 + 2 * e[0]
    b = 1 + 2 * e[1]
    c = e[2]
    g = e[3]
    k = e[4]
    det = a * b - c * c
    h = (1 + (b * g * g - 2 * c * g * k + a * k * k)) / det
    i1 = (a + b - 2) + (h - 1)
    i2 = (det - 1) + (a + b) * h - g * g - k * k - 2
    total = c10 * i1 + c01 * i2 + c11 * i1 * i2
    if has_more(constants):
        x = first_invariant(e)
        total += (constants[3] + constants[4] * x) * x * x
        if constants[5] != 0.0:
            total += constants[5] * x / (1 + np.sqrt(1 + x / constants[6]))
    if constants.shape[0] > OGDEN_FROM:
        out = np.empty(6)
        ogden_terms(constants, e, True, out)
        total += out[0]
    return total


@numba.njit(cache=True, fastmath=FAST)
def strain_energy(
    quads,
    nodes,
    displacement,
    director,
    reference,
    wall,
):
    """Strain energy, J; arguments as `dbvfiv.shell.kernel.shell_force` has them."""
    area, thickness = reference[4:]
    stiffness, points, constants, scales = wall
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    u = np.empty((3, 3))
    v = np.empty((3, 3))
    z = np.empty(16)
    strain = np.empty(8)
    stress = np.empty(8)
    e = np.empty(5)
    total = 0.0
    for el in range(quads.shape[0]):
        numbers_of(el, quads[el], nodes, displacement, director, reference, x, d, u, v, z)
        h = thickness[el]
        for point in range(4):
            strains_at(el, point, reference, z, strain)
            linear_response(stiffness, h, strain, stress)
            density = 0.0
            for i in range(8):
                density += 0.5 * stress[i] * strain[i]
            for l in range(points.shape[0]):
                point_strain(points[l, 0], h, scales[l], strain, e)
                density += points[l, 1] * h * _rubber_energy(constants[l], e)
            total += area[el, point] * density
    return total
