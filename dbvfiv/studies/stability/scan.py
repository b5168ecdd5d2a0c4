"""Scan of one parameter: brackets of every value at which a growth rate reaches zero or another level, their roots.

The k-th largest growth rate g_k is a continuous function of the parameter wherever the spectrum is, so crossings are
its zeros. Between the values of a scan they are bracketed by the number of unstable modes; where the parabola through
three values of g_k reaches zero between them although no number changes, the scan is refined, so that narrow tongues of
instability or stability are not stepped over; and where one mode ceases to be unstable while another becomes so, which
changes no number either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from ...errors import JumpError, SolveError
from .samples import WATCHED, Sample

#: Times that an interval of the scan is halved in search of a narrow tongue.
HALVINGS = 6
#: A vertex of the parabola this close to zero, as a share of the values around it, calls for a closer look.
MARGIN = 0.35
#: Share of a bracket within which a growth rate that is continuous changes by less than the second share of its change.
NARROW, STEEP = 1e-3, 0.5


@dataclass(frozen=True)
class Crossing:
    """A bracketed crossing of the k-th largest growth rate (k from 0)."""

    index: int
    low: Sample
    high: Sample

    @property
    def gains(self) -> bool:
        """True where a mode becomes unstable as the parameter grows."""
        return self.high.pairs > self.low.pairs


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
        self._vouched: dict[float, bool] = {}
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
        moving = np.array([self.samples[v].moving for v in values])
        wanted = set()
        for k in range(WATCHED):
            for i in range(1, len(values) - 1):
                g = growth[i - 1 : i + 2, k]
                if g.min() < -1e8 or not (np.all(g > 0) or np.all(g < 0)) or not moving[i - 1 : i + 2, k].any():
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
        known = self.samples[value].certified
        if known is None and value not in self._vouched:
            self._vouched[value] = True if self._certify is None else bool(self._certify(value))
        return self._vouched[value] if known is None else known

    def crossings(self) -> list[Crossing]:
        """Brackets of all crossings between neighbours of the scan that both have a certificate, with no value between
        them at which there is nothing.
        """
        found = []
        self.uncertain = []
        values = sorted(self.samples)
        for a, b in zip(values[:-1], values[1:]):
            low, high = self.samples[a], self.samples[b]
            few, many = sorted((low.pairs, high.pairs))
            known = low.certified is not False and high.certified is not False
            known = known and not any(a < value < b for value in self.failures)
            if known and few != many:
                known = self.certified(a) and self.certified(b)
            if not known:
                self.uncertain.append((a, b))
                continue
            listed = min(len(low.eigenvalues), len(high.eigenvalues))
            if many > listed:  # a growth rate that only one end knows
                self.uncertain.append((a, b))
            found += [Crossing(k, low, high) for k in range(few, min(many, listed))]
        return found


def _exchanged(low: Sample, high: Sample) -> bool:
    """True where one mode ceases to be unstable between two samples and another becomes so.

    Modes of the samples are paired by the least sum of their distances.
    """
    if not (low.pairs and high.pairs):
        return False
    here, there = low.eigenvalues[:WATCHED], high.eigenvalues[:WATCHED]
    pairs = linear_sum_assignment(np.abs(here[:, None] - there))
    before, after = low.growing[:WATCHED][pairs[0]], high.growing[:WATCHED][pairs[1]]
    return bool((before & ~after).any() and (after & ~before).any())


def locate(scan: Scan, crossing: Crossing, tolerance: float) -> tuple[float, complex]:
    """Value at which the growth rate of a bracketed crossing vanishes (Brent's method), and the eigenvalue there.
    Raises SolveError if an equilibrium inside the bracket was not found. Raises JumpError if the growth rate jumps
    there, as it does with a state that passes a limit point or loses contact.
    """
    growth = {end.value: float(end.growth[crossing.index]) for end in (crossing.low, crossing.high)}
    low, high = crossing.low.value, crossing.high.value
    if (growth[low] > 0) == (growth[high] > 0):  # one end is neutral itself, to rounding
        neutral = min((crossing.low, crossing.high), key=lambda end: abs(growth[end.value]))
        return neutral.value, complex(neutral.eigenvalues[crossing.index])

    def rate(value: float) -> float:
        found = scan.within(value)
        if found is None:
            raise SolveError(scan.failures[float(value)])
        growth[value] = float(found.growth[crossing.index])
        _check_jump(growth, low, high)
        return growth[value]

    accuracy = {"xtol": tolerance * max(abs(low), abs(high)), "rtol": 8.9e-16, "maxiter": 80}
    value = float(brentq(rate, low, high, **accuracy))
    return value, complex(scan.within(value).eigenvalues[crossing.index])


def _check_jump(growth: dict[float, float], low: float, high: float) -> None:
    """Refuse a bracket of a growth rate that has narrowed while the rates at its ends stayed apart."""
    sign = growth[high] > 0
    below = max(value for value, rate in growth.items() if (rate > 0) != sign)
    above = min(value for value, rate in growth.items() if value > below)
    if above - below > NARROW * (high - low):
        return
    if abs(growth[above] - growth[below]) > STEEP * abs(growth[high] - growth[low]):
        raise JumpError(
            f"A growth rate jumps between {below:.6g} and {above:.6g}, from {growth[below]:.4g} to "
            f"{growth[above]:.4g} 1/s: no mode is neutral there."
        )
