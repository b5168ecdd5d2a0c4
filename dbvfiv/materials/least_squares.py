"""Linear least squares under constraints: unknowns that are not negative, constants of a stable rubber."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear, nnls

from dbvfiv.materials.law import MaterialError

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


LEAST_MARGIN = 0.01
_MAX_CUTS = 200
#: Distance of the states looked at, in equivalent strain.
_SPACING = 0.05


def states_within(reach: float) -> np.ndarray:
    """Principal logarithmic strains (k, 3) that fill the ball of an equivalent strain.

    Raises
    ------
    MaterialError
        For a reach that is not positive and finite.
    """
    if not 0.0 < reach < np.inf:
        raise MaterialError(f"stable_to must be a strain greater than 0, but {np.expm1(reach):.6g} was given.")
    radius = reach * np.linspace(0.0, 1.0, max(21, int(np.ceil(reach / _SPACING)) + 1))
    angle = np.linspace(0.0, np.pi / 3.0, 25)
    rays = np.stack([np.cos(angle - k * 2.0 * np.pi / 3.0) for k in range(3)], axis=-1)
    return (radius[:, None, None] * rays).reshape(-1, 3)


def stable_constants(matrix, target, free, moduli, reach: float) -> np.ndarray:
    """Least squares under Hill's inequality with a margin, by cutting planes.

    Each Hill modulus less the margin is the least eigenvalue of a matrix that is linear in the constants, so an
    eigenvector of a negative one gives a linear inequality that the answer must fulfil.

    Parameters
    ----------
    matrix, target : numpy.ndarray, shapes (n, terms), (n,)
    free : numpy.ndarray, shape (terms,)
        The answer without the constraint.
    moduli : numpy.ndarray, shape (states, terms, 5, 5)
        Hill moduli per unit of each unknown; the first state is that at rest.
    reach : float
        Equivalent strain, for the message.
    """
    moduli = moduli - LEAST_MARGIN * moduli[0, :, :1, :1] * np.eye(5)
    answer, cuts = free, np.zeros((0, free.size))
    size = np.linalg.norm(free)
    for _ in range(_MAX_CUTS):
        values, vectors = np.linalg.eigh(np.tensordot(moduli, answer, axes=([1], [0])))
        worst = np.argsort(values[:, 0])[:3]
        normals = np.einsum("sa,skab,sb->sk", vectors[worst, :, 0], moduli[worst], vectors[worst, :, 0])
        violated = values[worst, 0] < -1e-9 * size * np.linalg.norm(normals, axis=1)
        if not violated.any():
            return answer
        cuts = np.vstack([cuts, normals[violated] / np.linalg.norm(normals[violated], axis=1)[:, None]])
        answer = _least_squares_above(matrix, target, cuts)
    raise MaterialError(
        f"No stable constants were found within {_MAX_CUTS} rounds for strains up to {np.expm1(reach):.3g}; try a "
        "smaller stable_to or fewer terms."
    )


def _least_squares_above(matrix, target, normals) -> np.ndarray:
    """Least squares with ``normals @ x >= 0``, as a dual non-negative problem (Lawson & Hanson, ch. 23)."""
    q, r = np.linalg.qr(matrix)
    centre = q.T @ target
    reduced = np.linalg.solve(r.T, normals.T).T  # normals R^-1
    weights = nonnegative(reduced.T, -centre)  # nearest point of a cone, by its polar
    return np.linalg.solve(r, centre + reduced.T @ weights)
