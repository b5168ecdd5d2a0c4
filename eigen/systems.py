"""Stacks of dense complex systems."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la


def solved(matrices: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solutions of systems, and logarithms of their determinants, from one factorisation each.

    Parameters
    ----------
    matrices : (k, n, n) complex array
        Overwritten.
    right : (n, m) array
        The same for all.

    Returns
    -------
    solutions : (k, n, m) complex array
    logarithms : (k,) complex array
        Both NaN where a matrix is singular.
    """
    right = np.asarray(right, complex)
    factor, solve = la.get_lapack_funcs(("getrf", "getrs"), (matrices, right))
    solutions = np.full((len(matrices), *right.shape), complex(np.nan, np.nan))
    logarithms = np.full(len(matrices), complex(np.nan, np.nan))
    for i, matrix in enumerate(matrices):
        # of the transpose, whose columns lie in memory as the rows of the matrix
        lu, pivots, singular = factor(matrix.T, overwrite_a=True)
        if singular > 0:
            continue
        solutions[i] = solve(lu, pivots, right, trans=1)[0]
        swaps = np.count_nonzero(pivots != np.arange(len(pivots)))
        logarithms[i] = np.log(lu.diagonal()).sum() + 1j * np.pi * swaps
    return solutions, logarithms
