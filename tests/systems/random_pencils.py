"""Random pencils small enough for a dense solution of the first-order form."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from eigen import CoupledPencil


def random_pencil(
    rng, n, m, b, *, added_mass=True, damping="general", unsymmetric=True, scale=1.0, algebraic=False, density=None
) -> CoupledPencil:
    """A random pencil; with `density` its structure is sparse.

    Parameters
    ----------
    damping : {"general", "positive", "none", "mass"}
    scale : float
        Of the fluid's pressures.
    algebraic : bool
        S1 = 0: the inner unknowns have no dynamics of their own.
    """

    def normal(*shape):
        return rng.standard_normal(shape)

    def matrix():
        if density is None:
            return normal(n, n)
        return sp.random(n, n, density, random_state=rng, data_rvs=rng.standard_normal).toarray()

    root = matrix()
    M = root @ root.T / n + np.eye(n)
    low = matrix()
    C = {
        "general": 0.1 * matrix(),
        "positive": 0.02 * (low @ low.T) + 0.01 * np.eye(n),
        "none": np.zeros((n, n)),
        "mass": 0.01 * M,
    }[damping]
    K = np.diag(10 ** rng.uniform(-1, 2, n)) + (0.3 * matrix() if unsymmetric else 0)
    parts = {"M": M, "C": C, "K": K}
    if m:
        parts |= {
            "G": normal(n, m),
            "J": normal(m, n),
            "A0": scale * normal(m, m),
            "A1": scale * normal(m, m),
            "B0": scale * normal(m, b),
            "B1": scale * normal(m, b),
            "R0": normal(b, m),
            "R1": normal(b, m),
            "S0": normal(b, b),
        }
        if added_mass:
            parts |= {"A2": 0.3 * scale * normal(m, m), "R2": 0.1 * normal(b, m)}
        if not algebraic:
            parts |= {"S1": normal(b, b)}
    return CoupledPencil(**parts)


def dense_eigenvalues(pencil: CoupledPencil) -> np.ndarray:
    """All finite eigenvalues of the plain first-order form."""
    F, E = pencil.first_order()
    if pencil.order > 200:  # QZ would take long; E is regular in the larger systems
        return la.eigvals(la.solve(E, F))
    alpha, beta = la.eig(F, E, homogeneous_eigvals=True)[0]
    finite = np.abs(beta) > 1e-11 * np.abs(alpha)
    return alpha[finite] / beta[finite]


def leading_of(values: np.ndarray, count: int) -> np.ndarray:
    """Leading eigenvalues of the upper half-plane, by growth rate."""
    upper = values[values.imag >= -1e-9 * np.abs(values)]
    return upper[np.argsort(-upper.real)][:count]
