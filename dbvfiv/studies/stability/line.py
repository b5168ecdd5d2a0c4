"""Samples along a parameter line, and every value at which one of their eigenvalues reaches the imaginary axis.

The k-th largest growth rate g_k is a continuous function of the parameter wherever the spectrum is, so crossings are
its zeros. Between the values of a scan they are bracketed by the number of unstable modes; where the parabola through
three values of g_k reaches zero between them although no number changes, the scan is refined, so that narrow tongues of
instability or stability are not stepped over; and where one mode ceases to be unstable while another becomes so, which
changes no number either.

Crossings found with a reduced-order model are corrected with the full matrices (`OnsetCorrection`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, linear_sum_assignment

from eigen import Column as Cells
from eigen import Spectrum

from ...case.parameters import Mu
from ...errors import CaseError, JumpError, NotValidError, SolveError
from .place import is_surrounding
from .samples import WATCHED, Sample, SampleKey
from .walk import StabilityWalk

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
            found += [Crossing(k, low, high) for k in range(few, min(many, WATCHED))]
        return found


def _exchanged(low: Sample, high: Sample) -> bool:
    """True where one mode ceases to be unstable between two samples and another becomes so.

    Modes of the samples are paired by the least sum of their distances.
    """
    if not (low.pairs and high.pairs):
        return False
    here, there = low.eigenvalues[:WATCHED], high.eigenvalues[:WATCHED]
    pairs = linear_sum_assignment(np.abs(here[:, None] - there))
    before, after = here[pairs[0]].real > 0, there[pairs[1]].real > 0
    return bool((before & ~after).any() and (after & ~before).any())


def locate(scan: Scan, crossing: Crossing, tolerance: float) -> tuple[float, complex]:
    """Value at which the growth rate of a bracketed crossing vanishes (Brent's method), and the eigenvalue there.

    Raises
    ------
    SolveError
        If an equilibrium inside the bracket was not found.
    JumpError
        If the growth rate jumps there, as it does with a state that passes a limit point or loses contact.
    """
    growth = {end.value: float(end.growth[crossing.index]) for end in (crossing.low, crossing.high)}
    low, high = crossing.low.value, crossing.high.value

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
            f"The state jumps between {below:.6g} and {above:.6g}, where a growth rate goes from {growth[below]:.4g} "
            f"to {growth[above]:.4g} 1/s: no mode is neutral there."
        )


#: Growth rate over the size of the eigenvalue up to which an onset counts as neutral.
ACCURATE = 1e-6
#: The same, at which corrections end.
NEUTRAL = 1e-10
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
    """Newton steps along a line with eigenvalues of the full matrices and slopes of the reduced-order model.

    Parameters
    ----------
    column : eigen.Column
    place : callable
        From a value along the line to its parameter point.
    direct : callable
        From a value to leading eigenvalues of the full pencil, where corrections on the small model do not settle.
    """

    column: Cells
    place: Callable[[float], Mu]
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
        found = self.column.nearest(self.place(value), near)
        return found if abs(found - near) <= MOVED * max(abs(near), 1.0) else None

    def _slope(self, eigenvalue, value: float, near: complex) -> float:
        step = STEP * (abs(value) or 1.0)
        up, down = (eigenvalue(v, near) for v in (value + step, value - step))
        return float("nan") if up is None or down is None else (up.real - down.real) / (2 * step)

    def _by_correction(self, value: float, near: complex) -> complex | None:
        found = self._small(value, near)
        if found is None:
            return None
        change = self.column.corrected(self.place(value), found)
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


# -- the line
# ----

#: Accuracy of a crossing on a reduced-order model that the full matrices correct.
ROUGH = 1e-6


class LineOnset(NamedTuple):
    """A located crossing of the imaginary axis.

    Attributes
    ----------
    value : float
    eigenvalue : complex, 1/s
    residual : float
        Growth rate over the size of the eigenvalue that the full matrices leave there; NaN where they were not asked.
    """

    value: float
    eigenvalue: complex
    residual: float

    @property
    def frequency(self) -> float:
        """Hz."""
        return abs(self.eigenvalue.imag) / (2 * np.pi)


class ParameterLine:
    """Samples and onsets along one parameter.

    Where the steady state stays the same, samples come from one reduced-order model of it, cells without a certificate
    excepted; elsewhere each value has its own steady state and its own full spectrum.

    Parameters
    ----------
    walk : StabilityWalk
    base : Mu
        Parameter point with all that is not moved.
    parameter : str
    values : sequence of float
        Ascending; the reduced-order model is made for them.
    log : bool
        Whether they are spaced logarithmically.
    snapshots, edges, count
        Of the reduced-order model, see `StabilityWalk.column`.
    counts : str
        "all": an independent count for every sample; "brackets": beside crossings; "none".
    key : SampleKey
        Of its samples.
    known : iterable of Sample
        Of an earlier run, not solved again; those of another key are left aside.
    tell : callable, optional
        Told of every sample with counts as it is found.
    """

    def __init__(
        self,
        walk: StabilityWalk,
        base: Mu,
        parameter: str,
        values: Sequence[float],
        log: bool = False,
        *,
        snapshots: int = 3,
        edges: bool = False,
        count: int = 2,
        counts: str = "all",
        key: SampleKey = SampleKey(),
        known: Iterable[Sample] = (),
        tell: Callable[[Sample], None] | None = None,
    ):
        self.walk, self.base, self.parameter, self.values, self.log = walk, base, parameter, tuple(values), log
        self._column_options = {"snapshots": snapshots, "edges": edges, "count": count}
        self.counts, self.tell, self.key = counts, tell, key
        self.samples = {sample.value: sample for sample in known if sample.key[:3] == key[:3]}
        self._earlier = set(self.samples)
        certify = self._is_certified if counts == "brackets" else None
        self.scan = Scan(self._scanned, log, certify, self._inside)

    def place(self, value: float) -> Mu:
        """Parameter point at a value."""
        return self.base.at(**{self.parameter: float(value)})

    @property
    def stays(self) -> bool:
        """True where all values share one steady state."""
        return is_surrounding(self.walk.case, self.parameter)

    @cached_property
    def column(self) -> Cells | None:
        """Cells at the values, with their reduced-order model; None where each value has its own steady state.

        Raises
        ------
        SolveError
        """
        if not self.stays:
            return None
        return self.walk.column([self.place(value) for value in self.values], **self._column_options)

    @property
    def is_reduced(self) -> bool:
        """True where there is a reduced-order model."""
        return self.column is not None and self.column.cell is not None

    @property
    def error(self) -> float:
        """Largest estimated relative error of a leading eigenvalue of the reduced-order model."""
        return self.column.error if self.stays and any(not s.refusal for s in self.samples.values()) else 0.0

    def cells(self) -> list[Sample]:
        """Samples at all values at once.

        Raises
        ------
        SolveError
            If a steady state that all of them share was not found.
        """
        try:
            for i, value in enumerate(self.values if self.column is not None else ()):
                self.samples[value] = replace(self.walk.sample(self.place(value), self.column, i, value), key=self.key)
        except NotValidError:  # at all of them
            refused = {v: Sample(v, refusal=self.walk.refusal(self.place(v)), key=self.key) for v in self.values}
            self.samples |= refused
        found = [self.sample(value) for value in self.values]
        if self.stays and any(sample.failure for sample in found):
            raise SolveError(next(sample.failure for sample in found if sample.failure))
        return found

    def sample(self, value: float, spectrum: Spectrum | None = None) -> Sample:
        """Sample at a value, with its count; one that an earlier run has found is not solved again, and the leading
        modes of the full pencil may be known.
        """
        if value not in self.samples:
            try:
                sample = self.walk.sample(self.place(value), self._cell(value, spectrum), value=value)
            except NotValidError as error:
                sample = Sample(value, refusal=str(error))
            except (SolveError, CaseError) as error:
                sample = Sample(value, failure=str(error))
            self.samples[value] = sample = replace(sample, key=self.key)
            if self.tell is not None:
                self.tell(sample)
        elif value in self._earlier and not self.samples[value].is_missing:
            self._earlier.discard(value)
            self.walk.recall(self.place(value))
        return self.samples[value]

    def _cell(self, value: float, spectrum: Spectrum | None = None) -> Cells:
        """Leading eigenvalues at a value and their certificate."""
        place = self.place(value)
        if self.stays:
            self.walk.require_valid(place)
            if self.is_reduced:
                return self.column.cell(place)
        return self.walk.column([place], spectra=None if spectrum is None else [spectrum])

    def _is_certified(self, value: float) -> bool:
        return bool(self._cell(value).certified[0])

    def spectrum(self, value: float) -> np.ndarray:
        """Leading eigenvalues of the full pencil.

        Raises
        ------
        SolveError
        """
        return np.asarray(self.walk.spectrum(self.place(value)).eigenvalues)

    def _scanned(self, value: float) -> Sample:
        if value in self.samples or self.counts == "all":
            sample = self.sample(value)
            if sample.is_missing:
                raise SolveError(sample.failure or sample.refusal)
            return sample
        if self.is_reduced:
            return Sample(value, self.column.eigenvalues(self.place(value)))
        return Sample(value, self.spectrum(value))

    def _inside(self, value: float) -> Sample:
        """A sample on the way to a crossing. Where the wall relaxes the count costs most by far, and next to a neutral
        mode it is of no use, so it is left out there and the sample is not kept.
        """
        counted = value in self.samples or (self.counts == "all" and not self.place(value).loss_factor)
        if counted or not self.is_reduced:
            return self._scanned(value)
        return Sample(value, self.column.eigenvalues(self.place(value)))

    def bracket(self, crossing: Crossing, tolerance: float) -> tuple[float, complex]:
        """Value and eigenvalue of a crossing as samples have it, without a correction.

        Raises
        ------
        SolveError
        """
        return locate(self.scan, crossing, tolerance)

    def locate(self, crossing: Crossing, tolerance: float) -> LineOnset:
        """Locate a crossing; on a reduced-order model it is corrected with the full matrices, which search for it where
        corrections do not settle.

        Raises
        ------
        SolveError
        """
        value, eigenvalue = self.bracket(crossing, tolerance)
        if not self.is_reduced:
            return LineOnset(value, eigenvalue, abs(eigenvalue.real) / max(abs(eigenvalue), 1.0))
        correct = OnsetCorrection(self.column, self.place, self.spectrum)
        found, frequency, residual = correct(value, abs(eigenvalue.imag) / (2 * np.pi))
        if np.isfinite(residual):
            return LineOnset(found, 2j * np.pi * frequency, residual)
        full = Scan(self.spectrum)
        full.samples |= {sample.value: sample for sample in (crossing.low, crossing.high)}
        try:
            found, exact = locate(full, crossing, tolerance)
        except (SolveError, IndexError, ValueError):  # the full matrices have no such crossing there
            return LineOnset(value, eigenvalue, np.nan)
        return LineOnset(found, exact, abs(exact.real) / max(abs(exact), 1.0))
