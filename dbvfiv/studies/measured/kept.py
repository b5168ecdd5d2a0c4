"""Measured tables in a record, so that a result has them when their files have gone."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from ...case.measured import MeasuredTable, check_kind, read_measured
from ...errors import CaseError
from ...record.record import GrowingRecord, Record

#: Kind of the note of a record that holds a table.
NOTE = "measured"


def keep_measured(
    record: GrowingRecord, key: str, files: Sequence[Path], kinds: Collection[str], density: float
) -> None:
    """Put the tables of a case into a record that has none yet.

    Parameters
    ----------
    record : GrowingRecord
    key : str
        Of the case, for messages.
    files : sequence of Path
    kinds : collection of str
        What they may hold, see `dbvfiv.case.measured`.
    density : float, kg/m3

    Raises
    ------
    CaseError
        If a file has gone or holds something else.
    """
    if record.notes(NOTE):
        return
    tables = []
    for path in files:
        try:
            tables.append(read_measured(path, density))
            check_kind(tables[-1], kinds)
        except ValueError as error:
            raise CaseError(f"{key} is given as {str(path)!r}, {error}.", key) from None
    for table in tables:
        record.note(NOTE, name=table.name, columns={name: list(values) for name, values in table.columns.items()})


def kept_tables(record: Record) -> tuple[MeasuredTable, ...]:
    """The tables that a record holds."""
    return tuple(_table(note) for note in record.notes(NOTE))


def _table(note: dict[str, Any]) -> MeasuredTable:
    if "points" in note:  # of a version that knew pressures and flows alone
        pressure, mass_flow = zip(*note["points"])
        return MeasuredTable("", {"pressure": pressure, "mass_flow": mass_flow})
    return MeasuredTable(note["name"], {name: tuple(values) for name, values in note["columns"].items()})


def joined(tables: Sequence[MeasuredTable], kind: str, *names: str) -> tuple[tuple[Any, ...], ...] | None:
    """Columns of all tables of a kind, one below the other; None where there is no such table."""
    chosen = [table for table in tables if kind in table.holds]
    if not chosen:
        return None
    return tuple(tuple(value for table in chosen for value in table.columns[name]) for name in names)
