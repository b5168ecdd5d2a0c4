"""Reading tests in uniaxial, planar and biaxial tension from a CSV file.

The first line that is neither empty nor a comment (#) names the columns, each with its unit in
brackets: ``engineering_strain [%], nominal_stress [MPa]``. Other columns are ignored; the order does not matter. A
strain column may be replaced by ``stretch [-]``. Without a column ``cycle`` all rows are taken for loading data of one
cycle; which one is the user's choice (the thesis takes the fifth loading curve, Th. 3.2.1).
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.rubber_forms import MODES

STRAIN_UNITS = {"-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01, "percent": 0.01}
STRESS_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6, "N/mm2": 1e6, "psi": 6894.757293168361}
_COLUMNS = {"engineering_strain": STRAIN_UNITS, "stretch": {"-": 1.0, "1": 1.0}, "nominal_stress": STRESS_UNITS}
_WORDS = {
    "uniaxial": ("uniaxial", "tension", "uniaxial tension"),
    "planar": ("planar", "planar tension", "pure shear"),
    "biaxial": ("biaxial", "equibiaxial", "biaxial tension", "equibiaxial tension"),
}
_HEADER = re.compile(r"\s*([A-Za-z_ ]+?)\s*[\[(]\s*([^\])]+?)\s*[\])]\s*")


@dataclass(frozen=True)
class TensionTest:
    """A loading curve.

    Attributes
    ----------
    strain : numpy.ndarray, shape (n,)
        Engineering strain, a fraction; greater than -1.
    stress : numpy.ndarray, shape (n,)
        Nominal (engineering) stress, Pa.
    mode : str
        "uniaxial", "planar" (pure shear: the width is held) or "biaxial" (both directions pulled alike).
    """

    strain: np.ndarray
    stress: np.ndarray
    mode: str = "uniaxial"

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise MaterialError(f"A test is one of {', '.join(MODES)}, but {self.mode!r} was given.")
        strain, stress = (np.array(v, dtype=float) for v in (self.strain, self.stress))
        if strain.ndim != 1 or strain.shape != stress.shape:
            raise MaterialError(
                "A tension test needs as many strains as stresses in two flat lists, but their shapes are "
                f"{strain.shape} and {stress.shape}."
            )
        if not (np.all(np.isfinite(strain)) and np.all(np.isfinite(stress))):
            raise MaterialError("A tension test must hold finite numbers only.")
        if np.any(strain <= -1.0):
            raise MaterialError(
                f"Engineering strain must be greater than -1, but the tension test holds {strain.min():g}."
            )
        strain.setflags(write=False)
        stress.setflags(write=False)
        object.__setattr__(self, "strain", strain)
        object.__setattr__(self, "stress", stress)


def read_tension_test(path: str | Path) -> TensionTest:
    """Read a uniaxial tension test; see `read_curves`.

    Raises
    ------
    MaterialError
        Also if the table holds other tests, or several cycles.
    """
    curves = read_curves(path)
    if len(curves) > 1 or curves[0].test.mode != "uniaxial":
        raise MaterialError(f"Tension test {path}: it must hold one uniaxial test, but it holds {told_of(curves)}.")
    return curves[0].test


@dataclass(frozen=True)
class Curve:
    """The rows of one test, and of one cycle of it where the table tells cycles apart.

    Attributes
    ----------
    test : TensionTest
        In the order of the file; a cycle has its way back too.
    cycle : int or None
    """

    test: TensionTest
    cycle: int | None = None


def told_of(curves: list[Curve]) -> str:
    """Description of a table's test curves: deformation modes and load cycles."""
    return ", ".join(c.test.mode + ("" if c.cycle is None else f" (cycle {c.cycle})") for c in curves)


def read_curves(path: str | Path, mode: str | None = None) -> list[Curve]:
    """Read tests of a rubber.

    Parameters
    ----------
    path : str or Path
        CSV with a header naming ``engineering_strain`` (or ``stretch``) and ``nominal_stress``
        with units; separated by commas, semicolons or tabs. A column ``test`` may say which test each row belongs to
        (uniaxial, planar or biaxial), a column ``cycle`` which cycle (a whole number).
    mode : str, optional
        What the file holds if it has no column ``test``; uniaxial if not given.

    Returns
    -------
    list of Curve
        In SI units; tests in the order of `rubber_forms.MODES`, cycles ascending.

    Raises
    ------
    MaterialError
        If the file cannot be read, a column or unit is missing or unknown, or a cell is no
        number; the message names file, line and column.
    """
    path = Path(path)
    rows = _rows(path)
    line, header = rows[0]
    columns = _columns(path, line, header)
    words = {t.strip().lower(): i for i, t in enumerate(header) if t.strip().lower() in ("test", "cycle", "cycle [-]")}
    if mode is not None and "test" in words:
        raise MaterialError(f"Tension test {path}: it has a column test, so it cannot be given as {mode} as a whole.")
    kept: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for line, row in rows[1:]:
        place = f"Tension test {path}, line {line}"
        values = {name: _number(place, name, _cell(row, index)) * unit for name, (index, unit) in columns.items()}
        which = _mode(place, _cell(row, words["test"])) if "test" in words else mode or "uniaxial"
        cycle = next((_cycle(place, _cell(row, words[w])) for w in words if w != "test"), 0)
        strain = values["engineering_strain"] if "engineering_strain" in values else values["stretch"] - 1.0
        kept.setdefault((MODES.index(which), cycle), []).append((strain, values["nominal_stress"]))
    if not kept:
        raise MaterialError(f"Tension test {path}: there is no row of numbers below the header.")
    numbered = any(w != "test" for w in words)
    try:
        return [
            Curve(TensionTest(*np.array(kept[key]).T, MODES[key[0]]), key[1] if numbered else None)
            for key in sorted(kept)
        ]
    except MaterialError as error:
        raise MaterialError(f"Tension test {path}: {error}") from None


def read_numbers(path: str | Path, others: dict[str, dict[str, float]]) -> dict[str, np.ndarray]:
    """Strain, stress and further columns of a table that holds one test, in SI units.

    Parameters
    ----------
    path : str or Path
    others : dict
        Names of columns that may stand beside them, and factors of their units.

    Raises
    ------
    MaterialError
        See `read_curves`.
    """
    path = Path(path)
    rows = _rows(path)
    columns = _columns(path, *rows[0], _COLUMNS | others)
    found: dict[str, list[float]] = {name: [] for name in columns}
    for line, row in rows[1:]:
        for name, (index, unit) in columns.items():
            found[name].append(_number(f"Tension test {path}, line {line}", name, _cell(row, index)) * unit)
    if not found["nominal_stress"]:
        raise MaterialError(f"Tension test {path}: there is no row of numbers below the header.")
    values = {name: np.array(numbers) for name, numbers in found.items()}
    if "stretch" in values:
        values["engineering_strain"] = values.pop("stretch") - 1.0
    return values


def _cell(row: list[str], index: int) -> str:
    return row[index].strip() if index < len(row) else ""


def _number(place: str, name: str, cell: str) -> float:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise MaterialError(f"{place}: column {name} must hold a finite number, but {cell!r} was found.")
    return number


def _mode(place: str, cell: str) -> str:
    word = " ".join(cell.lower().replace("-", " ").replace("_", " ").split())
    found = next((mode for mode, words in _WORDS.items() if word in words), None)
    if found is None:
        raise MaterialError(f"{place}: column test must hold one of {', '.join(MODES)}, but {cell!r} was found.")
    return found


def _cycle(place: str, cell: str) -> int:
    try:
        number = float(cell)
    except ValueError:
        number = math.nan
    if not (number >= 1 and number == int(number)):
        raise MaterialError(f"{place}: column cycle must hold a whole number from 1, but {cell!r} was found.")
    return int(number)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and cells of every line that is neither empty nor a comment."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise MaterialError(f"Tension test {path} is not a text file in UTF-8.") from None
    except (OSError, ValueError) as error:
        raise MaterialError(
            f"Tension test {path} cannot be read: {getattr(error, 'strerror', None) or error}."
        ) from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise MaterialError(f"Tension test {path} is empty.")
    delimiter = max(",;\t", key=lines[0][1].count)
    return [(number, next(csv.reader([line], delimiter=delimiter))) for number, line in lines]


def _columns(
    path: Path, line: int, header: list[str], known: dict[str, dict[str, float]] = _COLUMNS
) -> dict[str, tuple[int, float]]:
    """Index and unit factor of each known column."""
    found: dict[str, tuple[int, float]] = {}
    for index, title in enumerate(header):
        match = _HEADER.fullmatch(title)
        name = re.sub(r"\s+", "_", (match[1] if match else title).strip().lower())
        if name not in known:
            continue
        units = known[name]
        if not match or match[2] not in units:
            given = f"unit {match[2]!r} is not known" if match else "no unit is given"
            raise MaterialError(
                f"Tension test {path}, line {line}: for column {name} {given}; write {name} [UNIT] with one "
                f"of {', '.join(units)}."
            )
        if name in found:
            raise MaterialError(f"Tension test {path}, line {line}: column {name} appears twice.")
        found[name] = (index, units[match[2]])
    if "nominal_stress" not in found or not {"engineering_strain", "stretch"} & set(found):
        raise MaterialError(
            f"Tension test {path}, line {line}: the header must name engineering_strain [%] (or stretch [-]) and "
            f"nominal_stress [MPa], but it reads {', '.join(t.strip() for t in header)!r}."
        )
    if {"engineering_strain", "stretch"} <= set(found):
        raise MaterialError(f"Tension test {path}, line {line}: give either engineering_strain or stretch, not both.")
    return found
