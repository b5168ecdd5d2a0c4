"""Laws, viscoelasticity and damping of the materials that a case names, from its cards; damping over frequency, of
Rayleigh's C = alpha M + beta K as the ratio xi = alpha / (2 omega) + beta omega / 2 (Th. Eq. 5.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from dbvfiv.case.quantity import Quantity, number_or_text
from dbvfiv.errors import CaseError
from dbvfiv.materials.laws import (
    IsotropicElastic,
    Law,
    MaterialError,
    MooneyRivlin,
    Ogden,
    OrthotropicPly,
    SofteningRubber,
    Yeoh,
    fibre_ply,
    ply_from_constituents,
)
from dbvfiv.materials.prony import WORST, Prony, PronyFit, fit_constant
from dbvfiv.materials.shipped import published_rubber, rubber, shipped_loss, shipped_loss_names
from dbvfiv.texts import listed, shortly

if TYPE_CHECKING:
    from dbvfiv.case.damping import Relaxing
    from dbvfiv.case.model import Case


#: Largest error of a fit that passes without a note.
_FAIR = 0.1
_CONSTITUENTS = ("fibre_fraction", "fibre_modulus", "matrix_modulus", "fibre_poisson", "matrix_poisson", "xi")


def _of_tests(module: str, name: str, *given: Any) -> Any:
    """Value of a function of a module of this folder that fits tests; loaded where a card names some."""
    return getattr(import_module(f"dbvfiv.fit.{module}"), name)(*given)


_SHIPPED = {"stable": rubber, "published": published_rubber}
_LAWS: dict[str, Callable[[Any], Law]] = {
    "mooney-rivlin": lambda c: MooneyRivlin(c.c10, c.c01, c.c11, c.density),
    "yeoh": lambda c: Yeoh(c.c10, c.c20, c.c30, c.density),
    "softening": lambda c: SofteningRubber(c.mu_inf, c.mu_0, c.x_0, c.c, c.density, c.c_3),
    "ogden": lambda c: Ogden(c.mu, c.alpha, c.density),
    "neo-hookean": lambda c: MooneyRivlin.neo_hookean(c.shear_modulus, c.density),
    "isotropic": lambda c: IsotropicElastic(c.youngs_modulus, c.poisson_ratio, c.density),
    "orthotropic": lambda c: OrthotropicPly(c.e1, c.e2, c.nu12, c.g12, c.g13, c.g23, c.density),
    "halpin-tsai": lambda c: ply_from_constituents(**{n: getattr(c, n) for n in _CONSTITUENTS}, density=c.density),
    "fit": lambda c: _of_tests("rubber", "law_of_tests", c),
    "shipped": lambda c: _SHIPPED[c.constants](c.rubber, c.strain_level, density=c.density),
}
CARD_KINDS = tuple(_LAWS)


def law_from_card(card: Any) -> Law:
    """The law that a material card describes. Raises MaterialError for an unknown kind or constants the law refuses.

    Parameters
    ----------
    card : dbvfiv.case.Card
        Any object with ``kind``, the constants of that kind and ``stiffness_factor``.
    """
    if card.kind not in _LAWS:
        raise MaterialError(f"A material's kind must be one of {', '.join(CARD_KINDS)}, but {card.kind!r} was given.")
    return _LAWS[card.kind](card).scaled(card.stiffness_factor)


def law_from_case(case: Case, name: str) -> Law:
    """The law of a material by its name in a case. Raises CaseError for a name the case does not know or constants that
    the law refuses; ``key`` is the table.

    Tables of the case go before the built-in CR, SBR, EPDM (at ``materials.strain_level``, by
    ``materials.constants``) and fibre (by ``materials.fibre_constants``).
    """
    _require_name(case, name)
    materials = case.materials
    if name == "fibre" and materials.is_built_in(name):
        return fibre_ply(materials.fibre_constants).scaled(materials.card(name).stiffness_factor)
    try:
        return law_from_card(materials.card(name))
    except CaseError as error:
        raise CaseError(f"materials.{name} cannot be used: {error}", key=f"materials.{name}") from None


def _require_name(case: Case, name: str) -> None:
    names = case.materials.names
    if name not in names:
        raise CaseError(f"{name!r} is no material of this case; it must be one of {', '.join(names)}.", key="materials")


@shortly
@dataclass(frozen=True)
class MaterialDamping:
    """Viscoelasticity of one material of a case."""

    name: str
    source: str  #: Origin of the data, in words.
    prony: Prony  #: Series without the case's factor on all loss factors.
    #: Error of the series against the given data; None for a series that was given outright.
    fit: PronyFit | None = None
    #: tuple of, or None; frequencies, Hz, and tan delta that were given or measured; None for a relaxation modulus or a
    #: series.
    data: tuple[np.ndarray, np.ndarray] | None = None
    #: Largest relative error over the band of the series with the factor, against the factor times tan delta of
    #: `prony`.
    missed: float = 0.0

    @property
    def note(self) -> str | None:
        """A sentence where the fit is poor, or the factor is not met."""
        if self.fit is not None and self.fit.largest_error > _FAIR:
            return (
                f"{self.name}: the series misses the {self.fit.quantity} by up to {self.fit.largest_error:.0%}; more "
                "damping.branches or a narrower damping.band help unless the data scatter."
            )
        if self.missed > _FAIR:
            return (
                f"{self.name}: with damping.loss_factor the series misses tan delta by up to {self.missed:.0%} of it; "
                "more damping.branches or a lower factor help."
            )
        return None


def relaxation_from_case(case: Case, name: str) -> Prony | None:
    """Prony series of a material of a case. Raises CaseError for a name that the case does not know, a material without
    any viscoelastic data, or data that cannot be used.

    Returns
    -------
    Prony or None
        Without the factor damping.loss_factor; strengths of zero for an elastic material; None under Rayleigh damping.
    """
    return damping_of(case, name).prony if case.damping.relaxes else None


def damping_of(case: Case, name: str) -> MaterialDamping:
    """Viscoelasticity of a material of a case, under either damping model; see `relaxation_from_case`."""
    _require_name(case, name)
    card = case.materials.loss(name)
    if card is None:
        raise CaseError(
            f"materials.{name} says nothing of how it relaxes; give loss_factor (a number, or one of "
            f"{', '.join(shipped_loss_names())}), loss_data, relaxation_data or prony.",
            key=f"materials.{name}",
        )
    way, branches = card.ways[0], case.damping.branches
    try:
        found = _READERS[way](name, card, case.damping.band, branches)
        if found.fit and found.fit.rms_error > WORST:
            raise MaterialError(
                f"a series of {branches} branches misses it by {found.fit.rms_error:.0%} rms; more "
                "damping.branches or a narrower damping.band are needed."
            )
    except MaterialError as error:
        key = f"materials.{name}.{way}"
        raise CaseError(f"{key} cannot be used: {error}", key=key) from None
    return replace(found, missed=_missed(case, found)) if case.damping.relaxes else found


def _missed(case: Case, found: MaterialDamping) -> float:
    """Error that `MaterialDamping.missed` holds."""
    factor, at = case.damping.loss_factor, np.geomspace(*case.damping.band, 100)
    try:
        series = found.prony.scaled(factor)
    except MaterialError as error:
        raise CaseError(f"materials.{found.name} cannot be used: {error}", key="damping.loss_factor") from None
    wanted = factor * found.prony.loss_factor(at)
    return float(np.abs(series.loss_factor(at) / wanted - 1.0).max()) if np.all(wanted > 0.0) else 0.0


def _of_constant(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    value, source = card.loss_factor, "given"
    if isinstance(value, str):
        shipped = shipped_loss(value)
        value, source = shipped.value, f"shipped for {value} ({shipped.range[0]:g} to {shipped.range[1]:g})"
    fit = _constant(float(value), band, branches)
    data = np.array(band), np.full(2, float(value))
    return MaterialDamping(name, f"tan delta {value:g}, {source}", fit.prony, fit, data)


_constant = cache(fit_constant)


def _of_series(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    strengths, times = zip(*card.prony)
    return MaterialDamping(name, f"Prony series of {len(times)}, given", Prony(strengths, times))


def _of_table(read: str, name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    fit, source, data = _of_tests("prony", read, card, band, branches)
    return MaterialDamping(name, source, fit.prony, fit, data)


_READERS = {
    "loss_factor": _of_constant,
    "loss_data": partial(_of_table, "series_of_loss_table"),
    "relaxation_data": partial(_of_table, "series_of_relaxation"),
    "prony": _of_series,
}


def rayleigh_ratio(frequency, alpha: float, beta: float):
    """Damping ratio of a mode of a frequency, Hz, under Rayleigh damping by alpha, 1/s, and beta, s.

    Examples
    --------
    >>> round(float(rayleigh_ratio(41.0, 0.0, 0.003)), 3)
    0.386
    """
    omega = 2 * np.pi * np.asarray(frequency, float)
    return 0.5 * (alpha / omega + beta * omega)


def rayleigh_constants(ratios: tuple[float, float], frequencies: tuple[float, float]) -> tuple[float, float]:
    """alpha and beta that give two damping ratios at two frequencies (Th. Eq. 5.5). Raises MaterialError for
    frequencies that are not two positive ones.

    Between the frequencies the damping is lower, beyond them higher. One constant is negative where the ratios
    differ by more than the frequencies do, and then no Rayleigh damping meets both.

    Ratios are half the loss factors, frequencies in Hz, positive and different; alpha comes in 1/s and beta in s.

    Examples
    --------
    Table 5-1 of the thesis, a ratio of 0.05 from 1 to 10 Hz; it prints 0.57 and 0.002:

    >>> alpha, beta = rayleigh_constants((0.05, 0.05), (1.0, 10.0))
    >>> round(alpha, 3), round(beta, 5)
    (0.571, 0.00145)
    """
    low, high = (float(f) for f in frequencies)
    if not (0 < low < np.inf and 0 < high < np.inf and low != high):
        raise MaterialError(
            f"alpha and beta follow from two different frequencies above 0 Hz, but {low:g} and {high:g} Hz were given."
        )
    omega = 2 * np.pi * np.array([low, high])
    alpha, beta = np.linalg.solve(np.stack([0.5 / omega, 0.5 * omega], axis=1), np.asarray(ratios, float))
    return float(alpha), float(beta)


#: Steps of a decade at which the table has a row.
_STEPS = (1.0, 2.0, 5.0)
_SHARE = 1e-9


@shortly
@dataclass(frozen=True)
class DampingReport:
    """Damping of a case."""

    case: Case
    #: Of the layers, inside to outside, each once; under Rayleigh damping those of which the case says how they relax.
    materials: tuple[MaterialDamping, ...]

    @property
    def factor(self) -> float:
        """Factor on the loss factors; 1 under Rayleigh damping, where they are there for comparison."""
        return self.case.damping.loss_factor if self.case.damping.relaxes else 1.0

    @property
    def table_frequencies(self) -> np.ndarray:
        """Round frequencies within the band and its ends, Hz."""
        low, high = self.case.damping.band
        first, last = int(np.floor(np.log10(low))), int(np.ceil(np.log10(high)))
        steps = [step * 10.0**k for k in range(first, last + 1) for step in _STEPS]
        within = [f for f in steps if low * (1 + _SHARE) < f < high * (1 - _SHARE)]
        return np.array([low, *within, high])

    def series(self, material: MaterialDamping) -> Prony:
        """Series of a material with the factor on all loss factors."""
        return material.prony.scaled(self.factor)

    def material_ratio(self, material: MaterialDamping, frequency) -> np.ndarray:
        """Damping ratio of what consists of one material alone: half its loss factor."""
        return 0.5 * self.series(material).loss_factor(frequency)

    def stiffening(self, material: MaterialDamping, frequency) -> np.ndarray:
        """Storage modulus of a material over its slow one."""
        return self.series(material).modulus(2j * np.pi * np.asarray(frequency, float)).real

    def rayleigh(self, frequency) -> np.ndarray:
        """Damping ratio by alpha and beta of the case."""
        return rayleigh_ratio(frequency, self.case.damping.alpha, self.case.damping.beta)

    def matches(self, at: tuple[float, float]) -> list[dict[str, Any]]:
        """Rayleigh's constants, 1/s and s, that damp as each material does at two frequencies, Hz; one is negative
        where no Rayleigh damping meets both damping ratios.
        """
        found = []
        for m in self.materials:
            ratios = tuple(float(x) for x in self.material_ratio(m, np.array(at)))
            alpha, beta = rayleigh_constants(ratios, at)
            found.append({"name": m.name, "frequencies": at, "ratios": ratios, "alpha": alpha, "beta": beta})
        return found

    def summary(self, at: tuple[float, float] | None = None) -> dict[str, Any]:
        """Plain numbers for JSON."""
        damping, frequency = self.case.damping, self.table_frequencies
        found = {
            "model": damping.model,
            "alpha": damping.alpha,
            "beta": damping.beta,
            "loss_factor": damping.loss_factor,
            "band": damping.band,
            "frequencies": frequency,
            "rayleigh_ratio": self.rayleigh(frequency),
            "materials": [self._entry(material, frequency) for material in self.materials],
        }
        if at is not None:
            found["matches"] = self.matches(at)
            found["warning"] = outside_band(self.case, at)
        return found

    def _entry(self, material: MaterialDamping, frequency: np.ndarray) -> dict[str, Any]:
        series, fit = self.series(material), material.fit
        return {
            "name": material.name,
            "source": material.source,
            "fitted": fit.quantity if fit else None,
            "largest_error": fit.largest_error if fit else None,
            "rms_error": fit.rms_error if fit else None,
            "note": material.note,
            "strengths": series.strengths,
            "times": series.times,
            "damping_ratio": self.material_ratio(material, frequency),
            "storage_over_slow": self.stiffening(material, frequency),
        }

    def lines(self, at: tuple[float, float] | None = None) -> list[str]:
        """Lines of the report as text; `at` adds the Rayleigh constants that match at two frequencies, Hz."""
        damping = self.case.damping
        low, high = damping.band
        if damping.relaxes:
            lines = [
                f"Loss factors, layer by layer, times {damping.loss_factor:g}, and alpha = {damping.alpha:g} 1/s; "
                f"{damping.branches} branches over {low:g} to {high:g} Hz."
            ]
        else:
            lines = [f"Rayleigh damping, alpha = {damping.alpha:g} 1/s, beta = {damping.beta:g} s."]
            if self.materials:
                lines.append("For comparison, what the materials lose by their loss factors:")
        lines += ["", *_table(("material", "fit: largest", "rms", "source"), [_fit_row(m) for m in self.materials])]
        lines += [f"Note: {m.note}" for m in self.materials if m.note]
        return [*lines, "", *self._ratio_lines(), *(self._match_lines(at) if at is not None else [])]

    def _ratio_lines(self) -> list[str]:
        frequency, damping = self.table_frequencies, self.case.damping
        own = {}
        if damping.alpha or not damping.relaxes:
            own["alpha" if damping.relaxes else "alpha, beta"] = self.rayleigh(frequency)
        own |= {m.name: self.material_ratio(m, frequency) for m in self.materials}
        lines = ["Damping ratio over frequency (half the loss factor of a material):", *_columns(frequency, own)]
        if self.materials:
            stiff = {m.name: self.stiffening(m, frequency) for m in self.materials}
            lines += ["", "Storage modulus over the slow one:", *_columns(frequency, stiff)]
        return lines

    def _match_lines(self, at: tuple[float, float]) -> list[str]:
        found = self.matches(at)
        rows = [(m["name"], *(f"{x:.4g}" for x in (*m["ratios"], m["alpha"], m["beta"]))) for m in found]
        titles = ("material", f"ratio at {at[0]:g} Hz", f"ratio at {at[1]:g} Hz", "alpha, 1/s", "beta, s")
        lines = ["", "Rayleigh damping of the same ratio at both frequencies (Eq. 5.5):", *_table(titles, rows)]
        if any(min(m["alpha"], m["beta"]) < 0 for m in found):
            lines.append("A negative constant: no Rayleigh damping meets both ratios.")
        outside = outside_band(self.case, at)
        return [*lines, *([f"Note: {outside}"] if outside else [])]


def describe_damping(case: Case) -> DampingReport:
    """Report on the damping of a case. Raises CaseError for data of a material that cannot be used."""
    names = dict.fromkeys(layer.material for layer in case.layers)
    told = [name for name in names if case.damping.relaxes or case.materials.loss(name) is not None]
    return DampingReport(case, tuple(damping_of(case, name) for name in told))


def outside_band(case: Case, frequencies: Iterable[float]) -> str | None:
    """Warning where frequencies, Hz, leave the band in which the loss factors of a case hold.

    Zero (no oscillation) and non-finite values are left out. None where all lie within, under Rayleigh damping, and
    where every material is a series given outright.
    """
    names = {layer.material for layer in case.layers}
    cards = [case.materials.loss(name) for name in names]
    if not case.damping.relaxes or all(card is not None and card.prony is not None for card in cards):
        return None
    low, high = case.damping.band
    asked = np.array([abs(float(f)) for f in frequencies])
    asked = asked[np.isfinite(asked) & (asked > 0)]
    beyond = np.sort(asked[(asked < low * (1 - _SHARE)) | (asked > high * (1 + _SHARE))])
    if not beyond.size:
        return None
    if beyond.size <= 3:
        which = f"{listed(f'{f:.4g}' for f in beyond)} Hz"
    else:
        which = f"{beyond.size} of {asked.size} frequencies, between {beyond[0]:.4g} and {beyond[-1]:.4g} Hz,"
    verb = "lies" if beyond.size == 1 else "lie"
    return (
        f"{which} {verb} outside damping.band, {low:g} to {high:g} Hz, over which the loss factors hold; the materials "
        "damp less there than given, or the band must be widened."
    )


def read_frequencies(given: str | Sequence[float]) -> tuple[float, float]:
    """Two frequencies, Hz, of a text such as "5,40" or "5 Hz, 40 Hz", or of two numbers. Raises CaseError."""
    quantity = Quantity("Hz")
    parts = given.split(",") if isinstance(given, str) else list(given)
    try:
        values = [quantity.parse(number_or_text(part)) for part in parts]
    except ValueError as error:
        raise CaseError(f"--at is given as {given!r}, {error}; it must be two frequencies such as 5,40.") from None
    if len(values) != 2 or min(values) <= 0 or values[0] == values[1]:
        raise CaseError(f"--at is given as {given!r}; it must be two different frequencies above 0 Hz, such as 5,40.")
    return min(values), max(values)


def _fit_row(material: MaterialDamping) -> tuple[str, str, str, str]:
    fit = material.fit
    errors = (f"{100 * fit.largest_error:.2g} %", f"{100 * fit.rms_error:.2g} %") if fit else ("none", "none")
    return material.name, *errors, material.source


def _columns(frequency: np.ndarray, columns: dict[str, np.ndarray]) -> list[str]:
    """Lines of a table over frequencies."""
    shown = [[f"{value:.4g}" for value in values] for values in columns.values()]
    return _table(("Hz", *columns), list(zip([f"{f:g}" for f in frequency], *shown)))


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table, its columns aligned."""
    widths = [max(len(row[i]) for row in (titles, *rows)) for i in range(len(titles))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in (titles, *rows)]
