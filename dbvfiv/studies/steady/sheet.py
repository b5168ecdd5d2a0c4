"""Catalogue sheet of steady states: head, flow, velocities, K, Kv and opening as CSV or XLSX, in units of choice."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from ...case.quantity import Quantity
from ...errors import CaseError


@dataclass(frozen=True)
class SheetColumn:
    """A column of the sheet.

    Attributes
    ----------
    title : str
    kind : str
        Quantity whose unit can be chosen, a key of `UNITS`; empty for one of fixed unit.
    unit : str
        Unit where none is chosen.
    value : callable
        From a steady `State` of a result to the number, in SI units where there is a kind.
    """

    title: str
    kind: str
    unit: str
    value: Callable[[Any], float]


#: Units that can be chosen: quantity -> its SI unit, and the name of each unit with what Pint calls it.
UNITS = {
    "head": ("m", {"m": "m", "ft": "ft"}),
    "pressure": ("Pa", {"Pa": "Pa", "kPa": "kPa", "bar": "bar", "psi": "psi"}),
    "flow": (
        "m^3/s",
        {"L/s": "L/s", "m3/h": "m^3/h", "m3/s": "m^3/s", "gpm": "gallon/min", "MGD": "megagallon/day", "cfs": "ft^3/s"},
    ),
    "velocity": ("m/s", {"m/s": "m/s", "ft/s": "ft/s"}),
    "size": ("m", {"mm": "mm", "cm": "cm", "in": "in"}),
}

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


def require_sheet(path: Path, units: str | None) -> None:
    """Refuse units that are not known, and a sheet that cannot be written, before anything is computed.

    Raises
    ------
    CaseError
    """
    chosen_units(units)
    if path.suffix.lower() == ".xlsx" and find_spec("openpyxl") is None:
        raise CaseError(f"{str(path)!r} needs the package openpyxl, which is not installed; a name in .csv does not.")
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise CaseError(f"{str(path)!r} cannot be written: it is a folder, or its folder does not exist.")


def chosen_units(text: str | None) -> dict[str, str]:
    """Unit of each quantity from "ft, gpm, in"; quantities that are not named keep the usual one.

    Raises
    ------
    CaseError
        For a unit that is not known, or two of one quantity.
    """
    chosen: dict[str, str] = {}
    for unit in filter(None, (part.strip() for part in (text or "").split(","))):
        kind = next((kind for kind, (_, names) in UNITS.items() if unit in names), None)
        if kind is None or kind in chosen:
            known = "; ".join(f"{kind} {', '.join(names)}" for kind, (_, names) in UNITS.items())
            why = "a second unit of one quantity" if kind else "no unit of a sheet"
            raise CaseError(f"--units is given as {text!r}, and {unit!r} is {why}; there are {known}.")
        chosen[kind] = unit
    return chosen


def sheet_rows(states: Iterable[Any], units: str | None = None) -> list[list[str | float | None]]:
    """Head line and one row for each state that flows; a number that is not finite is left blank."""
    chosen = chosen_units(units)
    names = [chosen.get(column.kind, column.unit) for column in COLUMNS]
    factors = [_factor(column.kind, name) for column, name in zip(COLUMNS, names)]
    rows: list[list[str | float | None]] = [
        [f"{column.title} [{name}]" if name else column.title for column, name in zip(COLUMNS, names)]
    ]
    for state in states:
        if state.hydraulics is not None:
            values = (column.value(state) / factor for column, factor in zip(COLUMNS, factors))
            rows.append([float(f"{value:.6g}") if math.isfinite(value) else None for value in values])
    return rows


def _factor(kind: str, unit: str) -> float:
    """SI value of one unit."""
    if not kind:
        return 1.0
    si, names = UNITS[kind]
    return Quantity(si).parse(f"1 {names[unit]}")


def write_sheet(path: Path, states: Sequence[Any], units: str | None = None) -> Path:
    """Write the sheet; one of that name is replaced."""
    rows = sheet_rows(states, units)
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
