"""GMRES for operators that are dear to apply and already preconditioned."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la


def gmres(
    apply: Callable[[np.ndarray], np.ndarray], rhs: np.ndarray, tolerance: float, most: int
) -> tuple[np.ndarray, int, float]:
    """Minimal-residual solution of ``apply(x) = rhs`` from zero (Saad & Schultz 1986), without restarts.

    Parameters
    ----------
    apply : callable
        Linear; may make complex vectors of real ones.
    rhs : (n,) array
    tolerance : float
        Residual over that of zero at which to stop.
    most : int
        Iterations.

    Returns
    -------
    x : (n,) array
    count : int
        Applications.
    missed : float
        Residual that is left over that of zero.

    Examples
    --------
    >>> x, count, missed = gmres(lambda x: np.array([2.0, 4.0]) * x, np.array([2.0, 4.0]), 1e-12, 5)
    >>> x.round(12), count
    (array([1., 1.]), 2)
    """
    size = np.linalg.norm(rhs)
    if size == 0.0:
        return np.zeros_like(rhs), 0, 0.0
    vectors, columns = [rhs / size], []
    weights, missed = np.zeros(0), 1.0
    for count in range(1, most + 1):
        w = apply(vectors[-1])
        column = np.zeros(count + 1, np.result_type(w, rhs))
        for _ in range(2):  # twice is enough
            for i, v in enumerate(vectors):
                part = np.vdot(v, w)
                column[i] += part
                w = w - part * v
        column[count] = np.linalg.norm(w)
        columns.append(column)
        matrix = np.zeros((count + 1, count), column.dtype)
        for j, one in enumerate(columns):
            matrix[: len(one), j] = one
        target = np.zeros(count + 1, column.dtype)
        target[0] = size
        weights = la.lstsq(matrix, target)[0]
        missed = float(np.linalg.norm(matrix @ weights - target) / size)
        if missed <= tolerance or abs(column[count]) <= 1e-14 * size:
            break
        vectors.append(w / column[count])
    return sum(c * v for c, v in zip(weights, vectors)), count, missed
