"""Numbers with units: ``"36 kPa"``, ``"12 mm"``, ``"54 deg"``, ``"10 %"`` become SI floats.

A pressure may also be a head: ``"2 m"`` or ``"6 ft"`` of the fluid (``"2 mm"`` is a slip), ``"2 mH2O"`` of water. A
bare number is taken as SI. Strings carry a unit of the right dimension; a fraction such as ``"3/28"`` is accepted where
a plain number is asked for.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Annotated, Any

from pydantic import BeforeValidator, GetCoreSchemaHandler
from pydantic_core import core_schema

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*((?:1?\s*/\s*)?[A-Za-zµμ°%][A-Za-zµμ°%0-9/*^. ()-]{{0,40}})?\s*")
_FRACTION = re.compile(rf"\s*({_NUMBER})\s*/\s*({_NUMBER})\s*")

#: Standard gravity, m/s2, and the density of the water in mH2O, kg/m3.
GRAVITY, WATER = 9.80665, 1000.0
#: Units of a head of the fluid.
_HEADS = ("m", "ft")
_HEAD_OF_WATER = re.compile(r"(mm|cm|dm|m|in|ft)\s*H2O")

#: Flows of the water trade, which are units of a project and none of Pint's.
_TRADE = ("gpm = gallon / minute", "MGD = 1e6 * gallon / day", "cfs = foot ** 3 / second")

# SI unit -> what such a quantity is called in messages and in the reference
DIMENSION = {
    "m": "length",
    "Pa": "pressure",
    "kg/m^3": "density",
    "s": "time",
    "1/s": "rate",
    "Hz": "frequency",
    "N/m": "force per length",
    "Pa/m": "stiffness per area",
    "m/s": "velocity",
    "m^2": "area",
    "m^3/s": "volume flow",
    "kg": "mass",
    "kg/s": "mass flow",
    "deg": "angle",
    "Pa s": "viscosity",
    "J/m^2": "energy per area",
    "Pa^2/Hz": "power density of a pressure",
    "": "plain number",
}
A_DIMENSION = {si: f"{'an' if name[0] in 'aeiou' else 'a'} {name}" for si, name in DIMENSION.items()}


@cache
def _registry():
    import pint  # slow to import, and a case of bare numbers does without it

    registry = pint.UnitRegistry()
    for line in _TRADE:
        registry.define(line)
    # Pint allows dimensionless <-> angle; the two are kept apart in `_to_si`.
    return registry


@cache
def _factor(unit_text: str, si: str) -> float | None:
    """Factor from ``unit_text`` to ``si``; None when the dimension differs or the unit is unknown."""
    try:
        registry = _registry()
        text = ("1" if unit_text.startswith("/") else "") + unit_text.replace("%", "percent")
        text = re.sub(r"\b([cdm]?m|ft|in|[hkM]?Pa|m?bar|psi)([23])\b", r"\1^\2", text)
        source = registry.Quantity(1.0, registry.parse_units(text))
        target = "degree" if si == "deg" else (si or "dimensionless")
        if si == "Hz" and "radian" in str(source.to_root_units().units):
            target = "turn/s"  # of an angular velocity, which pint counts in radians
        return float(source.to(target).magnitude)
    except Exception:  # pint raises a wide family, tokeniser errors included
        return None


def _angle_like(unit_text: str) -> bool:
    return bool(re.fullmatch(r"(deg|degree|degrees|°|rad|radian|radians|mrad|gon|grad|arcmin|turn)", unit_text))


def number_or_text(value: Any) -> Any:
    """A number where the value is one, numpy's and text such as "36e3" included; anything else as it is."""
    if isinstance(value, (bool, int)):
        return value
    try:
        return float(value)
    except (TypeError, ValueError):
        return value


def unit_behind(text: str) -> str:
    """Unit of a number with a unit; empty for any other text."""
    match = _QUANTITY.fullmatch(text)
    return (match[2] or "").strip() if match else ""


def head_of(pressure: float, density: float) -> float:
    """Head, m, of a fluid, kg/m3, that a pressure, Pa, carries."""
    return pressure / (density * GRAVITY)


def _head(text: str, density: float | None) -> float | None:
    """Pressure, Pa, of a head; None for a text that is no head. Raises ValueError for a head of a fluid whose density
    is not known.
    """
    unit = unit_behind(text)
    water = _HEAD_OF_WATER.fullmatch(unit)
    if unit not in _HEADS and water is None:
        return None
    if water is None and density is None:
        raise ValueError("which is a head, and the density of the fluid is not known here; mH2O or a pressure is")
    weight = GRAVITY * (WATER if water else density)
    number = float(_QUANTITY.fullmatch(text)[1])
    return float(f"{number * _factor(water[1] if water else unit, 'm') * weight:.15g}")


def _to_si(text: str, si: str) -> float:
    fraction = _FRACTION.fullmatch(text)
    if fraction and si == "":
        if float(fraction[2]) == 0.0:
            raise ValueError("which divides by zero")
        return float(fraction[1]) / float(fraction[2])
    match = _QUANTITY.fullmatch(text)
    if not match:
        raise ValueError("which is not a number with a unit")
    value, unit = float(match[1]), (match[2] or "").strip()
    if not unit:
        if si == "":
            return value
        raise ValueError("which has no unit")
    if _angle_like(unit) != (si == "deg"):
        raise ValueError(f"which is not {A_DIMENSION[si]}")
    factor = _factor(unit, si)
    if factor is None:
        raise ValueError(f"which is not {A_DIMENSION[si]}")
    # 15 digits: "6.19 mm" is to be the same float as 0.00619
    return value if factor == 1.0 else float(f"{value * factor:.15g}")


@dataclass(frozen=True)
class Quantity:
    """Marks a float field as a physical quantity.

    Parameters
    ----------
    si : str
        The SI unit the validated value is in (``"deg"`` for angles).
    shown : str
        The unit in which case files and tables show it.
    head : bool
        Whether it is a pressure of the fluid, which may also be given as a head.
    """

    si: str
    shown: str = ""
    head: bool = False

    def parse(self, given: Any, density: float | None = None) -> float:
        """Return the SI value of a number or a string with a unit. Raises ValueError with a clause that completes "key
        is given as X, ...".

        Parameters
        ----------
        density : float, optional
            Of the fluid, kg/m3, for heads of it.
        """
        if isinstance(given, bool):
            raise ValueError("which is a truth value")
        if isinstance(given, (int, float)):
            try:
                value = float(given)
            except OverflowError:
                raise ValueError("which is too large") from None
        elif isinstance(given, str):
            value = _head(given, density) if self.head else None
            value = _to_si(given, self.si) if value is None else value
        else:
            raise ValueError("which is not a number")
        if not math.isfinite(value):
            raise ValueError("which is not finite")
        return value

    def show(self, value: float) -> Any:
        """Return the value as a case file would hold it: a number, or a string with a unit.

        The result reads back as exactly the same float.
        """
        if not self.shown:
            fraction = Fraction(value).limit_denominator(100)
            if len(repr(value)) > 10 and float(fraction) == value:
                return f"{fraction.numerator}/{fraction.denominator}"
            return value
        factor = 1.0 if self.shown == self.si else _factor(self.shown, self.si)
        text = f"{value / factor:.15g} {self.shown}"
        return text if self.parse(text) == value else value

    def amount(self, value: float, form: str = ".4g") -> str:
        """A value in its usual unit, in words."""
        unit = self.shown or self.si
        return f"{value / (1.0 if unit == self.si else _factor(unit, self.si)):{form}} {unit}".strip()

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler):
        def parse(given: Any, info: core_schema.ValidationInfo) -> float:
            return self.parse(given, (info.context or {}).get("density"))

        return core_schema.with_info_before_validator_function(parse, handler(source))


def has_no_digit(text: str) -> bool:
    """True for what can be a word only."""
    return not any(character.isdigit() for character in text)


def word_or_number(
    words: Collection[str],
    quantity: Quantity,
    fits: Callable[[float], bool],
    unknown: str = "which is no word that is known here",
    is_word: Callable[[str], bool] = has_no_digit,
) -> BeforeValidator:
    """Validator of a key that takes one of some words, or a number that fits; `unknown` is said of other words."""

    def read(given: Any) -> Any:
        if isinstance(given, str) and given.strip() in words:
            return given.strip()
        if isinstance(given, str) and is_word(given.strip()):
            raise ValueError(unknown)
        value = quantity.parse(given)
        if not fits(value):
            raise ValueError("which is out of range")
        return value

    return BeforeValidator(read)


Length = Annotated[float, Quantity("m", "mm")]
Pressure = Annotated[float, Quantity("Pa", "kPa", head=True)]
Modulus = Annotated[float, Quantity("Pa", "MPa")]
Density = Annotated[float, Quantity("kg/m^3", "kg/m^3")]
Time = Annotated[float, Quantity("s", "s")]
Rate = Annotated[float, Quantity("1/s", "1/s")]
Frequency = Annotated[float, Quantity("Hz", "Hz")]
Stiffness = Annotated[float, Quantity("N/m", "N/m")]
LineForce = Annotated[float, Quantity("N/m", "N/m")]
FaceStiffness = Annotated[float, Quantity("Pa/m", "MPa/mm")]
Angle = Annotated[float, Quantity("deg", "deg")]
Number = Annotated[float, Quantity("")]
Percent = Annotated[float, Quantity("", "%")]
