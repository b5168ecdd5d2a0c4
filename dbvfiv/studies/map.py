"""Stability over two parameters: columns of cells, refined near onset, and exact onset curves on top."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from eigen.columns import DIRECT

from ..case.model import Case
from ..errors import SolveError
from ..observer import Observer
from .map_checks import Check, check_cells
from .map_column import CELLS, MapColumn, MapPlan
from .map_curves import OnsetCurve, doubts, linked
from .map_pool import ColumnPool
from .map_web import Web
from .parameters import check_scan
from .stability_walk import StabilityWalk


@dataclass(frozen=True)
class MapResult:
    """A stability map.

    Attributes
    ----------
    plan : MapPlan
    columns : tuple of MapColumn
        In ascending order, those between the grid's included.
    curves : tuple of OnsetCurve
    checks : tuple of Check
        Cells solved again with the full pencil.
    failures, warnings : tuples of str
    interrupted : bool
    """

    plan: MapPlan
    columns: tuple[MapColumn, ...]
    curves: tuple[OnsetCurve, ...] = ()
    checks: tuple[Check, ...] = ()
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    interrupted: bool = False

    def grid(self, name: str) -> np.ndarray:
        """One of `CELLS` on the grid, (laws, y values, x values); gaps and columns not reached hold NaN or -1."""
        return grid(self.plan, self.columns, name)


def grid(plan: MapPlan, found, name: str) -> np.ndarray:
    """A quantity of finished columns on the grid of a plan, (laws, y values, x values)."""
    blank = MapColumn.missing(plan, 0.0, 0, "").cells[name]
    by_value = {column.value: column.cells[name] for column in found if column.level == 0}
    table = np.stack([by_value.get(value, blank) for value in plan.across.values], axis=2)
    return table.transpose(0, 2, 1) if plan.transposed else table


#: Rounds of columns put in for the onset curves.
ROUNDS = 14
#: Columns put in for them at most: as many as the map has, or this many.
LEAST_ROOM = 40


@dataclass
class _Run:
    plan: MapPlan
    observer: Observer
    pool: ColumnPool
    found: dict[tuple[float, int], MapColumn] = field(default_factory=dict)

    def fill(self, wanted) -> None:
        """Solve columns that are not there yet."""
        wanted = [task for task in wanted if task not in self.found]
        for column in self.pool.columns(wanted):
            self.found[column.value, column.level] = column
            if column.failure:
                self.observer.warn(f"No column at {self.plan.across.parameter} = {column.value:.6g}: {column.failure}")
            self.observer.item(column)

    def between(self, level: int) -> list[tuple[float, int]]:
        """Columns to put in where the number of onsets differs between neighbours."""
        ordered = sorted((c for c in self.found.values() if not c.failure), key=lambda c: c.value)
        wanted = []
        for a, b in zip(ordered[:-1], ordered[1:]):
            if _pattern(a) != _pattern(b) and max(a.level, b.level) == level - 1:
                middle = 0.5 * (
                    self.plan.coordinate(self.plan.across, a.value) + self.plan.coordinate(self.plan.across, b.value)
                )
                wanted.append((self.plan.value(self.plan.across, middle), level))
        return wanted

    def trace(self) -> None:
        """Columns that the onset curves need to be known everywhere."""
        across = self.plan.across
        level = max(column.level for column in self.found.values())
        room = max(LEAST_ROOM, len(across.values))
        for _ in range(ROUNDS):
            wanted = Web.of(self.plan, self.found.values()).wanted()[:room]
            if not wanted:
                return
            room -= len(wanted)
            level += 1
            self.observer.progress(f"onset curves, {len(wanted)} more columns")
            self.fill([(self.plan.value(across, place), level) for place in wanted])


def _pattern(column: MapColumn) -> tuple:
    return tuple((int(row[0]), int(row[3])) for row in column.onsets)


def run_map(
    case: Case, observer: Observer | None = None, workers: int | None = None, known=(), plan: MapPlan | None = None
) -> MapResult:
    """A stability map of a case.

    Parameters
    ----------
    case : Case
    observer : Observer, optional
        `item` is told of every finished `MapColumn`.
    workers : int, optional
        Processes; those of the case by default.
    known : iterable of MapColumn
        Columns of an interrupted run, which are not solved again.

    Raises
    ------
    CaseError
        If the case has nothing that a parameter could change.
    SolveError
        If the case has no flow, or no column was found at all.
    """
    plan = plan or MapPlan.of(case)
    check_scan(case, plan.x.parameter, plan.y.parameter)
    observer = observer or Observer()
    known = {(column.value, column.level): column for column in known}
    walk = StabilityWalk(case)
    observer.begin("map", len(plan.across.values))
    curves: tuple[OnsetCurve, ...] = ()
    checks: tuple[Check, ...] = ()
    warnings: list[str] = []
    interrupted = False
    with ColumnPool(plan, case.map.workers if workers is None else workers, observer.warn, walk) as pool:
        run = _Run(plan, observer, pool, known)
        try:
            run.fill([(value, 0) for value in plan.across.values])
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
        except KeyboardInterrupt:
            interrupted = True
    for sentence in warnings:
        observer.warn(sentence)
    observer.end(interrupted)
    ordered = _ordered(run.found)
    failures = tuple(f"{plan.across.parameter} = {c.value:.6g}: {c.failure}" for c in ordered if c.failure)
    return MapResult(plan, ordered, curves, checks, failures, tuple(warnings), interrupted)


def _ordered(found) -> tuple[MapColumn, ...]:
    return tuple(sorted(found.values(), key=lambda column: column.value))


def _doubts(plan: MapPlan, ordered, checks) -> list[str]:
    """Sentences about cells that are not certified or fail a check."""
    doubtful = sum(int((~c.cells["certified"]).sum()) for c in ordered if not c.failure and c.level == 0)
    said = []
    if doubtful:
        said.append(
            f"{doubtful} cells are uncertain: spectrum and independent count disagree, or the count is not certain; "
            "they are called neither stable nor unstable."
        )
    bands = [c.band for c in ordered if not c.failure and np.isfinite(c.band)]
    if bands:
        said.append(
            f"Modes were searched for up to {min(bands):.4g} Hz"
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


__all__ = ["CELLS", "DIRECT", "MapResult", "grid", "run_map"]
