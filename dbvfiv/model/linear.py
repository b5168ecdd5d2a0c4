"""Sparse direct solves of the coupled tangent K - G D J without ever forming its dense part.

The pressures couple every row of the mesh to the rows upstream, so K - G D J would be full. Keeping row areas y and
station pressures p as unknowns

    [ K   0  -G   0 ] [q]   [r]
    [-J   I   0   0 ] [y] = [0]
    [ 0  -D   I  -B ] [p]   [0]
    [ 0   R   0   S ] [u]   [s]

gives the same q with a sparse matrix hardly larger than K. The last row and column are there if the fluid has unknowns
of its own.
"""

from __future__ import annotations

import weakref
from functools import cache

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc


@cache
def direct_solver() -> str:
    """Name of the best LU package of this PETSc: MUMPS, SuperLU, UMFPACK or its own."""
    probe = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=PETSc.COMM_SELF)
    probe.setValue(0, 0, 1.0)
    probe.assemble()
    for name in ("mumps", "superlu", "umfpack", "petsc"):
        try:
            solver = PETSc.PC().create(PETSc.COMM_SELF)
            solver.setType("lu")
            solver.setFactorSolverType(name)
            solver.setOperators(probe)
            solver.setUp()
        except PETSc.Error:
            continue
        return name
    raise RuntimeError("This PETSc offers no LU factorisation.")


class DirectFactor:
    """LU factors of a matrix of fixed pattern; the symbolic analysis is done once.

    Parameters
    ----------
    indptr, indices : int32 arrays
        CSR pattern. Values are handed to `refactor` in the same order.
    """

    def __init__(self, indptr: np.ndarray, indices: np.ndarray):
        self.size = len(indptr) - 1
        self._data = np.zeros(len(indices), PETSc.ScalarType)  # real numbers, whatever PETSc's scalars
        indptr, indices = np.ascontiguousarray(indptr, PETSc.IntType), np.ascontiguousarray(indices, PETSc.IntType)
        self._matrix = PETSc.Mat().createAIJWithArrays(
            (self.size, self.size), (indptr, indices, self._data), comm=PETSc.COMM_SELF
        )
        self._keep = (indptr, indices)
        self._solver = PETSc.KSP().create(PETSc.COMM_SELF)
        self._solver.setType("preonly")
        self._solver.setOperators(self._matrix)
        self._pc = self._solver.getPC()
        self._pc.setType("lu")
        self._pc.setFactorSolverType(direct_solver())
        self._rhs, self._solution = self._matrix.createVecs()
        self.factorisations = 0
        # PETSc keeps what Python lets go of, factors included, until it is told; runs that start afresh often would
        # fill the memory
        release = weakref.finalize(self, _release, self._pc, self._solver, self._matrix, self._rhs, self._solution)
        release.atexit = False

    @property
    def values(self) -> np.ndarray:
        """Matrix values to fill before `refactor`."""
        return self._data

    def refactor(self) -> None:
        """Factor the present values.

        Raises
        ------
        SingularMatrix
            If the values are not finite or the matrix is singular to working precision.
        """
        if not np.isfinite(self._data).all():
            raise SingularMatrix("The tangent holds numbers that are not finite.")
        self._matrix.assemble()
        self._solver.setOperators(self._matrix)
        try:
            self._solver.setUp()
            # a broken-down factorisation shows in the first solve only, whatever the package
            self._rhs.set(1.0)
            self._solver.solve(self._rhs, self._solution)
        except PETSc.Error as error:
            raise SingularMatrix("The tangent is singular.") from error
        if self._solver.getConvergedReason() < 0:
            raise SingularMatrix("The tangent is singular.")
        self.factorisations += 1

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        self._rhs.setArray(rhs)
        self._pc.apply(self._rhs, self._solution)
        return np.array(self._solution.getArray().real)

    def solve_transpose(self, rhs: np.ndarray) -> np.ndarray:
        self._rhs.setArray(rhs)
        self._pc.applyTranspose(self._rhs, self._solution)
        return np.array(self._solution.getArray().real)


def _release(*objects: PETSc.Object) -> None:
    for item in objects:
        item.destroy()


class SingularMatrix(ArithmeticError):
    """A factorisation broke down."""


class CoupledFactor:
    """Factors of K - G D J, bordered by the fluid's own unknowns if there are any.

    Parameters
    ----------
    k, g, j : sparse matrices
        Patterns of K (n, n), G (n, m) and J (m, n); their values are ignored. A case without flow has m = 0 columns.
    inner : int
        Number l of the fluid's own unknowns u.
    """

    def __init__(self, k: sp.csr_matrix, g: sp.csr_matrix, j: sp.csr_matrix, inner: int = 0):
        n, m = g.shape
        inner = inner if m else 0
        self.size, self.stations, self.inner = n, m, inner
        counts = np.array([k.nnz, g.nnz, j.nnz, m, m * m, m, m * inner, inner * m, inner * inner])
        offsets = np.concatenate([[0], np.cumsum(counts)])
        number = [np.arange(a + 1, b + 1, dtype=float) for a, b in zip(offsets[:-1], offsets[1:])]

        def numbered(pattern, values):
            return sp.csr_matrix((values, pattern.indices, pattern.indptr), shape=pattern.shape)

        def dense(values, rows, columns):
            return sp.csr_matrix(values.reshape(rows, columns))

        if m:
            blocks = [
                [numbered(k, number[0]), None, numbered(g, number[1])],
                [numbered(j, number[2]), sp.diags(number[3]), None],
                [None, dense(number[4], m, m), sp.diags(number[5])],
            ]
            if inner:
                blocks = [row + [None] for row in blocks] + [
                    [None, dense(number[7], inner, m), None, dense(number[8], inner, inner)]
                ]
                blocks[2][3] = dense(number[6], m, inner)
            whole = sp.bmat(blocks, format="csr")
        else:
            whole = numbered(k, number[0])
        whole.sort_indices()
        self._source = whole.data.astype(np.int64) - 1
        self._values = np.ones(offsets[-1])
        self._parts = [slice(a, b) for a, b in zip(offsets[:-1], offsets[1:])]
        self._factor = DirectFactor(whole.indptr, whole.indices)
        self._padded = np.zeros(n + 2 * m + inner)

    @property
    def factorisations(self) -> int:
        return self._factor.factorisations

    def refactor(self, k: np.ndarray, g: np.ndarray, j: np.ndarray, d: np.ndarray, b=None, r=None, s=None) -> None:
        """Factor for values of K, G and J on their patterns and the dense D (m, m), B (m, l), R (l, m) and S (l, l)."""
        kk, gg, jj, one, dd, last, bb, rr, ss = self._parts
        values = self._values
        values[kk], values[gg], values[jj], values[dd] = k, -g, -j, -d.ravel()
        if self.inner:
            values[bb], values[rr], values[ss] = -np.ravel(b), np.ravel(r), np.ravel(s)
        self._factor.values[:] = values[self._source]
        self._factor.refactor()

    def solve(self, rhs: np.ndarray) -> np.ndarray:
        """Solution (n,) for a right-hand side (n,), nothing on the fluid's own equations."""
        self._padded[:] = 0.0
        self._padded[: self.size] = rhs
        return self._factor.solve(self._padded)[: self.size]

    def solve_with_inner(self, rhs: np.ndarray, inner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solution (n,) and fluid unknowns (l,) for right-hand sides r (n,) and s (l,)."""
        self._padded[:] = 0.0
        self._padded[: self.size] = rhs
        self._padded[len(self._padded) - self.inner :] = inner
        solution = self._factor.solve(self._padded)
        return solution[: self.size], solution[len(solution) - self.inner :]

    def solve_transpose(self, rhs: np.ndarray) -> np.ndarray:
        self._padded[:] = 0.0
        self._padded[: self.size] = rhs
        return self._factor.solve_transpose(self._padded)[: self.size]
