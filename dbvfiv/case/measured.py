"""A measured discharge: rows of pressure or head and of flow, with units."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

from .quantity import Quantity
from .text_file import read_text_file

_PRESSURE, _VOLUME, _MASS = Quantity("Pa", "kPa", head=True), Quantity("m^3/s", "L/s"), Quantity("kg/s", "kg/s")
_UNIT = re.compile(r"[\[(]\s*([^\])]+?)\s*[\])]")
#: Cubic metres as they are written in such files.
_CUBE = re.compile(r"\bm(?:3|³|\*\*3)")
_HEADER = (
    "the first line must name a pressure or head and a flow with their units, such as 'pressure [kPa], flow [L/s]'"
)


def read_measured(path: Path, density: float | None = None) -> list[tuple[float, float]]:
    """Read measured points of a discharge curve.

    Parameters
    ----------
    path : Path
        CSV (commas, semicolons or tabs) of two columns, a pressure or a head and a volume or mass flow in either
        order; the first line names them with units in brackets, ``head [m], flow [L/s]``. Empty lines and text after
        ``#`` are skipped.
    density : float, optional
        Of the fluid, kg/m3, for heads and volume flows; those of water where it is not known, which will do to check a
        file.

    Returns
    -------
    list of tuple
        Pressures in Pa and mass flows in kg/s.

    Raises
    ------
    ValueError
        With a clause that completes "measured is given as FILE, ...".
    """
    density = 1000.0 if density is None else density
    lines = read_text_file(path).splitlines()
    numbered = [(i, line.split("#")[0].strip()) for i, line in enumerate(lines, 1)]
    numbered = [(i, line) for i, line in numbered if line]
    if not numbered:
        raise ValueError("which holds no rows")
    units = [_CUBE.sub("m^3", unit) for unit in _UNIT.findall(numbered[0][1])]
    kinds = [_kind(unit, density) for unit in units]
    if sorted(kind is _PRESSURE for kind in kinds) != [False, True] or None in kinds:
        raise ValueError(f"whose columns are not told; {_HEADER}")
    points = [_point(line, number, units, kinds, density) for number, line in numbered[1:]]
    if not points:
        raise ValueError("which holds no rows below its first line")
    return points


def _kind(unit: str, density: float) -> Quantity | None:
    """What a unit measures; None if it is neither a pressure nor a flow."""
    for kind in (_PRESSURE, _VOLUME, _MASS):
        try:
            kind.parse(f"1 {unit}", density if kind is _PRESSURE else None)
        except ValueError:
            continue
        return kind
    return None


def _point(line: str, number: int, units: list[str], kinds: list[Quantity | None], density: float):
    separator = next((mark for mark in ";\t," if mark in line), None)
    words = line.split() if separator is None else next(csv.reader([line], delimiter=separator))
    if len(words) != 2:
        raise ValueError(f"whose line {number} is not a pressure and a flow")
    found = {}
    for word, unit, kind in zip(map(str.strip, words), units, kinds):
        try:
            value = kind.parse(f"{float(word)!r} {unit}", density if kind is _PRESSURE else None)
        except ValueError:
            raise ValueError(f"whose line {number} holds {word!r}, which is not a number") from None
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"whose line {number} holds {word!r}, and numbers must be finite and not negative")
        found[kind is _PRESSURE] = value * (density if kind is _VOLUME else 1.0)
    return found[True], found[False]
