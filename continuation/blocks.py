"""Sparse matrices of one pattern, one for each sample of a period, as linearisations about motions have them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import scipy.sparse as sp

#: Size over the largest of those combinations of the matrices that projections leave out.
LEFT_OUT = 1e-6
#: The same of rough projections, which prepare corrections: an error there costs a part of an iteration.
ROUGH = 1e-4


class SparseBlocks:
    """N matrices that share a sparsity pattern; entries that are zero in all of them are not kept.

    Parameters
    ----------
    values : (N, nnz) array
    indices, indptr : arrays
        Of the rows, as `scipy.sparse.csr_matrix` has them.
    shape : (int, int)
    share : float
        Size of these matrices over that of others that they are added to: projections leave out the more of them, the
        smaller it is.

    Examples
    --------
    >>> blocks = SparseBlocks(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0, 1]), np.array([0, 1, 2]), (2, 2))
    >>> [block.toarray().tolist() for block in blocks]
    [[[1.0, 0.0], [0.0, 2.0]], [[3.0, 0.0], [0.0, 4.0]]]
    >>> blocks.times(np.array([[1.0, 1.0], [1.0, -1.0]])).tolist()
    [[1.0, 2.0], [3.0, -4.0]]
    >>> blocks.projected(np.array([[1.0], [1.0]])).ravel().round(12).tolist()
    [3.0, 7.0]
    """

    def __init__(self, values: np.ndarray, indices: np.ndarray, indptr: np.ndarray, shape, share: float = 1.0):
        used = values.any(axis=0)
        if not used.all():
            before = np.concatenate([[0], np.cumsum(used)])
            values, indices = np.take(values, np.flatnonzero(used), axis=1), indices[used]
            indptr = before[indptr].astype(indices.dtype)
        self.values, self._pattern, self.shape, self.share = values, (indices, indptr), shape, share

    def _matrix(self, values: np.ndarray) -> sp.csr_matrix:
        return sp.csr_matrix((values, *self._pattern), shape=self.shape, copy=False)

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[sp.csr_matrix]:
        return (self._matrix(row) for row in self.values)

    def _in_turn(self, rows: np.ndarray) -> Iterator[sp.csr_matrix]:
        """Matrices of values (k, nnz); one that changes, for it is dear to make."""
        matrix = self._matrix(rows[0])
        for row in rows:
            matrix.data = row
            yield matrix

    def times(self, samples: np.ndarray) -> np.ndarray:
        """Products (N, n) or (N, n, k) with as many vectors, or some each, real or complex."""
        if np.iscomplexobj(samples):
            flat = np.ascontiguousarray(samples).reshape(*samples.shape[:2], -1)
            return self.times(flat.view(float)).view(complex).reshape(len(samples), -1, *samples.shape[2:])
        return np.stack([matrix @ x for matrix, x in zip(self._in_turn(self.values), samples)])

    @cached_property
    def _combined(self) -> tuple[np.ndarray, np.ndarray]:
        """Weights (N, k) and values (k, nnz) of k matrices that the N are sums of: those of their singular vectors that
        count, by decreasing size.
        """
        sizes, vectors = np.linalg.eigh(self.values @ self.values.T)
        sizes, vectors = sizes[::-1], vectors[:, ::-1]
        least = min(LEFT_OUT / max(self.share, 1e-300), 1.0)
        kept = sizes >= least**2 * sizes[0] if LEFT_OUT else np.ones(len(sizes), bool)
        weights = np.ascontiguousarray(vectors[:, kept])
        return weights, weights.T @ self.values

    def left_projected(self, basis: np.ndarray, count: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Weights (N, k) and single-precision stack (k, r, n) of which V^T A for a basis V (n, r) are sums, roughly: of
        as many matrices as asked for, or as count.
        """
        weights, values = self._combined
        if count is None:
            sizes = np.linalg.norm(values, axis=1)
            count = int(np.sum(sizes >= min(ROUGH / max(self.share, 1e-300), 1.0) * sizes[0]))
        rows = [(matrix.T @ basis).T for matrix in self._in_turn(values[:count])]
        return weights[:, :count], np.array(rows, np.float32)

    def projected(self, basis: np.ndarray, known: np.ndarray | None = None) -> np.ndarray:
        """V^T A V (N, r, r) for a basis V (n, r); `known` is that of its first columns."""
        weights, values = self._combined
        size, old = basis.shape[1], 0 if known is None else known.shape[1]
        small = np.empty((len(values), size, size))
        if old:
            small[:, :old, :old] = np.tensordot(weights.T, known, 1)
        added = np.ascontiguousarray(basis[:, old:])
        for one, matrix in zip(small, self._in_turn(values)):
            one[:, old:] = basis.T @ (matrix @ added)
            if old:
                one[old:, :old] = (matrix.T @ added).T @ basis[:, :old]
        return np.tensordot(weights, small, 1)
