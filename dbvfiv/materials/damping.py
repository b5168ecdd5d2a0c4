"""Viscoelasticity of a case's materials: Prony series fitted over the band in which their loss factors hold."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbvfiv.case.relaxing import celsius
from dbvfiv.errors import CaseError
from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.loss_table import read_loss_table, read_relaxation_table
from dbvfiv.materials.prony import Prony
from dbvfiv.materials.prony_fit import (
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

if TYPE_CHECKING:
    from dbvfiv.case import Case
    from dbvfiv.case.relaxing import Relaxing

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
