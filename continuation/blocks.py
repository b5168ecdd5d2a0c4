"""Matrices at the samples of a period, as sums of few: sparse ones of one pattern, and their dense projections.

``A_i = sum_k w_ik A_k``: the matrices of a linearisation about a smooth motion are combinations of a few.  Reading few
matrices once, in single precision, and summing entries where they are used takes half the time of reading one for each
sample, which is bound by memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numba
import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from continuation.harmonics import Harmonics

#: Matrices that are summed at once: the number of them is filled up to a multiple of this with zeros.
TOGETHER = 4
#: Samples that are taken at once: likewise.
LANES = 8
#: Size over the largest of combinations of small dense matrices that are rounding.
ROUNDING = 1e-15


def pad_to_multiple(array: np.ndarray, axis: int, multiple: int) -> np.ndarray:
    """Fill an array up with zeros, so that its length is a multiple of a number.

    Examples
    --------
    >>> pad_to_multiple(np.ones((1, 3)), 1, 4).tolist()
    [[1.0, 1.0, 1.0, 0.0]]
    """
    missing = -array.shape[axis] % multiple
    return np.pad(array, [(0, missing if k == axis else 0) for k in range(array.ndim)])


@numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")
def add_products(indptr, indices, values, weights, x, out):
    """Add to out (n, v, N) the products of sum_k weights[k, t] B_k with x (m, v, N) at each sample t.

    values (nnz, k) holds entries of the B_k, weights (k, N), of one type; k is a multiple of `TOGETHER`.
    """
    count, samples = weights.shape
    entry = np.empty(samples, values.dtype)
    for i in range(len(indptr) - 1):
        for p in range(indptr[i], indptr[i + 1]):
            j = indices[p]
            a, b, c, d = values[p, 0], values[p, 1], values[p, 2], values[p, 3]
            for t in range(samples):
                entry[t] = a * weights[0, t] + b * weights[1, t] + c * weights[2, t] + d * weights[3, t]
            for k in range(4, count, 4):
                a, b, c, d = values[p, k], values[p, k + 1], values[p, k + 2], values[p, k + 3]
                for t in range(samples):
                    entry[t] += (
                        a * weights[k, t] + b * weights[k + 1, t] + c * weights[k + 2, t] + d * weights[k + 3, t]
                    )
            for v in range(x.shape[1]):
                for t in range(samples):
                    out[i, v, t] += entry[t] * x[j, v, t]


@numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")
def add_products_of_one(indptr, indices, values, weights, x, out):
    """`add_products` with one matrix, k = 1."""
    samples = weights.shape[1]
    total = np.empty(samples)
    for i in range(len(indptr) - 1):
        for v in range(x.shape[1]):
            total[:] = 0.0
            for p in range(indptr[i], indptr[i + 1]):
                a, j = values[p, 0], indices[p]
                for t in range(samples):
                    total[t] += a * x[j, v, t]
            for t in range(samples):
                out[i, v, t] += weights[0, t] * total[t]


class DenseBlocks:
    """N matrices that are sums of a few.

    Parameters
    ----------
    weights : (N, k) array
    parts : (k, r, r) array
    rows : (k', r, n) array, optional
        V^T A of the first of the full matrices that these are projections of, in single precision.
    """

    def __init__(self, weights: np.ndarray, parts: np.ndarray, rows: np.ndarray | None = None):
        self.weights, self.parts, self.rows = weights, parts, rows

    @classmethod
    def of_stack(cls, stack: np.ndarray, rows: np.ndarray | None = None, tolerance: float = ROUNDING) -> DenseBlocks:
        """Combinations of matrices (N, r, r) above a share of the largest; there are at most r^2."""
        weights, sizes, parts = la.svd(stack.reshape(len(stack), -1), full_matrices=False)
        kept = sizes >= tolerance * sizes[0]
        parts, weights = (sizes[:, None] * parts)[kept].reshape(-1, *stack.shape[1:]), weights[:, kept]
        rows = None if rows is None else np.tensordot(weights.T, rows, 1).astype(rows.dtype)
        return cls(np.ascontiguousarray(weights), parts, rows)

    @cached_property
    def stack(self) -> np.ndarray:
        """(N, r, r)."""
        return np.tensordot(self.weights, self.parts, 1)

    def __len__(self) -> int:
        return len(self.weights)

    def between_harmonics(self, h: Harmonics) -> np.ndarray:
        """(k, 2 H + 1, 2 H + 1): what the weight of each part makes of coefficients."""
        return np.matmul(h.basis.T, self.weights.T[:, :, None] * h.basis) / h.samples


#: Size over the largest of those combinations of the matrices that are left out.
LEFT_OUT = 1e-6
#: Type of entries in products: rounding is below what is left out.
SINGLE = np.float32
#: The same of rough projections, which prepare corrections: an error there costs a part of an iteration.
ROUGH = 1e-4


class BlockRows:
    """Values of N matrices of one pattern as they come; entries that are zero in all of them are not kept.

    Parameters
    ----------
    count : int
        N.
    used : (k,) array of int, optional
        Numbers of entries that are kept, which others join where they are not zero; those of the first matrix without.

    Examples
    --------
    >>> rows = BlockRows(2)
    >>> for row in ([0.0, 1.0, 0.0], [0.0, 2.0, 3.0]):
    ...     rows.put(np.array(row))
    >>> rows.used.tolist(), rows.values.tolist(), rows.mean.tolist()
    ([1, 2], [[1.0, 0.0], [2.0, 3.0]], [0.0, 1.5, 1.5])
    """

    def __init__(self, count: int, used: np.ndarray | None = None):
        self._count, self._done, self.used = count, 0, used

    def put(self, row: np.ndarray) -> None:
        """Take the values (nnz,) of the next matrix."""
        if not self._done:
            self._size = len(row)
            self._use(np.flatnonzero(row) if self.used is None else self.used)
        if len(self._unused) and np.take(row, self._unused, out=self._beside, mode="clip").any():
            known, values = self.used, self.values
            self._use(np.union1d(known, np.flatnonzero(row)))
            self.values[: self._done] = 0.0
            self.values[: self._done, np.searchsorted(self.used, known)] = values[: self._done]
        if len(self._unused):
            np.take(row, self.used, out=self.values[self._done], mode="clip")
        else:
            self.values[self._done] = row
        self._done += 1

    def _use(self, used: np.ndarray) -> None:
        #: (k,) numbers of the entries that are kept.
        self.used = used
        unused = np.ones(self._size, bool)
        unused[used] = False
        self._unused = np.flatnonzero(unused)
        self._beside = np.empty(len(self._unused))  # new memory costs more than what is done with it
        #: (N, k)
        self.values = np.empty((self._count, len(used)))

    @property
    def mean(self) -> np.ndarray:
        """(nnz,) mean of all matrices."""
        total = np.zeros(self._size)
        total[self.used] = self.values[: self._done].mean(axis=0)
        return total


class SparseBlocks:
    """N matrices that share a sparsity pattern, kept as sums of the few of their combinations that count.

    Parameters
    ----------
    values : (M, nnz) array or BlockRows
        Of M matrices that they are sums of: themselves without `spread`.
    indices, indptr : arrays
        Of the rows, as `scipy.sparse.csr_matrix` has them.
    shape : (int, int)
    share : float
        Weight of these matrices beside others that they are added to: the smaller it is, the more of them is left out.
    spread : (N, M) array, optional
        Weights of those in these.

    Attributes
    ----------
    weights : (N, k) array
    values : (k, nnz) array
        Combinations, by decreasing size.

    Examples
    --------
    >>> blocks = SparseBlocks(np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([0, 1]), np.array([0, 1, 2]), (2, 2))
    >>> blocks.times(np.array([[1.0, 1.0], [1.0, -1.0]])).round(12).tolist()
    [[1.0, 2.0], [3.0, -4.0]]
    >>> blocks.projected(np.array([[1.0], [1.0]])).stack.ravel().round(12).tolist()
    [3.0, 7.0]
    """

    def __init__(
        self,
        values: np.ndarray | BlockRows,
        indices: np.ndarray,
        indptr: np.ndarray,
        shape,
        share: float = 1.0,
        spread: np.ndarray | None = None,
    ):
        if isinstance(values, BlockRows):
            indptr = np.searchsorted(values.used, indptr).astype(indptr.dtype)
            indices, values = indices[values.used], values.values
        self._pattern, self.shape = (indices, indptr), tuple(shape)
        sizes, vectors = np.linalg.eigh(values @ values.T)
        sizes, vectors = np.sqrt(np.maximum(sizes[::-1], 0.0)), vectors[:, ::-1]
        least = min(LEFT_OUT / max(share, 1e-300), 1.0)
        kept = max(int(np.sum(sizes >= least * sizes[0])), 1) if LEFT_OUT else len(sizes)
        combinations = np.ascontiguousarray(vectors[:, :kept])
        self.weights = combinations if spread is None else spread @ combinations
        self.values = combinations.T @ values
        self._rough = max(int(np.sum(sizes[:kept] >= min(ROUGH, 1.0) * sizes[0])), 1)
        self._entries = self._lanes = None

    def __len__(self) -> int:
        return len(self.weights)

    def _in_turn(self):
        """Yield the combinations; one matrix whose data change, for it is dear to make."""
        matrix = sp.csr_matrix((self.values[0], *self._pattern), shape=self.shape, copy=False)
        for row in self.values:
            matrix.data = row
            yield matrix

    def add_to(self, out: np.ndarray, x: np.ndarray) -> None:
        """Add to samples (n, v, N') the products with samples (m, v, N') of v real motions, N' being N filled up to a
        multiple of `LANES`.
        """
        if self._entries is None:
            multiple = TOGETHER if len(self.values) > 1 else 1
            self._entries = np.ascontiguousarray(pad_to_multiple(self.values, 0, multiple).T, SINGLE)
            self._lanes = pad_to_multiple(
                pad_to_multiple(np.ascontiguousarray(self.weights.T, SINGLE), 0, multiple), 1, LANES
            )
        indices, indptr = self._pattern
        add = add_products if len(self._lanes) > 1 else add_products_of_one
        add(indptr, indices, self._entries, self._lanes, x, out)

    def times(self, samples: np.ndarray) -> np.ndarray:
        """Products (N, n) or (N, n, k) with as many vectors, or some each, real or complex."""
        if np.iscomplexobj(samples):
            return self.times(samples.real) + 1j * self.times(samples.imag)
        x = np.moveaxis(samples.reshape(*samples.shape[:2], -1), 0, 2)
        x = pad_to_multiple(np.ascontiguousarray(x), 2, LANES)
        out = np.zeros((self.shape[0], *x.shape[1:]))
        self.add_to(out, x)
        return np.moveaxis(out[..., : len(samples)], 2, 0).reshape(len(samples), -1, *samples.shape[2:])

    def projected(self, basis: np.ndarray, known: DenseBlocks | None = None, rough: bool = False) -> DenseBlocks:
        """V^T A V for a basis V (n, r); `known` is that of its first columns. With `rough`, V^T A of the combinations
        that count most as well.
        """
        old = 0 if known is None else known.parts.shape[1]
        added, size, count = np.ascontiguousarray(basis[:, old:]), basis.shape[1], len(self.values)
        parts, rows = np.empty((count, size, size)), []
        if old:
            parts[:, :old, :old] = known.parts
        for k, matrix in enumerate(self._in_turn()):
            row = (matrix.T @ added).T
            parts[k, old:] = row @ basis
            if old:
                parts[k, :old, old:] = basis[:, :old].T @ (matrix @ added)
            if rough and k < self._rough:
                rows.append(row.astype(np.float32))
        stack = np.array(rows) if rough else None
        if old and rough:
            stack = np.concatenate([known.rows, stack], axis=1)
        return DenseBlocks(self.weights, parts, stack)


def sum_of_products(h: Harmonics, blocks: Sequence[SparseBlocks], motions: Sequence[np.ndarray]) -> np.ndarray:
    """Coefficients (v, 2 H + 1, n) of the sum of matrices times real motions (v, 2 H + 1, m), one set for each."""
    lanes, count = pad_to_multiple(h.basis, 0, LANES), len(motions[0])
    out = np.zeros((blocks[0].shape[0], count, len(lanes)))
    x = np.empty((blocks[0].shape[1], count, len(lanes)))
    last = None
    for one, coefficients in zip(blocks, motions):
        if coefficients is not last:
            for v in range(count):
                x[:, v] = coefficients[v].T @ lanes.T
        last = coefficients
        one.add_to(out, x)
    return np.array([lanes.T @ out[:, v].T for v in range(count)]) / h.samples
