"""Limit cycles over a map: along each column of the grid from its onsets, by the amplitude equation near them where
that is asked for, by branches of cycles beyond.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from continuation.cycle_points import CyclePoint, SpecialCycle
from continuation.options import Reason

from ...case.parameters import PARAMETERS
from ...errors import SolveError
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..orbits import TOUCHING, Follower, Onset, onset_at
from ..stability.walk import StabilityWalk
from .column import MapColumn, MapPlan

ROWS, DONE = "cycles", "cycles of a column"
_COLUMNS = (
    Column("across", "SI", "Value of the parameter across"),
    Column("along", "SI", "Value of the parameter along"),
    Column("law", "", "Number of the flow model", "i8"),
    Column("amplitude", "m", "Half the swing of the displacement in y of one lip at x = z = 0; NaN without a cycle"),
    Column("frequency", "Hz", "Of the cycle"),
    Column(
        "growing", "", "Dimension in which perturbations of the cycle grow; -1 without a cycle or where not asked", "i8"
    ),
    Column("least", "m", "Least displacement of the lip over the cycle; lips that touch at rest do so at zero"),
    Column(
        "residual", "", "Correction that the amplitude equation's residual asks for over the amplitude; NaN of branches"
    ),
)
#: What is kept of each cell.
CELLS = ("amplitude", "frequency", "growing", "least", "residual")
#: Residual up to which the amplitude equation answers: cycles of valves differed by less than a tenth of it there.
TRUSTED = 0.1
SPEC = TableSpec(ROWS, _COLUMNS, chunk=512)


class CycleCells(NamedTuple):
    """Cycles along one column under one law."""

    #: amplitude, frequency, least and residual: (cells,); NaN where no cycle was found.
    amplitude: np.ndarray
    frequency: np.ndarray
    growing: np.ndarray  #: (cells,).
    least: np.ndarray
    residual: np.ndarray
    touching: list[float]  #: Values at which the lips of a cycle just touch.
    said: str  #: Why cells that are unstable have none; empty where all have one.

    @classmethod
    def blank(cls, cells: int) -> CycleCells:
        """No cycles."""
        nothing = np.full(cells, np.nan)
        return cls(nothing, nothing.copy(), np.full(cells, -1), nothing.copy(), nothing.copy(), [], "")

    def take(self, cell: int, amplitude: float, frequency: float, growing: int, least: float, residual: float) -> None:
        """Take a cycle, unless the cell has a better one: a stable one before others, then the larger one."""
        known = self.growing[cell] <= 0, self.amplitude[cell]
        if np.isnan(known[1]) or known <= (growing <= 0, amplitude):
            for name, value in zip(CELLS, (amplitude, frequency, growing, least, residual)):
                getattr(self, name)[cell] = value


def follow_cycles(case: Case, record: GrowingRecord, plan: MapPlan, columns: list[MapColumn], walk: StabilityWalk):
    """Cycles of all columns of the grid, where they are asked for and not in the record yet."""
    if not (case.map.cycles or case.map.amplitude):
        return
    known = read_cycles(record, plan)
    for law in range(len(plan.laws)):
        for column in columns:
            if column.level or not column.has(law) or (column.value, law) in known:
                continue
            record.progress(f"cycles at {plan.across.parameter} = {column.value:.6g}")
            keep_cycles(record, plan, column.value, law, cycles_along(case, plan, column, law, walk))


def cycles_along(case: Case, plan: MapPlan, column: MapColumn, law: int, walk: StabilityWalk) -> CycleCells:
    """Cycles in the cells of a column: of the branches from its onsets, each until it ends; where several pass, the
    stable one of largest amplitude.
    """
    found, near, reasons = (*(CycleCells.blank(len(plan.along.values)) for _ in range(2)), [])
    unstable = column.numbers(law, "unstable") > 0
    for number, along, frequency, direction, _ in column.onsets:
        if int(number) != law or not frequency or _is_covered(plan, found, along, direction):
            continue
        place = plan.place(column.value, along, plan.laws[law])
        try:
            onset = onset_at(walk, place, along, 2j * np.pi * frequency)
            if onset is None:
                continue
            follower = Follower(case, walk, place, plan.along.parameter, onset.spectrum)
            if case.map.amplitude and _answered(plan, near, follower, onset, unstable):
                continue
            keep = _Cells(plan, found, follower).take
            tracer, missed = follower.begin(onset, plan.along.values, keep)
        except SolveError as error:
            reasons.append(str(error))
            continue
        reasons += missed
        reason = tracer.run()
        if reason.kind is Reason.NO_CYCLE:
            at = PARAMETERS[plan.along.parameter].text(tracer.points[-1].value)
            reasons.append(f"at {at} the branch {reason}")
    found.amplitude[np.isclose(near.amplitude, found.amplitude, rtol=TRUSTED)] = np.nan  # the same cycle
    for cell in np.flatnonzero(~np.isnan(near.amplitude)):
        found.take(cell, *(getattr(near, name)[cell] for name in CELLS))
    lacking = int((unstable & np.isnan(found.amplitude)).sum())
    if not lacking:
        return found
    why = "; ".join(dict.fromkeys(r.rstrip(".") for r in reasons)) or "no onset of an oscillation leads there"
    return found._replace(said=f"{lacking} unstable cells without a cycle: {why}.")


def _answered(plan: MapPlan, near: CycleCells, follower: Follower, onset: Onset, unstable: np.ndarray) -> bool:
    """True where amplitude equations answer all unstable cells; they are asked from an onset both ways, until one has
    no cycle, or one that is not to be trusted.
    """
    values = np.asarray(plan.along.values)
    for cells in (np.flatnonzero(values > onset.value), np.flatnonzero(values < onset.value)[::-1]):
        expected = onset.eigenvalue
        for cell in cells:
            place = onset.place.at(**{plan.along.parameter: values[cell]})
            beside = onset_at(follower.walk, place, values[cell], expected)
            if beside is None:
                break
            equation, rest = follower.amplitude(beside)
            if not equation.residual <= TRUSTED or rest + follower.room + equation.extremes()[0] <= 0:
                break
            expected = beside.eigenvalue
            low, high = equation.extremes()
            others = beside.spectrum.unstable_count - 2 * (expected.real > 0)
            growing = int(not equation.attracts) + others
            near.take(
                cell, 0.5 * (high - low), equation.frequency / (2 * np.pi), growing, rest + low, equation.residual
            )
    return not np.isnan(near.amplitude[unstable]).any()


def _is_covered(plan: MapPlan, found: CycleCells, along: float, direction: float) -> bool:
    """True where a branch of cycles has passed the cell next to an onset, on its unstable side."""
    values = np.asarray(plan.along.values)
    beyond = np.flatnonzero(values > along) if direction > 0 else np.flatnonzero(values < along)[::-1]
    return bool(len(beyond)) and not np.isnan(found.amplitude[beyond[0]])


class _Cells:
    """Takes cycles at the values of a column into its cells."""

    def __init__(self, plan: MapPlan, found: CycleCells, follower: Follower):
        self.values, self.found, self.follower = np.asarray(plan.along.values), found, follower

    def take(self, item: CyclePoint | SpecialCycle) -> None:
        """Take a cycle that was asked for, unless the cell has a better one."""
        if isinstance(item, SpecialCycle) and item.kind == TOUCHING:
            self.found.touching.append(float(item.value))
        if not isinstance(item, CyclePoint) or not item.asked:
            return
        found, cell = self.found, int(np.argmin(np.abs(self.values - item.value)))
        low, high = self.follower.orbit(item.cycle).lip_extremes
        growing = -1 if item.exponents is None else item.exponents.unstable
        found.take(cell, 0.5 * (high - low), item.motion.omega / (2 * np.pi), growing, low, np.nan)


def keep_cycles(record: GrowingRecord, plan: MapPlan, value: float, law: int, found: CycleCells) -> None:
    """Keep a column; the note vouches for its rows."""
    cells = len(plan.along.values)
    places = {"across": np.full(cells, value), "along": np.array(plan.along.values), "law": np.full(cells, law)}
    record.extend(ROWS, places | {name: getattr(found, name) for name in CELLS})
    record.note(DONE, value=value, law=law, touching=found.touching, text=found.said)


def read_cycles(record: Record, plan: MapPlan) -> dict[tuple[float, int], CycleCells]:
    """Finished columns by value and law."""
    cells = len(plan.along.values)
    columns = {name: record.column(ROWS, name) for name in CELLS}
    return {
        (note["value"], note["law"]): CycleCells(
            *(columns[name][i * cells : (i + 1) * cells] for name in CELLS), note["touching"], note["text"]
        )
        for i, note in enumerate(record.notes(DONE))
    }


def cycle_grid(record: Record, plan: MapPlan, name: str) -> np.ndarray:
    """A quantity of `CELLS` on the grid, (laws, y values, x values)."""
    known, blank = read_cycles(record, plan), getattr(CycleCells.blank(len(plan.along.values)), name)
    table = np.array(
        [
            [getattr(known[value, law], name) if (value, law) in known else blank for value in plan.across.values]
            for law in range(len(plan.laws))
        ]
    )
    return table if plan.transposed else table.transpose(0, 2, 1)


def summary_of(record: Record, plan: MapPlan, law: int) -> dict[str, Any]:
    """Plain tables (y, x) for JSON."""
    cells = {f"cycle_{name}": cycle_grid(record, plan, name)[law].tolist() for name in CELLS}
    return cells | {"touching_curves": [line.tolist() for line in touching_curves(record, plan, law)]}


def touching_curves(record: Record, plan: MapPlan, law: int) -> list[np.ndarray]:
    """Lines (k, 2) in x and y on which cycles just close the lips at their middle: located along each column, straight
    to the nearest of the next column that no other line goes to.
    """
    known, lines, open_ = read_cycles(record, plan), [], []
    for value in plan.across.values:
        values = sorted(known[value, law].touching) if (value, law) in known else []
        pairs = sorted((abs(line[-1][1] - along), i, along) for i, line in enumerate(open_) for along in values)
        taken: dict[float, list] = {}
        for _, i, along in pairs:
            if along not in taken and not any(open_[i] is line for line in taken.values()):
                taken[along] = open_[i]
        for along in values:
            if along not in taken:
                lines.append(taken.setdefault(along, []))
            taken[along].append((value, along))
        open_ = [taken[along] for along in values]
    return [np.array(line)[:, :: -1 if plan.transposed else 1] for line in lines]


def sentences(record: Record, plan: MapPlan, law: int) -> list[str]:
    """Sentences on the cells with a limit cycle, and on the reasons why unstable cells have none."""
    amplitude, growing = (cycle_grid(record, plan, name)[law] for name in ("amplitude", "growing"))
    there = ~np.isnan(amplitude)
    said = [f"  limit cycles in {int(there.sum())} cells, {int((there & (growing > 0)).sum())} of them unstable"]
    near = int(np.isfinite(cycle_grid(record, plan, "residual")[law]).sum())
    if near:
        said[0] += f", {near} by the amplitude equation"
    if there.any():
        said[0] += f", amplitude {1e3 * np.nanmin(amplitude):.4g} to {1e3 * np.nanmax(amplitude):.4g} mm of one lip"
    row = PARAMETERS[plan.across.parameter]
    said += [
        f"  {row.text(note['value'])}: {note['text']}"
        for note in record.notes(DONE)
        if note["law"] == law and note["text"]
    ]
    return said
