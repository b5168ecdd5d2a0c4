"""Derivatives of the inertia forces M(q) a + h(q, v) by positions and velocities."""

from __future__ import annotations

import numba
import numpy as np

from ..shell import Shell

#: Step of the central difference that stands for third derivatives of directors, rad.
_STEP = 1e-4


def inertia_slopes(shell: Shell, nodal: np.ndarray, rate: np.ndarray, acceleration: np.ndarray):
    """Values (nnz,) of the derivatives by positions and by velocities on the pattern of the shell's matrices.

    Parameters
    ----------
    shell : Shell
    nodal, rate, acceleration : (nn, c) arrays
    """
    _, d1, d2 = shell.directors(nodal)
    r, a = rate[:, 3:5], acceleration[:, 3:5]
    mixed = np.stack([d2[:, [0, 2]], d2[:, [2, 1]]], axis=1)  # (nn, 2, 2, 3)
    turn = np.einsum("nri,nr->ni", d1, a) + _twice(d2, r)
    by_rate = 2.0 * np.einsum("nrsi,ns->nri", mixed, r)
    by_angle = np.einsum("nrsi,ns->nri", mixed, a)
    for s in range(2):
        ahead, behind = nodal.copy(), nodal.copy()
        ahead[:, 3 + s] += _STEP
        behind[:, 3 + s] -= _STEP
        by_angle[:, s] += (_twice(shell.directors(ahead)[2], r) - _twice(shell.directors(behind)[2], r)) / (2 * _STEP)
    size = len(shell.dofs.pattern[1])
    position, velocity = np.zeros(size), np.zeros(size)
    fixed = (shell.mesh.quads, shell.inertia_integrals, d1, mixed, turn, acceleration, by_angle, by_rate)
    _assemble(*fixed, shell.dofs.slots, position, velocity)
    return position, velocity


def _twice(d2: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Second derivatives of directors (nn, 3, 3) along rates (nn, 2) twice, (nn, 3)."""
    x, y = r[:, :1], r[:, 1:]
    return d2[:, 0] * x * x + d2[:, 1] * y * y + 2.0 * d2[:, 2] * x * y


@numba.njit(cache=True)
def _assemble(quads, integrals, d1, mixed, turn, acceleration, by_angle, by_rate, slots, position, velocity):
    kq = np.empty((20, 20))
    kv = np.empty((20, 20))
    moment = np.empty(3)
    for el in range(quads.shape[0]):
        kq[:] = 0.0
        kv[:] = 0.0
        for a in range(4):
            na = quads[el, a]
            moment[:] = 0.0
            for b in range(4):
                nb = quads[el, b]
                m1 = integrals[el, 1, a, b]
                m2 = integrals[el, 2, a, b]
                for i in range(3):
                    moment[i] += m1 * acceleration[nb, i] + m2 * turn[nb, i]
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + i, 5 * b + 3 + s] += m1 * by_angle[nb, s, i]
                        kv[5 * a + i, 5 * b + 3 + s] += m1 * by_rate[nb, s, i]
                    for r in range(2):
                        for i in range(3):
                            kq[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_angle[nb, s, i]
                            kv[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_rate[nb, s, i]
            for r in range(2):
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + 3 + r, 5 * a + 3 + s] += mixed[na, r, s, i] * moment[i]
        for i in range(20):
            for j in range(20):
                where = slots[el, 20 * i + j]
                if where >= 0:
                    position[where] += kq[i, j]
                    velocity[where] += kv[i, j]
