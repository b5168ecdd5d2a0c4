"""Small dense matrices, one for each sample of a period: projections of a linearisation about a motion."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la

from continuation.harmonics import Harmonics


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
    def of_stack(cls, stack: np.ndarray, rows: np.ndarray | None = None, tolerance: float = 0.0) -> DenseBlocks:
        """Of the matrices (N, r, r) themselves, or of those of their combinations above a share of the largest."""
        if not tolerance:
            return cls(np.eye(len(stack)), stack, rows)
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
