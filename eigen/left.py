"""Products of left and right vectors of a quadratic pencil."""
from __future__ import annotations

import numpy as np

from .pencil import CoupledPencil, real_apply


def coupling_of_modes(pencil: CoupledPencil, left_values, left_q, left_u,
                      right_values, right_q, right_u) -> np.ndarray:
    r"""w_i^H [T(l_i) - T(l_j)] / (l_i - l_j) x_j, the product in which modes are orthogonal.

    For a quadratic pencil this is w^H [(l_i + l_j) M' + C'] x with M', C' the coefficients of
    lambda^2 and lambda of the full pencil; on the diagonal it is w^H T'(l) x.

    Returns
    -------
    ndarray, shape (k_left, k_right)
    """
    p = pencil
    y = real_apply(p.J, right_q)
    wg = real_apply(p.G.T.tocsr(), left_q).conj().T          # w^H G
    wh, Wh = left_q.conj().T, left_u.conj().T
    inertia = wh @ real_apply(p.M, right_q) - wg @ (p.A2 @ y) + Wh @ (p.R2 @ y)
    damping = (wh @ real_apply(p.C, right_q) - wg @ (p.A1 @ y + p.B1 @ right_u)
               + Wh @ (p.R1 @ y + p.S1 @ right_u))
    return (np.asarray(left_values)[:, None] + np.asarray(right_values)) * inertia + damping


def biorthogonalise(pencil: CoupledPencil, eigenvalues, q, u, w, W, cluster: float = 1e-7):
    """Scale left vectors to w^H T' x = 1 and sort out those of multiple eigenvalues.

    Returns
    -------
    w, W : ndarray
    biorthogonality : float
        Largest off-diagonal product relative to the norms of the vectors' products.
    defective : list of int
        Modes whose w^H T' x vanishes: a defective or nearly defective eigenvalue. Their left
        vectors keep unit norm.
    """
    k = eigenvalues.size
    w, W = np.array(w, complex), np.array(W, complex)
    if not k:
        return w, W, 0.0, []
    size = np.linalg.norm(w, axis=0)
    size[size == 0] = 1.0
    w, W = w / size, W / size
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    magnitude = np.abs(table).max(axis=1)
    defective: list[int] = []
    done = np.zeros(k, bool)
    for i in range(k):
        if done[i]:
            continue
        near = np.abs(eigenvalues - eigenvalues[i]) <= cluster * max(abs(eigenvalues[i]), 1e-300)
        group = np.flatnonzero(near & ~done)
        done[group] = True
        block = table[np.ix_(group, group)]
        scale = magnitude[group].max() or 1.0
        if np.linalg.cond(block) > 1e8 or np.abs(block).max() < 1e-9 * scale:
            defective.extend(int(g) for g in group)
            continue
        turn = np.linalg.inv(block).conj().T
        w[:, group], W[:, group] = w[:, group] @ turn, W[:, group] @ turn
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    off = np.abs(table - np.diag(np.diag(table)))
    off[defective] = 0.0
    off[:, defective] = 0.0
    return w, W, float(off.max(initial=0.0)), defective
