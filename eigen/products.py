"""Products of left and right vectors of a pencil."""

from __future__ import annotations

import numpy as np

from .pencil import CoupledPencil, real_apply


def coupling_of_modes(pencil: CoupledPencil, left_values, left_q, left_u, right_values, right_q, right_u) -> np.ndarray:
    r"""w_i^H [T(l_i) - T(l_j)] / (l_i - l_j) x_j, the product in which modes are orthogonal.

    For a quadratic pencil this is w^H [(l_i + l_j) M' + C'] x with M', C' the coefficients of
    lambda^2 and lambda of the full pencil; on the diagonal it is w^H T'(l) x. What relaxes adds the
    divided differences of its factors.

    Returns
    -------
    ndarray, shape (k_left, k_right)
    """
    p = pencil
    y = real_apply(p.J, right_q)
    wg = real_apply(p.G.T.tocsr(), left_q).conj().T  # w^H G
    wh, Wh = left_q.conj().T, left_u.conj().T
    inertia = wh @ real_apply(p.M, right_q) - wg @ (p.A2 @ y) + Wh @ (p.R2 @ y)
    damping = wh @ real_apply(p.C, right_q) - wg @ (p.A1 @ y + p.B1 @ right_u) + Wh @ (p.R1 @ y + p.S1 @ right_u)
    first, second = np.asarray(left_values)[:, None], np.asarray(right_values)
    table = (first + second) * inertia + damping
    if p.relaxation is not None:
        for quotient, matrix in zip(p.relaxation.quotients(first, second), p.relaxing):
            table = table + quotient * (wh @ real_apply(matrix, right_q))
    return table
