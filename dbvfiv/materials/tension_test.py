"""Reading a uniaxial tension test from a CSV file.

The first line that is neither empty nor a comment (#) names the columns, each with its unit in
brackets: ``engineering_strain [%], nominal_stress [MPa]``. Other columns are ignored; the order does not matter. A
strain column may be replaced by ``stretch [-]``. Loading data only, from one cycle: which one is the user's choice (the
thesis takes the fifth loading curve, Th. 3.2.1).
"""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbvfiv.materials.checks import MaterialError

STRAIN_UNITS = {"-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01, "percent": 0.01}
STRESS_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6, "N/mm2": 1e6, "psi": 6894.757293168361}
_COLUMNS = {"engineering_strain": STRAIN_UNITS, "stretch": {"-": 1.0, "1": 1.0}, "nominal_stress": STRESS_UNITS}
_HEADER = re.compile(r"\s*([A-Za-z_ ]+?)\s*[\[(]\s*([^\])]+?)\s*[\])]\s*")


@dataclass(frozen=True)
class TensionTest:
    """A uniaxial loading curve.

    Attributes
    ----------
    strain : numpy.ndarray, shape (n,)
        Engineering strain, a fraction; greater than -1.
    stress : numpy.ndarray, shape (n,)
        Nominal (engineering) stress, Pa.
    """

    strain: np.ndarray
    stress: np.ndarray

    def __post_init__(self) -> None:
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
    """Read a tension test.

    Parameters
    ----------
    path : str or Path
        CSV with a header naming ``engineering_strain`` (or ``stretch``) and ``nominal_stress``
        with units; separated by commas, semicolons or tabs.

    Returns
    -------
    TensionTest
        In SI units, in the order of the file.

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
    values: dict[str, list[float]] = {name: [] for name in columns}
    for line, row in rows[1:]:
        for name, (index, unit) in columns.items():
            cell = row[index].strip() if index < len(row) else ""
            try:
                number = float(cell)
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                raise MaterialError(
                    f"Tension test {path}, line {line}: column {name} must hold a finite number, but "
                    f"{cell!r} was found."
                )
            values[name].append(number * unit)
    if not values["nominal_stress"]:
        raise MaterialError(f"Tension test {path}: there is no row of numbers below the header.")
    strain = values["engineering_strain"] if "engineering_strain" in values else np.array(values["stretch"]) - 1.0
    try:
        return TensionTest(strain, values["nominal_stress"])
    except MaterialError as error:
        raise MaterialError(f"Tension test {path}: {error}") from None


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


def _columns(path: Path, line: int, header: list[str]) -> dict[str, tuple[int, float]]:
    """Index and unit factor of each known column."""
    found: dict[str, tuple[int, float]] = {}
    for index, title in enumerate(header):
        match = _HEADER.fullmatch(title)
        name = re.sub(r"\s+", "_", (match[1] if match else title).strip().lower())
        if name not in _COLUMNS:
            continue
        units = _COLUMNS[name]
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
