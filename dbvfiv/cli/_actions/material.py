"""Options of commands that make materials: names, densities, fractions."""

from __future__ import annotations

import re

from ...case.quantity import Quantity
from ...errors import CaseError

_STRAIN, _DENSITY = Quantity("", "%"), Quantity("kg/m^3", "kg/m^3")


def of_material(name: str, density: str) -> tuple[str, float]:
    """Name and density, kg/m3, for a table to paste.

    Raises
    ------
    CaseError
    """
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise CaseError(f"--name {name!r} must be of letters, digits, - and _, to stand in a case file.")
    return name, _positive("--density", density, _DENSITY, "a density greater than 0: 1300 kg/m^3")


def strain_of(option: str, text: str) -> float:
    """A strain greater than 0, a fraction.

    Raises
    ------
    CaseError
    """
    return _positive(option, text, _STRAIN, "a strain greater than 0: 30 %")


def fraction_of(option: str, text: str) -> float:
    """A fraction between 0 and 1.

    Raises
    ------
    CaseError
    """
    wanted = "a fraction greater than 0 and less than 1: 45 %"
    value = _positive(option, text.strip(), _STRAIN, wanted)
    if value >= 1.0:
        raise CaseError(f"{option} is given as {text.strip()!r}; it must be {wanted}.")
    return value


def _positive(option: str, text: str, quantity: Quantity, wanted: str) -> float:
    """A quantity in SI units."""
    try:
        value = quantity.parse(text)
    except ValueError as error:
        raise CaseError(f"{option} is given as {text!r}, {error}; it must be {wanted}.") from None
    if not 0.0 < value < float("inf"):
        raise CaseError(f"{option} is given as {text!r}; it must be {wanted}.")
    return value
