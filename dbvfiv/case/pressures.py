"""Pressures that are asked for by command line and Python."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..errors import CaseError
from .parameters import PARAMETERS
from .quantity import number_or_text

_PRESSURE = PARAMETERS["pressure"]
_ALLOWED = (
    f"it must be a pressure greater than 0 kPa and at most {_PRESSURE.high / 1e3:g} kPa, such as '36 kPa' or 36e3 (Pa)"
)


def read_pressures(given: Iterable[Any], name: str, density: float | None = None) -> tuple[float, ...]:
    """Pressures in Pa from numbers and texts with units, heads of a fluid of that density, kg/m3, included.

    Raises
    ------
    CaseError
        For anything that is not a pressure above zero and up to 10 MPa; `name` says in the sentence where it was given.
    """
    found = []
    for value in given:
        try:
            pressure = _PRESSURE.quantity.parse(number_or_text(value), density)
        except ValueError as error:
            raise CaseError(f"{name} is given as {value!r}, {error}; {_ALLOWED}.") from None
        if not 0 < pressure <= _PRESSURE.high:
            raise CaseError(f"{name} is given as {value!r}; {_ALLOWED}.")
        found.append(pressure)
    if not found:
        raise CaseError(f"{name} is an empty list; it needs at least one pressure.")
    return tuple(found)


def is_single(pressure: Any) -> bool:
    """True for one pressure, False for several."""
    return isinstance(pressure, (int, float, str)) or getattr(pressure, "ndim", None) == 0
