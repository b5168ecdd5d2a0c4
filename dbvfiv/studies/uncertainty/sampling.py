"""Sampled valves: verdicts beside the valve of the case, densities, probabilities with intervals, variance shares."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eigen.columns import Cell, ColumnSolver

from ...case.parameters import Mu
from ...errors import CaseError, NotValidError, SolveError
from ...model.state import SteadyState
from ..inputs import CONFIDENCE, Plan, Probability, quasi_random
from ..stability.neighbours import At, Beside, Neighbours
from ..stability.verdict import OUTCOMES, Verdict
from ..stability.walk import StabilityWalk


class Found(NamedTuple):
    """One sampled valve at one value of the range."""

    sample: int
    value: float  #: Of the range, SI; the inlet pressure where there is none.
    outcome: int  #: Number of the outcome of its verdict in `OUTCOMES`.
    #: growth_rate, frequency and damping_ratio: 1/s, Hz; of the leading oscillating mode, and the least ratio; NaN
    #: where nothing is known.
    growth_rate: float
    frequency: float
    damping_ratio: float
    #: opening and flow: m2, m3/s; area between the lips and volume flow, NaN without a steady state.
    opening: float
    flow: float
    apart: bool = False  #: Found with its full matrices although samples share a space.
    why: str = ""  #: Of a sample that is undecided or not valid.

    @classmethod
    def of(
        cls,
        sample: int,
        value: float,
        verdict: Verdict,
        state: SteadyState | None = None,
        density: float = np.nan,
        apart: bool = False,
    ) -> Found:
        """Row of a verdict and its steady state, in a fluid of a density, kg/m3."""
        read = (np.nan, np.nan) if state is None else (state.outlet_area, state.volume_flow_of(density))
        numbers = verdict.growth_rate, verdict.frequency, verdict.damping_ratio
        why = "" if verdict.stable is not None else verdict.reason
        return cls(sample, value, OUTCOMES.index(verdict.outcome), *numbers, *read, apart, why)


class Start(NamedTuple):
    """Steady state of the case at a value of the range."""

    q: np.ndarray  #: (n,); displacements.
    lift: float  #: Pa; behind a pump, its pressure beyond that of the pump's table, which samples share.


class Sampler:
    """Steady states of the case, and verdicts on samples that start from them.

    Parameters
    ----------
    states : sequence of Start or None
        Of the case at the values of the range; None where it has no steady state.
    neighbours : mapping, optional
        What samples have in common, by the numbers of the values; without it each is found with its full matrices.
    walk : StabilityWalk, optional
        Of the case.
    """

    def __init__(
        self,
        plan: Plan,
        states: Sequence[Start | None],
        neighbours: Mapping[int, Neighbours] = {},
        walk: StabilityWalk | None = None,
    ):
        self.plan, self.states, self._walk = plan, states, walk or StabilityWalk(plan.case)
        self._solver, self._neighbours = ColumnSolver(), neighbours
        self._found: dict[int, Beside] = {}

    def found(self, first: int, numbers: np.ndarray) -> list[Found]:
        """Rows of samples, whose values (m, d) are given; the first has the number `first`."""
        if self.plan.is_surrounding:
            return [row for i in range(len(self.plan.values)) for row in self._side_by_side(i, first, numbers)]
        return [found for k, row in enumerate(numbers) for found in self._one(first + k, row)]

    def _side_by_side(self, number: int, first: int, rows: np.ndarray) -> Iterator[Found]:
        """Samples that share the steady state of the case."""
        value, walk = self.plan.values[number], self._walk
        places = [self.plan.place(self.plan.case, row, value) for row in rows]
        try:
            if (start := self.states[number]) is None:
                raise SolveError("The valve of the case has no steady state there.")
            met = walk.meet_pump(places[0], start.lift, start.q).pressure
            places = [place.at(pressure=met) for place in places]
            walk.settle(places[0], start.q)
            state = walk.state(places[0])
            try:
                cells = walk.column(places, snapshots=min(len(places), 7)).cells
            except NotValidError:  # at all of them
                cells = [Cell()] * len(places)
            verdicts = [walk.sample(*pair, value).verdict for pair in zip(places, cells)]
        except (SolveError, CaseError) as error:
            state, verdicts = None, [Verdict.undecided(str(error))] * len(places)
        for k, (place, verdict) in enumerate(zip(places, verdicts)):
            yield Found.of(first + k, value, verdict, state, place.density)

    def _one(self, sample: int, row: np.ndarray) -> Iterator[Found]:
        walk = None
        for i, value in enumerate(self.plan.values):
            state, density, near = None, np.nan, self._neighbours.get(i)
            apart = near is not None
            try:
                walk = walk or self.plan.walk(row, self._solver)
                lift, q = (0.0, None) if self.states[i] is None else (self.states[i].lift, self.states[i].q)
                q = q if near is None else near.state(row)
                place = walk.meet_pump(self.plan.place(walk.case, row, value), lift, q)
                walk.settle(place, q)
                state, density = walk.state(place), place.density
                verdict = self._beside(i).verdicts(walk, [place], row)[0] if near else None
                apart = apart and verdict is None
                verdict = verdict or walk.verdict(place)
            except (SolveError, CaseError, ValueError) as error:
                verdict = Verdict.undecided(str(error))
            yield Found.of(sample, value, verdict, state, density, apart)

    def walks(self, i: int) -> At:
        """Function from values of the inputs to the walk of a sample and its parameter point at a value of the range,
        where the case has a steady state.
        """
        plan, start, solver = self.plan, self.states[i], ColumnSolver()

        def at(row: np.ndarray) -> tuple[StabilityWalk, Mu]:
            walk = plan.walk(row, solver)
            return walk, walk.meet_pump(plan.place(walk.case, row, plan.values[i]), start.lift, start.q)

        return at

    def _beside(self, i: int) -> Beside:
        if i not in self._found:
            self._found[i] = Beside(self.walks(i), self._neighbours[i])
        return self._found[i]


#: Coefficient of variation of the weights that a step towards a rare event is chosen by (Papaioannou, Geyer and Straub,
#: Struct. Saf. 76, 2019, 10-20).
SPREAD = 1.5
#: Steps towards a rare event at most: each shifts samples by one to two standard deviations.
STEPS = 12
#: Share of samples that keep the density of the inputs, so that no weight exceeds its inverse.
DEFENSIVE = 0.1
#: Regions of a rare event that are told apart.
REGIONS = 2
#: Independent runs of subset sampling; share of the samples of a level that lead to the next one (Au and Beck, Probab.
#: Eng. Mech. 16, 2001, 263-277), levels at most, which reach 1e-12, and levels that samples are shared out among.
RUNS, SHARE, LEVELS, USUAL = 4, 0.1, 12, 4
#: Share of accepted steps that those of its chains are made for, and the first step (Papaioannou, Betz, Zwirglmaier and
#: Straub, Probab. Eng. Mech. 41, 2015, 89-103).
ACCEPTED, FIRST_STEP = 0.44, 0.6


def weighted(weights: np.ndarray, hits: np.ndarray, undecided: np.ndarray) -> Probability:
    """Probability of an outcome from samples of another density, with the weights that make up for it."""
    (value, low, _), (_, _, high), (decided, *_) = (_part(weights, a) for a in (hits, hits | undecided, ~undecided))
    return Probability(float(np.clip(value / decided, low, high)) if decided else np.nan, low, high)


def _part(weights: np.ndarray, which: np.ndarray) -> tuple[float, float, float]:
    """Probability of some samples with its interval: the mean of their weights, by Student's distribution, or one less
    that of the others where these are fewer, by whose weights the mean scatters less.
    """
    if 2 * (weights @ which) > weights.sum():
        value, low, high = _part(weights, ~which)
        return 1 - value, 1 - high, 1 - low
    value, low, high = _mean(weights * which, largest=float(weights.max(initial=0.0)))
    return value, max(low, 0.0), min(high, 1.0)


def _mean(terms: np.ndarray, least: float = 0.0, largest: float = 1.0) -> tuple[float, float, float]:
    """Mean of independent terms, not negative, with the interval that holds those of Student for it and for its
    logarithm: few large weights make its distribution skew, between normal and lognormal. Their coefficient of
    variation is `least` at least, and one that is not 0 is `largest` at most.
    """
    from scipy.stats import t

    mean = float(terms.mean())
    if mean <= 0:
        # none of n samples: three over the number of samples, by what each may stand for
        return 0.0, 0.0, largest * (1 - (0.5 * (1 - CONFIDENCE)) ** (1 / len(terms)))
    freedom = max(float(terms.sum() ** 2 / (terms**2).sum()) - 1, 1.0)  # hits of equal weight that tell as much
    variation = max(float(terms.std(ddof=1)) / mean, least)
    reach = float(t.ppf(0.5 * (1 + CONFIDENCE), freedom)) * variation / np.sqrt(len(terms))
    return mean, mean * (1 - reach), mean * np.exp(reach)


@dataclass(frozen=True)
class Shifted:
    """Density of samples: unit normal ones about several centres, and `DEFENSIVE` of them about zero."""

    centres: np.ndarray
    shares: np.ndarray

    @classmethod
    def none(cls, dimension: int) -> Shifted:
        """Density of the inputs themselves."""
        return cls(np.zeros((1, dimension)), np.ones(1))

    def draw(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Independent scores (count, d)."""
        which = random.choice(len(self.shares), size=count, p=self.shares)
        return self.centres[which] + random.standard_normal((count, self.centres.shape[1]))

    def log_weight(self, scores: np.ndarray) -> np.ndarray:
        """Logarithm (count,) of the density of the inputs over this one."""
        apart = scores[:, None] - self.centres
        ratio = 0.5 * (scores**2).sum(axis=1)[:, None] - 0.5 * (apart**2).sum(axis=2) + np.log(self.shares)
        return -np.logaddexp.reduce(ratio, axis=1)

    def fitted(self, scores: np.ndarray, weights: np.ndarray) -> Shifted:
        """Density with its centres where weighted scores are (expectation and maximisation, unit covariance)."""
        start = np.argsort(weights)[::-1]
        far = start[np.argmax(((scores[start[: len(start) // 4 + 1]] - scores[start[0]]) ** 2).sum(axis=1))]
        centres, shares = scores[[start[0], far]][:REGIONS], np.full(REGIONS, 1 / REGIONS)
        for _ in range(50):
            near = np.log(shares) - 0.5 * ((scores[:, None] - centres) ** 2).sum(axis=2)
            near = np.exp(near - np.logaddexp.reduce(near, axis=1)[:, None]) * weights[:, None]
            mass = near.sum(axis=0)
            shares = np.maximum(mass / mass.sum(), 1e-6)
            shares = shares / shares.sum()
            centres = (near.T @ scores) / np.maximum(mass, 1e-300)[:, None]
        zero = np.zeros((1, scores.shape[1]))
        return Shifted(np.vstack([centres, zero]), np.append((1 - DEFENSIVE) * shares, DEFENSIVE))


def approach(
    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray], dimension: int, count: int, seed: int
) -> Shifted:
    """Density of samples about a rare event, where a performance is positive: cross entropy in steps that make it ever
    less smooth.

    Parameters
    ----------
    evaluate : callable
        From scores (m, d) and the logarithm of their weights to performances (m,), NaN where undecided.
    dimension, count : int
        Number of inputs, and of samples a step.
    """
    from scipy.optimize import brentq
    from scipy.special import log_ndtr, ndtr

    density, random = Shifted.none(dimension), np.random.default_rng(seed)
    smooth = np.inf
    for step in range(STEPS):
        scores = quasi_random(count, dimension, seed) if step == 0 else density.draw(count, random)
        log_weight = density.log_weight(scores)
        performance = evaluate(scores, log_weight)
        known = np.isfinite(performance)
        g, z, log_weight = performance[known], scores[known], log_weight[known]
        if not len(g):
            return density
        unit = float(np.std(g)) or 1.0

        def spread(sigma: float, log_weight=log_weight, g=g) -> float:
            terms = log_weight + log_ndtr(g / sigma)
            terms = np.exp(terms - terms.max())
            return float(terms.std() / terms.mean())

        if _variation((g > 0) / ndtr(np.maximum(g, 0.0) / smooth)) <= SPREAD:
            return density
        low, high = 1e-6 * unit, min(smooth, 1e3 * unit)
        if spread(low) <= SPREAD:
            smooth = low
        elif spread(high) >= SPREAD:
            smooth = high
        else:
            smooth = float(
                np.exp(brentq(lambda log: spread(np.exp(log)) - SPREAD, np.log(low), np.log(high), xtol=1e-2))
            )
        terms = log_weight + log_ndtr(g / smooth)
        density = density.fitted(z, np.exp(terms - terms.max()))
    return density


def subset(
    evaluate: Callable[[np.ndarray, np.ndarray], np.ndarray], dimension: int, samples: int, seed: int
) -> Probability:
    """Probability of a rare event, where a performance is positive, by subset sampling: levels of samples of the inputs
    beyond ever higher performances, which assume no centres or shapes of the event.

    Independent runs give the interval, so that correlations within and between their levels are in it; it is no
    narrower than that of independent samples in each level, where few runs agree by chance. Where no run meets the
    event, its upper end is that of independent samples of their last levels.

    Parameters
    ----------
    evaluate : callable
        From scores (m, d) and the logarithms (m,) of the probability of their level to performances (m,), NaN where
        undecided.
    dimension, samples : int
        Number of inputs, and of samples by and large.
    """
    count = max(32, round(samples / (RUNS * (1 + (USUAL - 1) * (1 - SHARE)))))
    runs = [_subset_run(evaluate, dimension, count, np.random.default_rng([seed, run])) for run in range(RUNS)]
    hits, doubtful, squares, most, decided = np.array(runs).T
    if not doubtful.any():
        return Probability(0.0, 0.0, float(most.mean()))
    least = float(np.sqrt(squares.mean()))
    (value, low, _), (_, _, high) = _mean(hits, least), _mean(doubtful, least)
    high = min(high, 1.0)
    return Probability(min(value / decided.mean(), high) if decided.any() else np.nan, max(low, 0.0), high)


def _subset_run(evaluate, dimension: int, count: int, random: np.random.Generator) -> tuple[float, ...]:
    """Probability from one run, undecided samples of its levels not counted and counted as hits; the square of its
    coefficient of variation were all samples of a level independent; what the last level may hold at most where none of
    all runs hits; and the share of the inputs that is decided.
    """
    square, scores, log_level, step = 0.0, random.standard_normal((count, dimension)), 0.0, FIRST_STEP
    values = evaluate(scores, np.zeros(count))
    undecided, doubt = int(np.isnan(values).sum()), 0.0
    decided = 1 - undecided / count
    for _ in range(LEVELS):
        values = np.nan_to_num(values, nan=-np.inf)
        bound = np.sort(values)[-max(2, round(SHARE * count)) - 1]
        seeds = np.flatnonzero(values > bound)
        if bound >= 0 or not len(seeds):
            break
        doubt += np.exp(log_level) * undecided / count
        log_level, square = log_level + np.log(len(seeds) / count), square + 1 / len(seeds) - 1 / count
        chain, undecided = [(scores[seeds], values[seeds])], 0
        for k in range(-(-count // len(seeds)) - 1):
            here, own = chain[-1]
            ahead = np.sqrt(1 - step**2) * here + step * random.standard_normal(here.shape)
            new = evaluate(ahead, np.full(len(ahead), log_level))
            undecided += int(np.isnan(new).sum())
            taken = new > bound
            chain.append((np.where(taken[:, None], ahead, here), np.where(taken, new, own)))
            step = min(1.0, step * np.exp((taken.mean() - ACCEPTED) / np.sqrt(k + 1)))
        scores, values = (np.concatenate(parts)[:count] for parts in zip(*chain))
    hits, level = float(np.mean(values > 0)), float(np.exp(log_level))
    square += (1 / hits - 1) / count if hits else 0.0
    most = level * (1 - (0.5 * (1 - CONFIDENCE)) ** (1 / (RUNS * count)))
    return level * hits, min(level * (hits + undecided / count) + doubt, 1.0), square, most, decided


def _variation(terms: np.ndarray) -> float:
    """Coefficient of variation; infinite where all are zero."""
    mean = float(terms.mean())
    return float(terms.std() / mean) if mean > 0 else np.inf


def shares(scores: np.ndarray, values: np.ndarray) -> np.ndarray:
    """First-order Sobol indices (d,): share of the variance of values (n,) that each input alone explains.

    The variance between groups of equal size in the order of an input, without what chance alone puts there (epsilon
    squared of an analysis of variance): no form of the dependence is assumed.

    Parameters
    ----------
    scores : (n, d) array
        Of the inputs; only their order matters.
    """
    known = np.isfinite(values)
    scores, values = scores[known], values[known]
    count = len(values)
    groups = max(2, round(2 * count ** (1 / 3)))
    total = float(np.var(values)) * count if count >= 4 * groups else 0.0
    if total == 0:
        return np.full(scores.shape[1], np.nan)
    found = []
    for column in scores.T:
        parts = np.array_split(values[np.argsort(column, kind="stable")], groups)
        within = sum(float(np.var(part)) * len(part) for part in parts) / (count - groups)
        between = total - within * (count - groups)
        found.append((between - (groups - 1) * within) / total)
    return np.clip(found, 0.0, 1.0)
