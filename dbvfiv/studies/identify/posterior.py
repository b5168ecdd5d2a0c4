"""Posterior of standard normal scores: samples by tempering, what they tell apart, and what a measurement would.

Samples go from the prior to the posterior in steps that raise the power of the likelihood, each resampled and moved by
random walks that leave it as it is (Del Moral, Doucet and Jasra, J. R. Stat. Soc. B 68, 2006, 411-436): several regions
of the posterior keep their weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..inputs import quasi_random

#: Share of samples that a step of the tempering leaves as equal ones.
EQUAL = 0.5
#: Moves after each step and after the last one, and acceptance that their size is led to.
MOVES, LAST, ACCEPTED = 30, 80, 0.25


def sample_posterior(
    log_likelihood: Callable[[np.ndarray], np.ndarray], dimension: int, count: int, seed: int
) -> tuple[np.ndarray, float]:
    """Scores (count, d) of the posterior, and the logarithm of the evidence.

    Parameters
    ----------
    log_likelihood : callable
        From scores (n, d) to (n,).
    dimension, count, seed : int
    """
    random = np.random.default_rng([seed, 2])
    z = quasi_random(count, dimension, seed)
    value, power, evidence, size = log_likelihood(z), 0.0, 0.0, 2.38 / np.sqrt(dimension)
    while power < 1.0:
        step = _next_step(value, 1.0 - power)
        log = step * value
        top = log.max()
        weight = np.exp(log - top)
        evidence += float(top + np.log(weight.mean()))
        power = min(power + step, 1.0)
        places = (random.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(weight) / weight.sum(), places), count - 1)
        z, value = z[chosen], value[chosen]
        for _ in range(MOVES if power < 1.0 else LAST):
            root = np.linalg.cholesky(np.cov(z.T).reshape(dimension, dimension) + 1e-12 * np.eye(dimension))
            # a wide and a narrow walk in turn: modes of different width both move
            near = size * np.exp(random.uniform(-1.5, 0.5, (count, 1)))
            trial = z + near * random.standard_normal(z.shape) @ root.T
            new = log_likelihood(trial)
            gain = power * (new - value) + 0.5 * ((z**2).sum(axis=1) - (trial**2).sum(axis=1))
            taken = np.log(random.random(count)) < gain
            z[taken], value[taken] = trial[taken], new[taken]
            size *= np.exp(np.clip(taken.mean() - ACCEPTED, -0.2, 0.2))
    return z, evidence


def _next_step(value: np.ndarray, most: float) -> float:
    """Largest step of the power after which a share `EQUAL` of the samples is left."""

    def is_small(step: float) -> bool:
        weight = np.exp(step * (value - value.max()))
        return weight.sum() ** 2 / (weight**2).sum() >= EQUAL * len(value)

    if is_small(most):
        return most
    low, high = -60.0, np.log(most)  # of the logarithm: likelihoods differ by many orders
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_small(np.exp(middle)) else (low, middle)
    return float(np.exp(low))


class Emulator:
    """Functions of coordinates, from values at some points: a linear trend and cubic radial functions, smoothed by as
    much as predicts each point best from the others.

    Parameters
    ----------
    points : (n, d) array
    values : (n, k) array

    Attributes
    ----------
    left : (n, k) array
        Errors of the prediction of each point from the others.
    """

    SMOOTHINGS = (0.0, 3.0, 30.0, 300.0, 3000.0)

    def __init__(self, points: np.ndarray, values: np.ndarray):
        self.points = points
        n, d = points.shape
        trend = np.column_stack([np.ones(n), points])
        distance = _cubes(points, points)
        best = np.full(values.shape[1], np.inf)
        self._radial, self._trend = np.zeros_like(values), np.zeros((d + 1, values.shape[1]))
        self.left = np.full(values.shape, np.inf)
        for smoothing in self.SMOOTHINGS:
            whole = np.block([[distance + (smoothing + 1e-8) * np.eye(n), trend], [trend.T, np.zeros((d + 1, d + 1))]])
            inverse = np.linalg.pinv(whole, rcond=1e-13)
            found = inverse[:, :n] @ values
            left = found[:n] / np.diag(inverse)[:n, None]
            score = np.mean(np.abs(left), axis=0)
            better = score < best
            best[better] = score[better]
            self._radial[:, better], self._trend[:, better] = found[:n, better], found[n:, better]
            self.left[:, better] = left[:, better]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Values (m, k) at points (m, d)."""
        return _cubes(points, self.points) @ self._radial + self._trend[0] + points @ self._trend[1:]


def _cubes(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
    return np.maximum(square, 0.0) ** 1.5


#: Variance inflation from which an input is confounded with others, and least correlation of those that are named.
INFLATED, CORRELATED = 2.0, 0.3


@dataclass(frozen=True)
class Learned:
    """Knowledge of independent inputs, whose prior is standard normal, by samples of their posterior.

    Attributes
    ----------
    scores : (n, d) array
    """

    scores: np.ndarray

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance (d, d)."""
        d = self.scores.shape[1]
        return np.cov(self.scores.T).reshape(d, d)

    @cached_property
    def correlation(self) -> np.ndarray:
        """Correlations (d, d)."""
        spread = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(spread, spread)

    @property
    def inflation(self) -> np.ndarray:
        """Variance (d,) of each input over that which it would have were the others known."""
        return np.diag(self.covariance) * np.diag(np.linalg.inv(self.covariance))

    def confounded(self) -> list[tuple[int, list[int]]]:
        """Inputs that others would sharpen, each with those by falling correlation."""
        found = []
        for i, inflation in enumerate(self.inflation):
            row = np.abs(self.correlation[i]) * (np.arange(len(self.correlation)) != i)
            partners = [int(j) for j in np.argsort(-row) if row[j] >= CORRELATED]
            if inflation >= INFLATED and partners:
                found.append((i, partners))
        return found

    def directions(self) -> list[tuple[float, np.ndarray]]:
        """Standard deviations of combinations of scores, over those of the prior, with the combinations: what is known
        best first.
        """
        variance, vectors = np.linalg.eigh(self.covariance)
        return [(float(np.sqrt(max(v, 0.0))), vectors[:, k]) for k, v in enumerate(variance)]


def expected_variance(targets: np.ndarray, predicted: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Variances (k,) of targets (n, k) expected after measuring what samples predict (n, m), with standard errors (m,),
    over those before it; by linear regression on the samples.
    """
    a, b = targets - targets.mean(axis=0), predicted - predicted.mean(axis=0)
    cross, own = a.T @ b / len(a), b.T @ b / len(b) + np.diag(np.square(error))
    known = np.einsum("im,mi->i", cross, np.linalg.solve(own, cross.T))
    return 1.0 - known / np.maximum(a.var(axis=0), 1e-300)
