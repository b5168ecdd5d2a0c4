"""Compiled parts of the element loop for drilling rotations, the numbers behind the first sixteen; see `drilling`.

Every loop runs over as many rotations as its arrays have, which is none in elements without them.
"""

from __future__ import annotations

import numba

from .kernel_rubber import FAST


@numba.njit(fastmath=FAST, inline="always")
def add_bow_stress(bows, weight, stress, w):
    """Add what one point of the given area contributes to the forces on the rotations in w (20,)."""
    for i in range(6):
        s = weight * stress[i]
        for k in range(bows.shape[1]):
            w[16 + k] += bows[i, k] * s


@numba.njit(fastmath=FAST, inline="always")
def add_bow_tangent(bows, weight, tangent, product, kz):
    """Add what one point contributes to the rows of the rotations in kz (20, 20); product (8, 16) are the resultants
    by the first sixteen numbers.
    """
    for k in range(bows.shape[1]):
        for i in range(6):
            t = bows[i, k]
            for j in range(16):
                kz[16 + k, j] += t * product[i, j]
            for l in range(6):
                s = weight * t * tangent[i, l]
                for j in range(bows.shape[1]):
                    kz[16 + k, 16 + j] += s * bows[l, j]


@numba.njit(fastmath=FAST, inline="always")
def hold_drilling(own, z, w):
    """Add the forces of the rotations on their own stiffness (m, m) to w (20,)."""
    for a in range(own.shape[0]):
        for b in range(own.shape[0]):
            w[16 + a] += own[a, b] * z[16 + b]


@numba.njit(fastmath=FAST, inline="always")
def add_own_stiffness(own, kz):
    """Add the rotations' own stiffness (m, m) to kz (20, 20)."""
    for a in range(own.shape[0]):
        for b in range(own.shape[0]):
            kz[16 + a, 16 + b] += own[a, b]


@numba.njit(fastmath=FAST, inline="always")
def _add_entries(slots, values, data):
    """Add entries of an element to matrix values; slots and values alike in shape, negative slots are left out."""
    for i in range(slots.shape[0]):
        for j in range(slots.shape[1]):
            where = slots[i, j]
            if where >= 0:
                data[where] += values[i, j]


@numba.njit(fastmath=FAST, inline="always")
def add_drilling_tangent(el, kz, bz, slots, mixed, data):
    """Add the rows and columns of the rotations to the matrix values, with the slope bz (16, 20) of the first numbers;
    mixed (4, 20) is workspace.
    """
    rows, columns, both = slots
    for a in range(rows.shape[1]):
        for j in range(20):
            total = 0.0
            for k in range(16):
                total += kz[16 + a, k] * bz[k, j]
            mixed[a, j] = total
    _add_entries(rows[el], mixed, data)
    _add_entries(columns[el], mixed.T, data)
    _add_entries(both[el], kz[16:, 16:], data)
