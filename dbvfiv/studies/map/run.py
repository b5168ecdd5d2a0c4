"""Stability over two parameters: columns of cells, refined near onset, exact onset curves on top, and checks of cells
with the full pencil.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import SolveError
from ...fit import outside_band
from ...observer import Observer
from ..case import Case
from ..stability.place import check_scan
from ..stability.verdict import NOT_VALID, OUTCOMES
from ..stability.walk import StabilityWalk
from .column import ColumnTask, MapColumn, MapPlan, grid_of
from .curves import OnsetCurve, Web, doubts, linked
from .pool import ColumnPool

#: Grids kept of another symmetry class.
_GRIDS = ("growth_rate", "frequency", "unstable", "counted", "certified")
#: Largest accepted |difference| / |eigenvalue|.
ACCEPTED = 1e-6


@dataclass(frozen=True)
class Check:
    """One cell, solved directly.

    Attributes
    ----------
    x, y : float
    law : int
        Number of the continuity law.
    growth_rate, frequency : float
        Of the full pencil, 1/s and Hz.
    error : float
        |difference of the leading eigenvalue| over its size.
    unstable : int
    agrees : bool
        Error within `ACCEPTED` and the same number of unstable eigenvalues.
    """

    x: float
    y: float
    law: int
    growth_rate: float
    frequency: float
    error: float
    unstable: int
    agrees: bool


def check_cells(plan: MapPlan, columns: tuple[MapColumn, ...], walk: StabilityWalk, number: int) -> tuple[Check, ...]:
    """Check cells spread over the map by a sequence that fills the plane evenly."""
    usable = [column for column in columns if not column.failure and column.level == 0]
    if not usable:
        return ()
    cells, laws = len(plan.along.values), len(plan.laws)
    # steps of the golden section in both directions (Roberts' sequence)
    picks = sorted(
        (int((0.5 + 0.7548776662 * i) % 1 * len(usable)), int((0.5 + 0.5698402910 * i) % 1 * cells), i % laws)
        for i in range(number)
    )
    return tuple(_check(plan, usable[i], j, law, walk) for i, j, law in picks)


def _check(plan: MapPlan, column: MapColumn, j: int, law: int, walk: StabilityWalk) -> Check:
    along = plan.along.values[j]
    spectrum = walk.spectrum(plan.place(column.value, along, plan.laws[law]), 4)
    kept = complex(column.cells["growth_rate"][law, j], 2 * np.pi * column.cells["frequency"][law, j])
    true = complex(spectrum.eigenvalues[0]) if len(spectrum) else complex(np.nan)
    error = abs(kept - true) / max(abs(true), 1.0)
    unstable = spectrum.unstable_count
    agrees = error <= ACCEPTED and unstable == int(column.cells["unstable"][law, j])
    x, y = (along, column.value) if plan.transposed else (column.value, along)
    return Check(x, y, law, true.real, true.imag / (2 * np.pi), float(error), unstable, bool(agrees))


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

    @property
    def failures(self) -> tuple[str, ...]:
        """None: a column without a state is a gap of the map, which says why itself."""
        return ()

    def note(self) -> dict[str, Any]:
        """Note that a record keeps of another symmetry class: grids as tables (y, x)."""
        return {name: self.grid(name)[0].tolist() for name in _GRIDS}


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
