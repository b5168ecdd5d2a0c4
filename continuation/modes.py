"""Counting and matching modes of nearby points."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment


def count_unstable(values, tolerance=0.0) -> int:
    """Unstable eigenvalues, given one of each conjugate pair."""
    return int(sum((2 if value.imag > 0 else 1) for value in values if value.real > tolerance))


def match_modes(first, second) -> list[tuple[int, int]]:
    """Pair the modes of two nearby points by eigenvalue and shape.

    Parameters
    ----------
    first, second : (values, vectors)
        With one mode of each conjugate pair.

    Returns
    -------
    list of (i, j)
    """
    if first[0].size == 0 or second[0].size == 0:
        return []
    rows, columns = linear_sum_assignment(mode_distance(first, second))
    return list(zip(rows.tolist(), columns.tolist()))


def mode_distance(first, second) -> np.ndarray:
    """How unlike the modes of two points are, shape (first, second), from 0 to about 2.5."""
    (a, x), (b, y) = first, second
    size = max(np.abs(a).max(), np.abs(b).max(), 1e-300)
    near = np.abs(a[:, None] - b[None, :])
    near = near / (np.abs(a)[:, None] + np.abs(b)[None, :] + 1e-3 * size)
    overlap = np.abs(x.conj().T @ y)
    norms = np.linalg.norm(x, axis=0)[:, None] * np.linalg.norm(y, axis=0)[None, :]
    likeness = overlap / np.maximum(norms, 1e-300)
    # A complex mode cannot have become a real one without another that met it.
    kind = 0.5 * ((a.imag == 0)[:, None] != (b.imag == 0)[None, :])
    return near + (1.0 - likeness) + kind
