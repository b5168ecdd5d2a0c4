"""Measured data: tables of discharge, area, sections of the wall and pressure taps, with units in the header."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationInfo

from .quantity import Quantity
from .section import Described
from .tables import SEPARATORS, cells_of, numbered_lines

_PRESSURE, _VOLUME, _MASS = Quantity("Pa", "kPa", head=True), Quantity("m^3/s", "L/s"), Quantity("kg/s", "kg/s")
_LENGTH, _AREA = Quantity("m", "mm"), Quantity("m^2", "cm^2")
#: Columns that are told by their unit, and those that are told by their name.
_BY_UNIT = {"pressure": (_PRESSURE,), "mass_flow": (_VOLUME, _MASS), "area": (_AREA,)}
_BY_NAME = {"x": _LENGTH, "y": _LENGTH, "z": _LENGTH, "tap": _PRESSURE}
_CALLED = {"pressure": "a pressure or head", "mass_flow": "a flow", "area": "an area", "face": "a face"} | {
    name: name for name in _BY_NAME
}
#: May be negative: places, because the valve is symmetric, and pressures in the fluid.
_SIGNED = ("x", "y", "tap")
FACES = ("inner", "outer", "middle")
#: What a table may hold: its columns, and those that it may have beside them with what they are otherwise.
DISCHARGE, AREA, SHAPE, TAPS = "a discharge", "areas", "sections of the wall", "pressures along the axis"
_NEEDED = {
    DISCHARGE: {"pressure", "mass_flow"},
    AREA: {"pressure", "area"},
    SHAPE: {"pressure", "x", "y"},
    TAPS: {"pressure", "z", "tap"},
}
_OTHERWISE = {SHAPE: {"z": None, "face": "inner"}}
_NAMED = re.compile(r"([^,;\t\[\]()]*?)\s*[\[(]\s*([^\])]+?)\s*[\])]|\b(face)\b", re.IGNORECASE)
#: Squares and cubes of metres as they are written in such files.
_POWER = re.compile(r"\b([cdm]?m|in|ft)(?:(?:\*\*)?([23])|([²³]))")
_HEADER = (
    "the first line must name the columns with their units, a pressure or head with a flow, an area or both "
    "(pressure [kPa], flow [L/s]), with x and y of points of a section and, where not at the lip or the inner "
    "face, z and face (pressure [kPa], z [mm], face, x [mm], y [mm]), or with z and tap, a static pressure measured "
    "there (pressure [kPa], z [mm], tap [kPa])"
)


@dataclass(frozen=True)
class MeasuredTable:
    """A table of measured numbers."""

    name: str  #: Of its file.
    #: SI: ``pressure`` (Pa), and ``mass_flow`` (kg/s), ``area`` (m2), ``x``, ``y``, ``z`` (m), ``tap`` (Pa) or words in
    #: ``face``; ``z`` is None at the edge of the lip.
    columns: Mapping[str, tuple[Any, ...]]

    @property
    def holds(self) -> frozenset[str]:
        """Kinds of measurement (`DISCHARGE`, `AREA`, `SHAPE`, `TAPS`) that the table has the columns of."""
        return frozenset(kind for kind in _NEEDED if _makes(kind, set(self.columns)))


def read_measured(path: Path, density: float | None = None) -> MeasuredTable:
    """Read a table of measured numbers. Raises ValueError with a clause that completes "measured is given as FILE,
    ...".

    Parameters
    ----------
    path : Path
        CSV (commas, semicolons or tabs); the first line names the columns with units in brackets, such as ``head [m],
        flow [L/s]``. Pressure or head, flow and area are told by their units, ``x``, ``y``, ``z`` and ``tap`` by their
        names; a column ``face`` says ``inner``, ``outer`` or ``middle``. Empty lines and text after ``#`` are skipped.
    density : float, optional
        Of the fluid, kg/m3, for heads and volume flows; that of water where it is not known, which will do to check a
        file.
    """
    density = 1000.0 if density is None else density
    numbered = numbered_lines(path)
    if not numbered:
        raise ValueError("which holds no rows")
    columns = _read_header(numbered[0][1], density)
    rows = [_read_row(line, number, columns, density) for number, line in numbered[1:]]
    if not rows:
        raise ValueError("which holds no rows below its first line")
    found = {name: values for (name, _, _), values in zip(columns, zip(*rows))}
    for kind, otherwise in _OTHERWISE.items():
        if _makes(kind, set(found)):
            found = {name: (value,) * len(rows) for name, value in otherwise.items()} | found
    return MeasuredTable(Path(path).name, found)


def _makes(kind: str, names: set[str]) -> bool:
    """True where these column names are the columns of a kind of table, with or without its optional ones."""
    beside = {"mass_flow", "area"} if kind in (DISCHARGE, AREA) else set(_OTHERWISE.get(kind, ()))
    return _NEEDED[kind] <= names <= _NEEDED[kind] | beside


def _read_header(line: str, density: float) -> list[tuple[str, str, Quantity | None]]:
    """Name, unit and quantity of each column."""
    columns = []
    for called, unit, face in _NAMED.findall(line):
        if face or called.strip().casefold() == "face":
            columns.append(("face", "", None))
            continue
        unit = _POWER.sub(lambda m: f"{m[1]}^{m[2] or '23'['²³'.index(m[3])]}", unit)
        columns.append(_column(called.strip().casefold(), unit, density))
    names = [name for name, _, _ in columns]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"whose columns are not told, because two are {_CALLED[twice]}; {_HEADER}")
    divided = any(mark in line for mark in SEPARATORS)
    if (divided and len(cells_of(line)) != len(columns)) or not any(_makes(kind, set(names)) for kind in _NEEDED):
        raise ValueError(f"whose columns are not told; {_HEADER}")
    return columns


def _column(called: str, unit: str, density: float) -> tuple[str, str, Quantity]:
    name = "tap" if called.split()[:1] == ["tap"] else called
    if name in _BY_NAME:
        if not _measures(_BY_NAME[name], unit, density):
            what = "a pressure or head" if name == "tap" else "a length"
            raise ValueError(f"whose column {name} is in {unit!r}, which is no unit of {what}")
        return name, unit, _BY_NAME[name]
    for name, quantities in _BY_UNIT.items():
        for quantity in quantities:
            if _measures(quantity, unit, density):
                return name, unit, quantity
    shown = f"{called} [{unit}]".strip()
    raise ValueError(f"whose columns are not told, because {shown!r} is none that is known; {_HEADER}")


def _measures(quantity: Quantity, unit: str, density: float) -> bool:
    """True where a unit belongs to a quantity."""
    try:
        quantity.parse(f"1 {unit}", density if quantity is _PRESSURE else None)
    except ValueError:
        return False
    return True


def _read_row(line: str, number: int, columns: list[tuple[str, str, Quantity | None]], density: float) -> list[Any]:
    words = cells_of(line)
    if len(words) != len(columns):
        allowed = " and ".join(_CALLED[name] for name, _, _ in columns)
        raise ValueError(f"whose line {number} is not {allowed}")
    return [_read_cell(word, number, *column, density) for word, column in zip(words, columns)]


def _read_cell(word: str, number: int, name: str, unit: str, quantity: Quantity | None, density: float) -> Any:
    if quantity is None:
        if word.casefold() not in FACES:
            raise ValueError(
                f"whose line {number} holds {word!r}, and a face is {', '.join(FACES[:-1])} or {FACES[-1]}"
            )
        return word.casefold()
    try:
        value = quantity.parse(f"{float(word)!r} {unit}", density if quantity is _PRESSURE else None)
    except ValueError:
        raise ValueError(f"whose line {number} holds {word!r}, which is not a number") from None
    if not (math.isfinite(value) and (value >= 0 or name in _SIGNED)):
        raise ValueError(f"whose line {number} holds {word!r}, and numbers must be finite and not negative")
    return value * (density if quantity is _VOLUME else 1.0)


#: Marks a key that names files of measured data.
MEASURED_FILES = Described("file or list of files", "the name of a file that can be read, or a list of such names")


def find_measured(given: Any, info: ValidationInfo, kinds: Collection[str]) -> Any:
    """Full names of the files that a key names, one or several, looked into where files are to be looked for. Raises
    ValueError with a clause that completes "KEY is given as X, ...".

    Parameters
    ----------
    given : text, path, list of those or None
    kinds : collection of str
        What the files may hold.
    """
    several = isinstance(given, (list, tuple))
    paths = list(given) if several else [] if given is None else [given]
    if not all(isinstance(path, (str, Path)) for path in paths):
        raise ValueError("which names no file" if not several else "of which one names no file")
    context = info.context or {}
    if not context.get("check_files", True):
        return tuple(Path(path) for path in paths)
    found = []
    for name in paths:
        path = Path(context.get("folder", ".")) / name
        try:
            check_kind(read_measured(path, context.get("density")), kinds)
        except ValueError as error:
            raise ValueError(f"of which {str(name)!r} is one {error}" if several else str(error)) from None
        found.append(path.resolve())
    return tuple(found)


def check_kind(table: MeasuredTable, kinds: Collection[str]) -> None:
    """Refuse a table of something else. Raises ValueError with a clause that completes "KEY is given as FILE, ..."."""
    if not table.holds & set(kinds):
        raise ValueError(f"which holds {' and '.join(sorted(table.holds))}, and here belong {' or '.join(kinds)}")
