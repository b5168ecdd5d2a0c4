"""Series of Maxwell branches fitted to measured loss factors, moduli and relaxation, and the tables that hold these.

Columns are separated by commas, semicolons, tabs or blanks; the first line of names says what each is, with its unit in
brackets: ``frequency [Hz], tan delta``, ``frequency [Hz], storage modulus [MPa], loss modulus [MPa]`` or ``time [s],
modulus [MPa]``. A column ``temperature [degC]`` may stand beside them. Other columns are ignored.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dbvfiv.case.damping import celsius, kelvin
from dbvfiv.fit.curves import STRESS_UNITS
from dbvfiv.materials.laws import MaterialError
from dbvfiv.materials.prony import (
    PER_DECADE,
    Prony,
    PronyFit,
    branch_moduli,
    check_loss,
    even_weights,
    fit_loss_curve,
    nonnegative,
    relaxation_times,
)
from dbvfiv.verdict.table import Table, read_table, seconds_in, unit_in_name

if TYPE_CHECKING:
    from dbvfiv.case.damping import Relaxing

_FREQUENCY_UNITS = {"Hz": 1.0, "mHz": 1e-3, "kHz": 1e3, "MHz": 1e6, "rad/s": 1.0 / (2.0 * np.pi)}
_RATIO_UNITS = {"": 1.0, "-": 1.0, "1": 1.0, "%": 0.01}
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


def fit_tan_delta(frequency, tan_delta, times) -> PronyFit:
    """Series of given times from tan delta over frequency; relative errors count, evenly over the logarithm. Raises
    MaterialError for tables that cannot be used.

    Parameters
    ----------
    frequency, tan_delta : array_like, shape (n,)
        Hz, ascending; greater than 0 and at most 2.
    times : array_like, shape (j,)
        s.
    """
    return fit_loss_curve(*checked_tan_delta(frequency, tan_delta), np.asarray(times, float))


def fit_moduli(frequency, storage, loss, times) -> PronyFit:
    """Series of given times from storage and loss modulus over frequency. Raises MaterialError for tables that cannot
    be used, or moduli that leave no slow modulus.

    The slow modulus is found with the strengths and dropped: what a law is scaled with is its own test.

    Parameters
    ----------
    frequency, storage, loss : array_like, shape (n,)
        Hz, ascending; Pa, or any common unit, positive.
    times : array_like, shape (j,)
        s.
    """
    frequency, storage, loss = checked_moduli(frequency, storage, loss)
    times = np.asarray(times, float)
    branch, even = branch_moduli(frequency, times), even_weights(frequency)
    above = np.hstack([np.ones((len(frequency), 1)), branch.real]) * (even / storage)[:, None]
    below = np.hstack([np.zeros((len(frequency), 1)), branch.imag]) * (even / loss)[:, None]
    matrix, weight = np.vstack([above, below]), np.concatenate([even, even])
    found = nonnegative(matrix, weight)
    prony = Prony(_over_slow(found, "storage modulus"), times)
    return PronyFit(prony, "moduli", matrix @ found / weight - 1.0)


def fit_relaxation(time, modulus, times) -> PronyFit:
    """Series of given times from a relaxation test: the modulus over the time since the strain was put on. Raises
    MaterialError for tables that cannot be used, or a modulus that relaxes to nothing.

    Parameters
    ----------
    time, modulus : array_like, shape (n,)
        s, ascending, positive; Pa, or any unit, positive.
    times : array_like, shape (j,)
        s.
    """
    time, modulus = checked_relaxation(time, modulus)
    times = np.asarray(times, float)
    even = even_weights(time)
    matrix = np.hstack([np.ones((len(time), 1)), np.exp(-np.multiply.outer(time, 1.0 / times))])
    found = nonnegative(matrix * (even / modulus)[:, None], even)
    prony = Prony(_over_slow(found, "relaxing modulus"), times)
    return PronyFit(prony, "relaxing modulus", matrix @ found / modulus - 1.0)


def checked_tan_delta(frequency, tan_delta) -> tuple[np.ndarray, np.ndarray]:
    """A table that `fit_tan_delta` takes, as arrays; raises `MaterialError` for any other."""
    frequency, wanted = _checked("frequency", "Hz", frequency, tan_delta)
    check_loss(wanted)
    if not (wanted > 0).all():
        raise MaterialError("tan delta must be greater than 0 in a table; an elastic material is loss_factor = 0.")
    return frequency, wanted


def checked_moduli(frequency, storage, loss) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A table that `fit_moduli` takes, as arrays; see `checked_tan_delta`."""
    frequency, storage = _checked("frequency", "Hz", frequency, storage)
    _, loss = _checked("frequency", "Hz", frequency, loss)
    _check_positive("storage modulus", frequency, "Hz", storage)
    _check_positive("loss modulus", frequency, "Hz", loss)
    check_loss(loss / storage)
    return frequency, storage, loss


def checked_relaxation(time, modulus) -> tuple[np.ndarray, np.ndarray]:
    """A table that `fit_relaxation` takes, as arrays; see `checked_tan_delta`."""
    time, modulus = _checked("time", "s", time, modulus)
    _check_positive("modulus", time, "s", modulus)
    return time, modulus


def _checked(name: str, unit: str, at, values) -> tuple[np.ndarray, np.ndarray]:
    """Two columns as arrays: finite, as long as each other, the first one positive and ascending."""
    at, values = np.asarray(at, float), np.asarray(values, float)
    if at.ndim != 1 or at.shape != values.shape:
        raise MaterialError(f"There must be one value for each {name}, but the shapes are {at.shape}, {values.shape}.")
    if not at.size:
        raise MaterialError("There is no row of numbers.")
    if not (np.isfinite(at).all() and np.isfinite(values).all()):
        raise MaterialError("There must be finite numbers only.")
    if at[0] <= 0:
        raise MaterialError(f"The {name} must be greater than 0 {unit}, but {at[0]:g} {unit} was found.")
    for before, after in zip(at, at[1:]):
        if after == before:
            raise MaterialError(f"The {name} {after:g} {unit} appears twice; each must stand once.")
        if after < before:
            raise MaterialError(
                f"The {name} must increase from row to row, but {after:g} {unit} follows {before:g} {unit}."
            )
    return at, values


def _check_positive(what: str, at: np.ndarray, unit: str, values: np.ndarray) -> None:
    bad = np.flatnonzero(values <= 0)
    if bad.size:
        i = bad[0]
        raise MaterialError(f"The {what} must be greater than 0, but at {at[i]:g} {unit} it is {values[i]:g}.")


def _over_slow(found: np.ndarray, what: str) -> np.ndarray:
    if found[0] <= 1e-6 * found.sum():
        raise MaterialError(
            f"The {what} leaves nothing that lasts: the material would flow, and a wall needs a slow modulus above 0."
        )
    return found[1:] / found[0]


def read_loss_table(path: str | Path, temperature: float | None = None) -> tuple[np.ndarray, ...]:
    """Read frequencies, Hz, with tan delta, or with storage and loss modulus, Pa, where a table holds both; each (n,).
    Raises MaterialError if the file cannot be read, a column or its unit is missing or unknown, or several temperatures
    are left.

    Parameters
    ----------
    temperature : float, optional
        K; which rows are meant where the table holds several temperatures.
    """
    columns = _read(path, ("frequency", "tan delta", "storage modulus", "loss modulus"), temperature)
    _require(
        path, columns, "frequency", "frequency [Hz] beside tan delta, or storage modulus [MPa] and loss modulus [MPa]"
    )
    if {"storage modulus", "loss modulus"} <= set(columns):
        return columns["frequency"], columns["storage modulus"], columns["loss modulus"]
    if "tan delta" not in columns:
        raise MaterialError(
            f"Table {path}: it needs a column tan delta, or columns storage modulus [MPa] and loss modulus [MPa]."
        )
    return columns["frequency"], columns["tan delta"]


def read_relaxation_table(path: str | Path, temperature: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Read times, s, since the strain was put on and a relaxing modulus, Pa; see `read_loss_table`."""
    columns = _read(path, ("time", "modulus"), temperature)
    for name in ("time", "modulus"):
        _require(path, columns, name, "time [s] and modulus [MPa]")
    return columns["time"], columns["modulus"]


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
    units = {"frequency": _FREQUENCY_UNITS, "tan delta": _RATIO_UNITS}.get(name, STRESS_UNITS)
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
    """Means of the groups of temperatures that lie together, each within the same temperature about its middle."""
    groups: list[list[float]] = []
    for one in np.sort(measured):
        if groups and one - groups[-1][-1] <= SAME_TEMPERATURE and one - groups[-1][0] <= 2.0 * SAME_TEMPERATURE:
            groups[-1].append(one)
        else:
            groups.append([one])
    return [float(np.round(np.mean(group), 2)) for group in groups]


def series_of_loss_table(card: Relaxing, band: tuple[float, float], branches: int) -> tuple:
    """Series of the table of loss factors or moduli that a card names, over a band, Hz. Raises MaterialError for a
    table that cannot be used.

    Returns
    -------
    fit : PronyFit
    source : str
        Origin of the data, in words.
    data : tuple of arrays
        Frequencies, Hz, and tan delta that were measured.
    """
    table = read_loss_table(card.loss_data, card.loss_temperature)
    check, fit_to, what = (
        (checked_tan_delta, fit_tan_delta, "tan delta")
        if len(table) == 2
        else (checked_moduli, fit_moduli, "storage and loss modulus")
    )
    try:
        frequency, *values = check(*table)
        at = _points(band, frequency)
        fit = fit_to(at, *(_between(at, frequency, value) for value in values), relaxation_times(band, branches))
    except MaterialError as error:
        raise _blamed(card.loss_data, error) from None
    tan_delta = values[0] if len(values) == 1 else values[1] / values[0]
    source = f"{what} measured, {_file(card.loss_data.name, card)}"
    return fit, source, (frequency, tan_delta)


def series_of_relaxation(card: Relaxing, band: tuple[float, float], branches: int) -> tuple:
    """Series of the relaxation test that a card names; as `series_of_loss_table`, without data over frequency."""
    table = read_relaxation_table(card.relaxation_data, card.loss_temperature)
    try:
        time, modulus = checked_relaxation(*table)
        _check_covers(band, 1.0 / (2 * np.pi * time[-1]), 1.0 / (2 * np.pi * time[0]))
        fit = fit_relaxation(time, modulus, relaxation_times(band, branches))
    except MaterialError as error:
        raise _blamed(card.relaxation_data, error) from None
    return fit, f"relaxing modulus measured, {_file(card.relaxation_data.name, card)}", None


def _blamed(path: Any, error: MaterialError) -> MaterialError:
    text = str(error)
    return MaterialError(f"table {path}: {text[0].lower()}{text[1:]}")


def _file(name: str, card: Relaxing) -> str:
    return name if card.loss_temperature is None else f"{name} at {celsius(card.loss_temperature)}"


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
    even = np.geomspace(*band, max(int(PER_DECADE * np.log10(band[1] / band[0])), 8) + 1)
    even[0], even[-1] = band
    own = measured[(measured > band[0]) & (measured < band[1])]
    far = np.abs(np.log(even[:, None] / own)).min(axis=1) > 1e-9 if own.size else np.ones(even.size, bool)
    return np.sort(np.concatenate([even[far], own]))


def _between(at: np.ndarray, frequency: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Straight lines between measured points on logarithmic axes."""
    inside = np.clip(at, frequency[0], frequency[-1])
    return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(values)))
