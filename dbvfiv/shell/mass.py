"""Mass: translation, rotation of the wall and, for unequal layers, the coupling of the two.

Consistent, or the mean of consistent and lumped. Equation (T.30) of docs/theory.md.
"""

from __future__ import annotations

import numba
import numpy as np

from .reference import SHAPE, ReferenceGeometry
from .section import Section
from .zones import WallParts

CONSISTENT, AVERAGED = "consistent", "averaged"
MASSES = (CONSISTENT, AVERAGED)


def mass_integrals(geometry: ReferenceGeometry, section: Section | WallParts, mass: str = CONSISTENT) -> np.ndarray:
    """Integrals of rho t^k N_a N_b over each element, k = 0, 1, 2, from which all inertia of a shell follows.

    Parameters
    ----------
    geometry : ReferenceGeometry
    section : Section or WallParts
    mass : "consistent" or "averaged"
        The integrals, or the mean of them and of their sums over b on the diagonal: the higher-order mass of Goudreau
        and Taylor (1973, Computer Methods in Applied Mechanics and Engineering 2, 69-97).

    Returns
    -------
    (ne, 3, 4, 4) array
        kg, kg m and kg m2.

    Raises
    ------
    ValueError
        If there is no mass of that name.
    """
    if mass not in MASSES:
        raise ValueError(f"The mass is {mass!r}, but only {' and '.join(map(repr, MASSES))} exist.")
    h = geometry.thickness
    shape = np.einsum("ep,pa,pb->eab", geometry.area, SHAPE, SHAPE)
    if mass == AVERAGED:
        shape = 0.5 * (shape + shape.sum(axis=2)[:, :, None] * np.eye(4))
    moments = np.atleast_2d(section.inertia) * h[:, None] ** np.arange(1, 4)
    return moments[:, :, None, None] * shape[:, None]


@numba.njit(cache=True)
def assemble_mass(quads, integrals, director1, slots, data):
    """Add the mass matrix at the state with director derivatives director1 (nn, 2, 3) to the matrix values."""
    k = np.empty((20, 20))
    for el in range(quads.shape[0]):
        k[:] = 0.0
        for a in range(4):
            na = quads[el, a]
            for b in range(4):
                nb = quads[el, b]
                m0 = integrals[el, 0, a, b]
                m1 = integrals[el, 1, a, b]
                m2 = integrals[el, 2, a, b]
                for i in range(3):
                    k[5 * a + i, 5 * b + i] = m0
                    for r in range(2):
                        k[5 * a + i, 5 * b + 3 + r] = m1 * director1[nb, r, i]
                        k[5 * a + 3 + r, 5 * b + i] = m1 * director1[na, r, i]
                for r in range(2):
                    for t in range(2):
                        total = 0.0
                        for i in range(3):
                            total += director1[na, r, i] * director1[nb, t, i]
                        k[5 * a + 3 + r, 5 * b + 3 + t] = m2 * total
        for i in range(20):
            for j in range(20):
                where = slots[el, 20 * i + j]
                if where >= 0:
                    data[where] += k[i, j]


@numba.njit(cache=True)
def convective_inertia(quads, integrals, director1, director2, rate, out):
    """Add the inertia forces quadratic in the velocities, M_dot-type terms of turning directors, to out (nn, 5).

    The kinetic energy depends on the rotations through the directors; with velocities `rate` (nn, 5) the acceleration
    of a director at zero rotational acceleration is d2 applied to the rotation rates twice.
    """
    turn = np.empty((4, 3))
    for el in range(quads.shape[0]):
        for b in range(4):
            n = quads[el, b]
            r0 = rate[n, 3]
            r1 = rate[n, 4]
            for i in range(3):
                turn[b, i] = (
                    director2[n, 0, i] * r0 * r0 + director2[n, 1, i] * r1 * r1 + 2 * director2[n, 2, i] * r0 * r1
                )
        for a in range(4):
            na = quads[el, a]
            for i in range(3):
                first = 0.0
                second = 0.0
                for b in range(4):
                    first += integrals[el, 1, a, b] * turn[b, i]
                    second += integrals[el, 2, a, b] * turn[b, i]
                out[na, i] += first
                for r in range(2):
                    out[na, 3 + r] += director1[na, r, i] * second
