"""Every value of one parameter at which an eigenvalue of the coupled valve reaches the imaginary axis.

The k-th largest growth rate g_k is a continuous function of the parameter wherever the spectrum is, so crossings are
its zeros. Between the values of a scan they are bracketed by the number of unstable modes; where the parabola through
three values of g_k reaches zero between them although no number changes, the scan is refined, so that narrow tongues of
instability or stability are not stepped over; and where one mode ceases to be unstable while another becomes so, which
changes no number either.

Crossings found with a reduced-order model are corrected with the full matrices (`OnsetCorrection`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from eigen import Column, Condition

from ...errors import SolveError

#: Times that an interval of the scan is halved in search of a narrow tongue.
HALVINGS = 6
#: A vertex of the parabola this close to zero, as a share of the values around it, calls for a closer look.
MARGIN = 0.35
#: Modes whose order is watched.
WATCHED = 4


@dataclass(frozen=True)
class Sample:
    """Leading eigenvalues at one value, sorted by growth rate, a conjugate pair given once.

    `certified` says whether an independent count agrees with them, None where it was not asked.
    """

    value: float
    eigenvalues: np.ndarray
    certified: bool | None = None

    @property
    def growth(self) -> np.ndarray:
        """(WATCHED,) largest growth rates; very negative where there are fewer."""
        found = np.full(WATCHED, -1e9)
        kept = self.eigenvalues.real[:WATCHED]
        found[: len(kept)] = kept
        return found

    @property
    def unstable(self) -> int:
        """Unstable modes, a pair being one."""
        return int(np.sum(self.eigenvalues.real > 0))


@dataclass(frozen=True)
class Crossing:
    """A bracketed crossing of the k-th largest growth rate (k from 0)."""

    index: int
    low: Sample
    high: Sample


class Scan:
    """Samples along one parameter.

    Parameters
    ----------
    sample : callable
        Value to eigenvalues, sorted by growth rate, or to a whole `Sample`; raises SolveError where there is no
        equilibrium.
    log : bool
        Intervals are halved in the logarithm.
    certify : callable, optional
        From a value to whether an independent count agrees with its sample; asked at the ends of brackets. Without it
        all samples are taken as they are.
    inside : callable, optional
        As `sample`, for values inside a bracket, where only the eigenvalues matter; `sample` by default.

    Attributes
    ----------
    uncertain : list of (float, float)
        Intervals between neighbours of the scan, one of which lacks a certificate: nothing is claimed about them.
    """

    def __init__(
        self,
        sample: Callable[[float], np.ndarray | Sample],
        log: bool = False,
        certify: Callable[[float], bool] | None = None,
        inside: Callable[[float], np.ndarray | Sample] | None = None,
    ):
        self._sample, self.log, self._certify, self._inside = sample, log, certify, inside or sample
        self.samples: dict[float, Sample] = {}
        self.failures: dict[float, str] = {}
        self.uncertain: list[tuple[float, float]] = []

    def at(self, value: float) -> Sample | None:
        """The sample at a value; None where there is no equilibrium, with the sentence kept in `failures`."""
        return self._asked(float(value), self._sample)

    def within(self, value: float) -> Sample | None:
        """Sample at a value inside a bracket, which needs no certificate; None where there is no equilibrium."""
        return self._asked(float(value), self._inside)

    def _asked(self, value: float, sample) -> Sample | None:
        if value in self.failures:
            return None
        if value not in self.samples:
            try:
                found = sample(value)
                self.samples[value] = found if isinstance(found, Sample) else Sample(value, np.asarray(found))
            except SolveError as error:
                self.failures[value] = str(error)
                return None
        return self.samples[value]

    def middle(self, a: float, b: float) -> float:
        return float(np.sqrt(a * b)) if self.log and a > 0 else 0.5 * (a + b)

    def run(self, values) -> list[Crossing]:
        """Scan values and narrow tongues between them; crossings in ascending order."""
        for value in sorted(map(float, values)):
            self.at(value)
        for _ in range(HALVINGS):
            wanted = {*self._tongues(), *self._exchanges()}
            if not wanted:
                break
            for value in sorted(wanted):
                self.at(value)
        return self.crossings()

    def _coordinate(self, values: np.ndarray) -> np.ndarray:
        return np.log(values) if self.log and np.all(values > 0) else values

    def _exchanges(self) -> list[float]:
        """Middles of intervals within which modes take each other's place on the unstable side."""
        values = sorted(self.samples)
        return [self.middle(a, b) for a, b in zip(values, values[1:]) if _exchanged(self.samples[a], self.samples[b])]

    def _tongues(self) -> list[float]:
        """Middles of intervals within which a growth rate may reach zero and turn back."""
        values = np.array(sorted(self.samples))
        if len(values) < 3:
            return []
        x = self._coordinate(values)
        growth = np.array([self.samples[v].growth for v in values])
        wanted = set()
        for k in range(WATCHED):
            for i in range(1, len(values) - 1):
                g = growth[i - 1 : i + 2, k]
                if g.min() < -1e8 or not (np.all(g > 0) or np.all(g < 0)):
                    continue
                # nearest to zero in the middle: a summit below the axis or a hollow above it
                if not abs(g[1]) <= min(abs(g[0]), abs(g[2])):
                    continue
                c2, c1, c0 = np.polyfit(x[i - 1 : i + 2] - x[i], g, 2)
                vertex = c0 - c1 * c1 / (4 * c2) if c2 else c0
                reach = max(abs(g[0]), abs(g[2])) - abs(g[1])
                if vertex * g[1] <= 0 or abs(vertex) < MARGIN * reach:
                    wanted.update((self.middle(values[i - 1], values[i]), self.middle(values[i], values[i + 1])))
        return list(wanted)

    def certified(self, value: float) -> bool:
        """True where the eigenvalue count of the sample at a value of the scan is certified."""
        sample = self.samples[value]
        if sample.certified is None:
            vouched = True if self._certify is None else bool(self._certify(value))
            sample = self.samples[value] = replace(sample, certified=vouched)
        return bool(sample.certified)

    def crossings(self) -> list[Crossing]:
        """Brackets of all crossings between neighbours of the scan that both have a certificate, with no value between
        them at which there is nothing.
        """
        found = []
        self.uncertain = []
        values = sorted(self.samples)
        for a, b in zip(values[:-1], values[1:]):
            low, high = self.samples[a], self.samples[b]
            few, many = sorted((low.unstable, high.unstable))
            known = (low.certified is not False) and (high.certified is not False)
            known = known and not any(a < value < b for value in self.failures)
            if known and few != many:
                known = self.certified(a) and self.certified(b)
            if not known:
                self.uncertain.append((a, b))
                continue
            found += [Crossing(k, low, high) for k in range(few, min(many, WATCHED))]
        return found


def _exchanged(low: Sample, high: Sample) -> bool:
    """True where one mode ceases to be unstable between two samples and another becomes so.

    Modes of the samples are paired by the least sum of their distances.
    """
    if not (low.unstable and high.unstable):
        return False
    here, there = low.eigenvalues, high.eigenvalues
    pairs = linear_sum_assignment(np.abs(here[:, None] - there))
    before, after = here[pairs[0]].real > 0, there[pairs[1]].real > 0
    return bool((before & ~after).any() and (after & ~before).any())


def locate(scan: Scan, crossing: Crossing, tolerance: float) -> float:
    """The value at which the growth rate of a bracketed crossing vanishes (Brent's method).

    Raises
    ------
    SolveError
        If an equilibrium inside the bracket was not found.
    """

    def growth(value: float) -> float:
        sample = scan.within(value)
        if sample is None:
            raise SolveError(scan.failures[float(value)])
        return float(sample.growth[crossing.index])

    low, high = crossing.low.value, crossing.high.value
    return float(brentq(growth, low, high, xtol=tolerance * max(abs(low), abs(high)), rtol=8.9e-16, maxiter=80))


#: Growth rate over the size of the eigenvalue up to which an onset counts as neutral.
ACCURATE = 1e-6
#: The same, at which corrections end.
NEUTRAL = 1e-8
#: Corrections at most.
CORRECTIONS = 5
#: Step along the column for the slope of the growth rate, relative.
STEP = 1e-4
#: Largest step along the column, relative.
REACH = 0.05
#: Largest relative distance of a mode from where it was looked for.
MOVED = 0.1
#: Largest relative difference of one mode on the small model and with the full matrices.
SAME = 1e-2


@dataclass(frozen=True)
class OnsetCorrection:
    """Newton steps along a column with eigenvalues of the full matrices and slopes of the small model.

    Parameters
    ----------
    column : Column
    condition : callable
        From a value along the column to its condition.
    direct : callable
        From a value to leading eigenvalues of the full pencil, where corrections on the small model do not settle.
    """

    column: Column
    condition: Callable[[float], Condition]
    direct: Callable[[float], np.ndarray]

    def __call__(self, value: float, frequency: float) -> tuple[float, float, float]:
        """Value, frequency (Hz) and growth rate over the size of the eigenvalue, NaN where no mode was followed."""
        near = 2j * np.pi * frequency
        for eigenvalue in (self._by_correction, self._by_solving):
            found = self._settled(eigenvalue, value, near)
            if found is not None:
                return found
        return value, frequency, float("nan")

    def _settled(self, eigenvalue, value: float, near: complex):
        slope = self._slope(self._small, value, near)
        if not np.isfinite(slope):
            slope = self._slope(self._by_solving, value, near)
        if not np.isfinite(slope) or slope == 0:
            return None
        for _ in range(CORRECTIONS):
            found = eigenvalue(value, near)
            if found is None or not np.isfinite(found):
                return None
            near, left = found, abs(found.real) / max(abs(found), 1.0)
            if left <= NEUTRAL:
                break
            if abs(found.real) > REACH * abs(slope) * (abs(value) or 1.0):
                return None  # a growth rate that hardly changes along the column leads astray
            value -= found.real / slope
        return (value, abs(near.imag) / (2 * np.pi), left) if left <= ACCURATE else None

    def _small(self, value: float, near: complex) -> complex | None:
        """Eigenvalue of the small model; None where it has none near, as where all cells needed the full matrices."""
        found = self.column.nearest(self.condition(value), near)
        return found if abs(found - near) <= MOVED * max(abs(near), 1.0) else None

    def _slope(self, eigenvalue, value: float, near: complex) -> float:
        step = STEP * (abs(value) or 1.0)
        up, down = (eigenvalue(v, near) for v in (value + step, value - step))
        return float("nan") if up is None or down is None else (up.real - down.real) / (2 * step)

    def _by_correction(self, value: float, near: complex) -> complex | None:
        found = self._small(value, near)
        if found is None:
            return None
        change = self.column.corrected(self.condition(value), found)
        return found + change if abs(change) < SAME * max(abs(found), 1.0) else None

    def _by_solving(self, value: float, near: complex) -> complex | None:
        try:
            nearest = _nearest(self.direct(value), near)
        except SolveError:
            return None
        return None if nearest is None or abs(nearest - near) > SAME * max(abs(near), 1.0) else nearest


def _nearest(values: np.ndarray, near: complex) -> complex | None:
    """The eigenvalue next to a place, None if there is none at all."""
    return complex(values[int(np.argmin(np.abs(values - near)))]) if len(values) else None
