"""Laws of the materials that a case names."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dbvfiv.errors import CaseError
from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.fit import RubberFit, fit_rubber
from dbvfiv.materials.halpin_tsai import fibre_ply, ply_from_constituents
from dbvfiv.materials.isotropic import IsotropicElastic
from dbvfiv.materials.law import Law
from dbvfiv.materials.loading_cycles import loading_tests, read_tests
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.orthotropic import OrthotropicPly
from dbvfiv.materials.rubber_forms import form_of
from dbvfiv.materials.rubbers import published_rubber, rubber
from dbvfiv.materials.softening import SofteningRubber
from dbvfiv.materials.yeoh import Yeoh

if TYPE_CHECKING:
    from dbvfiv.case import Case


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
