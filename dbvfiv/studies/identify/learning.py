"""Inputs from measured oscillations: likelihood on emulated modes, its posterior, onset, what to measure next.

Samples of standard normal scores go from the prior to the posterior in steps that raise the power of the likelihood,
each resampled and moved by random walks that leave it as it is (Del Moral, Doucet and Jasra, J. R. Stat. Soc. B 68,
2006, 411-436): several regions of the posterior keep their weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import logsumexp, ndtr

from ...case.distribution import Distribution
from ...verdict.lines import WIDE
from ..inputs import Plan, quasi_random
from .valves import MODES, Measured, Places, follow, least_damping, onsets, stretch

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
    square = np.maximum(square, 0.0)
    return square * np.sqrt(square)  # a power takes ten times as long


#: Variance inflation from which an input is confounded with others, and least correlation of those that are named.
INFLATED, CORRELATED = 2.0, 0.3


@dataclass(frozen=True)
class Learned:
    """Knowledge of inputs, whose prior is normal with unit variances, by samples of their posterior."""

    scores: np.ndarray  #: (n, d).
    #: (d, d); lower triangle of the correlation that they have before anything is measured; none without it.
    root: np.ndarray | None = None

    @property
    def _root(self) -> np.ndarray:
        return np.eye(self.scores.shape[1]) if self.root is None else self.root

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
        """Inputs that others would sharpen more than before anything was measured, each with those by falling
        correlation.
        """
        found, before = [], np.diag(np.linalg.inv(self._root @ self._root.T))
        for i, inflation in enumerate(self.inflation / before):
            row = np.abs(self.correlation[i]) * (np.arange(len(self.correlation)) != i)
            partners = [int(j) for j in np.argsort(-row) if row[j] >= CORRELATED]
            if inflation >= INFLATED and partners:
                found.append((i, partners))
        return found

    def directions(self) -> list[tuple[float, np.ndarray]]:
        """Standard deviations of combinations of scores, over those of the prior, with the combinations: what is known
        best first.
        """
        root = self._root
        variance, vectors = np.linalg.eigh(np.linalg.solve(root, np.linalg.solve(root, self.covariance).T))
        vectors = np.linalg.solve(root.T, vectors)  # whose variance was 1
        return [(float(np.sqrt(max(v, 0.0))), vectors[:, k]) for k, v in enumerate(variance)]


def expected_variance(targets: np.ndarray, predicted: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Variances (k,) of targets (n, k) expected after measuring what samples predict (n, m), with standard errors (m,),
    over those before it; by linear regression on the samples.
    """
    a, b = targets - targets.mean(axis=0), predicted - predicted.mean(axis=0)
    cross, own = a.T @ b / len(a), b.T @ b / len(b) + np.diag(np.square(error))
    known = np.einsum("im,mi->i", cross, np.linalg.solve(own, cross.T))
    return 1.0 - known / np.maximum(a.var(axis=0), 1e-300)


#: Valves beyond the number of inputs without which nothing is emulated.
MORE = 3
#: Probability that a measured oscillation is none of the modes computed; it is then as likely anywhere in two decades
#: of frequency, and in a range of damping ratios.
NONE, DECADES, DAMPED = 0.02, np.log(100.0), 0.3
#: Square of the distance from a mode, in standard errors, from which it is asked whether it is one.
DOUBTFUL = 9.0
ROOT = np.sqrt(2.0 * np.pi)
#: Error of the emulated modes over that of the measurement up to which more valves are not needed.
SMALL = 0.5


def coordinates(plan: Plan, independent: np.ndarray) -> np.ndarray:
    """Coordinates (n, d) of samples from independent scores, in which inputs act evenly: scores, and values between
    bounds where those end a distribution.
    """
    scores = plan.scores_of(independent)
    return np.column_stack([_coordinate(one.distribution, scores[:, i]) for i, one in enumerate(plan.inputs)])


def _coordinate(distribution: Distribution, scores: np.ndarray) -> np.ndarray:
    if distribution.form in ("normal", "lognormal"):
        return scores
    if distribution.form == "uniform":
        return np.sqrt(3.0) * (2.0 * ndtr(scores) - 1.0)
    values = np.array(distribution.numbers)
    return (distribution.at(scores) - values.mean()) / values.std()


@dataclass
class Learning:
    """Modes of sampled valves and measured oscillations."""

    plan: Plan
    places: Places
    lines: Sequence[Measured]
    scores: np.ndarray  #: (n, d); independent scores of the samples.
    rounds: np.ndarray  #: (n,).
    #: From place to eigenvalues (n, MODES) and likeness (n, MODES, MODES) of all samples; NaN where not asked.
    modes: dict[int, tuple[np.ndarray, np.ndarray]]
    #: (n, 2); values of the range at which flutter begins below and above the last record; NaN where it does not, or
    #: nobody asked.
    begins: np.ndarray
    left_out: tuple[int, ...] = ()  #: Numbers of measured oscillations that are none of the modes.
    _fits: dict[int, Modal] = field(default_factory=dict)

    @property
    def dimension(self) -> int:
        """Scores of a sample: of the inputs, then of the common error of computed frequencies and damping."""
        return len(self.plan.inputs) + 2

    def modal(self, place: int) -> Modal:
        """Emulated modes of a place."""
        if place not in self._fits:
            known = np.isfinite(self.modes[place][0]).any(axis=1)
            last = self.rounds == self.rounds[known].max(initial=0)
            self._fits[place] = Modal.of(coordinates(self.plan, self.scores), self.followed(place), last)
        return self._fits[place]

    def followed(self, place: int) -> np.ndarray:
        """Frequency, Hz, and damping ratio (n, MODES, 2) of the samples at a place by the modes of the case."""
        return follow(*self.modes[place])

    def _errors(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Common relative errors (n,) of computed frequencies and damping: half of their variance."""
        asked, d = self.plan.case.identify, len(self.plan.inputs)
        return tuple(e / WIDE / np.sqrt(2) * z[:, d + k] for k, e in enumerate((asked.error, asked.damping_error)))

    def _predicted(self, z: np.ndarray) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Frequency, Hz, and damping ratio (n, MODES) of the modes by the place of measured oscillations."""
        at = coordinates(self.plan, z[:, : len(self.plan.inputs)])
        return {place: self.modal(place).at(at) for place in {self.places.of_line(line) for line in self.lines}}

    def _apart(self, line: Measured, z: np.ndarray, predicted) -> tuple[np.ndarray, np.ndarray]:
        """Squares (n, MODES) of the distance of a measured oscillation from each of the modes in standard errors, and
        logarithms of what makes its normal distribution one.
        """
        asked, place = self.plan.case.identify, self.places.of_line(line)
        modal, (frequency, damping) = self.modal(place), predicted[place]
        off, softer = self._errors(z)
        own = np.hypot(line.frequency_error, asked.error / np.sqrt(2) * frequency) / WIDE
        spread = np.hypot(own, modal.error[:, 0] * frequency)
        square, size = ((line.frequency - frequency * (1 + off[:, None])) / spread) ** 2, np.log(ROOT * spread)
        if np.isfinite(line.damping_ratio):
            own = np.hypot(line.damping_error, asked.damping_error / np.sqrt(2) * damping) / WIDE
            spread = np.hypot(own, modal.error[:, 1])
            square = square + ((line.damping_ratio - damping * (1 + softer[:, None])) / spread) ** 2
            size = size + np.log(ROOT * spread)
        known = np.isfinite(square) & np.isfinite(size)
        return np.where(known, square, np.inf), np.where(known, size, 0.0)

    def _shares(self, line: Measured, z: np.ndarray, predicted) -> tuple[np.ndarray, np.ndarray]:
        """Logarithms (n, MODES) of the likelihood of a measured oscillation as each of the modes, which are equally
        probable before, and of their sum (n,).
        """
        square, size = self._apart(line, z, predicted)
        known = max(int(np.isfinite(square).any(axis=0).sum()), 1)
        log = -0.5 * square - size - np.log(known)
        return log, np.maximum(logsumexp(log, axis=1), -1e12)

    @property
    def used(self) -> list[int]:
        """Numbers of the measured oscillations that are modes."""
        return [number for number in range(len(self.lines)) if number not in self.left_out]

    def log_likelihood(self, z: np.ndarray) -> np.ndarray:
        """Logarithm (n,) of the likelihood of all that was measured and is a mode; which mode it is, is open."""
        predicted = self._predicted(z)
        return sum((self._shares(self.lines[number], z, predicted)[1] for number in self.used), np.zeros(len(z)))

    def doubtful(self, z: np.ndarray) -> list[int]:
        """Oscillations that are far from every mode of the samples of a posterior."""
        predicted = self._predicted(z)
        return [n for n in self.used if np.median(self._apart(self.lines[n], z, predicted)[0].min(axis=1)) > DOUBTFUL]

    def evidence_of_none(self, number: int) -> float:
        """Logarithm of the evidence of an oscillation that is none of the modes, over the odds that it is one."""
        line = self.lines[number]
        density = -np.log(line.frequency * DECADES) - (np.log(DAMPED) if np.isfinite(line.damping_ratio) else 0.0)
        return density + np.log(NONE / (1.0 - NONE))

    def matches(self, z: np.ndarray) -> list[np.ndarray]:
        """Probability (MODES + 1,) of each mode for each measured oscillation, and of none."""
        found, predicted = [], self._predicted(z)
        for number, line in enumerate(self.lines):
            shares = np.zeros(MODES + 1)
            if number in self.left_out:
                shares[-1] = 1.0
            else:
                log, total = self._shares(line, z, predicted)
                shares[:-1] = np.exp(log - total[:, None]).mean(axis=0)
            found.append(shares)
        return found

    def emulation(self, z: np.ndarray) -> float:
        """Largest error of the emulated modes over that of what was measured, of the likeliest modes."""
        worst = 0.0
        asked = self.plan.case.identify
        for line, share in zip(self.lines, self.matches(z)):
            modal, mode = self.modal(self.places.of_line(line)), int(np.argmax(share))
            if mode == MODES:
                continue
            own = np.hypot(line.frequency_error / line.frequency, asked.error) / WIDE
            worst = max(worst, modal.error[mode, 0] / own)
            if np.isfinite(line.damping_ratio):
                own = np.hypot(line.damping_error, asked.damping_error * line.damping_ratio) / WIDE
                worst = max(worst, modal.error[mode, 1] / own)
        return float(worst)

    @cached_property
    def _over_range(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values (k,) of the range about the last record at which enough samples are known, their least damping ratio
        (n, k) there, and True (n,) where all of it is known.
        """
        values, least = np.array(self.places.values), len(self.plan.inputs) + MORE
        table = np.stack([least_damping(self.modes[place][0]) for place in self.places.ranged], axis=1)
        run = stretch(values, self.places.now, np.isfinite(table), least)
        return values[run], table[:, run], np.isfinite(table[:, run]).all(axis=1)

    @property
    def values(self) -> np.ndarray:
        """Values (k,) of the range over which damping is known: all, unless valves are lost at its ends."""
        return self._over_range[0]

    def damping_over_range(self, z: np.ndarray, seed: int) -> np.ndarray | None:
        """Least damping ratio (n, k) over `values`, with the scatter that emulation leaves; None where too few valves
        are known.
        """
        values, table, known = self._over_range
        if not len(values):
            return None
        emulator = Emulator(coordinates(self.plan, self.scores)[known], table[known])
        scatter = _spread(emulator.left)
        found = emulator(coordinates(self.plan, z[:, : len(self.plan.inputs)]))
        found = found + scatter * np.random.default_rng([seed, 3]).standard_normal(found.shape)
        return found * (1.0 + self._errors(z)[1][:, None])

    def onsets(self, z: np.ndarray, damping: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values (n,) at which flutter begins below and above the last record, NaN where it does not in the range, and
        the damping ratio at that record.

        Between the values of the range damping is interpolated; what that is off by is learned from valves whose
        onsets were found.
        """
        now, (values, table, known) = self.places.now, self._over_range
        found, rough = onsets(values, damping, now), onsets(values, table[known], now)
        points, random = coordinates(self.plan, self.scores)[known], np.random.default_rng([seed, 4])
        for side in (0, 1):
            off = np.log(self.begins[known, side] / rough[side])
            use = np.isfinite(off)
            if use.sum() >= len(self.plan.inputs) + MORE:
                emulator = Emulator(points[use], off[use, None])
                shift = emulator(coordinates(self.plan, z[:, : len(self.plan.inputs)]))[:, 0]
                shift = shift + _spread(emulator.left)[0] * random.standard_normal(len(z))
                low, high = off[use].min(), off[use].max()
                found[side][:] *= np.exp(np.clip(shift, 2 * low - high, 2 * high - low))
            elif use.any():
                found[side][:] *= np.exp(random.choice(off[use], len(z)))
        return np.minimum(found[0], now), np.maximum(found[1], now), found[2]

    def further(self, z: np.ndarray, targets: dict[str, np.ndarray]) -> list[dict[str, Any]]:
        """Best further measurement for each target: the mode at a value of the range that narrows it most, measured as
        well as those before.
        """
        asked, points = self.plan.case.identify, coordinates(self.plan, z[:, : len(self.plan.inputs)])
        accuracy = np.median([line.frequency_error / line.frequency for line in self.lines])
        known = [line.damping_error for line in self.lines if np.isfinite(line.damping_error)]
        of_damping = float(np.median(known)) if known else 0.005
        best = dict.fromkeys(targets, (1.0, None))
        for value, place in zip(self.places.values, self.places.ranged):
            modal = self.modal(place)
            frequency, damping = modal.at(points)
            for mode in np.flatnonzero(np.isfinite(modal.error[:, 0])):
                f, ratio = frequency[:, mode], damping[:, mode]
                error = [
                    np.hypot(np.hypot(accuracy, asked.error) / WIDE, modal.error[mode, 0]),
                    np.hypot(np.hypot(of_damping, asked.damping_error * ratio.mean()) / WIDE, modal.error[mode, 1]),
                ]
                predicted = np.column_stack([np.log(f), ratio])
                for name, target in targets.items():
                    use = np.isfinite(target)
                    if use.sum() < 0.2 * len(target):
                        continue
                    left = expected_variance(target[use, None], predicted[use], np.array(error))[0]
                    if left < best[name][0]:
                        best[name] = (left, {"value": float(value), "frequency": float(np.median(f))})
        return [
            {"target": name, "remaining": float(np.sqrt(max(left, 0.0))), **measurement}
            for name, (left, measurement) in best.items()
            if measurement is not None
        ]


def _spread(left: np.ndarray) -> np.ndarray:
    """Standard errors (k,) that outliers do not move."""
    return np.quantile(np.abs(left), 0.68, axis=0)


@dataclass(frozen=True)
class Modal:
    """Emulated frequency and damping of the modes of one place."""

    #: (modes, Emulator); modes of the case that the same samples have share one: logarithms of frequencies, then
    #: damping ratios.
    emulators: list[tuple[np.ndarray, Emulator]]
    #: (MODES, 2); standard errors of the logarithm of the frequency, and of the damping ratio; infinite where a mode is
    #: unknown.
    error: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, followed: np.ndarray, last: np.ndarray) -> Modal:
        """Modes from those that samples have; errors are those of the last round's samples."""
        emulators, error = [], np.full((MODES, 2), np.inf)
        followed_by = np.isfinite(followed[..., 0])
        least = max(points.shape[1] + MORE, 0.5 * followed_by.any(axis=1).sum())
        for known in np.unique(followed_by[:, followed_by.sum(axis=0) >= least], axis=1).T:
            modes = np.flatnonzero((followed_by == known[:, None]).all(axis=0))
            found = followed[known][:, modes]
            one = Emulator(points[known], np.hstack([np.log(found[..., 0]), found[..., 1]]))
            emulators.append((modes, one))
            here = last[known]
            error[modes] = _spread(one.left[here] if here.sum() >= 4 else one.left).reshape(2, -1).T
        return cls(emulators, error)

    def at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies, Hz, and damping ratios (n, MODES) at points; NaN of modes that are unknown."""
        found = np.full((2, len(points), MODES), np.nan)
        for modes, emulator in self.emulators:
            log, found[1][:, modes] = np.hsplit(emulator(points), 2)
            found[0][:, modes] = np.exp(log)
        return found[0], found[1]
