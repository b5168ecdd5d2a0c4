"""Layers and the materials they are made of.

A material card is data only; what it does under strain is the business of the
``materials`` room.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictStr, model_validator

from .damping import Relaxing
from .quantity import Angle, Density, Length, Modulus, Number, Percent, Quantity, word_or_number
from .section import BrokenRule, Described, Section, key
from .tables import ExistingFile
from .wall import Extent

RUBBERS = ("CR", "SBR", "EPDM")
BUILT_IN = (*RUBBERS, "fibre")
#: Tested strain levels, the first and the last, and the word for those that agree with the strains found.
LOWEST_LEVEL, HIGHEST_LEVEL = 0.10, 0.60
AUTO = "auto"
_PERCENT = Quantity("", "%")


StrainLevel = Annotated[
    float | str,
    word_or_number((AUTO,), _PERCENT, lambda value: LOWEST_LEVEL <= value <= HIGHEST_LEVEL, is_word=lambda text: False),
    Described("plain number or choice", 'a number at least 10 % and at most 60 %, or "auto"', _PERCENT),
]


Constants = Literal["stable", "published"]


def _density(default: Any) -> Any:
    return key(default, "Mass density.", gt=0, le=30000)


class MooneyRivlin(Relaxing):
    """Incompressible W = c10 (I1 - 3) + c01 (I2 - 3) + c11 (I1 - 3)(I2 - 3)."""

    kind: Literal["mooney-rivlin"] = key(..., "Incompressible Mooney-Rivlin rubber.")
    c10: Modulus = key(..., "Factor of I1 - 3.", ge=-1e12, le=1e12)
    c01: Modulus = key(..., "Factor of I2 - 3.", ge=-1e12, le=1e12)
    c11: Modulus = key(0.0, "Factor of (I1 - 3)(I2 - 3).", ge=-1e12, le=1e12)
    density: Density = _density(...)

    @model_validator(mode="after")
    def _stiff_at_rest(self) -> MooneyRivlin:
        modulus = 2 * (self.c10 + self.c01)
        if modulus <= 0:
            raise BrokenRule(
                "c10",
                f"{self.c10:g} Pa with c01 = {self.c01:g} Pa, which makes the small-strain shear modulus "
                f"2 (c10 + c01) = {modulus:g} Pa",
                "c10 + c01 must be greater than 0",
            )
        return self


class Yeoh(Relaxing):
    """Incompressible W = c10 (I1 - 3) + c20 (I1 - 3)^2 + c30 (I1 - 3)^3."""

    kind: Literal["yeoh"] = key(..., "Incompressible Yeoh rubber.")
    c10: Modulus = key(..., "Factor of I1 - 3, half the shear modulus at small strain.", gt=0, le=1e12)
    c20: Modulus = key(0.0, "Factor of (I1 - 3)^2.", ge=-1e12, le=1e12)
    c30: Modulus = key(0.0, "Factor of (I1 - 3)^3.", ge=-1e12, le=1e12)
    density: Density = _density(...)


class Softening(Relaxing):
    """Incompressible W = 1/2 [mu_inf x + 2 mu_0 x_0 (sqrt(1 + x/x_0) - 1) + c x^2/2 + c_3 x^3/3] with x = I1 - 3."""

    kind: Literal["softening"] = key(..., "Incompressible rubber with a knee at small strain.")
    mu_inf: Modulus = key(0.0, "Shear modulus beyond the knee; from mu_0/200 on every state is stable.", ge=0, le=1e12)
    mu_0: Modulus = key(..., "What the shear modulus at small strain exceeds mu_inf by.", ge=0, le=1e12)
    x_0: Number = key(..., "I1 - 3 at the knee, about 3 times the square of its strain in tension.", gt=0, le=1e6)
    c: Modulus = key(0.0, "Stiffening at large strains.", ge=0, le=1e12)
    c_3: Modulus = key(0.0, "Stiffening at larger ones, with the square of x.", ge=0, le=1e13)
    density: Density = _density(...)

    @model_validator(mode="after")
    def _stiff_at_rest(self) -> Softening:
        if not self.mu_inf + self.mu_0 > 0:
            raise BrokenRule("mu_0", "0 Pa beside mu_inf = 0 Pa", "mu_inf + mu_0 must be greater than 0")
        return self


class Ogden(Relaxing):
    """Incompressible W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3), l the principal stretches."""

    kind: Literal["ogden"] = key(..., "Incompressible Ogden rubber with any number of terms.")
    mu: tuple[Annotated[Modulus, Field(ge=-1e12, le=1e12)], ...] = key(
        ..., "Modulus of each term; half the sum of mu alpha is the shear modulus at small strain.", min_length=1
    )
    alpha: tuple[Annotated[Number, Field(ge=-30, le=30)], ...] = key(
        ..., "Exponent of each term, as many as mu, none of them 0.", min_length=1
    )
    density: Density = _density(...)

    @model_validator(mode="after")
    def _terms_agree(self) -> Ogden:
        if len(self.alpha) != len(self.mu):
            raise BrokenRule("alpha", f"{len(self.alpha)} exponents for {len(self.mu)} moduli", "there must be as many")
        if 0.0 in self.alpha:
            raise BrokenRule("alpha", "a list with a 0 in it", "no exponent may be 0")
        modulus = 0.5 * sum(mu * alpha for mu, alpha in zip(self.mu, self.alpha))
        if modulus <= 0:
            raise BrokenRule(
                "mu",
                f"moduli that make the small-strain shear modulus, half the sum of mu alpha, {modulus:g} Pa",
                "it must be greater than 0",
            )
        return self


#: Shore A hardness for which Gent's relation holds (Qi, Joyce and Boyce, Rubber Chem. Technol. 76, 2003, 419-435).
SOFTEST, HARDEST = 20.0, 80.0
_RANGE = f"a modulus follows from {SOFTEST:g} to {HARDEST:g} Shore A alone"
_SHORE = re.compile(r"\s*(\d+(?:\.\d*)?)\s*(?:°\s*)?sh(?:ore)?[\s-]*a\s*", re.IGNORECASE)


def shear_modulus_of(shore: float) -> float:
    """Shear modulus, Pa, of an incompressible rubber of a hardness in Shore A (Gent, Rubber Chem. Technol. 31, 1958,
    896-906): a third of ``E = 0.0981 (56 + 7.66 S) / (0.137505 (254 - 2.54 S))`` MPa.
    """
    return 1e6 / 3.0 * 0.0981 * (56.0 + 7.66 * shore) / (0.137505 * (254.0 - 2.54 * shore))


def _by_hardness(given: Any) -> Any:
    match = _SHORE.fullmatch(given) if isinstance(given, str) else None
    if match is None:
        return given
    if not SOFTEST <= float(match[1]) <= HARDEST:
        raise ValueError(f"and {_RANGE}")
    return float(f"{shear_modulus_of(float(match[1])):.15g}")


class NeoHookean(Relaxing):
    """Incompressible W = G/2 (I1 - 3)."""

    kind: Literal["neo-hookean"] = key(..., "Incompressible neo-Hookean rubber.")
    shear_modulus: Annotated[Modulus, BeforeValidator(_by_hardness)] = key(
        ...,
        'Shear modulus G, or hardness = "60 Shore A" in its place, 20 to 80, by Gent (1958): a reading that is 5 '
        "points off changes G by a fifth.",
        gt=0,
        le=1e13,
    )
    density: Density = _density(...)


class Isotropic(Relaxing):
    """Isotropic, linear between Green-Lagrange strain and second Piola-Kirchhoff stress."""

    kind: Literal["isotropic"] = key(..., "Linear elastic, isotropic.")
    youngs_modulus: Modulus = key(..., "Young's modulus.", gt=0, le=1e13)
    poisson_ratio: Number = key(..., "Poisson ratio.", gt=-1, lt=0.5)
    density: Density = _density(...)


class Orthotropic(Relaxing):
    """Orthotropic ply in plane stress; 1 lies along the fibre, 3 through the thickness."""

    kind: Literal["orthotropic"] = key(..., "Linear elastic ply, orthotropic.")
    e1: Modulus = key(..., "Young's modulus along the fibre.", gt=0, le=1e13)
    e2: Modulus = key(..., "Young's modulus across the fibre.", gt=0, le=1e13)
    nu12: Number = key(..., "Poisson ratio: contraction along 2 under stress along 1.", ge=-100, le=100)
    g12: Modulus = key(..., "Shear modulus in the plane of the ply.", gt=0, le=1e13)
    g13: Modulus = key(..., "Transverse shear modulus along the fibre.", gt=0, le=1e13)
    g23: Modulus = key(..., "Transverse shear modulus across the fibre.", gt=0, le=1e13)
    density: Density = _density(...)

    @model_validator(mode="after")
    def _positive_definite(self) -> Orthotropic:
        limit = math.sqrt(self.e1 / self.e2)
        if abs(self.nu12) >= limit:
            raise BrokenRule(
                "nu12",
                f"{self.nu12:g}, which makes the ply's stiffness not positive definite",
                f"it must lie strictly between -{limit:g} and {limit:g} = sqrt(e1/e2)",
            )
        return self


class HalpinTsai(Relaxing):
    """Fibre ply from its constituents by the Halpin-Tsai equations (Th. 3.3; defaults of App. A)."""

    kind: Literal["halpin-tsai"] = key("halpin-tsai", "Fibre ply from the constants of fibre and matrix.")
    fibre_fraction: Percent = key(0.45, "Volume fraction of the fibre.", gt=0, lt=1)
    fibre_modulus: Modulus = key(3460e6, "Young's modulus of the fibre.", gt=0, le=1e13)
    matrix_modulus: Modulus = key(4.37e6, "Young's modulus of the matrix.", gt=0, le=1e13)
    fibre_poisson: Number = key(0.21, "Poisson ratio of the fibre.", gt=0, lt=0.5)
    matrix_poisson: Number = key(0.35, "Poisson ratio of the matrix.", gt=0, lt=0.5)
    xi: Number = key(120000.0, "Halpin-Tsai coefficient along the fibre (twice its slenderness).", gt=0, le=1e12)
    density: Density = _density(1270.0)


class Fit(Relaxing):
    """Rubber fitted to tests in tension, planar and biaxial tension (`dbvfiv fit` shows how well)."""

    kind: Literal["fit"] = key(..., "Rubber fitted to its tests.")
    path: ExistingFile = key(
        ..., "CSV file of the tension test, or of several tests with a column test; relative to the case file."
    )
    planar: ExistingFile | None = key(
        None, "CSV file of a test in planar tension (pure shear), fitted with the others."
    )
    biaxial: ExistingFile | None = key(None, "CSV file of a test in equibiaxial tension, fitted with the others.")
    law: Literal["softening", "mooney-rivlin", "neo-hookean", "yeoh", "ogden"] = key("softening", "Form of its energy.")
    terms: Literal[1, 2, 3] | None = key(
        None,
        "Number of constants: mooney-rivlin 2 (c10, c01) or 3 (and c11), yeoh 3 or 2; of terms: ogden 2, 1 or 3; the "
        "first of them if not given.",
    )
    constraint: Literal["none", "non-negative", "stable"] = key(
        "none", "On the constants: none, at least 0, or stable in every state up to stable_to."
    )
    stable_to: Percent | None = key(
        None,
        "Strain in tension up to which, or as far from rest in any state, the constants are to be stable; as far as "
        "the tests go if not given.",
        gt=0,
        le=100,
    )
    error: Literal["absolute", "relative"] = key(
        "absolute", "What is made small: residual stresses, or these over the measured ones."
    )
    cycle: Literal["first", "last"] = key(
        "last", "Which loading is taken where the file has a column cycle: the first, or the stabilised last."
    )
    density: Density = _density(...)

    @model_validator(mode="after")
    def _stable_alone_has_a_reach(self) -> Fit:
        if self.stable_to is not None and self.constraint != "stable":
            raise BrokenRule(
                "stable_to",
                f"{self.stable_to:.0%} beside constraint = {self.constraint!r}",
                "it goes with 'stable' alone",
            )
        return self


class ShippedRubber(Relaxing):
    """One of the three tested rubbers at a strain level."""

    kind: Literal["shipped"] = key(..., "A rubber whose constants come with the program.")
    rubber: Literal["CR", "SBR", "EPDM"] = key(..., "Which rubber.")
    constants: Constants = key("stable", "As materials.constants has it for the built-in rubbers.")
    strain_level: Percent = key(0.10, "Strain up to which its constants were fitted.", ge=0.10, le=0.60)
    density: Density = _density(1300.0)


class BuiltIn(Relaxing):
    """One of the built-in materials as it is, relaxing in a way of its own; a table without a kind is this."""

    kind: Literal["built-in"] = key("built-in", "What the material is without this table.")


Card = (
    MooneyRivlin
    | Yeoh
    | Softening
    | Ogden
    | NeoHookean
    | Isotropic
    | Orthotropic
    | HalpinTsai
    | Fit
    | ShippedRubber
    | BuiltIn
)
KINDS = {c.model_fields["kind"].annotation.__args__[0]: c for c in Card.__args__}


class Materials(Section):
    """Materials by name; every table ``[materials.NAME]`` adds or replaces one."""

    strain_level: StrainLevel = key(
        AUTO,
        "Strain level of the built-in rubbers CR, SBR and EPDM; between the tested levels "
        "10, 20, 40 and 60 % the constants are interpolated (10 %, the thesis). With auto each has the level that its "
        "layers strain to at the largest pressure that the case names: of drive.pressure, steady.pressures and "
        "report.heads, and of closure.rated_pressure or closure.pressures where one is given. It is settled once, on "
        "14 x 24 elements, to 0.1 %, and is the same in all studies.",
    )
    constants: Constants = key(
        "stable",
        "Constants of the built-in rubbers: of a law fitted to the published curves that is stable in every state, or "
        "the published ones (App. A, the thesis), which lose stability at strains below their level.",
    )
    fibre_constants: Literal["program", "table"] = key(
        "program",
        "Ply constants of the built-in fibre: as App. A's program uses them (xi = 2 shear modulus in "
        "the plane) or as Table 3-5 prints them.",
    )
    named: dict[StrictStr, Annotated[Card, Field(discriminator="kind")]] = key(
        {}, "The tables [materials.NAME]; in the file they stand directly under materials."
    )

    @model_validator(mode="before")
    @classmethod
    def _gather_named(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        known = {k: v for k, v in data.items() if k in cls.model_fields}
        named = dict(known.get("named") or {}) if isinstance(known.get("named", {}), dict) else None
        if named is None:
            return data
        for name, value in data.items():
            if name not in cls.model_fields:  # what is not a table is refused as an unknown key
                (named if isinstance(value, dict) else known)[name] = value
        for name, value in named.items():
            if isinstance(value, dict) and "hardness" in value and "shear_modulus" not in value:
                given = value["hardness"]
                modulus = f"{given} Shore A" if isinstance(given, (int, float)) else given
                if not isinstance(modulus, str) or not _SHORE.fullmatch(modulus):
                    raise BrokenRule(f"{name}.hardness", repr(given), 'it must be such as "60 Shore A"')
                if not SOFTEST <= float(_SHORE.fullmatch(modulus)[1]) <= HARDEST:
                    raise BrokenRule(f"{name}.hardness", modulus, _RANGE)
                rest = {key: one for key, one in value.items() if key != "hardness"}
                named[name] = {"kind": "neo-hookean", "shear_modulus": modulus} | rest
            elif name in BUILT_IN and isinstance(value, dict):
                named[name] = {"kind": "built-in"} | value
        return known | {"named": named}

    @model_validator(mode="after")
    def _built_in_names(self) -> Materials:
        for name, card in self.named.items():
            if isinstance(card, BuiltIn) and name not in BUILT_IN:
                raise BrokenRule(
                    f"{name}.kind",
                    "'built-in' for a name that is not",
                    f"it must be one of {', '.join(KINDS)}, and built-in for {', '.join(BUILT_IN)} alone",
                )
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Every name a layer may use."""
        return tuple(dict.fromkeys((*BUILT_IN, *self.named)))

    def at_levels(self, levels: Mapping[str, float]) -> dict[str, Any]:
        """Changes of a case that give built-in rubbers the constants of a level each, and leave how they relax."""
        changes = {}
        for name, level in levels.items():
            own = self.named[name].model_dump(mode="json") if name in self.named else {}
            shipped = {"kind": "shipped", "strain_level": level}
            changes[f"materials.{name}"] = {"rubber": name, "constants": self.constants} | own | shipped
        return changes

    def levels(self, names: Collection[str]) -> dict[str, float]:
        """Strain levels of those rubbers among some materials that have one; none while they are to be found."""
        cards = {name: self.card(name) for name in RUBBERS if name in names}
        if self.strain_level == AUTO and any(self.is_built_in(name) for name in cards):
            return {}
        return {name: card.strain_level for name, card in cards.items() if isinstance(card, ShippedRubber)}

    def is_built_in(self, name: str) -> bool:
        """True where a name stands for a built-in material that no table of the case file replaces."""
        return name in BUILT_IN and isinstance(self.named.get(name, BuiltIn()), BuiltIn)

    def loss(self, name: str) -> Relaxing | None:
        """Viscoelastic data of a material: those of its table, else the shipped loss factor; None without either."""
        card = self.named.get(name, BuiltIn())
        if card.ways:
            return card
        known = name if self.is_built_in(name) else getattr(card, "rubber", None)
        return Relaxing(loss_factor=known) if known else None

    def card(self, name: str) -> Card:
        """Return the card of a material; tables of the case file go before the built-in ones. Raises KeyError for a
        name that is neither built in nor in the case file.
        """
        if not self.is_built_in(name) and name in self.named:
            return self.named[name]
        factor = self.named[name].stiffness_factor if name in self.named else 1.0
        if name in RUBBERS:
            level = LOWEST_LEVEL if self.strain_level == AUTO else self.strain_level
            own = {"strain_level": level, "constants": self.constants, "stiffness_factor": factor}
            return ShippedRubber(kind="shipped", rubber=name, **own)
        if name == "fibre":
            return HalpinTsai(stiffness_factor=factor)
        raise KeyError(name)


class _Ply(Section):
    """Material, thickness and angle of one layer of the wall."""

    material: StrictStr = key(..., "Name of its material.", min_length=1)
    thickness: Length = key(..., "Thickness before all layers are scaled to the local wall thickness.", gt=0, le=10)
    angle: Angle = key(0.0, "Angle of material axis 1 from the valve's axis, in the tangent plane.", ge=-180, le=180)

    @property
    def folded(self) -> float:
        """Its angle from -90 to 90 degrees: half a turn on it is the same layer."""
        return math.remainder(self.angle, 180.0)


class Layer(Extent, _Ply):
    """One layer of the wall: everywhere, or a filler on a part of it, which leaves the thickness of the wall as it is
    and takes its share of it there.
    """


DEFAULT_LAYERS = (
    Layer(material="CR", thickness=0.00635),
    Layer(material="SBR", thickness=0.003175),
    Layer(material="fibre", thickness=0.0008382, angle=54.0),
    Layer(material="fibre", thickness=0.0008382, angle=-54.0),
    Layer(material="EPDM", thickness=0.003175),
)
