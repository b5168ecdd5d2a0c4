"""Eigenvalues of ``A x = lambda B x`` near a point, and modes of neighbouring points matched.

Dense QZ serves small systems, shift-invert Arnoldi others; any callable
``(u, mu, count, near) -> Spectrum`` may take their place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse.linalg as spla
from scipy.optimize import linear_sum_assignment

#: Up to this order a dense generalised eigenvalue solve is the quicker and safer way.
DENSE_LIMIT = 300
#: Imaginary part over size below which an eigenvalue is real.
REAL = 1e-9


@dataclass(frozen=True, repr=False)
class Spectrum:
    """Eigenvalues, some of them, of ``A x = lambda B x``.

    Attributes
    ----------
    values : ndarray, complex, shape (m,)
        Eigenvalues; of a conjugate pair both, or either one.
    vectors : ndarray, complex, shape (n, m)
        Right eigenvectors, in columns.
    converged : ndarray of bool, shape (m,)
        Which pairs met the tolerance; the others are never used.
    iterations : int
        Work done, for the record.
    """

    values: np.ndarray
    vectors: np.ndarray
    converged: np.ndarray
    iterations: int = 0

    def __repr__(self) -> str:
        count, leading = len(self.values), max(np.real(self.values), default=np.nan)
        return f"<Spectrum: {count} eigenvalues, {np.sum(self.converged)} converged, growth rates up to {leading:.6g}>"

    def upper_half(self) -> tuple[np.ndarray, np.ndarray]:
        """Converged values with non-negative imaginary part, one of each pair, by growth rate."""
        keep = np.asarray(self.converged, bool) & np.isfinite(self.values)
        values = np.asarray(self.values, complex)[keep]
        vectors = np.asarray(self.vectors, complex)[:, keep]
        flip = values.imag < 0
        values = np.where(flip, values.conj(), values)
        vectors = np.where(flip, vectors.conj(), vectors)
        # Solvers leave rounding in the imaginary part of a real eigenvalue.
        scale = np.maximum(np.abs(values), REAL)
        values = np.where(np.abs(values.imag) <= REAL * scale, values.real, values)
        order = np.argsort(-values.real, kind="stable")
        values, vectors, flip = values[order], vectors[:, order], flip[order]
        chosen: list[int] = []
        for i, value in enumerate(values):
            # Only a value that came from the lower half can be the partner of an upper one.
            partner = any(abs(value - values[j]) <= 1e-6 * max(1.0, abs(value)) and flip[i] != flip[j] for j in chosen)
            if value.imag == 0.0 or not partner:
                chosen.append(i)
        return values[chosen], vectors[:, chosen]


def dense_spectrum(linearisation, count=None, near=None) -> Spectrum:
    """All finite eigenvalues by QZ, the first ``count`` leading or nearest to ``near``."""
    a, b = linearisation.to_dense()
    identity = np.array_equal(b, np.eye(b.shape[0]))
    values, vectors = sla.eig(a) if identity else sla.eig(a, b)
    # A singular mass gives infinite eigenvalues: algebraic constraints, not motions.
    size = max(np.abs(a).max(), 1e-300) / max(np.abs(b).max(), 1e-300)
    finite = np.isfinite(values) & (np.abs(values) < 1e12 * size)
    values, vectors = values[finite], vectors[:, finite]
    key = -values.real if near is None else np.abs(values - near)
    order = np.argsort(key, kind="stable")[: count if count else None]
    return Spectrum(values[order], vectors[:, order], np.ones(order.size, bool), 1)


def shift_invert_spectrum(linearisation, count, near=0.0) -> Spectrum:
    """``count`` eigenvalues nearest to ``near`` by ARPACK on ``(A - near B)^-1 B``. Raises ValueError: ``count`` is too
    large for the iteration.
    """
    n = linearisation.size
    if count > n - 2:
        raise ValueError(f"{count} eigenvalues were asked of a system of {n}; at most {n - 2}.")
    solver = linearisation.shifted(near)
    applied = 0

    def apply(x):
        nonlocal applied
        applied += 1
        return solver.solve(linearisation.mass_matvec(np.asarray(x).ravel()))

    operator = spla.LinearOperator((n, n), matvec=apply, dtype=complex)
    start = np.cos(np.arange(1.0, n + 1.0)).astype(complex)
    size = min(n - 1, max(2 * count + 1, 20))
    try:
        theta, vectors = spla.eigs(operator, k=count, which="LM", v0=start, ncv=size, tol=1e-10)
    except spla.ArpackNoConvergence as error:
        theta, vectors = error.eigenvalues, error.eigenvectors
    if theta.size == 0:
        return Spectrum(np.empty(0, complex), np.empty((n, 0), complex), np.empty(0, bool), applied)
    values = near + 1.0 / theta
    converged = np.empty(values.size, bool)
    for i, value in enumerate(values):
        x = vectors[:, i]
        ax, bx = linearisation.matvec(x), linearisation.mass_matvec(x)
        size = np.linalg.norm(ax) + abs(value) * np.linalg.norm(bx)
        converged[i] = np.linalg.norm(ax - value * bx) <= 1e-6 * max(size, 1e-300)
    order = np.argsort(np.abs(values - near), kind="stable")
    return Spectrum(values[order], vectors[:, order], converged[order], applied)


def compute_spectrum(linearisation, count, near=None) -> Spectrum:
    """Dense when the matrices are small and at hand, shift-invert Arnoldi otherwise.

    Without ``near`` the iteration looks around 0: right for a loss of stability at low
    frequency, and to be replaced by a better callable when the spectrum is wide.
    """
    if hasattr(linearisation, "to_dense") and linearisation.size <= DENSE_LIMIT:
        return dense_spectrum(linearisation, count, near)
    return shift_invert_spectrum(linearisation, count, 0.0 if near is None else near)


def count_unstable(values) -> int:
    """Unstable eigenvalues, given one of each conjugate pair."""
    return int(sum((2 if value.imag > 0 else 1) for value in values if value.real > 0))


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
    """Dissimilarity of the modes of two points, shape (first, second), from 0 to about 2.5."""
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
