"""Laws and viscoelasticity of the materials that a case names, from its cards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from dbvfiv.case.damping import celsius
from dbvfiv.errors import CaseError
from dbvfiv.fit.curves import loading_tests, read_tests
from dbvfiv.fit.prony import (
    PronyFit,
    checked_moduli,
    checked_relaxation,
    checked_tan_delta,
    fit_constant,
    fit_moduli,
    fit_relaxation,
    fit_tan_delta,
    read_loss_table,
    read_relaxation_table,
    relaxation_times,
)
from dbvfiv.fit.rubber import fit_rubber, form_of
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
from dbvfiv.materials.prony import Prony
from dbvfiv.materials.shipped import published_rubber, rubber, shipped_loss, shipped_loss_names
from dbvfiv.texts import shortly

if TYPE_CHECKING:
    from dbvfiv.case import Case
    from dbvfiv.case.damping import Relaxing

#: Errors of a fit, rms, beyond which it says nothing of the material, and largest one that passes without a note.
_WORST, _FAIR = 0.5, 0.1
#: Points a decade at which a measured table is met.
_PER_DECADE = 25
_CONSTITUENTS = ("fibre_fraction", "fibre_modulus", "matrix_modulus", "fibre_poisson", "matrix_poisson", "xi")


def _fitted(card: Any) -> Law:
    tests = loading_tests(read_tests(card.path, card.planar, card.biaxial), card.cycle)
    form = form_of(card.law, card.terms)
    return fit_rubber(tests, form, card.constraint, card.stable_to, card.error).law(card.density)


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
    "fit": _fitted,
    "shipped": lambda c: _SHIPPED[c.constants](c.rubber, c.strain_level, density=c.density),
}
CARD_KINDS = tuple(_LAWS)


def law_from_card(card: Any) -> Law:
    """The law that a material card describes.

    Parameters
    ----------
    card : dbvfiv.case.Card
        Any object with ``kind``, the constants of that kind and ``stiffness_factor``.

    Raises
    ------
    MaterialError
        For an unknown kind or constants the law refuses.
    """
    if card.kind not in _LAWS:
        raise MaterialError(f"A material's kind must be one of {', '.join(CARD_KINDS)}, but {card.kind!r} was given.")
    return _LAWS[card.kind](card).scaled(card.stiffness_factor)


def law_from_case(case: Case, name: str) -> Law:
    """The law of a material by its name in a case.

    Tables of the case go before the built-in CR, SBR, EPDM (at ``materials.strain_level``, by
    ``materials.constants``) and fibre (by ``materials.fibre_constants``).

    Raises
    ------
    CaseError
        For a name the case does not know or constants that the law refuses; ``key`` is the table.
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


def relaxation_from_case(case: Case, name: str) -> Prony | None:
    """Prony series of a material of a case.

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
        if found.fit and found.fit.rms_error > _WORST:
            raise MaterialError(
                f"a series of {branches} branches misses it by {found.fit.rms_error:.0%} rms; more "
                "damping.branches or a narrower damping.band are needed."
            )
        return found
    except MaterialError as error:
        key = f"materials.{name}.{way}"
        raise CaseError(f"{key} cannot be used: {error}", key=key) from None


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


def _of_loss_table(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
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
    return MaterialDamping(name, source, fit.prony, fit, (frequency, tan_delta))


def _of_relaxation(name: str, card: Relaxing, band, branches: int) -> MaterialDamping:
    table = read_relaxation_table(card.relaxation_data, card.loss_temperature)
    try:
        time, modulus = checked_relaxation(*table)
        _check_covers(band, 1.0 / (2 * np.pi * time[-1]), 1.0 / (2 * np.pi * time[0]))
        fit = fit_relaxation(time, modulus, relaxation_times(band, branches))
    except MaterialError as error:
        raise _blamed(card.relaxation_data, error) from None
    source = f"relaxing modulus measured, {_file(card.relaxation_data.name, card)}"
    return MaterialDamping(name, source, fit.prony, fit)


_READERS = {
    "loss_factor": _of_constant,
    "loss_data": _of_loss_table,
    "relaxation_data": _of_relaxation,
    "prony": _of_series,
}


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
    even = np.geomspace(*band, max(int(_PER_DECADE * np.log10(band[1] / band[0])), 8) + 1)
    even[0], even[-1] = band
    own = measured[(measured > band[0]) & (measured < band[1])]
    far = np.abs(np.log(even[:, None] / own)).min(axis=1) > 1e-9 if own.size else np.ones(even.size, bool)
    return np.sort(np.concatenate([even[far], own]))


def _between(at: np.ndarray, frequency: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Straight lines between measured points on logarithmic axes."""
    inside = np.clip(at, frequency[0], frequency[-1])
    return np.exp(np.interp(np.log(inside), np.log(frequency), np.log(values)))
