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

import numpy as np
import scipy.sparse as sp

from eigen.factor import DirectFactor


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
        return self.solve_with_inner(rhs)[0]

    def solve_with_inner(self, rhs: np.ndarray, inner: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Solution (n,) and fluid unknowns (l,) for right-hand sides r (n,) and s (l,), zero where it is not given; or
        columns of them.
        """
        solution = self._factor.solve(self._padded(rhs, inner))
        return solution[: self.size], solution[len(solution) - self.inner :]

    def solve_transposed(self, rhs: np.ndarray) -> np.ndarray:
        return self._factor.solve_transposed(self._padded(rhs))[: self.size]

    def _padded(self, rhs: np.ndarray, inner: np.ndarray | None = None) -> np.ndarray:
        """Right-hand sides of the whole matrix, nothing on rows that are not given."""
        padded = np.zeros((self._factor.size, *rhs.shape[1:]))
        padded[: self.size] = rhs
        if inner is not None:
            padded[len(padded) - self.inner :] = inner
        return padded
