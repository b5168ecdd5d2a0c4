"""Storage of a map's columns, curves and checks in a record, and their restart."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from ...observer import Observer
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..stability.verdict import FLUTTERS, OUTCOMES, STABLE, UNDECIDED
from ..study import nothing_to_resume
from .column import CELLS, MapColumn, MapPlan
from .curves import OnsetCurve
from .cycles import ROWS as CYCLE_ROWS
from .cycles import SPEC as CYCLE_SPEC
from .cycles import vouched_rows
from .run import Check

COLUMNS, CELL_ROWS, ONSETS = "columns", "cells", "onsets"
_COLUMNS = (
    Column("value", "SI", "Value of the parameter across that the cells of this column share"),
    Column("level", "", "0 on the grid, more for columns put between its own", "i8"),
    Column("solved", "", "Whether there is a state; a note says why not", "bool"),
    Column("first_cell", "", "First of its rows in the table of cells, law by law", "i8"),
    Column("first_onset", "", "First of its rows in the table of onsets", "i8"),
    Column("onset_count", "", "Onsets along this column", "i8"),
    Column("error", "", "Largest estimated relative error of a leading eigenvalue"),
    Column("band", "Hz", "Verdicts hold up to it; infinite for all frequencies"),
    Column("seconds", "s", "Processor time"),
)
_CELLS = (
    Column("across", "SI", "Value of the parameter across"),
    Column("along", "SI", "Value of the parameter along"),
    Column("law", "", "Number of the continuity law", "i8"),
    Column("growth_rate", "1/s", "Of the leading mode"),
    Column("frequency", "Hz", "Of the leading mode"),
    Column("second", "1/s", "Growth rate of the next mode"),
    Column(
        "unstable", "", "Unstable eigenvalues by the spectrum, conjugates counted apart; -1 where there is none", "i8"
    ),
    Column("counted", "", "The same by the argument principle; -1 where nobody asked", "i8"),
    Column(
        "certified",
        "",
        "Whether both counts agree and the leading eigenvalue is accurate; only beside onsets in columns put in",
        "bool",
    ),
    Column("how", "", "0 on the small model, 1 with the full pencil, 2 a gap", "i8"),
    Column("oscillating_rate", "1/s", "Of the leading oscillating mode", earlier=np.nan),
    Column("oscillating_frequency", "Hz", "Of the leading oscillating mode", earlier=np.nan),
    Column("damping_ratio", "", "Of the least damped mode listed", earlier=np.nan),
    Column("outcome", "", f"Verdict: {', '.join(f'{i} {name}' for i, name in enumerate(OUTCOMES))}", "i8", earlier=-1),
)
_ONSETS = (
    Column("across", "SI", "Column it lies on"),
    Column("law", "", "Number of the continuity law", "i8"),
    Column("along", "SI", "Where a mode is neutral"),
    Column("frequency", "Hz", "Its frequency"),
    Column("direction", "", "+1 where the mode becomes unstable along the column, -1 where it ceases to be", "i8"),
    Column("residual", "", "Growth rate over the size of the eigenvalue that the full matrices leave there"),
)
_GAP, _CURVES, _CHECKS, _NOT_VALID = "gap", "curves", "checks", "not valid"
#: Columns of the table of onsets in the order of `MapColumn.onsets`.
_OF_ONSET = ("law", "along", "frequency", "direction", "residual")


def tables_of(_mesh: MeshData | None) -> tuple[TableSpec, ...]:
    """Tables of a map. Curves and checks are notes."""
    cells = TableSpec(CELL_ROWS, _CELLS, chunk=512)
    return TableSpec(COLUMNS, _COLUMNS), cells, TableSpec(ONSETS, _ONSETS), CYCLE_SPEC


class KeepColumns(Observer):
    """Keeps every column as soon as it is finished, and says which are gaps.

    Parameters
    ----------
    record : GrowingRecord
    plan : MapPlan
    """

    def __init__(self, record: GrowingRecord, plan: MapPlan):
        self.record, self.plan = record, plan

    def item(self, result: object) -> None:
        if isinstance(result, MapColumn):
            keep_column(self.record, self.plan, result)
            if result.failure:
                self.record.fail(gap_sentence(self.plan, result))


def gap_sentence(plan: MapPlan, column: MapColumn) -> str:
    """Why there is no column."""
    return f"{plan.across.parameter} = {column.value:.6g}: {column.failure}"


def keep_column(record: GrowingRecord, plan: MapPlan, column: MapColumn) -> None:
    """Keep a column; its cells and onsets go first, so that its row vouches for them."""
    row = {
        "value": column.value,
        "level": column.level,
        "solved": not column.failure,
        "first_cell": record.rows(CELL_ROWS),
        "first_onset": record.rows(ONSETS),
        "onset_count": len(column.onsets),
        "error": column.error,
        "band": column.band,
        "seconds": column.seconds,
    }
    laws, cells = len(plan.laws), len(plan.along.values)
    places = {
        "across": np.full(laws * cells, column.value),
        "along": np.tile(plan.along.values, laws),
        "law": np.repeat(np.arange(laws), cells),
    }
    record.extend(CELL_ROWS, places | {name: np.ravel(column.cells[name]) for name in CELLS})
    if len(column.onsets):
        onsets = dict(zip(_OF_ONSET, column.onsets.T))
        record.extend(ONSETS, {"across": np.full(len(column.onsets), column.value)} | onsets)
    if column.why_not_valid:
        record.note(_NOT_VALID, value=column.value, level=column.level, text=column.why_not_valid)
    if column.failure:
        record.note(_GAP, value=column.value, level=column.level, text=column.failure)
    record.append(COLUMNS, row)


def read_columns(record: Record, plan: MapPlan) -> list[MapColumn]:
    """Finished columns in the order they were finished in."""
    reasons = {(note["value"], note["level"]): note["text"] for note in record.notes(_GAP)}
    unsound = {(note["value"], note["level"]): note["text"] for note in record.notes(_NOT_VALID)}
    shape = (len(plan.laws), len(plan.along.values))
    size = shape[0] * shape[1]
    cells = {name: record.column(CELL_ROWS, name) for name in CELLS}
    _fill_earlier(cells)
    onsets = np.column_stack([record.column(ONSETS, name).astype(float) for name in _OF_ONSET])
    rows = {c.name: record.column(COLUMNS, c.name).tolist() for c in _COLUMNS}
    found = []
    for i in range(record.rows(COLUMNS)):
        row = {name: values[i] for name, values in rows.items()}
        first, onset = row["first_cell"], row["first_onset"]
        found.append(
            MapColumn(
                row["value"],
                row["level"],
                {name: values[first : first + size].reshape(shape) for name, values in cells.items()},
                onsets[onset : onset + row["onset_count"]],
                row["error"],
                "" if row["solved"] else reasons[row["value"], row["level"]],
                row["seconds"],
                row["band"],
                unsound.get((row["value"], row["level"]), ""),
            )
        )
    return found


def _fill_earlier(cells: dict[str, np.ndarray]) -> None:
    """Outcomes of the cells of files of earlier versions, from their counts."""
    lacking = cells["outcome"] < 0
    known = np.where(cells["unstable"] > 0, OUTCOMES.index(FLUTTERS), OUTCOMES.index(STABLE))
    own = np.where(cells["certified"].astype(bool), known, OUTCOMES.index(UNDECIDED))
    cells["outcome"] = np.where(lacking, own, cells["outcome"])


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows that a map goes on from: cells, onsets and cycles of a column that was cut off before what vouches for
    them are left out.

    Raises
    ------
    CaseError
        If the map is complete.
    """
    if known.complete:
        raise nothing_to_resume("map", known.path)
    count = known.rows(COLUMNS)
    if not count:
        return {CELL_ROWS: 0, ONSETS: 0, CYCLE_ROWS: 0}
    plan = MapPlan.of(case)
    first, onset, onsets = (
        known.value(COLUMNS, name, count - 1) for name in ("first_cell", "first_onset", "onset_count")
    )
    return {
        CELL_ROWS: int(first) + len(plan.laws) * len(plan.along.values),
        ONSETS: int(onset) + int(onsets),
        CYCLE_ROWS: vouched_rows(known, plan),
    }


def keep_curves(record: GrowingRecord, curves: Iterable[OnsetCurve]) -> None:
    """Keep the onset curves of a map that is over."""
    record.note(_CURVES, curves=[asdict(curve) for curve in curves])


def read_curves(record: Record) -> tuple[OnsetCurve, ...] | None:
    """Onset curves; None while the map goes on."""
    notes = record.notes(_CURVES)
    return None if not notes else tuple(_curve(row) for row in notes[-1]["curves"])


def _curve(row: dict[str, Any]) -> OnsetCurve:
    return OnsetCurve(**row | {name: np.array(row[name], float) for name in ("x", "y", "frequency")})


def keep_checks(record: GrowingRecord, checks: Iterable[Check]) -> None:
    """Keep what cells solved again gave."""
    record.note(_CHECKS, checks=[asdict(check) for check in checks])


def read_checks(record: Record) -> tuple[Check, ...]:
    """Cells solved again with the full pencil."""
    notes = record.notes(_CHECKS)
    names = {field.name for field in fields(Check)}
    rows = notes[-1]["checks"] if notes else ()
    return tuple(Check(**{name: row[name] for name in names}) for row in rows)


def known_columns(record: Record, case: Case) -> dict[tuple[float, int], MapColumn]:
    """Columns of an interrupted run by value and level, for `run_map`."""
    return {(column.value, column.level): column for column in read_columns(record, MapPlan.of(case))}
