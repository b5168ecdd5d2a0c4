"""Mass: translation, rotation of the wall and, for unequal layers, the coupling of the two.

Consistent, or the mean of consistent and lumped. Equation (T.30) of docs/theory.md.
"""

from __future__ import annotations

import numba
import numpy as np

from .kernel_rubber import FAST
from .reference import SHAPE, ReferenceGeometry
from .section import Section, WallParts

CONSISTENT, AVERAGED = "consistent", "averaged"
MASSES = (CONSISTENT, AVERAGED)


def mass_integrals(geometry: ReferenceGeometry, section: Section | WallParts, mass: str = CONSISTENT) -> np.ndarray:
    """Integrals of rho t^k N_a N_b over each element, k = 0, 1, 2, from which all inertia of a shell follows. Raises
    ValueError if there is no mass of that name.

    Parameters
    ----------
    section : Section or WallParts
    mass : "consistent" or "averaged"
        The integrals, or the mean of them and of their sums over b on the diagonal: the higher-order mass of Goudreau
        and Taylor (1973, Computer Methods in Applied Mechanics and Engineering 2, 69-97).

    Returns
    -------
    (ne, 3, 4, 4) array
        kg, kg m and kg m2.
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


@numba.njit(cache=True, fastmath=FAST)
def inertia_force(quads, integrals, director1, director2, rate, acceleration, out):
    """Add M a + h to out (nn, 5): inertia at nodal velocities and accelerations (nn, 5), h the part quadratic in the
    velocities.
    """
    count = director1.shape[0]
    turn = np.empty((count, 3))
    for n in range(count):
        r0 = rate[n, 3]
        r1 = rate[n, 4]
        a0 = acceleration[n, 3]
        a1 = acceleration[n, 4]
        for i in range(3):
            turn[n, i] = (
                director1[n, 0, i] * a0
                + director1[n, 1, i] * a1
                + director2[n, 0, i] * r0 * r0
                + director2[n, 1, i] * r1 * r1
                + 2 * director2[n, 2, i] * r0 * r1
            )
    moment = np.empty(3)
    for el in range(quads.shape[0]):
        for a in range(4):
            na = quads[el, a]
            for i in range(3):
                push = 0.0
                twist = 0.0
                for b in range(4):
                    nb = quads[el, b]
                    m1 = integrals[el, 1, a, b]
                    push += integrals[el, 0, a, b] * acceleration[nb, i] + m1 * turn[nb, i]
                    twist += m1 * acceleration[nb, i] + integrals[el, 2, a, b] * turn[nb, i]
                out[na, i] += push
                moment[i] = twist
            for r in range(2):
                out[na, 3 + r] += (
                    director1[na, r, 0] * moment[0] + director1[na, r, 1] * moment[1] + director1[na, r, 2] * moment[2]
                )


@numba.njit(cache=True, fastmath=FAST)
def kinetic_energy(quads, integrals, director1, rate):
    """Kinetic energy, J, at nodal velocities (nn, 5)."""
    count = director1.shape[0]
    turn = np.empty((count, 3))
    for n in range(count):
        for i in range(3):
            turn[n, i] = director1[n, 0, i] * rate[n, 3] + director1[n, 1, i] * rate[n, 4]
    total = 0.0
    for el in range(quads.shape[0]):
        for a in range(4):
            na = quads[el, a]
            for b in range(4):
                nb = quads[el, b]
                uu = 0.0
                ut = 0.0
                tt = 0.0
                for i in range(3):
                    uu += rate[na, i] * rate[nb, i]
                    ut += rate[na, i] * turn[nb, i]
                    tt += turn[na, i] * turn[nb, i]
                total += integrals[el, 0, a, b] * uu + 2 * integrals[el, 1, a, b] * ut + integrals[el, 2, a, b] * tt
    return 0.5 * total
