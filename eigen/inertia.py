"""How many eigenvalues of symmetric sums of a structure's matrices are negative, without computing any (Sylvester).

The sums share one pattern. MUMPS factors its upper half as L D L^T and counts the signs of D; where PETSc computes with
complex numbers, SuperLU does with pivots from the diagonal.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .factorization import SingularShiftError, StructureMatrices, petsc_is_complex


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


class SymmetricFactor:
    """L D L^T of a symmetric matrix by MUMPS through PETSc; a context manager, at whose end PETSc lets go of it.

    Parameters
    ----------
    upper : (n, n) sparse matrix in compressed rows
        Its upper half, diagonal included, with sorted indices.

    Attributes
    ----------
    negative : int
        Number of negative eigenvalues.

    Raises
    ------
    SingularShiftError
        If a pivot is zero.
    """

    def __init__(self, upper: sp.csr_matrix):
        from petsc4py import PETSc

        indices = (upper.indptr.astype(PETSc.IntType), upper.indices.astype(PETSc.IntType))
        self._size = upper.shape[0]
        matrix = PETSc.Mat().createSBAIJ(upper.shape, 1, csr=(*indices, upper.data), comm=PETSc.COMM_SELF)
        matrix.assemble()
        solver = PETSc.KSP().create(comm=PETSc.COMM_SELF)
        solver.setType("preonly")
        solver.setOperators(matrix)
        pc = solver.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        self._factor = pc.getFactorMatrix()
        self._factor.setMumpsIcntl(13, 1)  # without this the signs of the last front are not counted
        self._factor.setMumpsIcntl(14, 50)
        solver.setUp()
        vectors = (PETSc.Vec().createWithArray(np.zeros(self._size), comm=PETSc.COMM_SELF) for _ in range(2))
        self._right, self._out = vectors
        self._held = [self._right, self._out, self._factor, pc, solver, matrix]
        failure = self._factor.getMumpsInfog(1)
        if failure < 0:
            self.__exit__()
            raise SingularShiftError(f"MUMPS could not factor the symmetric matrix (INFOG(1) = {failure}).")
        self.negative = self._factor.getMumpsInfog(12)

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solution for one right-hand side, shape (n,)."""
        self._right.array[:] = b
        self._factor.solve(self._right, self._out)
        return self._out.array.copy()

    def __enter__(self) -> SymmetricFactor:
        return self

    def __exit__(self, *_error) -> None:
        for item in self._held:
            item.destroy()
        self._held = []


class _DiagonalFactor(SymmetricLU):
    """The same by SuperLU."""

    def __init__(self, upper: sp.csr_matrix):
        super().__init__(_mirrored(upper))

    def __enter__(self) -> _DiagonalFactor:
        return self

    def __exit__(self, *_error) -> None:
        pass


class SymmetricStructure:
    """Symmetric parts of M, C, K and what relaxes of a structure.

    Parameters
    ----------
    matrices : StructureMatrices
        Loaded with the structure.

    Attributes
    ----------
    relaxation : Relaxation
    size : int
        Number n of unknowns.
    mass, slow : (3 + g,) arrays
        Weights of M alone and of K alone.
    """

    def __init__(self, matrices: StructureMatrices):
        upper, mirrored, self._indptr, self._indices = matrices.upper
        self.size, self.relaxation = matrices.shape[0], matrices.relaxation
        self._data = 0.5 * (matrices.data[:, upper] + matrices.data[:, mirrored])
        self.mass, _, self.slow = np.eye(3, len(self._data))

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

    def factored(self, weights: np.ndarray) -> SymmetricFactor | _DiagonalFactor:
        """A sum, factored.

        Raises
        ------
        SingularShiftError
        """
        return (_DiagonalFactor if petsc_is_complex() else SymmetricFactor)(self.upper(weights))

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
