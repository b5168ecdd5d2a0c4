"""Stability over two parameters: columns of cells, refined near onset, exact onset curves on top, checks of cells with
the full pencil; their storage, and what can be read off a run or its file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from eigen.columns import DIRECT, MISSING

from ...case.parameters import PARAMETERS
from ...errors import CaseError, SolveError
from ...fit.cards import outside_band
from ...model.leading import other_end
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ...texts import digits
from ..case import Case
from ..result import StudyResult
from ..session import Session, Study
from ..stability.dimensions import certified_in_all, flow_models, leading_class
from ..stability.place import check_range, describe_fixed, fixed_conditions
from ..stability.samples import SAMPLE_TABLE, SAMPLES, Sample, keep_samples, read_samples
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, OUTCOMES, STABLE, Verdict
from ..stability.walk import StabilityWalk
from . import chances, cycles
from .column import ColumnPool, ColumnTask, MapColumn, MapPlan, grid_of
from .curves import OnsetCurve, Web, doubts, linked

LAWS = {0.0: "quasi-steady", 1.0: "storage"}
#: Quantities of cells in documents, by the names of `Sample.number`.
_CELLS = {
    "growth_rate": "growth_rate",
    "frequency": "frequency",
    "unstable_count": "unstable",
    "unstable_count_independent": "counted",
    "certified": "certified",
}
#: Largest accepted |difference| / |eigenvalue|.
ACCEPTED = 1e-6


def check_cells(
    plan: MapPlan, columns: tuple[MapColumn, ...], walk: StabilityWalk, number: int
) -> list[dict[str, Any]]:
    """Cells spread over the map by a sequence that fills the plane evenly, solved again with the full pencil: error of
    the leading eigenvalue, over its size, and whether it is accepted and the number of unstable eigenvalues the same.
    A cell whose state is not found again is told as a warning.
    """
    usable = [column for column in columns if not column.failure and column.level == 0]
    if not usable:
        return []
    cells, laws = len(plan.along.values), len(plan.laws)
    # steps of the golden section in both directions (Roberts' sequence)
    picks = sorted(
        (int((0.5 + 0.7548776662 * i) % 1 * len(usable)), int((0.5 + 0.5698402910 * i) % 1 * cells), i % laws)
        for i in range(number)
    )
    found = []
    for i, cell, law in picks:
        kept = usable[i].samples[law][cell]
        if kept.is_missing:
            continue
        x, y = (kept.value, usable[i].value) if plan.transposed else (usable[i].value, kept.value)
        try:
            cell = walk.cell(plan.place(usable[i].value, kept.value, plan.laws[law]))
        except (SolveError, CaseError) as error:
            walk.observer.warn(f"The cell at {plan.told(x, y)} was not solved again: {error}")
            continue
        full, unstable = np.asarray(cell.leading), cell.certificate.unstable
        # of modes that grow alike to rounding, as without damping, either may be listed first
        tied = full[full[:1].real - full.real <= ACCEPTED * np.abs(full)].tolist()
        leading = complex(kept.eigenvalues[0]) if len(kept.eigenvalues) else complex(np.nan)
        true = min(tied, key=lambda value: abs(value - leading), default=complex(np.nan))
        error = abs(leading - true) / max(abs(true), 1.0) if tied or len(kept.eigenvalues) else 0.0
        numbers = {"growth_rate": true.real, "frequency": true.imag / (2 * np.pi), "error": float(error)}
        agrees = bool(error <= ACCEPTED and unstable == kept.unstable)
        found.append({"x": x, "y": y, "law": law} | numbers | {"unstable": unstable, "agrees": agrees})
    return found


#: Rounds of columns put in for the onset curves.
ROUNDS = 14
#: Columns put in for them at most under each law: as many as the map has, or this many.
LEAST_ROOM = 40


@dataclass
class _Filling:
    """Columns found so far, and those still wanted."""

    plan: MapPlan
    record: GrowingRecord
    pool: ColumnPool
    found: dict[tuple[float, int], MapColumn] = field(default_factory=dict)

    def fill(self, wanted: Iterable[ColumnTask]) -> None:
        """Columns that are not there yet: those an earlier run has found, and the others solved and kept."""
        wanted = [task for task in wanted if task.key not in self.found]
        for column in self.pool.columns(wanted):
            key = column.value, column.level
            self.found[key] = column
            if key not in self.pool.known:
                keep_column(self.record, column)
                if column.failure:
                    self.record.fail(gap_sentence(self.plan, column))
                self.record.item(column)

    @property
    def columns(self) -> tuple[MapColumn, ...]:
        """In ascending order, those between the grid's included."""
        return tuple(sorted(self.found.values(), key=lambda column: column.value))

    def between(self, level: int) -> list[ColumnTask]:
        """Columns to put in where the number of onsets under a law differs between neighbours."""
        across, wanted = self.plan.across, []
        for law in range(len(self.plan.laws)):
            ordered = [column for column in self.columns if column.has(law)]
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
        numbers, laws = range(len(self.plan.curves)), [law for law, _ in self.plan.curves]
        level = max(column.level for column in self.found.values())
        room = max(LEAST_ROOM, len(self.plan.across.values)) * len(numbers)
        for _ in range(ROUNDS):
            webs = [Web.of(self.plan, self.found.values(), number) for number in numbers]
            wanted = sorted({(place, own) for web, own in zip(webs, laws) for place in web.wanted()})[:room]
            if not wanted:
                return
            room -= len(wanted)
            level += 1
            tasks = self._tasks(wanted, level)
            self.record.progress(f"onset curves, {len(tasks)} more columns")
            self.fill(tasks)


def _pattern(column: MapColumn, law: int) -> tuple[int, ...]:
    """Directions of the onsets along a column."""
    return tuple(int(row[3]) for row in column.onsets if int(row[0]) == law)


def _doubts(plan: MapPlan, columns: Iterable[MapColumn], checks: Iterable[dict[str, Any]]) -> list[str]:
    """Sentences about cells that are not certified, fail a check, or leave the band of the material data."""
    solved, said = [c for c in columns if not c.failure], []
    for prefix, parts in _variants(plan):
        cells = [s for c in solved if not c.level for part in parts for s in c.samples[part]]
        lost = [s.failure for s in cells if s.failure]
        refused = sum(bool(s.refusal) for s in cells)
        left_open = [s.left_open for s in cells if s.left_open]
        asked = [s for s in cells if not (s.is_missing or s.left_open)]
        doubtful = sum(s.verdict.stable is None for s in asked)
        if lost:
            said.append(f"{prefix}{len(lost)} cells have no steady state that was found; the first: {lost[0]}")
        if refused:
            first = next(c for c in solved if c.refusal)
            at = PARAMETERS[plan.across.parameter].named(first.value)
            said.append(f"{prefix}{refused} cells are not valid; the first at {at}: {first.refusal}")
        if left_open:
            said.append(f"{prefix}{len(left_open)} cells are left open. {left_open[0]}")
        if doubtful:
            said.append(
                f"{prefix}{doubtful} cells are uncertain: spectrum and independent count disagree, the count is not "
                "certain, or a mode grows too slowly to be counted; they are called neither stable nor unstable."
            )
    bands = [c.band for c in solved if np.isfinite(c.band)]
    if bands:
        said.append(
            f"Verdicts hold for modes up to {digits(min(bands), 4)} Hz"
            + (f" to {digits(max(bands), 4)} Hz, by the column" if max(bands) > min(bands) else "")
            + f"; {other_end(plan.case)}."
        )
    for check in checks:
        if not check["agrees"]:
            apart = f"differs by {check['error']:.1e}"
            if check["error"] <= ACCEPTED:
                apart = f"has {check['unstable']} unstable eigenvalues and the cell another number"
            said.append(f"At {plan.told(check['x'], check['y'])} the full pencil {apart}.")
    frequencies = [s.verdict.frequency for c in solved for row in c.samples.values() for s in row]
    return [*said, *filter(None, [outside_band(plan.case, frequencies)])]


def _variants(plan: MapPlan) -> Iterator[tuple[str, list[int]]]:
    """Parts of the class of the equilibria, then of each other one, with the beginning of a sentence about it."""
    laws = len(plan.laws)
    yield "", list(range(laws))
    for part, motion in enumerate(plan.classes[1:], laws):
        yield f"In class {motion.name}: ", [part]


# -- storage

COLUMNS, ONSETS = "columns", "onsets"
_COLUMNS = (
    Column("value", "SI", "Value of the parameter across that the cells of this column share"),
    Column("level", "", "0 on the grid, more for columns put between its own", "i8"),
    Column(
        "sample_count", "", "Its rows in the table of samples, part by part; none of a gap, whose note says why", "i8"
    ),
    Column("onset_count", "", "Its rows in the table of onsets", "i8"),
    Column("error", "", "Largest estimated relative error of a leading eigenvalue"),
    Column("seconds", "s", "Processor time"),
)
_ONSETS = (
    Column("law", "", "Number of the family of curves: onsets under each flow model, then each contour", "i8"),
    Column("along", "SI", "Where a mode is neutral, or has the damping of the contour"),
    Column("frequency", "Hz", "Its frequency"),
    Column("direction", "", "+1 where the mode becomes unstable along the column, -1 where it ceases to be", "i8"),
    Column(
        "residual",
        "",
        "Growth rate beyond its level over the size of the eigenvalue that the full matrices leave there",
    ),
)
_GAP, _CURVES, _CHECKS = "gap", "curves", "checks"


def tables_of(_mesh: MeshData | None) -> tuple[TableSpec, ...]:
    """Tables of a map. Curves and checks are notes."""
    return SAMPLE_TABLE, TableSpec(COLUMNS, _COLUMNS), TableSpec(ONSETS, _ONSETS), cycles.SPEC


def gap_sentence(plan: MapPlan, column: MapColumn) -> str:
    """Why there is no column."""
    return f"{PARAMETERS[plan.across.parameter].named(column.value)}: {column.failure}"


def keep_column(record: GrowingRecord, column: MapColumn) -> None:
    """Keep a column; its samples and onsets go first, so that its row vouches for them."""
    samples = [sample for part in sorted(column.samples) for sample in column.samples[part]]
    if samples:
        keep_samples(record, samples)
    if len(column.onsets):
        record.extend(ONSETS, {c.name: values for c, values in zip(_ONSETS, column.onsets.T)})
    if column.failure:
        record.note(_GAP, value=column.value, level=column.level, text=column.failure)
    own = {name: getattr(column, name) for name in ("value", "level", "error", "seconds")}
    record.append(COLUMNS, own | {"sample_count": len(samples), "onset_count": len(column.onsets)})


def read_columns(record: Record, plan: MapPlan) -> list[MapColumn]:
    """Finished columns in the order they were finished in."""
    reasons = {(note["value"], note["level"]): note["text"] for note in record.notes(_GAP)}
    numbers = {(law, motion.name): part for part, (law, motion) in enumerate(plan.parts)}
    samples = read_samples(record)
    onsets = np.column_stack([record.column(ONSETS, column.name).astype(float) for column in _ONSETS])
    found, first, onset = [], 0, 0
    for row in record.table_rows(TableSpec(COLUMNS, _COLUMNS)):
        cells: dict[int, list[Sample]] = {}
        for sample in samples[first : first + row["sample_count"]]:
            cells.setdefault(numbers[sample.key.continuity, sample.key.symmetry], []).append(sample)
        first, onset = first + row.pop("sample_count"), onset + (own := row.pop("onset_count"))
        reason = reasons.get((row["value"], row["level"]), "") if not cells else ""
        found.append(MapColumn(samples=cells, onsets=onsets[onset - own : onset], failure=reason, **row))
    return found


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows that a map goes on from: samples, onsets and cycles of a column that was cut off before what vouches for
    them are left out.
    """
    samples, onsets = (int(known.column(COLUMNS, name).sum()) for name in ("sample_count", "onset_count"))
    cells = len(known.notes(cycles.DONE)) * len(MapPlan(case).along.values)
    return {SAMPLES: samples, ONSETS: onsets, cycles.ROWS: cells}


def check(case: Case) -> None:
    """Refuse axes of what the case does not have, and flow models that do not differ."""
    check_range(case, *(axis.parameter for axis in case.map.axes))
    flow_models(case, "map")


def run(session: Session, record: GrowingRecord, workers: int | None = None) -> None:
    """The map of `map` of the case; every column is kept as it is finished. A run that goes on repeats the decisions of
    the one before with its columns, so that it ends with the numbers of one that was never interrupted. Raises
    CaseError if the case has nothing that a parameter could change. Raises SolveError if the case has no flow, or no
    column was found at all.

    Parameters
    ----------
    workers : int, optional
        Processes that share the columns; those of the case by default. Under ``mpiexec`` with mpi4py all its processes.
    """
    case, plan = session.case, MapPlan(session.case)
    if case.map.samples:
        chances.Chances(case).check()
    walk = StabilityWalk(case, record, session.model)
    record.begin("map", len(plan.across.values))
    processes, known = case.map.workers if workers is None else workers, read_columns(record, plan)
    with ColumnPool(plan, processes, record.warn, walk, known) as pool:
        filling = _Filling(plan, record, pool)
        parts = tuple(range(len(plan.parts)))
        filling.fill([ColumnTask(value, 0, parts) for value in plan.across.values])
        for level in range(1, case.map.refine + 1):
            filling.fill(filling.between(level))
        if all(column.failure for column in filling.columns):
            raise SolveError(f"No state of the map was found: {filling.columns[0].failure}")
        if case.map.curve:
            filling.trace()
    columns = filling.columns
    checks, curves = check_cells(plan, columns, walk, case.map.checks), linked(plan, columns)
    record.note(_CHECKS, checks=checks)
    record.note(_CURVES, curves=[asdict(curve) for curve in curves])
    unsure = doubts(plan, curves) if case.map.curve else ()
    record.warn(*unsure, *_doubts(plan, columns, checks), *walk.about_rubbers())
    if case.map.samples:
        chances.find_chances(case, record, processes)
    cycles.follow_cycles(case, record, plan, list(columns), walk)


class MapResult(StudyResult):
    """Growth rate of the leading mode over two parameters.

    Attributes
    ----------
    plan : MapPlan
        Axes and continuity laws.
    columns : tuple of MapColumn
    curves : tuple of OnsetCurve
    checks : tuple of dict
    """

    kind = "map"

    @cached_property
    def plan(self) -> MapPlan:
        return MapPlan(self.case)

    @cached_property
    def columns(self) -> tuple[MapColumn, ...]:
        return tuple(sorted(read_columns(self.record, self.plan), key=lambda column: column.value))

    @cached_property
    def curves(self) -> tuple[OnsetCurve, ...]:
        notes = self.record.notes(_CURVES)
        if not notes:  # the run goes on
            return linked(self.plan, self.columns)
        arrays = ({name: np.array(row[name], float) for name in ("x", "y", "frequency")} for row in notes[-1]["curves"])
        return tuple(OnsetCurve(**row | own) for row, own in zip(notes[-1]["curves"], arrays))

    @property
    def checks(self) -> tuple[dict[str, Any], ...]:
        """See `check_cells`."""
        return tuple(check for note in self.record.notes(_CHECKS)[-1:] for check in note["checks"])

    @property
    def failures(self) -> tuple[str, ...]:
        return tuple(gap_sentence(self.plan, column) for column in self.columns if column.failure)

    def grid(self, name: str) -> np.ndarray:
        """A quantity of the cells on the grid (laws, y, x); see `Sample.number`."""
        return grid_of(self.plan, self.columns, name, range(len(self.plan.laws)))

    def over_classes(self, name: str) -> np.ndarray:
        """A quantity of the cells in all classes of motion on the grid (laws, y, x).

        Growth rate and frequency are those of the most unstable motion, the outcome is the one that decides; a cell is
        certified if it is in all classes, or unstable in one that is.
        """
        if name == "outcome":
            return self._by_class(name).min(axis=0)  # they are in that order
        if name == "certified":
            return certified_in_all(self._by_class(name).astype(bool), self._by_class("unstable") > 0)
        return np.array(self._leading()[name], float)

    def _by_class(self, name: str) -> np.ndarray:
        """A quantity of the cells (classes, laws, y, x); the laws differ in that of the equilibria alone."""
        others = range(len(self.plan.laws), len(self.plan.parts))
        more = (grid_of(self.plan, self.columns, name, [part]) for part in others)
        return np.stack(np.broadcast_arrays(self.grid(name), *more))

    def _leading(self) -> dict[str, Any]:
        """Growth rate, frequency and class of the most unstable motion in each cell, (laws, y, x)."""
        names = [motion.name for motion in self.plan.classes]
        return leading_class(names, *map(self._by_class, ("growth_rate", "frequency")))

    @property
    def probability(self) -> np.ndarray:
        """Probability of flutter with the ends of its 95 % interval on the grid (3, y, x); NaN where there is none."""
        return chances.chance_grid(self.record, self.plan)[:3]

    @property
    def _own_law(self) -> int:
        """Number of the picture of the case's own flow model; the first where none is its own."""
        laws, own = self.plan.laws, self.plan.base.storage
        return laws.index(own) if own in laws else 0

    def _has_chances(self, law: int) -> bool:
        return bool(self.case.map.samples) and self.plan.laws[law] == self.plan.base.storage

    def cycle_grid(self, name: str) -> np.ndarray:
        """A quantity of `dbvfiv.studies.map.cycles.CELLS` of the limit cycles on the grid (laws, y, x)."""
        return cycles.cycle_grid(self.record, self.plan, name)

    def touching_curves(self, law: int) -> list[np.ndarray]:
        """Lines (k, 2) in x and y on which cycles just close the lips."""
        return cycles.touching_curves(self.record, self.plan, law)

    @property
    def has_cycles(self) -> bool:
        """True where limit cycles were asked for."""
        return self.case.map.cycles or self.case.map.amplitude

    @property
    def moved(self) -> tuple[str, ...]:
        """Parameters that are not the same all over the map."""
        laws = ("storage",) if len(self.plan.laws) > 1 else ()
        return (self.plan.x.parameter, self.plan.y.parameter, *laws)

    def summary(self) -> dict[str, Any]:
        pictures = [self._picture(i) for i in range(len(self.plan.laws))]
        shared = {
            "x": _axis(self.plan.x),
            "y": _axis(self.plan.y),
            "fixed": fixed_conditions(self.case, *self.moved),
            "checks": list(self.checks),
            "gaps": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }
        document = shared | pictures[self._own_law] | {"classes": self.classes}
        if len(pictures) > 1:
            document["laws"] = pictures
        return document

    @cached_property
    def classes(self) -> list[dict[str, Any]]:
        """Cells in the other classes of motion, where they were asked for, (y, x) each."""
        found = []
        for part, motion in enumerate(self.plan.classes[1:], len(self.plan.laws)):
            table = {key: grid_of(self.plan, self.columns, name, [part])[0].tolist() for key, name in _CELLS.items()}
            certified = [[bool(cell) for cell in row] for row in table["certified"]]
            found.append({"symmetry": motion.name, "motion": motion.words} | table | {"certified": certified})
        return found

    def _picture(self, law: int) -> dict[str, Any]:
        leading = {}
        if self.classes:
            of_law = {name: table[law] for name, table in self._leading().items()}
            leading["leading"] = of_law | {"certified": self.over_classes("certified")[law].tolist()}
        followed = cycles.summary_of(self.record, self.plan, law) if self.has_cycles else {}
        sealed = {"sealed": self.grid("sealed")[law].astype(bool).tolist()} if self.case.valve.is_preset else {}
        mine = [curve for curve in self.curves if curve.law == law and not curve.level]
        contours = [curve.summary() for curve in self.curves if curve.law == law and curve.level]
        return (
            {key: self.grid(name)[law].tolist() for key, name in _CELLS.items()}
            | {
                "continuity": LAWS.get(self.plan.laws[law], self.plan.laws[law]),
                "certified": self.grid("certified")[law].astype(bool).tolist(),
                "verdict": self._verdicts(law),
                "onset_curves": [curve.points() for curve in mine],
                "onset_frequencies": [curve.frequency.tolist() for curve in mine],
                "onset_curves_exact": [bool(curve.exact) for curve in mine],
            }
            | ({"contours": contours} if self.case.map.levels else {})
            | (chances.summary_of(self.record, self.plan) if self._has_chances(law) else {})
            | sealed
            | leading
            | followed
        )

    def _missed(self, lost: int) -> str:
        return f"{lost} of {len(self.columns)} columns were not reached"

    def lines(self) -> list[str]:
        alone = "" if self.classes else f"; {self.plan.classes[0].alone}"
        lines = [f"At {describe_fixed(self.case, *self.moved)}{alone}:"]
        for i in range(len(self.plan.laws)):
            lines.append(self._cells_line(i))
            lines += [self._curve_line(curve) for curve in self.curves if curve.law == i]
            if self._has_chances(i):
                lines += chances.sentences(self.record, self.plan)
            if self.has_cycles:
                lines += cycles.sentences(self.record, self.plan, i)
        lines += [self._class_line(part, note) for part, note in enumerate(self.classes, len(self.plan.laws))]
        if self.checks:
            worst = max(check["error"] for check in self.checks)
            agreeing = sum(check["agrees"] for check in self.checks)
            lines.append(
                f"{agreeing} of {len(self.checks)} cells solved again with the full pencil agree; largest "
                f"difference {worst:.1e}."
            )
        return lines

    def _cells_line(self, law: int) -> str:
        certified, how, outcome = (self.grid(name)[law] for name in ("certified", "how", "outcome"))
        number = {name: int((outcome == i).sum()) for i, name in enumerate(OUTCOMES)}
        unstable, invalid = number[FLUTTERS] + number[DIVERGES], number[NOT_VALID]
        gaps, direct = int((how == MISSING).sum()) - invalid, int((how == DIRECT).sum())
        sealed = int(self.grid("sealed")[law].sum())
        name = LAWS.get(self.plan.laws[law], f"blend {self.plan.laws[law]:g}")
        name += f", class {self.plan.classes[0].name}" if self.classes else ""
        return (
            f"{name}: {how.shape[1]} x {how.shape[0]} cells, {unstable} unstable, {number[STABLE]} stable, "
            f"{int(certified.sum())} of {how.size} certified"
            + (f", {number[DIVERGES]} of the unstable ones diverge" if number[DIVERGES] else "")
            + (f", {invalid} not valid" if invalid else "")
            + (f", {sealed} of the stable ones sealed" if sealed else "")
            + (f", {direct} solved directly" if direct else "")
            + (f", {gaps} in gaps" if gaps else "")
            + "."
        )

    def _verdicts(self, law: int) -> list[list[dict[str, Any]]]:
        """Verdicts on the cells of the grid in all classes of motion, (y, x)."""
        found = {column.value: column for column in self.columns if column.level == 0}
        gap = Verdict.undecided("The column of this cell was not solved.")
        names = [motion.name for motion in self.plan.classes]
        parts = dict(zip(names, (law, *range(len(self.plan.laws), len(self.plan.parts)))))

        def verdict(across: float, i: int) -> Verdict:
            column = found.get(across)
            if column is None or column.failure:
                return Verdict.undecided(column.failure) if column else gap
            return Verdict.joined({name: column.verdict(part, i) for name, part in parts.items()})

        table = [
            [verdict(across, i).summary() for across in self.plan.across.values]
            for i in range(len(self.plan.along.values))
        ]
        return [list(row) for row in zip(*table)] if self.plan.transposed else table

    def _class_line(self, part: int, note: dict[str, Any]) -> str:
        (outcome,), certified = grid_of(self.plan, self.columns, "outcome", [part]), np.array(note["certified"], bool)
        number = {name: int((outcome == i).sum()) for i, name in enumerate(OUTCOMES)}
        return (
            f"class {note['symmetry']} ({note['motion']}): {number[FLUTTERS] + number[DIVERGES]} cells unstable, "
            f"{number[STABLE]} stable, {int(certified.sum())} of {certified.size} certified."
        )

    def _curve_line(self, curve: OnsetCurve) -> str:
        kind = "exact" if curve.exact else "not exact"
        rows = ((self.plan.x.parameter, curve.x), (self.plan.y.parameter, curve.y))
        spans = ", ".join(f"{name} {PARAMETERS[name].span(min(row), max(row))}" for name, row in rows)
        hertz = f"{min(curve.frequency):.4g} to {max(curve.frequency):.4g} Hz"
        return f"  {curve.title}, {kind}, {len(curve.x)} points: {spans}, {hertz}"


def _axis(axis) -> dict[str, Any]:
    return {"parameter": axis.parameter, "values": list(axis.values), "log": axis.log}


STUDY = Study("map", tables_of, run, MapResult, check, rows_to_keep=rows_to_keep)
