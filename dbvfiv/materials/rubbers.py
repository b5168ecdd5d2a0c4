"""Laws of the materials that a case names, and the three tested rubbers at any strain level.

Each was tested four times, in tension up to 10, 20, 40 and 60 % (Th. 3.2); the constants of a level describe the curve
of that test. Two sets are shipped: the published ones, and those of a law that is stable in every state (`softening`),
fitted by least squares to 60 points of each published curve.

Between the levels constants are interpolated linearly in the strain level, all of them with the same weights, but for
x_0 of the stable set, whose logarithm is: between 10 and 60 % it grows thirty times. The published energy is linear in
its constants, so energy, stress and tangent at any given strain are interpolated linearly too, however strongly the
constants cancel each other. The stable law keeps its conditions between two sets that meet them.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from dbvfiv.errors import CaseError
from dbvfiv.materials.fit import RubberFit, fit_rubber, form_of
from dbvfiv.materials.isotropic import IsotropicElastic
from dbvfiv.materials.law import Law, MaterialError, require_finite
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.ogden import Ogden
from dbvfiv.materials.orthotropic import OrthotropicPly
from dbvfiv.materials.ply_fit import fibre_ply, ply_from_constituents
from dbvfiv.materials.rubber_tests import loading_tests, read_tests
from dbvfiv.materials.softening import SofteningRubber
from dbvfiv.materials.yeoh import Yeoh

if TYPE_CHECKING:
    from dbvfiv.case import Case


_TABLES = {2: "two", 3: "three"}


@cache
def _data() -> dict:
    return tomllib.loads(files("dbvfiv.materials").joinpath("rubbers.toml").read_text("utf-8"))


def rubber_names() -> tuple[str, ...]:
    """Names of the shipped rubbers."""
    return tuple(sorted(_data()["three"]))


def strain_levels() -> tuple[float, ...]:
    """Tested strain levels as fractions, ascending."""
    return tuple(_data()["strain_level"])


def rubber(name: str, strain_level: float = 0.10, *, density: float | None = None) -> SofteningRubber:
    """A shipped rubber at a strain level, by constants that are stable in every state.

    Parameters
    ----------
    name : str
        "CR", "SBR" or "EPDM".
    strain_level : float
        Engineering strain up to which the constants are meant, as a fraction, 0.10 to 0.60.
    density : float, optional
        kg/m3; the shipped 1300 if not given.

    Raises
    ------
    MaterialError
        For an unknown name or a level outside the tested ones.

    Examples
    --------
    >>> round(rubber("CR", 0.10).small_strain_shear_modulus, -3)
    1307000.0
    """
    mu_inf, mu_0, knee, c, c_3 = _at_level("stable", name, strain_level, ("mu_inf", "mu_0", "x_0", "c", "c_3"))
    return SofteningRubber(mu_inf, mu_0, knee, c, _data()["density"] if density is None else density, c_3)


def published_rubber(
    name: str, strain_level: float = 0.10, *, terms: int = 3, density: float | None = None
) -> MooneyRivlin:
    """A shipped rubber at a strain level, by the published constants; arguments as `rubber` has them.

    Parameters
    ----------
    terms : int
        3 for the constants of App. A, 2 for the two-constant fit of Table 3-3.

    Raises
    ------
    MaterialError
        For an unknown name, a level outside the tested ones or another number of terms.

    Examples
    --------
    >>> round(published_rubber("CR", 0.10).small_strain_shear_modulus)
    1422406
    """
    if terms not in _TABLES:
        raise MaterialError(f"A published rubber has 2 or 3 constants, but terms = {terms!r} was given.")
    constants = _at_level(_TABLES[terms], name, strain_level, ("c10", "c01", "c11"))
    return MooneyRivlin(*constants, _data()["density"] if density is None else density)


def _at_level(table: str, name: str, strain_level: float, constants: tuple[str, ...]) -> list[float]:
    """Constants of a rubber in a table of the shipped ones, interpolated."""
    data = _data()
    if name not in data[table]:
        raise MaterialError(f"The shipped rubbers are {', '.join(rubber_names())}, but {name!r} was given.")
    require_finite(f"Rubber {name}", strain_level=strain_level)
    levels = data["strain_level"]
    if not levels[0] <= strain_level <= levels[-1]:
        raise MaterialError(
            f"Rubber {name}: strain_level must lie between {levels[0]:.0%} and {levels[-1]:.0%}, "
            f"the tested levels, but {strain_level:.4g} ({strain_level:.4%}) was given."
        )
    found = []
    for key in constants:
        values = data[table][name][key]
        if key == "x_0":
            found.append(float(np.exp(np.interp(strain_level, levels, np.log(values)))))
        else:
            found.append(float(np.interp(strain_level, levels, values)))
    return found


def _halpin_tsai(card: Any) -> OrthotropicPly:
    return ply_from_constituents(
        fibre_fraction=card.fibre_fraction,
        fibre_modulus=card.fibre_modulus,
        matrix_modulus=card.matrix_modulus,
        fibre_poisson=card.fibre_poisson,
        matrix_poisson=card.matrix_poisson,
        xi=card.xi,
        density=card.density,
    )


def fit_of_card(card: Any) -> RubberFit:
    """The fit that a card of kind fit asks for.

    Raises
    ------
    MaterialError
        For tests or options that cannot be used.
    """
    tests = loading_tests(read_tests(card.path, card.planar, card.biaxial), card.cycle)
    return fit_rubber(tests, form_of(card.law, card.terms), card.constraint, card.stable_to, card.error)


#: Shipped rubbers by the set of constants.
SHIPPED = {"stable": rubber, "published": published_rubber}
_LAWS: dict[str, Callable[[Any], Law]] = {
    "mooney-rivlin": lambda c: MooneyRivlin(c.c10, c.c01, c.c11, c.density),
    "yeoh": lambda c: Yeoh(c.c10, c.c20, c.c30, c.density),
    "softening": lambda c: SofteningRubber(c.mu_inf, c.mu_0, c.x_0, c.c, c.density, c.c_3),
    "ogden": lambda c: Ogden(c.mu, c.alpha, c.density),
    "neo-hookean": lambda c: MooneyRivlin.neo_hookean(c.shear_modulus, c.density),
    "isotropic": lambda c: IsotropicElastic(c.youngs_modulus, c.poisson_ratio, c.density),
    "orthotropic": lambda c: OrthotropicPly(c.e1, c.e2, c.nu12, c.g12, c.g13, c.g23, c.density),
    "halpin-tsai": _halpin_tsai,
    "fit": lambda c: fit_of_card(c).law(c.density),
    "shipped": lambda c: SHIPPED[c.constants](c.rubber, c.strain_level, density=c.density),
}
CARD_KINDS = tuple(_LAWS)


def law_from_card(card: Any) -> Law:
    """The law that a material card describes.

    Parameters
    ----------
    card : dbvfiv.case.Card
        Any object with ``kind`` and the constants of that kind.

    Raises
    ------
    MaterialError
        For an unknown kind or constants the law refuses.
    """
    if card.kind not in _LAWS:
        raise MaterialError(f"A material's kind must be one of {', '.join(CARD_KINDS)}, but {card.kind!r} was given.")
    return _LAWS[card.kind](card)


def law_from_case(case: Case, name: str) -> Law:
    """The law of a material by its name in a case.

    Tables of the case go before the built-in CR, SBR, EPDM (at ``materials.strain_level``, by
    ``materials.constants``) and fibre (by ``materials.fibre_constants``).

    Raises
    ------
    CaseError
        For a name the case does not know or constants that the law refuses; ``key`` is the table.
    """
    materials = case.materials
    if name == "fibre" and materials.is_built_in(name):
        return fibre_ply(materials.fibre_constants)
    try:
        card = materials.card(name)
    except KeyError:
        raise CaseError(
            f"{name!r} is no material of this case; it must be one of {', '.join(materials.names)}.",
            key="materials",
        ) from None
    try:
        return law_from_card(card)
    except CaseError as error:
        raise CaseError(f"materials.{name} cannot be used: {error}", key=f"materials.{name}") from None
