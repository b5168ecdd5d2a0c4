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


class BlockRows:
    """Values of N matrices of one pattern as they come; entries that are zero in all of them are not kept.

    Parameters
    ----------
    count : int
        N.

    Examples
    --------
    >>> rows = BlockRows(2)
    >>> for row in ([0.0, 1.0, 0.0], [0.0, 2.0, 3.0]):
    ...     rows.put(np.array(row))
    >>> rows.used.tolist(), rows.values.tolist(), rows.mean.tolist()
    ([1, 2], [[1.0, 0.0], [2.0, 3.0]], [0.0, 1.5, 1.5])
    """

    def __init__(self, count: int):
        self._count, self._done = count, 0
        self._total = self._unused = None

    def put(self, row: np.ndarray) -> None:
        """Take the values (nnz,) of the next matrix."""
        if self._total is None:
            self._total = np.zeros(len(row))
            self._use(np.flatnonzero(row))
        elif np.take(row, self._unused, out=self._beside, mode="clip").any():
            known, values = self.used, self.values
            self._use(np.union1d(known, np.flatnonzero(row)))
            self.values[: self._done] = 0.0
            self.values[: self._done, np.searchsorted(self.used, known)] = values[: self._done]
        if len(self._unused):
            np.take(row, self.used, out=self.values[self._done], mode="clip")
        else:
            self.values[self._done] = row
        self._total += row
        self._done += 1

    def _use(self, used: np.ndarray) -> None:
        #: (k,) numbers of the entries that are kept.
        self.used = used
        self._unused = np.setdiff1d(np.arange(len(self._total)), used, assume_unique=True)
        self._beside = np.empty(len(self._unused))  # new memory costs more than what is done with it
        #: (N, k)
        self.values = np.empty((self._count, len(used)))

    @property
    def mean(self) -> np.ndarray:
        """(nnz,) mean of all matrices."""
        return self._total / self._done


class SparseBlocks:
    """N matrices that share a sparsity pattern.

    Parameters
    ----------
    values : (N, nnz) array or BlockRows
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

    def __init__(
        self, values: np.ndarray | BlockRows, indices: np.ndarray, indptr: np.ndarray, shape, share: float = 1.0
    ):
        if isinstance(values, BlockRows):
            indptr = np.searchsorted(values.used, indptr).astype(indptr.dtype)
            indices, values = indices[values.used], values.values
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
