"""How well a pair satisfies the full pencil, and Newton's method for one that does not."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse.linalg as spla

from .condensation import Workspace
from .factorization import SingularShiftError
from .pencil import CoupledPencil, real_apply

ROUNDING = 64 * np.finfo(float).eps


class Residuals:
    """Residuals of pairs of one pencil.

    Parameters
    ----------
    pencil : CoupledPencil
    """

    def __init__(self, pencil: CoupledPencil):
        self.pencil = pencil

    @cached_property
    def _norms(self):
        p = self.pencil
        coupling = _norm(p.G) * _norm(p.J)
        return {
            "M": _norm(p.M),
            "C": _norm(p.C),
            "K": _norm(p.K),
            "relaxing": [_norm(matrix) for matrix in p.relaxing],
            "A": [coupling * np.linalg.norm(a) for a in (p.A0, p.A1, p.A2)],
            "B": [_norm(p.G) * np.linalg.norm(a) for a in (p.B0, p.B1)],
        }

    @cached_property
    def _fluid_rows(self):
        # per row: rows of the fluid may carry different units
        p = self.pencil
        J = _norm(p.J)
        return (
            [J * np.linalg.norm(a, axis=1) for a in (p.R0, p.R1, p.R2)],
            [np.linalg.norm(a, axis=1) for a in (p.S0, p.S1)],
        )

    def measure(self, eigenvalues, q, u) -> tuple[np.ndarray, np.ndarray]:
        """Residual and backward error of pairs, as `Spectrum` defines them.

        Parameters
        ----------
        eigenvalues : array, shape (k,)
        q, u : arrays, shapes (n, k) and (b, k)

        Returns
        -------
        residual, backward_error : ndarray, shape (k,)
        """
        s = np.asarray(eigenvalues)
        if not s.size:
            return np.zeros(0), np.zeros(0)
        structure, fluid = self.pencil.terms(s, q, u)
        left = np.linalg.norm(sum(structure), axis=0)
        terms = sum(np.linalg.norm(t, axis=0) for t in structure)
        a = np.abs(s)
        size_q, size_u = np.linalg.norm(q, axis=0), np.linalg.norm(u, axis=0)
        n = self._norms
        stiffness = n["K"]
        if self.pencil.relaxation is not None:
            stiffness = stiffness + np.array(n["relaxing"]) @ np.abs(self.pencil.relaxation.factors(s))
        full = (a**2 * n["M"] + a * n["C"] + stiffness + sum(a**k * x for k, x in enumerate(n["A"]))) * size_q + sum(
            a**k * x for k, x in enumerate(n["B"])
        ) * size_u
        residual, backward = _ratio(left, terms), _ratio(left, full)
        if self.pencil.b:
            R, S = self._fluid_rows
            scale = (
                sum(np.outer(r, a**k) for k, r in enumerate(R)) * size_q
                + sum(np.outer(r, a**k) for k, r in enumerate(S)) * size_u
            )
            fluid_error = _ratio(np.abs(sum(fluid)), scale).max(axis=0)
            residual, backward = np.maximum(residual, fluid_error), np.maximum(backward, fluid_error)
        return residual, backward


def balanced(pencil: CoupledPencil, eigenvalues, q, u) -> np.ndarray:
    """Inner unknowns that satisfy the rows of the fluid exactly, U = -S^-1 R J q.

    Where a stiff structure leaves more rounding error in q than in the few rows of the fluid.
    Pairs for which S is nearly singular (motions of the fluid alone) keep theirs.
    """
    u = np.array(u, complex)
    y = real_apply(pencil.J, q)
    for j, s in enumerate(eigenvalues):
        _, _, R, S = pencil.fluid_at(s)
        if np.linalg.cond(S) < 1e8:
            u[:, j] = -np.linalg.solve(S, R @ y[:, j])
    return u


def preferable(residual, backward, old_residual, old_backward):
    """Whether a pair is better than the one before: closer, or at rounding level at last."""
    return (residual < old_residual) & ((backward <= ROUNDING) | (old_backward > ROUNDING)) | (
        (backward <= ROUNDING) & (old_backward > ROUNDING)
    )


def acceptable(residual, backward_error, tolerance) -> np.ndarray:
    """Pairs below the tolerance, or as good as rounding allows."""
    return (residual <= tolerance) | (backward_error <= ROUNDING)


def newton(pencil: CoupledPencil, eigenvalue: complex, q, u, *, workspace: Workspace, tolerance: float, steps: int = 4):
    """Improve one pair by inverse iteration on the full pencil, with a new LU each step.

    Solves T(l) y = T'(l) x and takes l - (c^H x)/(c^H y), x = y / (c^H y).

    Returns
    -------
    eigenvalue, q, u, residual, backward_error
        The best pair seen; it may still miss the tolerance.
    """
    residuals = Residuals(pencil)
    real = complex(eigenvalue).imag == 0.0

    def scaled(l, q, u):
        size = np.linalg.norm(q) or np.linalg.norm(u) or 1.0
        q, u = q / size, u / size
        r, e = residuals.measure(np.array([l]), q[:, None], u[:, None])
        plain = l, q, u, float(r[0]), float(e[0])
        if r[0] <= 0.1 * tolerance or not u.size:
            return plain
        other = balanced(pencil, [l], q[:, None], u[:, None])
        r, e = residuals.measure(np.array([l]), q[:, None], other)
        return (l, q, other[:, 0], float(r[0]), float(e[0])) if preferable(r, e, plain[3], plain[4])[0] else plain

    best = scaled(eigenvalue, np.asarray(q, complex), np.asarray(u, complex))
    current = best
    for _ in range(steps):
        if acceptable(best[3], best[4], 0.01 * tolerance):
            break
        l, q, u = current[:3]
        shifted = factored_beside(pencil, l.real if real else l, workspace)
        if shifted is None:
            break
        l = shifted.shift  # the place of the factor, not the eigenvalue itself
        f, g = derivative_times(pencil, l, q, u)
        y, w = shifted.solve(f, g)
        along = np.vdot(q, y) + np.vdot(u, w)
        if not np.isfinite(along) or along == 0:
            break
        l = l - (np.vdot(q, q) + np.vdot(u, u)) / along
        current = scaled(complex(l.real) if real else l, y, w)
        if not np.isfinite(current[3]):
            break
        if preferable(current[3], current[4], best[3], best[4]):
            best = current
    return best


def factored_beside(pencil: CoupledPencil, eigenvalue, workspace: Workspace):
    """T factored a little beside an eigenvalue, so that inverse iteration contracts fast.

    Returns None if no such place was found.
    """
    for nudge in (1e-8, 1e-6, 1e-4):
        try:
            return workspace.shifted(pencil, eigenvalue * (1 + nudge) if eigenvalue else nudge)
        except SingularShiftError:
            continue
    return None


def derivative_times(pencil: CoupledPencil, s: complex, q, u):
    """T'(s) x for one vector, or columns with their own s; shapes as (q, u)."""
    y = real_apply(pencil.J, q)
    f = (
        2 * s * real_apply(pencil.M, q)
        + real_apply(pencil.C, q)
        - real_apply(pencil.G, pencil.A1 @ y + 2 * s * (pencil.A2 @ y) + pencil.B1 @ u)
    )
    if pencil.relaxation is not None:
        f = f + sum(x * real_apply(m, q) for x, m in zip(pencil.relaxation.slopes(s), pencil.relaxing))
    g = pencil.R1 @ y + 2 * s * (pencil.R2 @ y) + pencil.S1 @ u
    return f, g


def _norm(matrix) -> float:
    if 0 in matrix.shape or matrix.nnz == 0:
        return 0.0
    return float(np.sqrt(spla.norm(matrix, 1) * spla.norm(matrix, np.inf)))


def _ratio(a, b):
    return a / np.where(b > 0, b, 1.0)
