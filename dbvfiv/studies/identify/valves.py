"""Measured oscillations of a valve, and the modes that sampled valves have where those were measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq, linear_sum_assignment

from eigen.columns import ColumnSolver

from ...case.axis import parse_point
from ...case.parameters import PARAMETERS, Mu
from ...case.quantity import head_of
from ...errors import CaseError, SolveError
from ...verdict.reading import PLAIN, Reading, judge_file
from ..case import Case
from ..inputs import Plan
from ..stability.place import design_value
from ..stability.walk import StabilityWalk

#: Keys of a record that is a mode and no file.
OF_A_MODE = "frequency", "frequency_interval", "damping_ratio", "damping_ratio_interval"
#: Leading modes taken of a valve at a place.
MODES = 12
#: Least likeness of shapes, the modal assurance criterion, of a mode and that of the case itself.
ALIKE = 0.2
#: Values of the range at which its damping is looked at, between those computed.
FINE = 400
#: Error of an onset over the distance of the values that enclose it.
ACCURATE = 0.005
#: Values of the range without one, and how far it reaches beyond the records.
VALUES, BEYOND = 8, 2.5


@dataclass(frozen=True)
class Measured:
    """An oscillation that was measured."""

    record: int  #: Number of its record.
    #: frequency and frequency_error: Hz; with half its 95 % interval, as all errors.
    frequency: float
    frequency_error: float
    #: damping_ratio and damping_error: NaN where only the frequency is known.
    damping_ratio: float = np.nan
    damping_error: float = np.nan


def measured_of(case: Case, record: int) -> tuple[list[Measured], str]:
    """Oscillations of a record that are modes, each once, and a sentence on it. Raises CaseError for a record that
    cannot be read, or says neither file nor mode, or both.
    """
    given, name = case.identify.records[record], f"identify.records.{record}"
    if given.file is None:
        if given.frequency is None or given.frequency_interval is None:
            raise CaseError(
                f"{name} names no file, and a mode needs frequency and frequency_interval; give them, or file.",
                key=name,
            )
        if (given.damping_ratio is None) != (given.damping_ratio_interval is None):
            raise CaseError(f"{name} has one of damping_ratio and damping_ratio_interval; give both.", key=name)
        numbers = given.frequency, given.frequency_interval, given.damping_ratio, given.damping_ratio_interval
        one = Measured(record, *(np.nan if number is None else number for number in numbers))
        return [one], f"a mode of {one.frequency:.5g} Hz"
    for key in OF_A_MODE:
        if getattr(given, key) is not None:
            raise CaseError(
                f"{name} names a file and has {key}, which is of a mode in place of one; give one of them.", name
            )
    found, said = [], []
    columns = [given.column] if given.column else []
    for judged in judge_file(given.file, Reading(columns, rate=given.rate, hints=PLAIN)):
        own = []
        for line in judged.verdict.lines:
            if line.get("rate") and line["called"] in ("", "resonance") and line["damping_ratio_interval"]:
                numbers = (line[key] for key in ("frequency", "frequency_interval", "damping_ratio"))
                own.append(Measured(record, *numbers, line["damping_ratio_interval"]))
        found = _each_once(found, own, case.identify.error)
        said.append(f"{judged.signal.name}: {judged.verdict.name}")
    return found, "; ".join(said)


def _each_once(found: Sequence[Measured], more: Sequence[Measured], error: float) -> list[Measured]:
    """Oscillations of a record and of a further column of it. A mode that both have is that of the smaller interval:
    what moved it, and what the model is off by, is the same in both.

    Parameters
    ----------
    error : float
        Relative error of computed frequencies, within which two are one as two with intervals that overlap are.
    """
    kept = [*found]
    for one in more:
        near = min(found, key=lambda other: abs(other.frequency - one.frequency), default=None)
        if near is None or abs(near.frequency - one.frequency) > (
            near.frequency_error + one.frequency_error + error * one.frequency
        ):
            kept.append(one)
        elif one.frequency_error < near.frequency_error:
            at = next((i for i, other in enumerate(kept) if other is near), len(kept))
            kept[at : at + 1] = [one]
    return kept


@dataclass(frozen=True)
class Places:
    """Parameter points at which valves are asked: those of the records, then values of a range."""

    case: Case

    @cached_property
    def of_records(self) -> list[dict[str, float]]:
        """Parameters of each record by name, SI."""
        return [parse_point(one.at, self.case.fluid.density) for one in self.case.identify.records]

    @cached_property
    def parameter(self) -> str:
        """Parameter of the range."""
        return self.case.identify.parameter

    @cached_property
    def plan(self) -> Plan:
        """Inputs of the valve, none of which a place names or the range moves."""
        named = (name for one in self.of_records for name in one)
        return Plan(self.case, (self.parameter, *named), "the place of a record or the range of identify")

    @cached_property
    def now(self) -> float | None:
        """Value of that parameter at the last record."""
        return self.value_at(-1)

    def value_at(self, record: int) -> float | None:
        """Value of that parameter at a record; None of one of the design that has no one value in the case."""
        name, point = self.parameter, self._point(self.of_records[record])
        return point[name] if name in point else design_value(self.case, name)

    @cached_property
    def values(self) -> tuple[float, ...]:
        """Values of the range, SI."""
        axis = self.case.identify.axis
        if axis is not None:
            return axis.values
        known = [self._point(one)["pressure"] for one in self.of_records]
        rest, low = self.case.rest_pressure, min(known)
        flows = min(1.01 * rest, rest + (low - rest) / BEYOND)  # above what nothing flows at, and below the records
        return tuple(np.geomspace(max(low / BEYOND, flows), max(known) * BEYOND, VALUES).tolist())

    @property
    def hold_last(self) -> bool:
        """True where the last record lies within the range."""
        near = 1e-9 * abs(self.now)
        return self.values[0] - near <= self.now <= self.values[-1] + near

    def _point(self, moved: dict[str, float]) -> Mu:
        return Mu.of(self.case).at(**moved)

    @cached_property
    def moved(self) -> list[dict[str, float]]:
        """Parameters of all places, each once: those of the records first."""
        last = self.of_records[-1]
        wanted = [*self.of_records, *(last | {self.parameter: value} for value in self.values)]
        found: list[dict[str, float]] = []
        for one in wanted:
            if all(self._point(one) != self._point(other) for other in found):
                found.append(one)
        return found

    def number(self, moved: dict[str, float]) -> int:
        """Number of a place."""
        return next(i for i, one in enumerate(self.moved) if self._point(one) == self._point(moved))

    def of_line(self, line: Measured) -> int:
        """Number of the place of a measured oscillation."""
        return self.number(self.of_records[line.record])

    @cached_property
    def first(self) -> list[int]:
        """Places of the records, each once."""
        return sorted({self.number(one) for one in self.of_records})

    @cached_property
    def ranged(self) -> list[int]:
        """Places of the values of the range."""
        last = self.of_records[-1]
        return [self.number(last | {self.parameter: value}) for value in self.values]

    def words(self, place: int) -> str:
        """A place for people."""
        said = []
        for name, value in self.moved[place].items():
            said.append(f"{PARAMETERS[name].text(value)}{self.head(name, value)}")
        return ", ".join(said) or "the state of the case"

    def head(self, name: str, value: float) -> str:
        """Head of a pressure, to stand behind it; empty for other parameters."""
        return f" ({head_of(value, self.case.fluid.density):.3g} m)" if name == "pressure" else ""


class Modes(NamedTuple):
    """Leading modes of a sampled valve at one place."""

    sample: int
    place: int
    eigenvalues: np.ndarray  #: (MODES,), 1/s; NaN where there are fewer.
    #: (MODES, MODES); modal assurance criterion of the modes of the case itself, in rows, and of these.
    alike: np.ndarray
    why: str = ""  #: Why there are none.

    @classmethod
    def none(cls, sample: int, place: int, why: str) -> Modes:
        return cls(sample, place, np.full(MODES, np.nan + 0j), np.zeros((MODES, MODES)), why)


class Begins(NamedTuple):
    """Values of the range at which flutter of a sampled valve begins below and above the last record; NaN where it does
    not.
    """

    sample: int
    below: float
    above: float


class Valves:
    """Modes of sampled valves at places.

    Parameters
    ----------
    known : sequence of (q, shapes) or None
        Displacements and shapes of the modes of the case itself at each place.
    """

    def __init__(self, plan: Plan, places: Places, known: Sequence[tuple[np.ndarray, np.ndarray] | None]):
        self.plan, self.places, self.known = plan, places, known
        self._solver, self._own = ColumnSolver(), None

    def found(self, first: int, numbers: np.ndarray, asked: Sequence[int]) -> list[Modes | Begins]:
        """Modes of samples, whose values (m, d) are given, at places, and where their flutter begins if all of the
        range is asked; the first sample has the number `first`.
        """
        if self.plan.is_surrounding and all(PARAMETERS[n].surrounding for m in self.places.moved for n in m):
            self._own = self._own or StabilityWalk(self.plan.case)
        return [one for k, row in enumerate(numbers) for one in self._one(first + k, row, asked)]

    def _one(self, sample: int, row: np.ndarray, asked: Sequence[int]):
        walk = self._own
        try:
            walk = walk or self.plan.walk(row, self._solver)
        except (SolveError, CaseError) as error:
            yield from (Modes.none(sample, place, str(error)) for place in asked)
            return
        rows = {place: self._modes(sample, row, walk, place) for place in asked}
        yield from rows.values()
        if set(self.places.ranged) <= set(asked):
            damping = least_damping(np.array([rows[place].eigenvalues for place in self.places.ranged]))
            values = np.array(self.places.values)
            run = stretch(values, self.places.now, np.isfinite(damping)[None])
            least = partial(self._least, row, walk)
            found = self._begins(values[run], damping[run], least) if len(values[run]) else (np.nan, np.nan)
            yield Begins(sample, *found)

    def _modes(self, sample: int, row: np.ndarray, walk: StabilityWalk, place: int) -> Modes:
        if self.known[place] is None:
            return Modes.none(sample, place, "The valve of the case has no state there.")
        q, shapes = self.known[place]
        try:
            point = self.plan.point(walk.case, row, **self.places.moved[place])
            walk.settle(point, q)
            found = walk.spectrum(point, MODES)
            return Modes(sample, place, *_kept(found.eigenvalues, found.q, shapes))
        except (SolveError, CaseError, ValueError) as error:
            return Modes.none(sample, place, str(error))

    def _least(self, row: np.ndarray, walk: StabilityWalk, value: float) -> float:
        """Least damping ratio of a valve at a value of the range; NaN where it is not known."""
        moved = self.places.of_records[-1] | {self.places.parameter: value}
        try:
            point = self.plan.point(walk.case, row, **moved)
            return float(least_damping(walk.spectrum(point, MODES).eigenvalues[None])[0])
        except (SolveError, CaseError, ValueError):
            return np.nan

    def _begins(self, values: np.ndarray, damping: np.ndarray, least: Callable[[float], float]) -> Iterator[float]:
        """Onsets below and above, each between the two of the values that enclose it (Brent's method)."""
        now = self.places.now
        axis, back = (np.log(values), np.exp) if values[0] > 0 else (values, float)
        for guess in (side[0] for side in onsets(values, damping[None], now)[:2]):
            if not np.isfinite(guess):
                yield np.nan
                continue
            k = int(np.clip(np.searchsorted(values, guess), 1, len(values) - 1))
            known = {axis[k - 1]: damping[k - 1], axis[k]: damping[k]}
            try:
                found = brentq(
                    lambda x, known=known: known[x] if x in known else least(back(x)),
                    axis[k - 1],
                    axis[k],
                    xtol=ACCURATE * (axis[k] - axis[k - 1]),
                )
                yield float(back(found))
            except ValueError:  # a valve that was lost on the way
                yield np.nan


def stretch(values: np.ndarray, now: float, known: np.ndarray, least: int = 1) -> slice:
    """Run of values (k,), rising, about the present one, as far as all of it is known of so many samples.

    Parameters
    ----------
    known : (n, k) bool array
        Whether a sample has a mode at a value.

    Returns
    -------
    slice
        Empty where there are no two such values.
    """
    near = 1e-9 * abs(now)
    low = max(int(np.searchsorted(values, now + near, "right")) - 1, 0)
    high = min(int(np.searchsorted(values, now - near)), len(values) - 1)

    def holds(low: int, high: int) -> bool:
        within = 0 <= low and high < len(values)
        return within and known[:, low : high + 1].all(axis=1).sum() >= least

    if not holds(low, high):
        return slice(0, 0)
    while (up := holds(low, high + 1)) or holds(low - 1, high):
        low, high = (low, high + 1) if up else (low - 1, high)
    return slice(low, high + 1) if high > low else slice(0, 0)


def _kept(eigenvalues: np.ndarray, q: np.ndarray, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count = min(MODES, len(eigenvalues))
    kept, alike = np.full(MODES, np.nan + 0j), np.zeros((MODES, MODES))
    kept[:count] = eigenvalues[:count]
    size = (np.abs(shapes) ** 2).sum(axis=0)[:, None] * (np.abs(q[:, :count]) ** 2).sum(axis=0)
    alike[: shapes.shape[1], :count] = np.abs(shapes.conj().T @ q[:, :count]) ** 2 / np.maximum(size, 1e-300)
    return kept, alike


def own_modes(walk: StabilityWalk, point: Mu) -> tuple[np.ndarray, np.ndarray]:
    """Displacements of a state, and shapes (n, MODES at most) of its leading modes. Raises SolveError."""
    q = walk.equilibrium(point)
    return q, walk.spectrum(point, MODES).q[:, :MODES]


def follow(eigenvalues: np.ndarray, alike: np.ndarray) -> np.ndarray:
    """Frequency, Hz, and damping ratio (n, MODES, 2) of the modes of samples by those of the case that they are like.

    Parameters
    ----------
    eigenvalues : (n, MODES) complex array
    alike : (n, MODES, MODES) array
        See `Modes`.

    Returns
    -------
    array
        NaN where a sample has no mode of that shape that oscillates.
    """
    found = np.full((*eigenvalues.shape, 2), np.nan)
    for i, (values, likeness) in enumerate(zip(eigenvalues, alike)):
        known = np.flatnonzero(np.isfinite(values) & (np.abs(values.imag) > 1e-6 * np.abs(values.real)))
        rows, columns = linear_sum_assignment(-likeness[:, known])
        for row, column in zip(rows, columns):
            if likeness[row, known[column]] >= ALIKE:
                value = values[known[column]]
                found[i, row] = abs(value.imag) / (2 * np.pi), -value.real / abs(value)
    return found


def least_damping(eigenvalues: np.ndarray) -> np.ndarray:
    """Least damping ratio (n,) of oscillating modes; NaN where none is known."""
    ratio = np.where(np.abs(eigenvalues.imag) > 1e-6 * np.abs(eigenvalues.real), -eigenvalues.real, np.nan)
    ratio = ratio / np.abs(eigenvalues)
    known = np.isfinite(ratio).any(axis=1)
    out = np.full(len(ratio), np.nan)
    out[known] = np.nanmin(ratio[known], axis=1)
    return out


def records_said(case: Case) -> tuple[list[Measured], list[dict[str, Any]]]:
    """Oscillations of all records, and what each record is. Raises CaseError where none holds a mode."""
    found, said = [], []
    for number, record in enumerate(case.identify.records):
        lines, words = measured_of(case, number)
        found += lines
        name = "" if record.file is None else record.file.name
        said.append({"record": number, "file": name, "says": words, "modes": len(lines)})
    if not found:
        told = "; ".join(f"{one['file']} ({one['says']})" for one in said)
        raise CaseError(
            f"No record holds a mode, a ring-down, growth or a peak of motion under noise: {told}.",
            key="identify.records",
        )
    return found, said


def _interpolated(values: np.ndarray, damping: np.ndarray, now: float) -> tuple[PchipInterpolator, float]:
    """Damping over the values, or their logarithms, and the present one among them."""
    axis, place = (np.log(values), np.log(now)) if values[0] > 0 else (values, now)
    return PchipInterpolator(axis, damping, axis=1), float(np.clip(place, axis[0], axis[-1]))


def onsets(values: np.ndarray, damping: np.ndarray, now: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values at which flutter begins below and above the present one, and the damping there.

    Parameters
    ----------
    values : (k,) array
        Rising.
    damping : (n, k) array
        Least damping ratio of samples.

    Returns
    -------
    below, above, present : (n,) arrays
        NaN where flutter does not begin within the values. Of a sample that flutters now, where it ends.
    """
    smooth, place = _interpolated(values, damping, now)
    axis = smooth.x
    fine = np.unique(np.append(np.linspace(axis[0], axis[-1], FINE), place))
    table, at = smooth(fine), int(np.searchsorted(fine, place))
    below, above = np.full(len(damping), np.nan), np.full(len(damping), np.nan)
    for out, part, order in ((above, slice(at, None), 1), (below, slice(0, at + 1), -1)):
        x, y = fine[part][::order], table[:, part][:, ::order]
        if len(x) < 2:
            continue
        changed = (y[:, 1:] < 0) != (y[:, :1] < 0)
        first = np.argmax(changed, axis=1)
        rows = np.flatnonzero(changed.any(axis=1))
        k = first[rows]
        a, b = y[rows, k], y[rows, k + 1]
        out[rows] = x[k] + (x[k + 1] - x[k]) * a / (a - b)
    if values[0] > 0:
        below, above = np.exp(below), np.exp(above)
    return below, above, smooth(place)
