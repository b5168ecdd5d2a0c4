"""Files that a case names, and tables in them: a pressure over time, the curve of a pump."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ValidationInfo

from .quantity import Quantity
from .section import Described


def read_text_file(path: Path) -> str:
    """Text of a file in UTF-8, without the mark that some programs put in front. Raises ValueError with a clause that
    completes "KEY is given as FILE, ...".
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError("which does not exist") from None
    except UnicodeDecodeError:
        raise ValueError("which is not a text file") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"which cannot be read ({getattr(error, 'strerror', None) or 'bad name'})") from None


def numbered_lines(path: Path) -> list[tuple[int, str]]:
    """Lines of a text file with their numbers, but for empty ones and what follows ``#``; see `read_text_file`."""
    lines = ((i, line.split("#")[0].strip()) for i, line in enumerate(read_text_file(path).splitlines(), 1))
    return [(i, line) for i, line in lines if line]


#: What divides the cells of a table, the first that a line has; without any of these blanks do.
SEPARATORS = "\t;,"
_ALIGNING_TAB = re.compile(r"(?<=[;,])\t+|\t+(?=[;,])")
_DECIMAL_COMMA = re.compile(r"^([+-]?\d+),(\d+)")


def cells_of(line: str, head: str = "") -> list[str]:
    """Cells of a line of a table, divided as its head is, where one is given, or as the line itself.

    Between tabs or semicolons numbers may have decimal commas, as spreadsheets of half the world write them. A tab
    beside a comma or a semicolon is a blank.

    Examples
    --------
    >>> cells_of("0,5; 10,25 kPa"), cells_of("0.5,\\t10"), cells_of("x [mm] y [mm]")
    (['0.5', '10.25 kPa'], ['0.5', '10'], ['x[mm]', 'y[mm]'])
    """
    line, head = (_ALIGNING_TAB.sub(" ", text) for text in (line, head or line))
    mark = next((mark for mark in SEPARATORS if mark in head), None)
    if mark is None:
        return re.sub(r"\s+([\[(])", r"\1", line).split()
    cells = (cell.strip() for cell in next(csv.reader([line], delimiter=mark)))
    return [cell if mark == "," else _DECIMAL_COMMA.sub(r"\1.\2", cell) for cell in cells]


def _require_file(path: Path) -> None:
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null byte in it
        found = False
    if not found:
        raise ValueError("which does not exist" if not str(path).endswith("/") else "which is not a file")


def readable_file(read: Callable[[Path], object] = _require_file) -> AfterValidator:
    """Validator of a key that names a file: it is tried, and gets its full name, but where files are not looked for.

    Parameters
    ----------
    read : callable
        Raises ValueError with a clause that completes "key is given as FILE, ...".
    """

    def check(path: Path, info: ValidationInfo) -> Path:
        context = info.context or {}
        if not context.get("check_files", True):
            return path
        path = Path(context.get("folder", ".")) / path
        read(path)
        return path.resolve()

    return AfterValidator(check)


#: A key that names a file, which is looked for.
ExistingFile = Annotated[Path, readable_file()]

_TIME, _PRESSURE = Quantity("s", "s"), Quantity("Pa", "kPa", head=True)
_UNIT = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")


def read_drive_table(path: Path) -> list[tuple[float, float]]:
    """Read a drive table. Raises ValueError with a clause that completes "drive_table is given as FILE, ...".

    Parameters
    ----------
    path : Path
        CSV (commas, semicolons, tabs or blanks) of time and pressure. The first line may name the columns with units in
        brackets,
        ``time [ms], pressure [kPa]``; single entries may carry their own, ``10 ms, 6 kPa``. Plain numbers without a
        header are s and Pa. Empty lines and text after ``#`` are skipped.

    Returns
    -------
    list of tuple
        Times in s, increasing, and pressures in Pa.
    """
    rows = read_pairs(path, (_TIME, _PRESSURE), "a time and a pressure")
    for (before, _), (after, _) in zip(rows, rows[1:]):
        if not after > before:
            raise ValueError(f"whose times do not increase at {after:g} s")
    lowest = min(pressure for _, pressure in rows)
    if lowest < 0:
        raise ValueError(f"which holds a pressure of {lowest:g} Pa, and pressures must not be negative")
    return rows


def read_pairs(path: Path, kinds: tuple[Quantity, Quantity], words: str) -> list[tuple[float, float]]:
    """Rows of two numbers with units, SI; `words` says what a row is. Raises ValueError with a clause that completes
    "KEY is given as FILE, ...".
    """
    units, rows = [kind.si for kind in kinds], []
    for number, line in numbered_lines(path):
        found = [cell for cell in cells_of(line) if cell]
        if not found:
            continue
        if not rows and re.match(r"[A-Za-z]", found[0]):
            units = _header_units(line, number, kinds)
            continue
        if len(found) != 2:
            raise ValueError(f"whose line {number} is not {words}")
        rows.append(tuple(_value(word, unit, kind, number) for word, unit, kind in zip(found, units, kinds)))
    if not rows:
        raise ValueError("which holds no rows")
    return rows


def _header_units(line: str, number: int, kinds: tuple[Quantity, Quantity]) -> list[str]:
    found = _UNIT.findall(line)
    if not found:
        return [kind.si for kind in kinds]
    if len(found) != 2:
        raise ValueError(f"whose line {number} names {len(found)} units and not two")
    for unit, kind in zip(found, kinds):
        try:
            kind.parse(f"1 {unit}")
        except ValueError as error:
            raise ValueError(f"whose line {number} names the unit {unit!r}, {error}") from None
    return found


def _value(word: str, unit: str, kind: Quantity, number: int) -> float:
    try:
        value = kind.parse(f"{float(word)!r} {unit}")
    except ValueError:
        try:
            value = kind.parse(word)
        except ValueError as error:
            raise ValueError(f"whose line {number} holds {word!r}, {error}") from None
    if not math.isfinite(value):
        raise ValueError(f"whose line {number} holds {word!r}, which is not finite")
    return value


FLOW, HEAD = Quantity("m^3/s", "L/s"), Quantity("m", "m")


def read_pump_table(path: Path) -> list[tuple[float, float]]:
    """Rows of flow, m3/s, and head, m, of a CSV file as `dbvfiv.case.tables.read_drive_table` reads one. Raises
    ValueError with a clause that completes "pump is given as FILE, ...".

    The header names the units, ``flow [L/s], head [m]``. Plain numbers without a header are m3/s and m.
    """
    return read_pairs(path, (FLOW, HEAD), "a flow and a head")


def parse_rows(given: Any) -> list[tuple[float, float]]:
    """Rows given in the case itself, numbers in SI or texts with units. Raises ValueError with a clause that completes
    "pump is given as ROWS, ...".
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
    """Refuse what no pump's curve is. Raises ValueError with a clause that completes "pump is given as ..., ..."."""
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
