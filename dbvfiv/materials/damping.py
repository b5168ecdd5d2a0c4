"""Viscoelasticity of a case: loss factors and moduli from files, and Prony series fitted to them over their band.

Columns are separated by commas, semicolons, tabs or blanks; the first line of names says what each is, with its unit in
brackets: ``frequency [Hz], tan delta``, ``frequency [Hz], storage modulus [MPa], loss modulus [MPa]`` or ``time [s],
modulus [MPa]``. A column ``temperature [degC]`` may stand beside them. Other columns are ignored.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbvfiv.case.damping import celsius, kelvin
from dbvfiv.errors import CaseError
from dbvfiv.materials.law import MaterialError
from dbvfiv.materials.prony import (
    Prony,
    PronyFit,
    checked_moduli,
    checked_relaxation,
    checked_tan_delta,
    fit_constant,
    fit_moduli,
    fit_relaxation,
    fit_tan_delta,
    relaxation_times,
)
from dbvfiv.materials.rubber_tests import STRESS_UNITS
from dbvfiv.verdict.table import Table, read_table, seconds_in, unit_in_name

if TYPE_CHECKING:
    from dbvfiv.case import Case
    from dbvfiv.case.damping import Relaxing


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


#: Errors of a fit, rms, beyond which it says nothing of the material, and largest one that passes without a note.
_WORST, _FAIR = 0.5, 0.1
#: Points a decade at which a measured table is met.
_PER_DECADE = 25


@dataclass(frozen=True)
class ShippedLoss:
    """A loss factor that comes with the program.

    Attributes
    ----------
    value : float
        tan delta: the middle of the range.
    range : tuple of float
    note, source : str
    """

    value: float
    range: tuple[float, float]
    note: str
    source: str


@dataclass(frozen=True)
class MaterialDamping:
    """Viscoelasticity of one material of a case.

    Attributes
    ----------
    name : str
    source : str
        Origin of the data, in words.
    prony : Prony
        Series without the case's factor on all loss factors.
    fit : PronyFit or None
        Error of the series against the given data; None for a series that was given outright.
    data : tuple of arrays, or None
        Frequencies, Hz, and tan delta that were given or measured; None for a relaxation modulus or a series.
    """

    name: str
    source: str
    prony: Prony
    fit: PronyFit | None = None
    data: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def note(self) -> str | None:
        """A sentence where the fit is poor."""
        if self.fit is None or self.fit.largest_error <= _FAIR:
            return None
        return (
            f"{self.name}: the series misses the {self.fit.quantity} by up to {self.fit.largest_error:.0%}; more "
            "damping.branches or a narrower damping.band help unless the data scatter."
        )


@cache
def _shipped() -> dict:
    return tomllib.loads(files("dbvfiv.materials").joinpath("loss_factors.toml").read_text("utf-8"))


def shipped_loss_names() -> tuple[str, ...]:
    """Names of the materials whose loss factors come with the program."""
    return tuple(name for name, entry in _shipped().items() if isinstance(entry, dict))


def shipped_loss(name: str) -> ShippedLoss:
    """Loss factor that comes with the program, with its spread.

    Raises
    ------
    MaterialError
        For a name that there is none for.
    """
    if name not in shipped_loss_names():
        raise MaterialError(f"Loss factors are shipped for {', '.join(shipped_loss_names())}, but {name!r} was given.")
    entry = _shipped()[name]
    return ShippedLoss(entry["value"], tuple(entry["range"]), entry["note"], _shipped()["source"])


def relaxation_from_case(case: Case, name: str) -> Prony | None:
    """Prony series of a material of a case.

    Parameters
    ----------
    case : Case
    name : str
        Name of the material.

    Returns
    -------
    Prony or None
        Without the factor damping.loss_factor; strengths of zero for an elastic material; None under Rayleigh damping.

    Raises
    ------
    CaseError
        For a name that the case does not know, a material without any viscoelastic data, or data that cannot be used.
    """
    return damping_of(case, name).prony if case.damping.relaxes else None


def damping_of(case: Case, name: str) -> MaterialDamping:
    """Viscoelasticity of a material of a case, under either damping model; see `relaxation_from_case`."""
    if name not in case.materials.names:
        raise CaseError(
            f"{name!r} is no material of this case; it must be one of {', '.join(case.materials.names)}.",
            key="materials",
        )
    card = case.materials.loss(name)
    if card is None:
        raise CaseError(
            f"materials.{name} says nothing of how it relaxes; give loss_factor (a number, or one of "
            f"{', '.join(shipped_loss_names())}), loss_data, relaxation_data or prony.",
            key=f"materials.{name}",
        )
    try:
        found = _READERS[card.ways[0]](name, card, case.damping.band, case.damping.branches)
        if found.fit and found.fit.rms_error > _WORST:
            raise MaterialError(
                f"a series of {case.damping.branches} branches misses it by {found.fit.rms_error:.0%} rms; more "
                "damping.branches or a narrower damping.band are needed."
            )
        return found
    except MaterialError as error:
        key = f"materials.{name}.{card.ways[0]}"
        raise CaseError(f"{key} cannot be used: {error}", key=key) from None


def _of_constant(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    value, source = card.loss_factor, "given"
    if isinstance(value, str):
        shipped = shipped_loss(value)
        value, source = shipped.value, f"shipped for {value} ({shipped.range[0]:g} to {shipped.range[1]:g})"
    fit = _constant(float(value), band, branches)
    ends = np.array(band)
    return MaterialDamping(name, f"tan delta {value:g}, {source}", fit.prony, fit, (ends, np.full(2, float(value))))


@cache
def _constant(value: float, band: tuple[float, float], branches: int) -> PronyFit:
    return fit_constant(value, band, branches)


def _of_series(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    strengths, times = zip(*card.prony)
    return MaterialDamping(name, f"Prony series of {len(times)}, given", Prony(strengths, times))


def _of_loss_table(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    path = card.loss_data
    table = read_loss_table(path, card.loss_temperature)
    try:
        times = relaxation_times(band, branches)
        if table.storage is None:
            frequency, tan_delta = checked_tan_delta(table.frequency, table.tan_delta)
            at = _points(band, frequency)
            fit, what = fit_tan_delta(at, _between(at, frequency, tan_delta), times), "tan delta"
        else:
            frequency, storage, loss = checked_moduli(table.frequency, table.storage, table.loss)
            at, tan_delta = _points(band, frequency), loss / storage
            moduli = (_between(at, frequency, values) for values in (storage, loss))
            fit, what = fit_moduli(at, *moduli, times), "storage and loss modulus"
    except MaterialError as error:
        raise MaterialError(f"table {path}: {_continued(error)}") from None
    source = f"{what} measured, {_file(path, card)}"
    return MaterialDamping(name, source, fit.prony, fit, (frequency, tan_delta))


def _of_relaxation(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    path = card.relaxation_data
    table = read_relaxation_table(path, card.loss_temperature)
    try:
        time, modulus = checked_relaxation(table.time, table.modulus)
        _check_covers(band, 1.0 / (2 * np.pi * time[-1]), 1.0 / (2 * np.pi * time[0]))
        fit = fit_relaxation(time, modulus, relaxation_times(band, branches))
    except MaterialError as error:
        raise MaterialError(f"table {path}: {_continued(error)}") from None
    return MaterialDamping(name, f"relaxing modulus measured, {_file(path, card)}", fit.prony, fit)


_READERS = {
    "loss_factor": _of_constant,
    "loss_data": _of_loss_table,
    "relaxation_data": _of_relaxation,
    "prony": _of_series,
}


def _continued(error: MaterialError) -> str:
    text = str(error)
    return text[0].lower() + text[1:]


def _file(path: Path, card: Relaxing) -> str:
    at = "" if card.loss_temperature is None else f" at {celsius(card.loss_temperature)}"
    return f"{path.name}{at}"


def _check_covers(band: tuple[float, float], low: float, high: float) -> None:
    """Refuse a band in which nothing was measured, at least at one end."""
    if band[0] < low * (1 - 1e-6) or band[1] > high * (1 + 1e-6):
        raise MaterialError(
            f"damping.band is {band[0]:g} to {band[1]:g} Hz and must lie within what was measured, {low:.4g} to "
            f"{high:.4g} Hz."
        )


def _points(band: tuple[float, float], measured: np.ndarray) -> np.ndarray:
    """Frequencies at which a table is met: those measured within the band, and even steps between them."""
    _check_covers(band, measured[0], measured[-1])
    decades = np.log10(band[1] / band[0])
    even = np.geomspace(*band, max(int(_PER_DECADE * decades), 8) + 1)
    even[0], even[-1] = band
    own = measured[(measured > band[0]) & (measured < band[1])]
    far = np.abs(np.log(even[:, None] / own)).min(axis=1) > 1e-9 if own.size else np.ones(even.size, bool)
    return np.sort(np.concatenate([even[far], own]))


def _between(at: np.ndarray, frequency: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Straight lines between measured points on logarithmic axes."""
    inside = np.clip(at, frequency[0], frequency[-1])
    return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(values)))
