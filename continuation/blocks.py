"""Sparse matrices of one pattern, one for each sample of a period, as linearisations about motions have them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import scipy.sparse as sp

#: Size over the largest of those combinations of the matrices that projections leave out.
LEFT_OUT = 1e-6


class SparseBlocks:
    """N matrices that share a sparsity pattern.

    Parameters
    ----------
    values : (N, nnz) array
    indices, indptr : arrays
        Of the rows, as `scipy.sparse.csr_matrix` has them.
    shape : (int, int)

    Examples
    --------
    >>> blocks = SparseBlocks(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0, 1]), np.array([0, 1, 2]), (2, 2))
    >>> [block.toarray().tolist() for block in blocks]
    [[[1.0, 0.0], [0.0, 2.0]], [[3.0, 0.0], [0.0, 4.0]]]
    >>> blocks.projected(np.array([[1.0], [1.0]])).ravel().round(12).tolist()
    [3.0, 7.0]
    """

    def __init__(self, values: np.ndarray, indices: np.ndarray, indptr: np.ndarray, shape: tuple[int, int]):
        self.values, self._pattern, self.shape = values, (indices, indptr), shape
        self._matrices = [self._matrix(row) for row in values]

    def _matrix(self, values: np.ndarray) -> sp.csr_matrix:
        return sp.csr_matrix((values, *self._pattern), shape=self.shape, copy=False)

    def __len__(self) -> int:
        return len(self._matrices)

    def __iter__(self) -> Iterator[sp.csr_matrix]:
        return iter(self._matrices)

    @cached_property
    def _combined(self) -> tuple[np.ndarray, list[sp.csr_matrix]]:
        """Weights (N, k) and k matrices that the N are sums of: those of their singular vectors that count."""
        sizes, vectors = np.linalg.eigh(self.values @ self.values.T)
        kept = sizes >= LEFT_OUT**2 * sizes[-1] if LEFT_OUT else np.ones(len(sizes), bool)
        weights = np.ascontiguousarray(vectors[:, kept])
        return weights, [self._matrix(row) for row in weights.T @ self.values]

    def projected(self, basis: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
        """V^T A V (N, r, r) for a basis V (n, r); `known` is that of its first columns."""
        weights, matrices = self._combined
        size, old = basis.shape[1], 0 if known is None else known.shape[1]
        small = np.empty((len(matrices), size, size))
        if old:
            small[:, :old, :old] = np.tensordot(weights.T, known, 1)
        added = np.ascontiguousarray(basis[:, old:])
        for one, matrix in zip(small, matrices):
            one[:, old:] = basis.T @ (matrix @ added)
            if old:
                one[old:, :old] = (matrix.T @ added).T @ basis[:, :old]
        return np.tensordot(weights, small, 1)
