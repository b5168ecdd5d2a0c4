"""A pressure that follows a table: rows of time and pressure, with units."""

from __future__ import annotations

import math
import re
from pathlib import Path

from .quantity import Quantity
from .text_file import read_text_file

_TIME, _PRESSURE = Quantity("s", "s"), Quantity("Pa", "kPa", head=True)
_UNIT = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")


def read_drive_table(path: Path) -> list[tuple[float, float]]:
    """Read a drive table.

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

    Raises
    ------
    ValueError
        With a clause that completes "drive_table is given as FILE, ...".
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
    """Rows of two numbers with units, SI; `words` says what a row is.

    Raises
    ------
    ValueError
        With a clause that completes "KEY is given as FILE, ...".
    """
    text = read_text_file(path)
    units, rows = [kind.si for kind in kinds], []
    for number, line in enumerate(text.splitlines(), 1):
        found = _words(line.split("#")[0])
        if not found:
            continue
        if not rows and re.match(r"[A-Za-z]", found[0]):
            units = _header_units(line.split("#")[0], number, kinds)
            continue
        if len(found) != 2:
            raise ValueError(f"whose line {number} is not {words}")
        rows.append(tuple(_value(word, unit, kind, number) for word, unit, kind in zip(found, units, kinds)))
    if not rows:
        raise ValueError("which holds no rows")
    return rows


def _words(line: str) -> list[str]:
    line = line.strip()
    for separator in ",;\t":
        if separator in line:
            return [word.strip().strip('"') for word in line.split(separator) if word.strip()]
    return line.split()


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
