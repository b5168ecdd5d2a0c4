"""Tests of rubbers in uniaxial, planar and biaxial tension, read from CSV files or workbooks, and the cycles in them.

The first line that is neither empty nor a comment (#) names the columns, each with its unit in
brackets: ``engineering_strain [%], nominal_stress [MPa]``. Other columns are ignored; the order does not matter. A
strain column may be replaced by ``stretch [-]``. Without a column ``cycle`` all rows are taken for loading data of one
cycle; which one is the user's choice (the thesis takes the fifth loading curve, Th. 3.2.1).

A rubber that was stretched before is softer up to the strain it has seen (Mullins 1969, Rubber Chem. Technol. 42, 339);
after a few cycles to the same strain the curve repeats. A valve works on that stabilised curve. What the cycles leave
as permanent set is taken off: strains count from the length at which the cycle carries no stress, stresses from the
area there.

The loss factor of a loop is that of the linear material with the same loop area A, strain amplitude e0 and stress
between the ends of strain: tan delta = A / (pi E' e0^2), E' = (stress at the largest strain less that at the least)
/ (2 e0).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ..case.tables import cells_of
from ..materials.laws import MaterialError

STRAIN_UNITS = {"-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01, "percent": 0.01}
STRESS_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm^2": 1e6, "N/mm2": 1e6, "psi": 6894.757293168361}
_COLUMNS = {"engineering_strain": STRAIN_UNITS, "stretch": {"-": 1.0, "1": 1.0}, "nominal_stress": STRESS_UNITS}
_WORDS = {
    "uniaxial": ("uniaxial", "tension", "uniaxial tension"),
    "planar": ("planar", "planar tension", "pure shear"),
    "biaxial": ("biaxial", "equibiaxial", "biaxial tension", "equibiaxial tension"),
}
#: Kinds of tests, in the order in which they are listed.
MODES = tuple(_WORDS)
CYCLES = ("first", "last")
_HEADER = re.compile(r"\s*([A-Za-z_ ]+?)\s*[\[(]\s*([^\])]+?)\s*[\])]\s*")
#: Share of the range of strain that a way back must cover for a loop, and rows it needs.
_CLOSED, _FEWEST = 0.9, 3
#: Work over stiffness and amplitude squared that is rounding alone.
_NOISE = 1e-9


@dataclass(frozen=True)
class TensionTest:
    """A curve of one test, and of one cycle of it where the table tells cycles apart."""

    strain: np.ndarray  #: (n,); engineering strain, a fraction; greater than -1.
    stress: np.ndarray  #: (n,); nominal (engineering) stress, Pa.
    #: "uniaxial", "planar" (pure shear: the width is held) or "biaxial" (both directions pulled alike).
    mode: str = "uniaxial"
    cycle: int | None = None  #: A cycle has its way back too, in the order of the file; loading alone without one.

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
        for name, values in (("strain", strain), ("stress", stress)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)


def read_curves(path: str | Path, mode: str | None = None) -> list[TensionTest]:
    """Read tests of a rubber. Raises MaterialError if the file cannot be read, a column or unit is missing or unknown,
    or a cell is no number; the message names file, line and column.

    Parameters
    ----------
    path : str or Path
        CSV with a header naming ``engineering_strain`` (or ``stretch``) and ``nominal_stress``
        with units; separated by commas, semicolons or tabs; or the same on the first sheet of a
        workbook (.xlsx). A column ``test`` may say which test each row belongs to
        (uniaxial, planar or biaxial), a column ``cycle`` which cycle (a whole number).
    mode : str, optional
        What the file holds if it has no column ``test``; uniaxial if not given.

    Returns
    -------
    list of TensionTest
        In SI units; tests in the order of `MODES`, cycles ascending.
    """
    header, rows = _table(Path(path), _COLUMNS)
    titles = [re.sub(r"[\[(].*", "", title).strip().lower() for title in header]
    words = {name: titles.index(name) for name in ("test", "cycle") if name in titles}
    if mode is not None and "test" in words:
        raise MaterialError(f"Tension test {path}: it has a column test, so it cannot be given as {mode} as a whole.")
    number = words.get("cycle")
    kept: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for place, row, values in rows:
        which = _mode(place, _cell(row, words["test"])) if "test" in words else mode or "uniaxial"
        cycle = 0 if number is None else _cycle(place, _cell(row, number))
        points = kept.setdefault((MODES.index(which), cycle), [])
        points.append((values["engineering_strain"], values["nominal_stress"]))
    return [_test(path, *np.array(kept[key]).T, MODES[key[0]], key[1] or None) for key in sorted(kept)]


def read_columns(path: str | Path, others: dict[str, dict[str, float]]) -> tuple[TensionTest, dict[str, np.ndarray]]:
    """The one test of a table, and further columns in SI units. Raises MaterialError: see `read_curves`.

    Parameters
    ----------
    path : str or Path
    others : dict
        Names of columns that may stand beside strain and stress, and factors of their units.
    """
    found = [values for _, _, values in _table(Path(path), _COLUMNS | others)[1]]
    columns = {name: np.array([values[name] for values in found]) for name in found[0]}
    return _test(path, columns["engineering_strain"], columns["nominal_stress"]), columns


def _test(path: str | Path, *values) -> TensionTest:
    """The test of a file, which is named where the values are refused."""
    try:
        return TensionTest(*values)
    except MaterialError as error:
        raise MaterialError(f"Tension test {path}: {error}") from None


def _table(path: Path, known: dict[str, dict[str, float]]) -> tuple[list[str], Iterator]:
    """Titles of a table, and place, cells and SI values of the known columns of each row; a stretch as a strain."""
    (line, header), *rows = _rows(path)
    columns = _columns(path, line, header, known)
    if not rows:
        raise MaterialError(f"Tension test {path}: there is no row of numbers below the header.")

    def read():
        for line, row in rows:
            place = f"Tension test {path}, line {line}"
            values = {}
            for name, (index, unit) in columns.items():
                values[name] = _in_si(place, name, _cell(row, index), unit, known[name])
            if "stretch" in values:
                values["engineering_strain"] = values.pop("stretch") - 1.0
            yield place, row, values

    return header, read()


def _cell(row: list[str], index: int) -> str:
    return row[index].strip() if index < len(row) else ""


def _float(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _number(place: str, name: str, cell: str) -> float:
    number = _float(cell)
    if not math.isfinite(number):
        raise MaterialError(f"{place}: column {name} must hold a finite number, but {cell!r} was found.")
    return number


def _in_si(place: str, name: str, cell: str, unit: float, units: dict[str, float]) -> float:
    """SI value of a cell under a title with a unit; a cell of a ratio may have a per cent sign of its own."""
    if cell.endswith("%") and units.get("-") == 1.0:
        return 0.01 * _number(place, name, cell[:-1].strip())
    return unit * _number(place, name, cell)


def _mode(place: str, cell: str) -> str:
    word = " ".join(cell.lower().replace("-", " ").replace("_", " ").split())
    found = next((mode for mode, words in _WORDS.items() if word in words), None)
    if found is None:
        raise MaterialError(f"{place}: column test must hold one of {', '.join(MODES)}, but {cell!r} was found.")
    return found


def _cycle(place: str, cell: str) -> int:
    number = _float(cell)
    if not (number >= 1 and number % 1 == 0):
        raise MaterialError(f"{place}: column cycle must hold a whole number from 1, but {cell!r} was found.")
    return int(number)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line number and cells of every line that is neither empty nor a comment."""
    sheet = path.suffix.lower() == ".xlsx"
    try:
        text = _sheet(path) if sheet else path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise MaterialError(f"Tension test {path} is not a text file in UTF-8.") from None
    except ImportError:
        raise MaterialError(
            f"Tension test {path} needs the package openpyxl (pip install 'dbvfiv[fit]'); a CSV file does not."
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MaterialError(f"Tension test {path} cannot be read: {reason}.") from None
    except (BadZipFile, KeyError):
        raise MaterialError(f"Tension test {path} is not a workbook (.xlsx).") from None
    numbered = enumerate(text.splitlines(), 1)
    lines = [(number, line) for number, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise MaterialError(f"Tension test {path} is empty.")
    return [(number, cells_of(line, lines[0][1])) for number, line in lines]


def _sheet(path: Path) -> str:
    """First sheet of a workbook as lines with tabs; cells that hold a formula count with their last value, and those
    shown as a per cent have its sign.
    """
    from openpyxl import load_workbook  # optional

    rows = load_workbook(path, data_only=True).worksheets[0].iter_rows()
    return "\n".join("\t".join(" ".join(_shown(cell).split()) for cell in row) for row in rows)


def _shown(cell: Any) -> str:
    """Text of a cell of a workbook."""
    value, plain = cell.value, re.sub(r'"[^"]*"|\\.', "", cell.number_format or "")  # a sign in quotes is a mere text
    if isinstance(value, (int, float)) and not isinstance(value, bool) and "%" in plain:
        return f"{100.0 * value:.15g}%"
    return "" if value is None else str(value)


def _columns(
    path: Path, line: int, header: list[str], known: dict[str, dict[str, float]]
) -> dict[str, tuple[int, float]]:
    """Index and unit factor of each known column."""
    place, found = f"Tension test {path}, line {line}", {}
    for index, title in enumerate(header):
        match = _HEADER.fullmatch(title)
        name = re.sub(r"\s+", "_", (match[1] if match else title).strip().lower())
        if name not in known:
            continue
        units = known[name]
        if not match or match[2] not in units:
            given = f"unit {match[2]!r} is not known" if match else "no unit is given"
            raise MaterialError(
                f"{place}: for column {name} {given}; write {name} [UNIT] with one of {', '.join(units)}."
            )
        if name in found:
            raise MaterialError(f"{place}: column {name} appears twice.")
        found[name] = (index, units[match[2]])
    strains = {"engineering_strain", "stretch"} & set(found)
    if "nominal_stress" not in found or not strains:
        raise MaterialError(
            f"{place}: the header must name engineering_strain [%] (or stretch [-]) and "
            f"nominal_stress [MPa], but it reads {', '.join(t.strip() for t in header)!r}."
        )
    if len(strains) > 1:
        raise MaterialError(f"{place}: give either engineering_strain or stretch, not both.")
    return found


@dataclass(frozen=True)
class CycleReport:
    """One cycle of a test."""

    mode: str
    cycle: int
    #: peak_strain and peak_stress: largest engineering strain, and the nominal stress there, Pa.
    peak_strain: float
    peak_stress: float
    set_strain: float  #: Strain at which its loading begins to carry stress; 0 where it does so from the first row.
    #: lost and loss_factor: work lost in the loop over the volume, J/m3, that of both directions of a biaxial test, and
    #: tan delta; NaN without a way back.
    lost: float
    loss_factor: float


def read_tests(
    path: str | Path, planar: str | Path | None = None, biaxial: str | Path | None = None
) -> list[TensionTest]:
    """Tests of one rubber from one file or several; see `read_curves`. Raises MaterialError: also if two files hold the
    same kind of test.
    """
    curves = read_curves(path)
    for name, mode in ((planar, "planar"), (biaxial, "biaxial")):
        if name is not None:
            if any(curve.mode == mode for curve in curves):
                raise MaterialError(
                    f"Tension test {path} holds a {mode} test already, so {name} cannot be a second one."
                )
            curves += read_curves(name, mode)
    return curves


def loading_tests(curves: list[TensionTest], cycle: str = "last") -> tuple[TensionTest, ...]:
    """The loading branch of the "first" or "last" cycle of each test; curves without cycles as they are. Raises
    MaterialError for another word, or a loading branch without rows.
    """
    if cycle not in CYCLES:
        raise MaterialError(f"The cycle must be one of {', '.join(CYCLES)}, but {cycle!r} was given.")
    tests = []
    for mode in MODES:
        found = sorted((c for c in curves if c.mode == mode), key=lambda c: c.cycle or 0)
        if found:
            tests.append(_loading(found[0 if cycle == "first" else -1]))
    return tuple(tests)


def describe_cycles(curves: list[TensionTest]) -> list[CycleReport]:
    """Every cycle that a table tells apart."""
    return [_described(curve) for curve in curves if curve.cycle is not None]


def hysteresis_loss(strain, stress) -> tuple[float, float]:
    """Work lost in a loop over the volume, J/m3, and its loss factor. Raises MaterialError for a loop without range,
    without stiffness, or run through the wrong way about.

    Parameters
    ----------
    strain, stress : array_like, shape (n,)
        Engineering strain and nominal stress in the order of time; the loop is closed by a straight line.
    """
    strain, stress = np.asarray(strain, float), np.asarray(stress, float)
    middle = strain - strain.mean()
    lost = float(0.5 * np.sum((stress + np.roll(stress, -1)) * (np.roll(middle, -1) - middle)))
    amplitude = 0.5 * float(np.ptp(strain))
    if amplitude <= 0.0:
        raise MaterialError("A loop needs strains that differ.")
    top, bottom = (float(stress[strain == end].mean()) for end in (strain.max(), strain.min()))
    stiffness = (top - bottom) / (2.0 * amplitude)
    if stiffness <= 0.0:
        raise MaterialError("The stress of a loop must be greater at its largest strain than at its least one.")
    if lost < -_NOISE * stiffness * amplitude**2:
        raise MaterialError("The loop gives energy away: its way back lies above its loading; are the rows in order?")
    lost = max(lost, 0.0)
    return lost, lost / (np.pi * stiffness * amplitude**2)


def _loading(curve: TensionTest) -> TensionTest:
    """Up to the largest strain, counted from the permanent set."""
    if curve.cycle is None:
        return curve
    last = int(np.argmax(curve.strain))
    strain, stress = curve.strain[: last + 1], curve.stress[: last + 1]
    residual, kept = _set_of(strain, stress)
    if np.count_nonzero(kept) < _FEWEST:
        raise MaterialError(
            f"Cycle {curve.cycle} of the {curve.mode} test has {np.count_nonzero(kept)} rows of loading under "
            f"stress; at least {_FEWEST} are needed."
        )
    return TensionTest((1 + strain[kept]) / (1 + residual) - 1, stress[kept] * (1 + residual), curve.mode)


def _set_of(strain: np.ndarray, stress: np.ndarray) -> tuple[float, np.ndarray]:
    """Strain at which a loading branch begins to carry stress, and which of its rows lie beyond."""
    slack = np.flatnonzero(stress <= 0.0)
    if not slack.size:
        return 0.0, np.ones(stress.size, bool)
    i = int(slack[-1])
    beyond = np.arange(stress.size) > i
    if i + 1 == stress.size:
        return float(strain[i]), beyond
    if stress[i] < 0.0 or i + 2 >= stress.size:
        share = -stress[i] / (stress[i + 1] - stress[i])
        return float(strain[i] + share * (strain[i + 1] - strain[i])), beyond
    # slack: the first rows that carry stress say where it begins
    slope = (stress[i + 2] - stress[i + 1]) / (strain[i + 2] - strain[i + 1] or np.inf)
    begins = strain[i + 1] - stress[i + 1] / slope if slope > 0.0 else strain[i]
    return float(np.clip(begins, strain[i], strain[i + 1])), beyond


def _described(curve: TensionTest) -> CycleReport:
    strain, stress = curve.strain, curve.stress
    top = int(np.argmax(strain))
    back = strain[top] - strain[top:].min()
    closed = strain.size - top > _FEWEST and back >= _CLOSED * np.ptp(strain) > 0.0
    try:
        lost, factor = hysteresis_loss(strain, stress) if closed else (float("nan"), float("nan"))
    except MaterialError as error:
        raise MaterialError(f"Cycle {curve.cycle} of the {curve.mode} test: {error}") from None
    residual = _set_of(strain[: top + 1], stress[: top + 1])[0]
    lost *= 2.0 if curve.mode == "biaxial" else 1.0
    return CycleReport(curve.mode, curve.cycle, float(strain[top]), float(stress[top]), residual, lost, factor)
