"""Aims and constraints of a design as sentences.

``loss coefficient at 2 m down``, ``margin from 0.1 m to 5 m at least 5 %``, ``mass at most 12 kg``. A constraint may
name several bounds, ``margin at 2 m at least 2 %:8 %:4``: a design is then sought for each, which makes a front.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from .parameters import PARAMETERS
from .quantity import Quantity, number_or_text

#: What designs are judged by, and how it is shown.
QUANTITIES = {
    "flow": Quantity("m^3/s", "L/s"),
    "opening": Quantity("m^2", "cm^2"),
    "loss coefficient": Quantity(""),
    "margin": Quantity("", "%"),
    "mass": Quantity("kg", "kg"),
    "gap left": Quantity("", "%"),
}
#: Those that need no head.
OF_THE_WALL = ("mass",)
#: Those under back pressures, which count below zero; "seals at 5 m" asks that a section be shut.
BEHIND, SEALS = ("gap left",), "seals"
#: Heads that stand for a span until the least favourable ones are known.
SPAN = 6
#: What aims and constraints look like.
AIM = f"such as 'loss coefficient at 2 m down', of {', '.join(QUANTITIES)}"
CONSTRAINT = "such as 'margin from 0.1 m to 5 m at least 5 %', 'seals at 5 m' or 'mass at most 12 kg'"
_FORM = re.compile(
    rf"\s*(?P<what>{'|'.join(QUANTITIES)})"
    r"(?:\s+at\s+(?P<at>.+?)|\s+from\s+(?P<low>.+?)\s+to\s+(?P<high>.+?))?"
    r"\s+(?P<sense>up|down|at least|at most)(?:\s+(?P<bound>.+?))?\s*"
)


@dataclass(frozen=True)
class Statement:
    """One aim or constraint."""

    text: str
    quantity: str  #: Of `QUANTITIES`.
    #: Pa; inlet pressures at which it is asked, back pressures below zero; none where it needs none.
    pressures: tuple[float, ...]
    span: bool  #: Whether all pressures between the first and the last count.
    sign: float  #: +1 where more is better, -1 where less is.
    bounds: tuple[float, ...] = ()  #: SI; none of an aim.

    def asked_also_at(self, pressure: float) -> Statement:
        """The statement with a further pressure of its span."""
        return replace(self, pressures=tuple(sorted({*self.pressures, pressure})))

    def between(self, count: int) -> list[float]:
        """Pressures that divide its span evenly in their logarithm; its own where it has none."""
        if not self.span:
            return [*self.pressures]
        low, high = self.pressures[0], self.pressures[-1]
        return [low * (high / low) ** (i / (count - 1)) for i in range(count)]


def parse_statement(text: str, aim: bool, density: float | None = None) -> Statement:
    """Read an aim or a constraint. Raises ValueError with a clause that completes "key is given as X, ...".

    Parameters
    ----------
    density : float, optional
        Of the fluid, kg/m3, for heads of it.
    """
    match = _FORM.fullmatch(re.sub(rf"^\s*{SEALS}\s(.*)", rf"{BEHIND[0]} \1 at most 0", text))
    if match is None or (match["sense"] in ("up", "down")) != (match["bound"] is None):
        raise ValueError("which cannot be read")
    if aim and match["bound"] is not None:
        raise ValueError("which is a constraint; an aim ends with 'up' or 'down'")
    if not aim and match["bound"] is None:
        raise ValueError("which is an aim; a constraint ends with 'at least' or 'at most' and a value")
    what, pressure = match["what"], PARAMETERS["pressure"].quantity
    span = match["low"] is not None
    given = [match["low"], match["high"]] if span else re.split(r"\s*,\s*|\s+and\s+", match["at"] or "")
    pressures = sorted(pressure.parse(part, density) for part in given if part)
    if (what in OF_THE_WALL) == bool(pressures):
        raise ValueError(f"which {'has a head, but is that of the wall' if pressures else 'names no head'}")
    if pressures and (pressures[0] <= 0 or (span and pressures[0] == pressures[-1])):
        raise ValueError("whose heads must be greater than 0, and rise")
    if what in BEHIND:
        pressures = sorted(-p for p in pressures)
    bounds = _bounds(match["bound"], what)
    if QUANTITIES[what].shown == "%" and max(bounds, default=0.0) >= 1.0:
        raise ValueError(f"whose bound is {100 * max(bounds):g} %; a share is given as '5 %' or 0.05")
    sign = 1.0 if match["sense"] in ("up", "at least") else -1.0
    found = Statement(" ".join(text.split()), what, tuple(pressures), span, sign, bounds)
    return replace(found, pressures=tuple(found.between(SPAN)))


def _bounds(text: str | None, what: str) -> tuple[float, ...]:
    if text is None:
        return ()
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 1:
        return (QUANTITIES[what].parse(text),)
    if len(parts) != 3 or not re.fullmatch("[0-9]{1,3}", parts[2]) or int(parts[2]) < 2:
        raise ValueError("whose bounds are not FIRST:LAST:COUNT")
    first, last = (QUANTITIES[what].parse(part) for part in parts[:2])
    if first == last:
        raise ValueError("whose first bound is the last")
    return tuple(first + (last - first) * i / (int(parts[2]) - 1) for i in range(int(parts[2])))


def parse_span(text: str, quantity: Quantity, density: float | None = None) -> tuple[float, float]:
    """Read the bounds of a variable, ``0.7:1.4`` or ``30 deg:70 deg``; heads of a fluid whose density, kg/m3, is given.
    Raises ValueError with a clause that completes "key is given as X, ...".
    """
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 2:
        raise ValueError("which is not LOW:HIGH")
    low, high = (quantity.parse(number_or_text(part), density) for part in parts)
    if not low < high:
        raise ValueError("whose bounds do not rise")
    return low, high
