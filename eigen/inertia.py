"""How many eigenvalues of symmetric sums of a structure's matrices are negative, without computing any (Sylvester).

The sums share one pattern, whose symbolic analysis is kept. MUMPS factors them as L D L^T and counts the signs of D;
where PETSc computes with complex numbers, SuperLU does with pivots from the diagonal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .factorization import MumpsFactorization, SingularShiftError, StructureMatrices, petsc_is_complex
from .relaxation import Relaxation


class SymmetricLU:
    """SuperLU of a symmetric matrix with pivots from the diagonal only: their signs are its inertia (Sylvester).

    Raises
    ------
    SingularShiftError
        If a pivot is zero, or had to be taken from elsewhere.
    """

    def __init__(self, matrix: sp.spmatrix):
        matrix = sp.csc_matrix(matrix)
        size = np.abs(matrix.diagonal())
        self._scale = 1.0 / np.sqrt(np.where(size > 0, size, 1.0))
        scale = sp.diags(self._scale)
        try:
            self._lu = spla.splu(
                (scale @ matrix @ scale).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularShiftError(f"SuperLU could not factor the matrix ({error}).") from error
        if not np.array_equal(self._lu.perm_r, self._lu.perm_c):
            raise SingularShiftError("A pivot of the symmetric matrix is zero.")
        #: Pivots of the matrix scaled to a diagonal of ones.
        self.pivots = self._lu.U.diagonal()

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(np.sum(self.pivots < 0))

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution for one right-hand side, shape (n,)."""
        return self._scale * self._lu.solve(self._scale * b)


class SymmetricFactor(MumpsFactorization):
    """L D L^T of symmetric matrices of one pattern by MUMPS through PETSc."""

    # without the second one the signs of the last front are not counted
    kind, controls = "cholesky", {14: 50, 13: 1}

    def refactor(self, values: np.ndarray) -> None:
        """Factor the matrix with these entries, both halves, on the pattern.

        Raises
        ------
        SingularShiftError
            If MUMPS meets a zero pivot.
        """
        self._matrix.setOption(self._petsc.Mat.Option.SYMMETRIC, True)
        super().refactor(values)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return self._factor.getMumpsInfog(12)


class SymmetricStructure:
    """Symmetric parts of M, C, K and what relaxes of a structure.

    Parameters
    ----------
    matrices : StructureMatrices
        Loaded with the structure.

    Attributes
    ----------
    matrices : StructureMatrices
        As given, loaded until another structure is.
    relaxation : Relaxation
    size : int
        Number n of unknowns.
    mass, slow : (3 + g,) arrays
        Weights of M alone and of K alone.
    """

    def __init__(self, matrices: StructureMatrices):
        self.matrices = matrices
        upper, mirrored, self._indptr, self._indices = matrices.upper
        self.size, self.relaxation = matrices.shape[0], matrices.relaxation
        self._data = np.array([0.5 * (part[upper] + part[mirrored]) for part in matrices.data])
        self.mass, _, self.slow = np.eye(3, len(self._data))

    def relaxing_as(self, relaxation: Relaxation) -> SymmetricStructure:
        """The same matrices under other strengths and times."""
        other = copy(self)
        other.relaxation = relaxation
        return other

    def at(self, s: float) -> np.ndarray:
        """Weights of M, C, K and the K_g in D(s) = s^2 M + s C + K + sum phi_g(s) K_g."""
        return np.array([s * s, s, 1.0, *self.relaxation.factors(s)])

    def slope(self, s: float) -> np.ndarray:
        """Weights of the parts in D'(s)."""
        return np.array([2.0 * s, 1.0, 0.0, *self.relaxation.slopes(s)])

    def stiffness(self, factors) -> np.ndarray:
        """Weights of K and of the K_g with factors."""
        return np.array([0.0, 0.0, 1.0, *factors])

    def upper(self, weights: np.ndarray) -> sp.csr_matrix:
        """Upper half of a sum."""
        return sp.csr_matrix((weights @ self._data, self._indices, self._indptr), (self.size, self.size))

    def full(self, weights: np.ndarray) -> sp.csr_matrix:
        """A sum."""
        return _mirrored(self.upper(weights)).tocsr()

    @contextmanager
    def factored(self, weights: np.ndarray) -> Iterator[SymmetricFactor | SymmetricLU]:
        """A sum, factored; the factor is valid in the context only.

        Raises
        ------
        SingularShiftError
        """
        if petsc_is_complex():
            yield SymmetricLU(_mirrored(self.upper(weights)))
            return
        idle = self.matrices.idle
        factor = idle.pop() if idle else SymmetricFactor(self.matrices)
        factor.refactor((weights @ self._data)[self.matrices.mirrored])
        try:
            yield factor
        finally:
            idle.append(factor)

    def acting(self, weights: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """A sum as a function of vectors, shape (n,) or (n, k)."""
        upper = self.upper(weights)
        lower, diagonal = upper.T, upper.diagonal()
        return lambda vectors: upper @ vectors + lower @ vectors - (diagonal * vectors.T).T

    def times(self, weights: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """A sum times vectors."""
        return self.acting(weights)(vectors)

    def on_space(self, motions: np.ndarray) -> np.ndarray:
        """The parts on a space, (3 + g, k, k): sums of them are those of the matrices."""
        units = np.eye(len(self._data))
        return np.array([motions.T @ self.times(unit, motions) for unit in units])


def _mirrored(upper: sp.csr_matrix):
    """A symmetric matrix by its upper half."""
    return upper + sp.triu(upper, 1).T


def is_positive_definite(matrix: sp.spmatrix) -> bool:
    """Whether a symmetric sparse matrix is positive definite, by its pivots."""
    if (matrix.diagonal() <= 0).any():
        return False
    try:
        return bool((SymmetricLU(matrix).pivots > 1e-13).all())
    except SingularShiftError:
        return False
