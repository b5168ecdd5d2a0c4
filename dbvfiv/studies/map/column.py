"""One column of a stability map: all its cells, and where along it modes reach the imaginary axis."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigen import Column
from eigen.columns import MISSING

from ...case.axis import Axis
from ...case.parameters import Mu
from ...errors import CaseError, NotValidError, SolveError
from ..case import Case
from ..stability.crossings import OnsetCorrection, Sample, Scan, locate
from ..stability.place import condition_of, is_surrounding, point_under
from ..stability.verdict import NOT_VALID, OUTCOMES, UNDECIDED, Verdict, describe_counts
from ..stability.walk import StabilityWalk

#: What is kept of each cell.
CELLS = (
    *("growth_rate", "frequency", "second", "oscillating_rate", "oscillating_frequency", "damping_ratio"),
    *("unstable", "counted", "certified", "how", "outcome"),
)
#: Relative accuracy of onsets along a column, and of those that the full matrices correct.
LOCATED, ROUGH = 1e-10, 1e-6


class ColumnTask(NamedTuple):
    """A column to solve.

    Attributes
    ----------
    value : float
        Of the axis across.
    level : int
        0 for a column of the grid, more for one that is put between two of them.
    laws : tuple of int
        Numbers of the continuity laws under which it is needed.
    """

    value: float
    level: int
    laws: tuple[int, ...]

    @property
    def key(self) -> tuple[float, int]:
        """Key that identifies the column among the others."""
        return self.value, self.level


@dataclass(frozen=True)
class MapPlan:
    """Plan of a map: its cells, and the order in which they are computed.

    Attributes
    ----------
    case : Case
    x, y : Axis
    laws : tuple of float
        Blends of the continuity laws, one picture each.
    refine : int
        Number of times that columns are halved where the number of onsets changes.
    """

    case: Case
    x: Axis
    y: Axis
    laws: tuple[float, ...]
    refine: int = 2

    @classmethod
    def of(cls, case: Case) -> MapPlan:
        """The map of a case file."""
        x, y = case.map.axes
        storage = Mu.of(case).storage
        both = case.map.continuity == "both" and "storage" not in (x.parameter, y.parameter)
        return cls(case, x, y, (0.0, 1.0) if both else (storage,), case.map.refine)

    @property
    def transposed(self) -> bool:
        """True where columns run along x, since y alone changes the steady state."""
        return is_surrounding(self.case, self.x.parameter) and not is_surrounding(self.case, self.y.parameter)

    @property
    def across(self) -> Axis:
        """Axis with one column for each of its values."""
        return self.y if self.transposed else self.x

    @property
    def along(self) -> Axis:
        """Axis of the cells of one column."""
        return self.x if self.transposed else self.y

    @cached_property
    def base(self) -> Mu:
        return Mu.of(self.case)

    def place(self, across: float, along: float, law: float) -> Mu:
        """Parameters of a cell."""
        named = {self.across.parameter: across, self.along.parameter: along}
        return self.base.at(**({"storage": law} | named))

    def task(self, value: float, level: int = 0) -> ColumnTask:
        """A column under all laws."""
        return ColumnTask(value, level, tuple(range(len(self.laws))))

    def coordinate(self, axis: Axis, value: float) -> float:
        """0..1 along an axis, in the logarithm if its values are spaced so."""
        a, b = axis.values[0], axis.values[-1]
        return math.log(value / a) / math.log(b / a) if axis.log else (value - a) / (b - a)

    def value(self, axis: Axis, coordinate: float) -> float:
        """Inverse of `coordinate`."""
        a, b = axis.values[0], axis.values[-1]
        return a * (b / a) ** coordinate if axis.log else a + (b - a) * coordinate


@dataclass(frozen=True)
class MapColumn:
    """A finished column.

    Attributes
    ----------
    value : float
        Of the axis across.
    level : int
        0 for a column of the grid, more for one that was put between two of them.
    cells : dict of (laws, cells) arrays
        See `CELLS`.
    onsets : (k, 5) array
        Law (its number), value along the column, frequency in Hz, +1 where a mode becomes unstable along the column, -1
        where it ceases to be, and the growth rate over the size of the eigenvalue that the full matrices leave there,
        NaN where it was not corrected by them.
    error : float
        Largest estimated relative error of a leading eigenvalue.
    failure : str
        Why there is no column; empty if there is one.
    seconds : float
        Processor time.
    band : float
        Hz; verdicts hold up to it, infinite for all frequencies.
    why_not_valid : str
        Why the constants of the rubber do not hold in some or all of the cells; empty where they do.
    """

    value: float
    level: int
    cells: dict[str, np.ndarray]
    onsets: np.ndarray
    error: float
    failure: str = ""
    seconds: float = 0.0
    band: float = math.inf
    why_not_valid: str = ""

    @classmethod
    def missing(cls, plan: MapPlan, task: ColumnTask, sentence: str, seconds: float = 0.0) -> MapColumn:
        """A marked gap."""
        shape = (len(plan.laws), len(plan.along.values))
        cells = {name: np.full(shape, np.nan) for name in CELLS[:6]}
        cells |= {
            "unstable": np.full(shape, -1),
            "counted": np.full(shape, -1),
            "certified": np.zeros(shape, bool),
            "how": np.full(shape, MISSING),
            "outcome": np.full(shape, OUTCOMES.index(UNDECIDED)),
        }
        return cls(task.value, task.level, cells, np.zeros((0, 5)), np.nan, sentence, seconds)

    def has(self, law: int) -> bool:
        """True where the column was solved under a continuity law, given by its number."""
        how = self.cells.get("how")
        return not self.failure and (how is None or bool((how[law] != MISSING).any()))

    def verdict(self, law: int, cell: int) -> Verdict:
        """Verdict on a cell."""
        own = {name: values[law, cell] for name, values in self.cells.items()}
        outcome = OUTCOMES[int(own["outcome"])]
        if outcome == NOT_VALID:
            return Verdict.not_valid(self.why_not_valid)
        if self.failure:
            return Verdict.undecided(self.failure)
        unstable, counted, certified = int(own["unstable"]), int(own["counted"]), bool(own["certified"])
        numbers = (float(own[name]) for name in ("oscillating_rate", "oscillating_frequency", "damping_ratio"))
        reason = describe_counts(unstable, counted, certified, 0.0, self.band)
        return Verdict(outcome, reason, *numbers, certain=certified, band=self.band)


def grid_of(plan: MapPlan, found, name: str) -> np.ndarray:
    """A quantity of finished columns on the grid of a plan, (laws, y values, x values)."""
    blank = MapColumn.missing(plan, plan.task(0.0), "").cells[name]
    by_value = {column.value: column.cells[name] for column in found if column.level == 0}
    table = np.stack([by_value.get(value, blank) for value in plan.across.values], axis=2)
    return table.transpose(0, 2, 1) if plan.transposed else table


def solve_column(plan: MapPlan, walk: StabilityWalk, task: ColumnTask) -> MapColumn:
    """A column; a steady state that is not found leaves a gap with the reason.

    On the grid every cell gets a certificate; in columns between, put in for the onset curves, those that onsets lie
    between.
    """
    started = time.process_time()
    value, level, laws = task
    columns, onsets = [], []
    cells = MapColumn.missing(plan, task, "").cells
    try:
        for number in laws:
            column, verdicts, found = _law(plan, walk, value, plan.laws[number], level > 0)
            columns.append((column, verdicts))
            onsets += [(number, *onset) for onset in found]
    except NotValidError as error:
        cells["outcome"][list(laws)] = OUTCOMES.index(NOT_VALID)
        seconds = time.process_time() - started
        return MapColumn(value, level, cells, np.zeros((0, 5)), 0.0, "", seconds, why_not_valid=str(error))
    except (SolveError, CaseError) as error:
        return MapColumn.missing(plan, task, str(error), time.process_time() - started)
    for number, (column, verdicts) in zip(laws, columns):
        for name in set(CELLS) & vars(column).keys():
            cells[name][number] = getattr(column, name)
        cells["certified"][number] = column.certified
        cells["oscillating_rate"][number] = [verdict.growth_rate for verdict in verdicts]
        cells["oscillating_frequency"][number] = [verdict.frequency for verdict in verdicts]
        cells["damping_ratio"][number] = [verdict.damping_ratio for verdict in verdicts]
        cells["outcome"][number] = [OUTCOMES.index(verdict.outcome) for verdict in verdicts]
    return MapColumn(
        value,
        level,
        cells,
        np.array(onsets, float).reshape(-1, 5),
        max(column.error for column, _ in columns),
        "",
        time.process_time() - started,
        min((v.band for _, verdicts in columns for v in verdicts if np.isfinite(v.band)), default=math.inf),
        next((v.reason for _, verdicts in columns for v in verdicts if v.outcome == NOT_VALID), ""),
    )


def _law(
    plan: MapPlan, walk: StabilityWalk, value: float, law: float, edges: bool
) -> tuple[Column, list[Verdict], list[tuple[float, ...]]]:
    along = plan.along
    places = [plan.place(value, other, law) for other in along.values]
    if not is_surrounding(plan.case, along.parameter):
        return _state_by_state(plan, walk.apart(), places)
    column = walk.column(places, edges=edges)
    verdicts = walk.verdicts(places, column)
    sample = column.eigenvalues or (lambda condition: walk.column([point_under(places[0], condition)]).leading[0])
    cell = column.cell or (lambda condition: walk.column([point_under(places[0], condition)]))
    scan = Scan(
        lambda other: sample(condition_of(plan.place(value, other, law))),
        along.log,
        lambda other: bool(cell(condition_of(plan.place(value, other, law))).certified[0]),
    )
    # what the cells know need not be found again
    _enter_known(scan, along, column)
    found = _onsets(scan, along, LOCATED if column.corrected is None else ROUGH)
    if column.corrected is None:
        return column, verdicts, found

    correct = OnsetCorrection(
        column,
        lambda other: condition_of(plan.place(value, other, law)),
        lambda other: walk.spectrum(plan.place(value, other, law)).eigenvalues,
    )
    onsets = []
    for other, frequency, direction, _ in found:
        other, frequency, left = correct(other, frequency)
        onsets.append((other, frequency, direction, left))
    return column, verdicts, onsets


def shared_place(plan: MapPlan, value: float) -> Mu | None:
    """Parameter point whose steady state all cells of a column share; None if cells have states of their own."""
    if not is_surrounding(plan.case, plan.along.parameter):
        return None
    return plan.place(value, plan.along.values[0], plan.laws[0])


def _enter_known(scan: Scan, along: Axis, column: Column) -> None:
    """Put what the cells know into a scan: samples, and values at which there is none."""
    for value, row, certified, counted, how in zip(
        map(float, along.values), column.leading, column.certified, column.counted, column.how
    ):
        if how == MISSING:
            scan.failures[value] = "the constants of the rubber do not hold"
        else:
            scan.samples[value] = Sample(value, row, bool(certified) if counted >= 0 else None)


def _state_by_state(plan: MapPlan, walk: StabilityWalk, places: list[Mu]):
    """Both axes change the steady state: every cell has its own, solved directly, whatever columns came before."""
    parts = [_cell_or_blank(walk, place) for place in places]
    column = Column.joined(parts)
    verdicts = walk.verdicts(places, column)
    parameter = plan.along.parameter

    def cell(other: float) -> Column:
        return walk.column([places[0].at(**{parameter: other})])

    scan = Scan(lambda other: cell(other).leading[0], plan.along.log, lambda other: bool(cell(other).certified[0]))
    _enter_known(scan, plan.along, column)
    return column, verdicts, _onsets(scan, plan.along, LOCATED)


def _cell_or_blank(walk: StabilityWalk, place: Mu) -> Column:
    """Column of one place; blank where the constants of the rubber do not hold."""
    try:
        return walk.column([place])
    except NotValidError:
        return Column.blank(1)


def _onsets(scan: Scan, along: Axis, accuracy: float) -> list[tuple[float, float, float, float]]:
    """Value, frequency, direction, and what is left of the growth rate over the size of the eigenvalue."""
    found = []
    for crossing in scan.run(along.values):
        value = locate(scan, crossing, accuracy)
        eigenvalue = complex(scan.within(value).eigenvalues[crossing.index])
        direction = 1.0 if crossing.high.unstable > crossing.low.unstable else -1.0
        left = abs(eigenvalue.real) / max(abs(eigenvalue), 1.0)
        found.append((value, abs(eigenvalue.imag) / (2 * np.pi), direction, left))
    return found
