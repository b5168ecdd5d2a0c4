"""Least squares with unknowns that are not negative."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear, nnls

#: Steps for each unknown: data that unknowns meet to rounding take more than the three of the library.
STEPS = 50


def nonnegative(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Unknowns x >= 0, (n,), of the least ||A x - b||, for A (m, n) and b (m,).

    The active-set method of Lawson and Hanson; where rounding makes it go round in circles, that of Stark and Parker.
    """
    try:
        return nnls(matrix, target, maxiter=STEPS * matrix.shape[1])[0]
    except RuntimeError:
        return lsq_linear(matrix, target, (0.0, np.inf), method="bvls", tol=1e-15).x
