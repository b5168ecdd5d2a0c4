"""Measured loss factors, moduli over frequency and relaxing moduli over time, from text files.

Columns are separated by commas, semicolons, tabs or blanks; the first line of names says what each is, with its unit in
brackets: ``frequency [Hz], tan delta``, ``frequency [Hz], storage modulus [MPa], loss modulus [MPa]`` or ``time [s],
modulus [MPa]``. A column ``temperature [degC]`` may stand beside them. Other columns are ignored.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbvfiv.case.relaxing import celsius, kelvin
from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.tension_test import STRESS_UNITS
from dbvfiv.verdict.table import Table, read_table
from dbvfiv.verdict.units import seconds_in, unit_in_name

FREQUENCY_UNITS = {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6, "rad/s": 1.0 / (2.0 * np.pi)}
RATIO_UNITS = {"": 1.0, "-": 1.0, "1": 1.0, "%": 0.01}
#: Names of columns, in small letters with single blanks; what stands in brackets is left out.
_NAMES = {
    "frequency": ("frequency", "freq", "f", "angular frequency", "omega", "ω"),
    "tan delta": ("tan delta", "tandelta", "tan d", "tan δ", "tanδ", "loss factor", "eta", "η"),
    "storage modulus": ("storage modulus", "e'", "g'", "storage"),
    "loss modulus": ("loss modulus", "e''", "g''", 'e"', 'g"', "loss"),
    "modulus": ("modulus", "relaxation modulus", "relaxing modulus", "e", "g", "e(t)", "g(t)"),
    "time": ("time", "t"),
    "temperature": ("temperature", "temp", "temp."),
}
#: Temperatures within this of each other are one, K: a chamber holds no better.
SAME_TEMPERATURE = 1.0


@dataclass(frozen=True)
class LossTable:
    """tan delta over frequency, or both moduli.

    Attributes
    ----------
    frequency : numpy.ndarray, shape (n,)
        Hz.
    tan_delta : numpy.ndarray, shape (n,), or None
        None where both moduli were measured.
    storage, loss : numpy.ndarray, shape (n,), or None
        Pa; None where tan delta was measured alone.
    """

    frequency: np.ndarray
    tan_delta: np.ndarray | None = None
    storage: np.ndarray | None = None
    loss: np.ndarray | None = None


@dataclass(frozen=True)
class RelaxationTable:
    """A relaxing modulus.

    Attributes
    ----------
    time : numpy.ndarray, shape (n,)
        s since the strain was put on.
    modulus : numpy.ndarray, shape (n,)
        Pa.
    """

    time: np.ndarray
    modulus: np.ndarray


def read_loss_table(path: str | Path, temperature: float | None = None) -> LossTable:
    """Read tan delta, or storage and loss modulus, over frequency.

    Parameters
    ----------
    path : path
    temperature : float, optional
        K; which rows are meant where the table holds several temperatures.

    Raises
    ------
    MaterialError
        If the file cannot be read, a column or its unit is missing or unknown, or several temperatures are left.
    """
    columns = _read(path, ("frequency", "tan delta", "storage modulus", "loss modulus"), temperature)
    _require(
        path, columns, "frequency", "frequency [Hz] beside tan delta, or storage modulus [MPa] and loss modulus [MPa]"
    )
    frequency = columns["frequency"]
    both = "storage modulus" in columns and "loss modulus" in columns
    if not both and "tan delta" not in columns:
        raise MaterialError(
            f"Table {path}: it needs a column tan delta, or columns storage modulus [MPa] and loss modulus [MPa]."
        )
    if not both:
        return LossTable(frequency, columns["tan delta"])
    return LossTable(frequency, storage=columns["storage modulus"], loss=columns["loss modulus"])


def read_relaxation_table(path: str | Path, temperature: float | None = None) -> RelaxationTable:
    """Read a relaxing modulus over time; see `read_loss_table`."""
    columns = _read(path, ("time", "modulus"), temperature)
    for name in ("time", "modulus"):
        _require(path, columns, name, "time [s] and modulus [MPa]")
    return RelaxationTable(columns["time"], columns["modulus"])


def _require(path: str | Path, columns: dict[str, np.ndarray], name: str, wanted: str) -> None:
    if name not in columns:
        raise MaterialError(f"Table {path}: there is no column {name}; the header must name {wanted}.")


def _read(path: str | Path, wanted: tuple[str, ...], temperature: float | None) -> dict[str, np.ndarray]:
    """Columns in SI units by what they are, of one temperature."""
    try:
        table = read_table(path)
    except OSError as error:
        raise MaterialError(f"Table {path} cannot be read ({error.strerror or error}).") from None
    except ValueError as error:
        raise MaterialError(f"Table {path} cannot be used: {error}.") from None
    found: dict[str, int] = {}
    for i, title in enumerate(table.names):
        name = _meaning(title, wanted)
        if name in found:
            raise MaterialError(f"Table {path}: column {name} appears twice.")
        if name:
            found[name] = i
    chosen = list(found.values())
    if chosen and table.bad_rows(chosen).any():
        raise MaterialError(f"Table {path} cannot be used: {table.describe_bad(chosen)}.")
    columns = {name: _in_si(path, table, name, i) for name, i in found.items()}
    return _of_one_temperature(path, columns, temperature)


def _meaning(title: str, wanted: tuple[str, ...]) -> str | None:
    """Name of the wanted column that a title stands for; None for a title that is not known."""
    bare = re.sub(r"\s*[\[(<{][^\])>}]*[\])>}]\s*$", "", title) if not title.strip().endswith("(t)") else title
    plain = " ".join(re.sub(r"[_,]", " ", bare).replace("′", "'").replace("″", "''").lower().split())
    return next((name for name in (*wanted, "temperature") if plain in _NAMES[name]), None)


def _in_si(path: str | Path, table: Table, name: str, column: int) -> np.ndarray:
    title = table.names[column]
    unit = ((table.units[column] if table.units else "") or unit_in_name(title)).strip()
    values = table.values[:, column]
    try:
        if name == "temperature":
            return kelvin(values, unit)
        return _factor(name, title, unit) * values
    except ValueError as error:
        raise MaterialError(f"Table {path}, column {title!r}: {error}.") from None


def _factor(name: str, title: str, unit: str) -> float:
    if name == "time":
        return seconds_in(unit)
    units = {"frequency": FREQUENCY_UNITS, "tan delta": RATIO_UNITS}.get(name, STRESS_UNITS)
    if unit not in units:
        known = ", ".join(u for u in units if u)
        said = f"the unit {unit!r} is not known" if unit else "no unit is given"
        raise ValueError(f"{said}; write {name} [UNIT] with one of {known}")
    turns = any(word in title.lower() for word in ("angular", "omega", "ω"))
    if name == "frequency" and turns != (unit == "rad/s"):
        raise ValueError("an angular frequency is in rad/s, and a frequency in Hz")
    return units[unit]


def _of_one_temperature(
    path: str | Path, columns: dict[str, np.ndarray], temperature: float | None
) -> dict[str, np.ndarray]:
    """Rows of the temperature that was asked for, or of the only one."""
    measured = columns.pop("temperature", None)
    if measured is None:
        if temperature is not None:
            raise MaterialError(
                f"Table {path}: {celsius(temperature)} is asked for, but there is no column temperature [degC]."
            )
        return columns
    steps = _steps(measured)
    named = ", ".join(celsius(t) for t in steps)
    if temperature is None:
        if len(steps) > 1:
            raise MaterialError(
                f"Table {path} holds several temperatures, {named}; loss_temperature must say which one is meant."
            )
        return columns
    near = np.abs(measured - temperature) <= SAME_TEMPERATURE
    if not near.any():
        raise MaterialError(f"Table {path}: {celsius(temperature)} is asked for, but it holds {named} alone.")
    return {name: values[near] for name, values in columns.items()}


def _steps(measured: np.ndarray) -> list[float]:
    """Means of the groups of temperatures that lie together."""
    ordered = np.sort(measured)
    groups = np.split(ordered, np.flatnonzero(np.diff(ordered) > SAME_TEMPERATURE) + 1)
    return [float(np.round(group.mean(), 2)) for group in groups]
