"""Samples along a parameter line, and every value at which one of their eigenvalues reaches the imaginary axis.

Crossings found with a reduced-order model are corrected with the full matrices (`OnsetCorrection`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigen.columns import Cell, Column, ReducedColumn
from eigen.spectrum import Spectrum

from ...case.axis import Level
from ...case.parameters import Mu
from ...errors import CaseError, NotValidError, SolveError
from .place import is_surrounding
from .samples import Sample, SampleKey
from .scan import Crossing, Scan, locate
from .walk import StabilityWalk

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
    model : eigen.ReducedColumn
    place : callable
        From a value along the line to its parameter point.
    direct : callable
        From a value to leading eigenvalues of the full pencil, where corrections on the small model do not settle.
    level : Level, optional
        Of the crossing; neutral by default.
    single : float, optional
        Largest relative change of an eigenvalue by one correction that stands for that of the full matrices.
    """

    model: ReducedColumn
    place: Callable[[float], Mu]
    direct: Callable[[float], np.ndarray]
    level: Level = Level()
    single: float = ACCURATE

    def __call__(self, value: float, frequency: float) -> tuple[float, float, float]:
        """Value, frequency (Hz) and excess over the size of the eigenvalue, NaN where no mode was followed."""
        near = self.level.eigenvalue(2 * np.pi * frequency)
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
            excess = float(self.level.excess(found))
            near, left = found, abs(excess) / max(abs(found), 1.0)
            if left <= NEUTRAL:
                break
            if abs(excess) > REACH * abs(slope) * (abs(value) or 1.0):
                return None  # a growth rate that hardly changes along the column leads astray
            value -= excess / slope
        return (value, abs(near.imag) / (2 * np.pi), left) if left <= ACCURATE else None

    def _small(self, value: float, near: complex) -> complex | None:
        """Eigenvalue of the small model; None where it has none near, as where all cells needed the full matrices."""
        found = self.model.nearest(self.place(value), near)
        return found if abs(found - near) <= MOVED * max(abs(near), 1.0) else None

    def _slope(self, eigenvalue, value: float, near: complex) -> float:
        step = STEP * (abs(value) or 1.0)
        up, down = (eigenvalue(v, near) for v in (value + step, value - step))
        if up is None or down is None:
            return float("nan")
        return float(self.level.excess(up) - self.level.excess(down)) / (2 * step)

    def _by_correction(self, value: float, near: complex) -> complex | None:
        found = self._small(value, near)
        if found is None:
            return None
        size, change = max(abs(found), 1.0), complex(self.model.corrected(self.place(value), [found])[0])
        if abs(change) > self.single * size:  # one correction leaves as much as it changes, or several times that
            change = self.model.exact(self.place(value), found) - found
        return found + change if abs(change) < SAME * size else None

    def _by_solving(self, value: float, near: complex) -> complex | None:
        try:
            values = self.direct(value)
        except SolveError:
            return None
        beside = values[np.abs(values - near) <= SAME * max(abs(near), 1.0)]
        return complex(beside[int(np.argmin(np.abs(beside - near)))]) if len(beside) else None


# -- the line

#: Accuracy of a crossing on a reduced-order model that the full matrices correct.
ROUGH = 1e-6


class LineOnset(NamedTuple):
    """A located crossing of the imaginary axis, or of another level."""

    value: float
    eigenvalue: complex  #: 1/s.
    #: Excess over the size of the eigenvalue that the full matrices leave there; NaN where they were not asked.
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
    base : Mu
        Parameter point with all that is not moved.
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
    def column(self) -> Column | None:
        """Cells at the values, with their reduced-order model; None where each value has its own steady state. Raises
        SolveError.
        """
        if not self.stays:
            return None
        return self.walk.column([self.place(value) for value in self.values], **self._column_options)

    @property
    def is_reduced(self) -> bool:
        """True where there is a reduced-order model."""
        return self.column is not None and self.column.model is not None

    @property
    def error(self) -> float:
        """Largest estimated relative error of a leading eigenvalue of the reduced-order model."""
        return self.column.error if self.stays and any(not s.refusal for s in self.samples.values()) else 0.0

    def cells(self) -> list[Sample]:
        """Samples at all values at once. Raises SolveError if a steady state that all of them share was not found."""
        try:
            for value, cell in zip(self.values, () if self.column is None else self.column.cells):
                self.samples[value] = replace(self.walk.sample(self.place(value), cell, value), key=self.key)
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
                sample = self.walk.sample(self.place(value), self._cell(value, spectrum), value)
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

    def _cell(self, value: float, spectrum: Spectrum | None = None) -> Cell:
        """Leading eigenvalues at a value and their certificate."""
        place = self.place(value)
        if self.stays:
            self.walk.require_valid(place)
            if self.is_reduced:
                return self.column.model.cell(place)
        return self.walk.cell(place, spectrum)

    def _is_certified(self, value: float) -> bool:
        cell = self._cell(value)
        return cell.certificate.agrees and not cell.open_above

    def spectrum(self, value: float) -> np.ndarray:
        """Leading eigenvalues of the full pencil. Raises SolveError."""
        return np.asarray(self.walk.spectrum(self.place(value)).eigenvalues)

    def _scanned(self, value: float, counted: bool = True) -> Sample:
        """A sample where its count is asked for or costs nothing besides, else leading eigenvalues alone."""
        if value in self.samples or (self.counts == "all" and (counted or not self.is_reduced)):
            sample = self.sample(value)
            if sample.is_missing:
                raise SolveError(sample.failure or sample.refusal)
            return sample
        known = self.column.model.eigenvalues(self.place(value)) if self.is_reduced else self.spectrum(value)
        return Sample(value, known)

    def _inside(self, value: float) -> Sample:
        """A sample on the way to a crossing. Where the wall relaxes the count costs most by far, and next to a neutral
        mode it is of no use, so it is left out there and the sample is not kept.
        """
        return self._scanned(value, counted=not self.place(value).loss_factor)

    def contour(self, level: Level) -> Scan:
        """Scan for the values at which modes cross a level."""
        return Scan(lambda value: level.shifted(self._known(value)), self.log)

    def _known(self, value: float) -> np.ndarray:
        """Leading eigenvalues at a value, without a count where the reduced-order model has them."""
        if self.is_reduced:
            self.walk.require_valid(self.place(value))
            return self.column.model.eigenvalues(self.place(value))
        return self._scanned(value).eigenvalues

    def locate(
        self, crossing: Crossing, tolerance: float, level: Level = Level(), scan: Scan | None = None
    ) -> LineOnset:
        """Locate a crossing; on a reduced-order model it is corrected with the full matrices, which search for it where
        corrections do not settle. A level besides the neutral one has a scan of its own. Raises SolveError.
        """
        value, eigenvalue = locate(scan or self.scan, crossing, tolerance)
        if not self.is_reduced:
            return LineOnset(value, eigenvalue, abs(eigenvalue.real) / max(abs(eigenvalue), 1.0))
        correct = OnsetCorrection(
            self.column.model, self.place, self.spectrum, level, min(ACCURATE, max(tolerance, NEUTRAL))
        )
        found, frequency, residual = correct(value, abs(eigenvalue.imag) / (2 * np.pi))
        if np.isfinite(residual):
            return LineOnset(found, level.eigenvalue(2 * np.pi * frequency), residual)
        full = Scan(lambda value: level.shifted(self.spectrum(value)))
        full.samples |= {sample.value: sample for sample in (crossing.low, crossing.high)}
        try:
            found, exact = locate(full, crossing, tolerance)
        except (SolveError, IndexError, ValueError):  # the full matrices have no such crossing there
            return LineOnset(value, eigenvalue, np.nan)
        return LineOnset(found, exact, abs(exact.real) / max(abs(exact), 1.0))
