"""The determinant of a full pencil along a line, relative to a structure known to be stable.

det T(s) / det D_ref(s) with D_ref = s^2 M + s C_ref + K_ref, where M, C_ref, K_ref are
symmetric and positive definite, so that D_ref has no zero on or right of the line (Kelvin,
Tait, Chetaev). The ratio has no pole there and tends to a known power of s at infinity; its
zeros right of the line are the eigenvalues counted, the structure's own among them.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .condensation import condensed_matrix
from .factorization import SingularShiftError, StructureMatrices, SuperluFactorization, is_positive_definite, superlu
from .pencil import CoupledPencil, real_apply


class Determinant:
    """log det T(s) - log det D_ref(s) of a pencil, dense or sparse.

    Parameters
    ----------
    pencil : CoupledPencil
    line : float
        Growth rate; the reference is stable to the right of it.

    Attributes
    ----------
    degree : int or None
        The ratio grows like leading * s**degree; None if the leading coefficient vanishes.
    leading_phase : float
        0 or pi.
    evaluations : int

    Raises
    ------
    ValueError
        If M is not symmetric and positive definite.
    """

    dense_below = 400

    def __init__(self, pencil: CoupledPencil, line: float = 0.0):
        self.pencil, self.line = pencil, line
        self.evaluations = 0
        self._dense = pencil.n <= self.dense_below
        if abs(pencil.M - pencil.M.T).max() > 1e-10 * abs(pencil.M).max():
            raise ValueError("The count needs a symmetric mass matrix.")
        if not is_positive_definite(pencil.M):
            raise ValueError("The count needs a positive definite mass matrix.")
        self._prepare_reference()
        self._scale = None
        self.degree, self.leading_phase = self._at_infinity()

    def _prepare_reference(self):
        p, g = self.pencil, self.line
        # (g + z)^2 M + (g + z) C + K = z^2 M + z (C + 2 g M) + (K + g C + g^2 M)
        damping = (p.C + 2 * g * p.M).tocsr()
        stiffness = (p.K + g * p.C + g * g * p.M).tocsr()
        symmetric = [((x + x.T) * 0.5).tocsr() for x in (damping, stiffness)]
        unit = abs(p.M).max()
        shifts = []
        for part in symmetric:
            size = max(abs(part).max() / unit, 1e-300) if part.nnz else 1.0
            candidates = np.concatenate([[0.0], size * 10.0 ** np.arange(-8, 5)])
            for shift in candidates:
                if is_positive_definite(part + shift * p.M):
                    shifts.append(shift)
                    break
            else:
                raise ValueError("No stable reference structure was found for the count.")
        self._reference = tuple((part + shift * p.M).tocsr() for part, shift in zip(symmetric, shifts))
        difference = max(_gap(damping, self._reference[0]), _gap(stiffness, self._reference[1]))
        self.structure_is_reference = difference < 1e-14
        if self._dense:
            self._parts = [x.toarray() for x in (p.M, p.C, p.K, *self._reference)]
            self._G, self._J = p.G.toarray(), p.J.toarray()
            return
        self._structure = StructureMatrices(p)
        self._factor = SuperluFactorization(self._structure)
        if not self.structure_is_reference:
            twin = CoupledPencil(M=p.M, C=self._reference[0], K=self._reference[1])
            self._twin = StructureMatrices(twin)
            self._twin_factor = SuperluFactorization(self._twin)

    def _at_infinity(self):
        p = self.pencil
        if self._dense:
            H = self._J @ la.solve(self._parts[0], self._G, assume_a="pos")
        else:
            H = p.J @ superlu(sp.csc_matrix(p.M)).solve(p.G.toarray())
        grows = (p.B1 != 0).any(axis=0) | (p.S1 != 0).any(axis=0)
        leading = condensed_matrix(
            np.zeros_like(p.A0), np.where(grows, p.B1, p.B0), np.zeros_like(p.R0), np.where(grows, p.S1, p.S0), H
        )
        m = p.m
        if leading.size:
            leading[:m, :m] -= p.A2 @ H
            leading[m:, :m] = p.R2 @ H
        if not leading.size:
            return 0, 0.0
        size = np.abs(leading).max(axis=1)
        if (size == 0).any():
            return None, 0.0
        leading = leading / size[:, None]
        columns = np.abs(leading).max(axis=0)
        if (columns == 0).any():
            return None, 0.0
        leading = leading / columns
        if np.linalg.cond(leading) > 1e12:
            return None, 0.0
        return int(grows.sum()), 0.0 if np.linalg.slogdet(leading)[0] > 0 else np.pi

    def reference_zeros(self) -> np.ndarray:
        """Eigenvalues of the reference in the upper half-plane, relative to the line.

        All of them for a dense pencil; none are computed for a sparse one.
        """
        if not self._dense:
            return np.zeros(0, complex)
        M, _, _, C, K = self._parts
        n = M.shape[0]
        form = np.block(
            [[np.zeros((n, n)), np.eye(n)], [-la.solve(M, K, assume_a="pos"), -la.solve(M, C, assume_a="pos")]]
        )
        values = la.eigvals(form)
        return values[values.imag > 0]

    def __call__(self, z: complex) -> complex:
        """log |ratio| + i arg ratio at line + z; the argument is known modulo 2 pi.

        NaN where the structure is singular to the last bit.
        """
        self.evaluations += 1
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", la.LinAlgWarning)
            try:
                return self._evaluate(complex(z))
            except SingularShiftError:
                return complex(np.nan, np.nan)

    def _evaluate(self, z):
        p, s = self.pencil, self.line + z
        if self._dense:
            M, C, K, Cr, Kr = self._parts
            lu = la.lu_factor(s * s * M + s * C + K, check_finite=False)
            H = self._J @ la.lu_solve(lu, self._G, check_finite=False)
            total = 0.0
            if not self.structure_is_reference:
                total = _dense_log(lu) - _dense_log(la.lu_factor(z * z * M + z * Cr + Kr, check_finite=False))
        else:
            self._factor.refactor(self._structure.values(s).astype(complex))
            H = real_apply(p.J, self._factor.solve(p.G.toarray().astype(complex)))
            total = 0.0
            if not self.structure_is_reference:
                self._twin_factor.refactor(self._twin.values(z).astype(complex))
                total = self._factor.log_determinant() - self._twin_factor.log_determinant()
        small = condensed_matrix(*p.fluid_at(s), H)
        if small.size:
            if self._scale is None:  # constant positive factors leave the phase alone
                size = np.abs(small).max(axis=1)
                self._scale = np.where(size > 0, size, 1.0)
            sign, size = np.linalg.slogdet(small / self._scale[:, None])
            total = total + complex(size, np.angle(sign))
        return complex(total)


def _dense_log(lu) -> complex:
    factor, pivots = lu
    diagonal = np.diagonal(factor)
    swaps = int(np.sum(pivots != np.arange(pivots.size)))
    return complex(np.log(np.abs(diagonal)).sum(), np.angle(diagonal).sum() + np.pi * (swaps % 2))


def _gap(a, b) -> float:
    size = max(abs(a).max(), abs(b).max()) if a.nnz or b.nnz else 0.0
    return float(abs(a - b).max() / size) if size else 0.0
