"""Stability over two parameters: columns of cells, refined near onset, and exact onset curves on top."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ...errors import SolveError
from ...materials import outside_band
from ...observer import Observer
from ..case import Case
from ..stability.place import check_scan
from ..stability.verdict import NOT_VALID, OUTCOMES
from ..stability.walk import StabilityWalk
from .checks import Check, check_cells
from .column import ColumnTask, MapColumn, MapPlan, grid_of
from .curves import OnsetCurve, Web, doubts, linked
from .pool import ColumnPool


@dataclass(frozen=True)
class FoundMap:
    """A stability map.

    Attributes
    ----------
    plan : MapPlan
    columns : tuple of MapColumn
        In ascending order, those between the grid's included.
    curves : tuple of OnsetCurve
    checks : tuple of Check
        Cells solved again with the full pencil.
    warnings : tuple of str
    interrupted : bool
    """

    plan: MapPlan
    columns: tuple[MapColumn, ...]
    curves: tuple[OnsetCurve, ...] = ()
    checks: tuple[Check, ...] = ()
    warnings: tuple[str, ...] = ()
    interrupted: bool = False

    def grid(self, name: str) -> np.ndarray:
        """A quantity of the cells on the grid; see `dbvfiv.studies.map.column.grid_of`."""
        return grid_of(self.plan, self.columns, name)


#: Rounds of columns put in for the onset curves.
ROUNDS = 14
#: Columns put in for them at most under each law: as many as the map has, or this many.
LEAST_ROOM = 40


@dataclass
class _Run:
    plan: MapPlan
    observer: Observer
    pool: ColumnPool
    found: dict[tuple[float, int], MapColumn] = field(default_factory=dict)

    def fill(self, wanted: Iterable[ColumnTask]) -> None:
        """Columns that are not there yet: those an earlier run has found, and the others solved."""
        wanted = [task for task in wanted if task.key not in self.found]
        for column in self.pool.columns(wanted):
            key = column.value, column.level
            self.found[key] = column
            if key not in self.pool.known:
                self.observer.item(column)

    def between(self, level: int) -> list[ColumnTask]:
        """Columns to put in where the number of onsets under a law differs between neighbours."""
        across, wanted = self.plan.across, []
        for law in range(len(self.plan.laws)):
            ordered = [column for column in _ordered(self.found) if column.has(law)]
            for a, b in zip(ordered[:-1], ordered[1:]):
                if _pattern(a, law) != _pattern(b, law) and max(a.level, b.level) == level - 1:
                    ends = (self.plan.coordinate(across, column.value) for column in (a, b))
                    wanted.append((0.5 * sum(ends), law))
        return self._tasks(wanted, level)

    def _tasks(self, wanted: Iterable[tuple[float, int]], level: int) -> list[ColumnTask]:
        """Columns at places, each under the laws that ask for it, in ascending order."""
        laws: dict[float, tuple[int, ...]] = {}
        for place, law in wanted:
            laws[place] = (*laws.get(place, ()), law)
        return [ColumnTask(self.plan.value(self.plan.across, place), level, laws[place]) for place in sorted(laws)]

    def trace(self) -> None:
        """Columns that the onset curves need to be known everywhere."""
        numbers = range(len(self.plan.laws))
        level = max(column.level for column in self.found.values())
        room = max(LEAST_ROOM, len(self.plan.across.values)) * len(numbers)
        for _ in range(ROUNDS):
            wanted = sorted((place, law) for law in numbers for place in self._web(law).wanted())[:room]
            if not wanted:
                return
            room -= len(wanted)
            level += 1
            tasks = self._tasks(wanted, level)
            self.observer.progress(f"onset curves, {len(tasks)} more columns")
            self.fill(tasks)

    def _web(self, law: int) -> Web:
        return Web.of(self.plan, self.found.values(), law)


def _pattern(column: MapColumn, law: int) -> tuple[int, ...]:
    """Directions of the onsets along a column."""
    return tuple(int(row[3]) for row in column.onsets if int(row[0]) == law)


def run_map(
    case: Case,
    observer: Observer | None = None,
    workers: int | None = None,
    known: Iterable[MapColumn] = (),
    walk: StabilityWalk | None = None,
) -> FoundMap:
    """A stability map of a case.

    Parameters
    ----------
    case : Case
    observer : Observer, optional
        `item` is told of every finished `MapColumn`.
    workers : int, optional
        Processes; those of the case by default.
    known : iterable of MapColumn
        Columns of an interrupted run, which are not solved again: the run repeats its decisions with them, so that it
        ends with the numbers of one that was never interrupted.
    walk : StabilityWalk, optional
        Of the case.

    Raises
    ------
    CaseError
        If the case has nothing that a parameter could change.
    SolveError
        If the case has no flow, or no column was found at all.
    """
    plan = MapPlan.of(case)
    check_scan(case, plan.x.parameter, plan.y.parameter)
    observer = observer or Observer()
    walk = walk or StabilityWalk(case)
    observer.begin("map", len(plan.across.values))
    curves: tuple[OnsetCurve, ...] = ()
    checks: tuple[Check, ...] = ()
    warnings: list[str] = []
    interrupted = False
    with ColumnPool(plan, case.map.workers if workers is None else workers, observer.warn, walk, known) as pool:
        run = _Run(plan, observer, pool)
        try:
            run.fill([plan.task(value) for value in plan.across.values])
            for level in range(1, plan.refine + 1):
                run.fill(run.between(level))
            if all(column.failure for column in run.found.values()):
                raise SolveError(f"No state of the map was found: {_ordered(run.found)[0].failure}")
            if case.map.curve:
                run.trace()
            ordered = _ordered(run.found)
            checks = check_cells(plan, ordered, walk, case.map.checks)
            curves = linked(plan, ordered)
            if case.map.curve:
                warnings += doubts(plan, curves)
            warnings += _doubts(plan, ordered, checks)
            warnings += _outside(case, ordered)
        except KeyboardInterrupt:
            interrupted = True
    for sentence in warnings:
        observer.warn(sentence)
    observer.end(interrupted)
    return FoundMap(plan, _ordered(run.found), curves, checks, tuple(warnings), interrupted)


def _ordered(found) -> tuple[MapColumn, ...]:
    return tuple(sorted(found.values(), key=lambda column: column.value))


def _outside(case: Case, ordered) -> list[str]:
    """A sentence where leading modes leave the frequencies at which loss factors hold."""
    sentence = outside_band(
        case, [f for c in ordered if not c.failure for f in c.cells["oscillating_frequency"].ravel()]
    )
    return [] if sentence is None else [sentence]


def _doubts(plan: MapPlan, ordered, checks) -> list[str]:
    """Sentences about cells that are not certified or fail a check."""
    own = [c for c in ordered if not c.failure and c.level == 0]
    unsound = [c.cells["outcome"] == OUTCOMES.index(NOT_VALID) for c in own]
    doubtful = sum(int((~c.cells["certified"] & ~bad).sum()) for c, bad in zip(own, unsound))
    said = []
    if any(bad.any() for bad in unsound):
        number, first = sum(int(bad.sum()) for bad in unsound), next(c for c in own if c.why_not_valid)
        said.append(f"{number} cells are not valid; the first at {first.value:.6g}: {first.why_not_valid}")
    if doubtful:
        said.append(
            f"{doubtful} cells are uncertain: spectrum and independent count disagree, or the count is not certain; "
            "they are called neither stable nor unstable."
        )
    bands = [c.band for c in ordered if not c.failure and np.isfinite(c.band)]
    if bands:
        said.append(
            f"Verdicts hold for modes up to {min(bands):.4g} Hz"
            + (f" to {max(bands):.4g} Hz, by the column" if max(bands) > min(bands) else "")
            + "; modes.max_frequency chooses another end."
        )
    for check in checks:
        if not check.agrees:
            said.append(
                f"At {plan.x.parameter} = {check.x:.6g}, {plan.y.parameter} = {check.y:.6g} the full pencil "
                f"differs by {check.error:.1e}."
            )
    return said
