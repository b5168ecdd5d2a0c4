"""The curve of a pump: rows of flow and head, with units."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo

from .described import Described
from .drive_table import read_pairs
from .quantity import Quantity

FLOW, HEAD = Quantity("m^3/s", "L/s"), Quantity("m", "m")


def read_pump_table(path: Path) -> list[tuple[float, float]]:
    """Rows of flow, m3/s, and head, m, of a CSV file as `dbvfiv.case.drive_table.read_drive_table` reads one.

    The header names the units, ``flow [L/s], head [m]``. Plain numbers without a header are m3/s and m.

    Raises
    ------
    ValueError
        With a clause that completes "pump is given as FILE, ...".
    """
    return read_pairs(path, (FLOW, HEAD), "a flow and a head")


def parse_rows(given: Any) -> list[tuple[float, float]]:
    """Rows given in the case itself, numbers in SI or texts with units.

    Raises
    ------
    ValueError
        With a clause that completes "pump is given as ROWS, ...".
    """
    rows = []
    for number, row in enumerate(given, 1):
        if not isinstance(row, (list, tuple)) or len(row) != 2:
            raise ValueError(f"whose row {number} is not a flow and a head")
        try:
            rows.append((FLOW.parse(row[0]), HEAD.parse(row[1])))
        except ValueError as error:
            raise ValueError(f"whose row {number} holds {list(row)!r}, {error}") from None
    return rows


def check_curve(rows: list[tuple[float, float]]) -> None:
    """Refuse what no pump's curve is.

    Raises
    ------
    ValueError
        With a clause that completes "pump is given as ..., ...".
    """
    if len(rows) < 2:
        raise ValueError("which holds fewer than two rows, and a curve needs a range of flows")
    if rows[0][0] < 0:
        raise ValueError(f"which begins at a flow of {rows[0][0]:g} m3/s, and flows must not be negative")
    for (before, _), (after, _) in zip(rows, rows[1:]):
        if not after > before:
            raise ValueError(f"whose flows do not increase at {after:g} m3/s")
    if not rows[0][1] > 0:
        raise ValueError(f"which begins at a head of {rows[0][1]:g} m, and it must begin above 0")
    if min(head for _, head in rows) < 0:
        raise ValueError("which holds a negative head")


def _read(given: Any, info: ValidationInfo) -> Any:
    """Rows of a file or of the case."""
    if given is None:
        return None
    if isinstance(given, (str, Path)):
        rows = read_pump_table(Path((info.context or {}).get("folder", ".")) / given)
    elif isinstance(given, (list, tuple)):
        rows = parse_rows(given)
    else:
        raise ValueError("which is neither a file nor rows of flow and head")
    check_curve(rows)
    return tuple(rows)


PumpCurve = Annotated[
    tuple[tuple[float, float], ...],
    BeforeValidator(_read),
    Described(
        "file or list of pairs",
        "a CSV file of flow and head, or at least two rows of a flow in m3/s and a head in m, flows increasing from 0 "
        'or more, such as [[0, 12], ["50 L/s", "9 m"]]',
    ),
]
