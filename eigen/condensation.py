"""Solves with the full pencil T(sigma), the fluid condensed to a small dense matrix."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from .factorization import (
    MumpsFactorization,
    SingularShiftError,
    StructureMatrices,
    SuperluFactorization,
    petsc_is_complex,
)
from .full_rows import FullRows
from .pencil import CoupledPencil, real_apply


class Workspace:
    """Symbolic work that survives from pencil to pencil of one sparsity pattern.

    Hand the same workspace to every call for a family of pencils (a sweep, a path) and the
    pattern is analysed once.

    Examples
    --------
    >>> import numpy as np
    >>> pencil = CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, 4.0]))
    >>> shifted = Workspace().shifted(pencil, 0.5)
    >>> q, U = shifted.solve(np.ones(2), np.zeros(0))
    >>> np.allclose(q, [1 / 1.3, 1 / 4.3])
    True
    """

    def __init__(self):
        self._structure: StructureMatrices | None = None
        self._real: MumpsFactorization | None = None
        self._loaded: CoupledPencil | None = None

    def structure(self, pencil: CoupledPencil) -> StructureMatrices:
        """M, C, K and what relaxes of the pencil on the common pattern."""
        if self._loaded is pencil:
            return self._structure
        if self._structure is not None and (self._structure.fits(pencil) or self._structure.covers(pencil)):
            self._structure.load(pencil)
        else:
            self._structure = StructureMatrices(pencil)
            self._real = None
        self._loaded = pencil
        return self._structure

    def shifted(self, pencil: CoupledPencil, shift: complex) -> ShiftedPencil:
        """Factor the pencil at a shift.

        The factor of a real shift is valid until the next call with a real shift.

        Raises
        ------
        SingularShiftError
            If the shift is an eigenvalue to working precision.
        """
        return ShiftedPencil(pencil, self.structure(pencil), shift, self.factored(pencil, shift))

    def factored(self, pencil: CoupledPencil, shift: complex):
        """LU of the structure alone at a shift, shift^2 M + shift C + K and what relaxes.

        Raises
        ------
        SingularShiftError
            If a pivot is zero.
        """
        structure = self.structure(pencil)
        if complex(shift).imag == 0.0:
            if self._real is None:
                self._real = MumpsFactorization(structure)
            factor = self._real
        elif petsc_is_complex():
            factor = MumpsFactorization(structure)
        else:
            factor = SuperluFactorization(structure)
        factor.refactor(structure.values(shift))
        return factor


class ShiftedPencil:
    """T(sigma) of the full pencil, ready for solves; also with its transpose.

    Parameters
    ----------
    pencil : CoupledPencil
    structure : StructureMatrices
    shift : complex
    factor : object with solve, solve_transposed
        LU of the structure, sigma^2 M + sigma C + K and what relaxes.

    Attributes
    ----------
    motion, force : FullRows
        J and the transpose of G.

    Raises
    ------
    SingularShiftError
        If either the sparse or the condensed matrix is singular to working precision.
    """

    def __init__(self, pencil, structure, shift, factor):
        shift = complex(shift)
        self.pencil, self.factor = pencil, factor
        self.shift = shift.real if shift.imag == 0.0 else shift
        self.damping_shifted = structure.combine(self.shift, 1.0, 0.0)
        self._A, self._B, self._R, self._S = pencil.fluid_at(self.shift)
        self.motion, self.force = FullRows(pencil.J), FullRows(pencil.G.T)
        # m further right-hand sides, once
        self.response = factor.solve(pencil.G.toarray())
        self.transfer = self.motion @ self.response
        small = condensed_matrix(self._A, self._B, self._R, self._S, self.transfer)
        # rows and columns differ by powers of the fluid's density: equilibrate before pivoting
        self._row = _scale(small, 1)
        self._col = _scale(small * self._row[:, None], 0)
        self._small = None
        if small.shape[0]:
            scaled = small * self._row[:, None] * self._col
            self._small = la.lu_factor(scaled, check_finite=False)
            if not np.isfinite(scaled).all() or _reciprocal_condition(scaled, self._small) < 1e-14:
                raise SingularShiftError("The condensed fluid matrix is singular at the shift.")
        self._check()

    def solve(self, f: np.ndarray, g: np.ndarray):
        """Solve T(sigma) (q, U) = (f, g).

        Parameters
        ----------
        f : array, shape (n,) or (n, k)
        g : array, shape (b,) or (b, k)

        Returns
        -------
        q, U : arrays of the same shapes
        """
        q = self.factor.solve(f)
        if self._small is None:
            return q, np.array(g)
        y = self.motion @ q
        right = np.concatenate([self._A @ y, g - self._R @ y])
        unknown = _times(self._col, self._back(_times(self._row, right), 0))
        m = self._A.shape[0]
        return q + self.response @ unknown[:m], unknown[m:]

    def solve_transposed(self, f: np.ndarray, g: np.ndarray):
        """Solve T(sigma)^T (w, W) = (f, g); transposed, not conjugated."""
        if self._small is None:
            return self.factor.solve_transposed(f), np.array(g)
        m = self._A.shape[0]
        s = self.response.T @ f
        # h = A^T s + A^T H^T h - R^T W,  -B^T (s + H^T h) + S^T W = g: with h = small^T-solved
        # (z, W) of [I - A H, -B; R H, S]^T (z, W) = (s, g), h = A^T z - R^T W
        right = np.concatenate([s, g])
        unknown = _times(self._row, self._back(_times(self._col, right), 1))
        z, W = unknown[:m], unknown[m:]
        h = self._A.T @ z - self._R.T @ W
        return self.factor.solve_transposed(f + self.motion.transposed(h)), W

    def _back(self, right, transposed):
        if np.iscomplexobj(right) and not np.iscomplexobj(self._small[0]):
            return la.lu_solve(self._small, right.real, transposed, check_finite=False) + 1j * la.lu_solve(
                self._small, right.imag, transposed, check_finite=False
            )
        return la.lu_solve(self._small, right, transposed, check_finite=False)

    def _check(self):
        """Refuse a factor that does not solve: pivots lost to a shift on an eigenvalue."""
        n = self.pencil.n
        probe = np.cos(1.0 + np.arange(n) ** 1.5)
        q = self.factor.solve(probe)
        p, s = self.pencil, self.shift
        terms = [s * s * real_apply(p.M, q), s * real_apply(p.C, q), real_apply(p.K, q), *p.relaxed(s, q)]
        error = np.linalg.norm(sum(terms) - probe)
        size = np.linalg.norm(probe)
        # on an eigenvalue the right-hand side is lost in a solution blown up along the eigenvector
        if not error <= 1e-4 * size:
            raise SingularShiftError("The structural matrix is singular at the shift.")


def condensed_matrix(A, B, R, S, H) -> np.ndarray:
    """[I - A H, -B; R H, S], the full pencil condensed to (p, U), shape (..., m + b, m + b).

    Its determinant times that of the structure is the determinant of the full pencil; kept
    bordered, the fluid brings no poles of its own. Stacks of matrices give a stack.
    """
    m, b = B.shape[-2:]
    out = np.empty((*H.shape[:-2], m + b, m + b), np.result_type(A, B, R, S, H))
    out[..., :m, :m] = np.eye(m) - A @ H
    out[..., :m, m:] = -B
    out[..., m:, :m] = R @ H
    out[..., m:, m:] = S
    return out


def _scale(matrix, axis):
    largest = np.abs(matrix).max(axis=axis, initial=0.0)
    return 1.0 / np.where(largest > 0.0, largest, 1.0)


def _times(scale, x):
    return x * (scale if x.ndim == 1 else scale[:, None])


def _reciprocal_condition(matrix, lu):
    (gecon,) = la.get_lapack_funcs(("gecon",), (matrix,))
    return float(gecon(lu[0], np.linalg.norm(matrix, 1))[0])
