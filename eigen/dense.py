"""All eigenvalues of a small pencil."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from .operator import CoupledPencil


def all_pairs(pencil: CoupledPencil, *, left: bool):
    """Finite eigenpairs of the first-order form, conjugates given once.

    Returns
    -------
    eigenvalues : ndarray, shape (k,)
        Imaginary part >= 0.
    q, u : ndarray
        Right vectors.
    w, W : ndarray or None
        Left vectors of the polynomial, w^H T = 0.
    """
    F, E, unit, row, col = _scaled(pencil)
    n = pencil.n
    inner = slice(2 * n, 2 * n + pencil.b)
    values, right, conjugate_left = _standard(F, E, left)
    if values is None:
        values, right, conjugate_left = _general(F, E, left)
    keep = values.imag >= 0
    values, x = values[keep] * unit, right[:, keep] * col[:, None]
    if not left:
        return values, x[:n], x[inner], None, None
    z = conjugate_left[:, keep] * row[:, None]
    return values, x[:n], x[inner], z[n : 2 * n], z[inner]


def all_eigenvalues(pencil: CoupledPencil) -> np.ndarray:
    """Finite eigenvalues without vectors, conjugates given once; several times as fast."""
    F, E, unit, _, _ = _scaled(pencil)
    getrf, getrs, gecon = la.get_lapack_funcs(("getrf", "getrs", "gecon"), (E,))
    lu, pivots, info = getrf(E)
    if info != 0 or gecon(lu, np.linalg.norm(E, 1))[0] < 1e-9:
        values = all_pairs(pencil, left=False)[0]
        return values
    values = la.eigvals(getrs(lu, pivots, F)[0], check_finite=False) * unit
    return values[values.imag >= 0]


def _scaled(pencil):
    """F, E in units of a typical frequency, rows equilibrated, and the scales."""
    F, E = pencil.first_order()
    n = pencil.n
    # else infinite eigenvalues are hard to tell
    unit = np.sqrt(_largest(pencil.K) / (_largest(pencil.M) or 1.0)) or 1.0
    col = np.ones(pencil.order)
    col[n : 2 * n] = unit
    F, E = F * col, E * (col * unit)
    size = np.maximum(np.abs(F).max(axis=1), np.abs(E).max(axis=1))
    row = 1.0 / np.where(size > 0, size, 1.0)
    return F * row[:, None], E * row[:, None], unit, row, col


def _standard(F, E, left):
    """Eigenpairs of E^-1 F where E is far from singular: twice as fast as QZ."""
    getrf, gecon = la.get_lapack_funcs(("getrf", "gecon"), (E,))
    *lu, info = getrf(E)
    if info != 0 or gecon(lu[0], np.linalg.norm(E, 1))[0] < 1e-9:
        return None, None, None
    matrix = la.lu_solve(lu, F, check_finite=False)
    if not left:
        values, right = la.eig(matrix, check_finite=False)
        return values, right, None
    values, below, right = la.eig(matrix, left=True, right=True, check_finite=False)
    # y^H E^-1 F = l y^H, hence z = E^-T y
    z = la.lu_solve(lu, below.real, trans=1, check_finite=False) + 1j * la.lu_solve(
        lu, below.imag, trans=1, check_finite=False
    )
    return values, right, z


def _general(F, E, left):
    (alpha, beta), below, right = la.eig(F, E, left=True, right=True, homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-13 * np.hypot(np.abs(alpha), np.abs(beta))
    return alpha[finite] / beta[finite], right[:, finite], below[:, finite] if left else None


def _largest(matrix) -> float:
    return float(np.abs(matrix.data).max(initial=0.0))
