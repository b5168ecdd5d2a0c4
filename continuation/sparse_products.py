"""Products with sparse matrices that are sums of a few, other ones at each sample: entries are summed as they are used.

Reading few matrices once, in single precision, and summing them where they are used takes half the time of reading one
for each sample, which is bound by memory.
"""

from __future__ import annotations

import numba
import numpy as np

#: Matrices that are summed at once: the number of them is filled up to a multiple of this with zeros.
TOGETHER = 4
#: Samples that are taken at once: likewise.
LANES = 8


def padded(array: np.ndarray, axis: int, multiple: int) -> np.ndarray:
    """An array with zeros behind it, so that its length is a multiple of a number.

    Examples
    --------
    >>> padded(np.ones((1, 3)), 1, 4).tolist()
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
