"""What a linearisation about a periodic motion gives on a basis, roughly and at a fraction of its cost.

Preconditioners with two levels need V^T A x of full vectors x for a small basis V. Matrices at the samples are sums of
a few, A_i = sum w_ik A_k, so that V^T A_k, held in single precision, serve all samples in one dense product.
"""

from __future__ import annotations

import numpy as np

from continuation.periodic import PeriodicOperator, ReducedOperator, Term


class LeftProjection:
    """V^T A of an operator whose terms are all blocks.

    Parameters
    ----------
    operator : PeriodicOperator
    reduced : ReducedOperator
        Projection on the basis, with its rough rows.
    """

    def __init__(self, operator: PeriodicOperator, reduced: ReducedOperator):
        self._motion, self._rates = operator.motion, operator.rates()
        # terms through few numbers are cheap as they are
        self._narrow = [
            Term([(f, small.left @ blocks) for f, blocks in t.middle], right=t.right, outer=t.outer)
            for t, small in zip(operator.terms, reduced.terms)
            if t.narrow
        ]
        rates, size = self._rates, self._motion.harmonics.size
        self._parts = []
        for (outer, function, blocks), between in zip(reduced.parts, reduced.between_harmonics):
            if blocks.rows is not None:
                weights = rates.matrix(outer) @ between[: len(blocks.rows)] @ rates.matrix(function)
                self._parts.append((weights.transpose(1, 0, 2).reshape(size, -1), blocks.rows))

    def apply(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (2 H + 1, r) for real ones (2 H + 1, n) of a change of the motion."""
        size = np.abs(coefficients).max() or 1.0  # single precision has a short range
        columns = np.ascontiguousarray((coefficients / size).T, np.float32)
        total = 0.0
        for weights, rows in self._parts:
            products = (rows.reshape(-1, rows.shape[2]) @ columns).reshape(*rows.shape[:2], -1)
            products = products.transpose(0, 2, 1).reshape(-1, rows.shape[1]).astype(float)
            total = total + weights @ products
        total = size * total
        if self._narrow:
            h = self._motion.harmonics
            samples = h.evaluate(coefficients)
            total = total + h.project(sum(term.apply(samples, self._rates) for term in self._narrow))
        return total
