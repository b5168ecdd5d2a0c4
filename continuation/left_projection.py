"""What a linearisation about a periodic motion gives on a basis, roughly and at a fraction of its cost.

Preconditioners with two levels need V^T A x of full vectors x for a small basis V. Matrices at the samples are sums of
a few, A_i = sum w_ik A_k, so that V^T A_k, held in single precision, serve all samples in one dense product.
"""

from __future__ import annotations

import numpy as np

from continuation.blocks import SparseBlocks
from continuation.periodic import PeriodicOperator, ReducedOperator, Term


class LeftProjection:
    """V^T A of an operator whose terms are all blocks.

    Parameters
    ----------
    operator : PeriodicOperator
    basis : (n, r) array
    reduced : ReducedOperator
        Projection on the basis.
    known : LeftProjection, optional
        That on the first columns of the basis.
    """

    def __init__(
        self,
        operator: PeriodicOperator,
        basis: np.ndarray,
        reduced: ReducedOperator,
        known: LeftProjection | None = None,
    ):
        self._motion, self._rates = operator.motion, operator.rates()
        pairs = list(zip(operator.terms, reduced.terms))
        # terms through few numbers are cheap as they are
        self._narrow = [Term(small.middle, right=t.right, outer=t.outer) for t, small in pairs if t.right is not None]
        self._parts, stacks, old = [], [], 0 if known is None else known._stack.shape[1]
        added = np.ascontiguousarray(basis[:, old:])
        for term in (t for t in operator.terms if t.right is None):
            for function, blocks in term.middle:
                count = None if known is None else known._parts[len(self._parts)][2].shape[1]
                weights, stack = _rows(blocks, added, count)
                self._parts.append((term.outer, function, weights))
                stacks.append(stack)
        stack = np.concatenate(stacks)
        self._stack = stack if known is None else np.concatenate([known._stack, stack], axis=1)

    def apply(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (2 H + 1, r) for real ones (2 H + 1, n) of a change of the motion."""
        h, rates = self._motion.harmonics, self._rates
        size = np.abs(coefficients).max() or 1.0  # single precision has a short range
        flat = self._stack.reshape(-1, coefficients.shape[1]) @ (coefficients.T / size).astype(np.float32)
        products = size * np.moveaxis(flat.reshape(*self._stack.shape[:2], h.size), 2, 0).astype(float)
        total, begin = np.zeros((h.samples, self._stack.shape[1])), 0
        for outer, function, weights in self._parts:
            part = h.evaluate(products[:, begin : begin + weights.shape[1]])
            begin += weights.shape[1]
            total += rates.apply(outer, np.einsum("ik,ikr->ir", weights, rates.apply(function, part)))
        if self._narrow:
            samples = h.evaluate(coefficients)
            total = total + sum(term.apply(samples, rates) for term in self._narrow)
        return h.project(total)


def _rows(blocks, basis: np.ndarray, count: int | None) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(blocks, SparseBlocks):
        return blocks.left_projected(basis, count)
    return np.eye(len(blocks)), np.array([basis.T @ block for block in blocks], np.float32)
