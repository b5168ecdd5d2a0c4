"""Catalogue sheet of steady states: head, flow, velocities, K, Kv and opening as CSV or XLSX, in units of choice."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...case.units import Units, factor_of
from ...errors import CaseError


@dataclass(frozen=True)
class SheetColumn:
    """A column of the sheet.

    Attributes
    ----------
    title : str
    kind : str
        Quantity whose unit can be chosen, a key of `dbvfiv.case.units.UNITS`; empty for one of fixed unit.
    unit : str
        Unit where none is chosen.
    value : callable
        From a steady `State` of a result to the number, in SI units where there is a kind.
    """

    title: str
    kind: str
    unit: str
    value: Callable[[Any], float]


COLUMNS = (
    SheetColumn("bore", "size", "mm", lambda s: 2 * _bore(s)),
    SheetColumn("static head", "head", "m", lambda s: s.head),
    SheetColumn("static pressure", "pressure", "kPa", lambda s: s.flange_pressure),
    SheetColumn("flow", "flow", "L/s", lambda s: s.volume_flow),
    SheetColumn("velocity", "velocity", "m/s", lambda s: s.hydraulics.flange_velocity),
    SheetColumn("jet velocity", "velocity", "m/s", lambda s: s.outlet_velocity),
    SheetColumn("head loss", "head", "m", lambda s: s.hydraulics.head_loss),
    SheetColumn("K", "", "", lambda s: s.hydraulics.loss_coefficient),
    SheetColumn("Kv", "", "m3/h", lambda s: s.hydraulics.kv),
    SheetColumn("Cv", "", "gpm", lambda s: s.hydraulics.cv),
    SheetColumn("opening", "size", "mm", lambda s: s.lip_opening),
)


def _bore(state: Any) -> float:
    valve = state.results.case.valve
    return valve.inlet_radius - valve.flange_wall_deduction


def require_sheet(path: Path) -> None:
    """Refuse a sheet that cannot be written before anything is computed.

    Raises
    ------
    CaseError
    """
    if path.suffix.lower() == ".xlsx" and find_spec("openpyxl") is None:
        raise CaseError(
            f"{str(path)!r} needs the package openpyxl (pip install 'dbvfiv[report]'); a name in .csv does not."
        )
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise CaseError(f"{str(path)!r} cannot be written: it is a folder, or its folder does not exist.")


def sheet_rows(states: Iterable[Any], units: Units) -> list[list[str | float | None]]:
    """Head line and one row for each state that flows; a number that is not finite is left blank."""
    names = [_unit(column, units) for column in COLUMNS]
    factors = [factor_of(column.kind, name) if column.kind else 1.0 for column, name in zip(COLUMNS, names)]
    rows: list[list[str | float | None]] = [
        [f"{column.title} [{name}]" if name else column.title for column, name in zip(COLUMNS, names)]
    ]
    for state in states:
        if state.hydraulics is not None:
            values = (column.value(state) / factor for column, factor in zip(COLUMNS, factors))
            rows.append([float(f"{value:.6g}") if math.isfinite(value) else None for value in values])
    return rows


def _unit(column: SheetColumn, units: Units) -> str:
    """Unit of a column; pressures have one of their own beside heads."""
    if not column.kind or (column.kind == "pressure" and units.heads):
        return column.unit
    return units.name(column.kind)


def write_sheet(path: Path, states: Sequence[Any]) -> Path:
    """Write the sheet in the units of its case; one of that name is replaced."""
    rows = sheet_rows(states, states[0].results.case.units if states else Units("", 1.0))
    if path.suffix.lower() == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(rows)
        return path
    from openpyxl import Workbook  # optional

    book = Workbook()
    book.active.title = "steady"
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path
