"""Units in which people read results: heads, pressures, flows, velocities and sizes; JSON and result files stay SI.

The units are those of ``project.units``, else that in which ``drive.pressure`` was given: with ``-p "1 m"`` every
pressure of tables, sentences and the report is a head of the fluid.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from ..texts import digits
from .parameters import PARAMETERS, Parameter
from .quantity import GRAVITY, Quantity

#: Units that can be chosen: quantity -> its SI unit, and the name of each unit with what Pint calls it. The first is
#: that of tables where none is chosen.
UNITS = {
    "head": ("m", {"m": "m", "ft": "ft"}),
    "pressure": ("Pa", {"kPa": "kPa", "Pa": "Pa", "bar": "bar", "psi": "psi"}),
    "flow": (
        "m^3/s",
        {"L/s": "L/s", "m3/h": "m^3/h", "m3/s": "m^3/s", "gpm": "gallon/min", "MGD": "megagallon/day", "cfs": "ft^3/s"},
    ),
    "velocity": ("m/s", {"m/s": "m/s", "ft/s": "ft/s"}),
    "size": ("m", {"mm": "mm", "cm": "cm", "in": "in"}),
}
_NUMBER = r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
#: Numbers that share one unit behind the last: "5 to 10 kPa", "7, 14 and 21 kPa".
_NUMBERS = rf"(?:{_NUMBER}(?:, | to | and | or ))*{_NUMBER}"


def read_units(text: str) -> dict[str, str]:
    """Unit of each quantity from "ft, gpm, in"; quantities that are not named are left out. Raises ValueError with a
    clause that completes "key is given as X, ...".
    """
    chosen: dict[str, str] = {}
    for unit in filter(None, (part.strip() for part in text.split(","))):
        quantity = next((name for name, (_, names) in UNITS.items() if unit in names), None)
        if quantity is None or quantity in chosen:
            known = "; ".join(f"{name} {', '.join(names)}" for name, (_, names) in UNITS.items())
            why = "a second unit of one quantity" if quantity else "no unit to choose"
            raise ValueError(f"and {unit!r} is {why}; there are {known}")
        chosen[quantity] = unit
    return chosen


def factor_of(quantity: str, unit: str) -> float:
    """SI value of one unit."""
    si, names = UNITS[quantity]
    return Quantity(si).parse(f"1 {names[unit]}")


def unit_of(pressure: Any) -> str:
    """Unit in which a pressure or head was given, "" for a bare number or a unit that tables do not know."""
    found = re.search(r"\d\s*([A-Za-z]+)\s*(:|$)", pressure) if isinstance(pressure, str) else None
    return found[1] if found and found[1] in {**UNITS["head"][1], **UNITS["pressure"][1]} else ""


def with_pressure_in(units: str, unit: str) -> str:
    """Units with another one for pressures, those of other quantities kept; a head takes the place of both."""
    gone = ("head", "pressure") if unit in UNITS["head"][1] else ("pressure",)
    kept = {name: one for name, one in read_units(units).items() if name not in gone}
    return ", ".join(filter(None, (unit, *kept.values())))


@dataclass(frozen=True)
class Units:
    """Units of a case.

    Parameters
    ----------
    text : str
        Those chosen, "m, gpm".
    density : float
        Of the fluid, kg/m3, by which a pressure is a head.
    """

    text: str
    density: float

    @cached_property
    def _chosen(self) -> dict[str, str]:
        return read_units(self.text)

    @cached_property
    def heads(self) -> bool:
        """True where pressures are given as heads."""
        return "head" in self._chosen and "pressure" not in self._chosen

    def name(self, quantity: str) -> str:
        """Unit of a quantity."""
        if quantity == "pressure" and self.heads:
            return self._chosen["head"]
        return self._chosen.get(quantity, next(iter(UNITS[quantity][1])))

    def factor(self, quantity: str) -> float:
        """SI value of the unit of a quantity: Pa for a pressure that is given as a head."""
        if quantity == "pressure" and self.heads:
            return factor_of("head", self.name(quantity)) * self.density * GRAVITY
        return factor_of(quantity, self.name(quantity))

    def text_of(self, quantity: str, value: float, digits: int = 4) -> str:
        """A value with its unit, "1 m" or "18 kPa", from SI."""
        return f"{value / self.factor(quantity):.{digits}g} {self.name(quantity)}"

    def pressure(self, value: float, digits: int = 4) -> str:
        """A pressure, Pa, with its unit."""
        return self.text_of("pressure", value, digits)

    def parameter(self, name: str) -> Parameter:
        """Row of the table of parameters, pressures in their unit."""
        row = PARAMETERS[name]
        if row.quantity.si != "Pa":
            return row
        return replace(row, shown_unit=self.name("pressure"), scale=self.factor("pressure"))

    @cached_property
    def _changed(self) -> dict[str, tuple[str, float]]:
        """Units of tables that are not those chosen: what stands in their place, and the factor on their numbers."""
        changed = {}
        for quantity, (_, names) in UNITS.items():
            usual = next(iter(names))
            if self.name(quantity) != usual:
                changed[usual] = (self.name(quantity), factor_of(quantity, usual) / self.factor(quantity))
        if "kPa" in changed and self.name("pressure") != "Pa":
            changed.setdefault("Pa", (self.name("pressure"), 1.0 / self.factor("pressure")))
        return changed

    def columns(self, columns: Iterable[Any]) -> tuple[Any, ...]:
        """Columns of a printed table in these units; a head beside a pressure that is one too is left out."""
        return tuple(self._column(c) for c in columns if not (self.heads and c.name == "head"))

    def _column(self, column: Any) -> Any:
        shown = column.shown
        words = shown.unit.split() if shown is not None else []
        unit = next((word for word in words if word in self._changed), None)
        if unit is None:
            return column
        name, ratio = self._changed[unit]

        def write(row: Any) -> str:
            return re.sub(_NUMBER, lambda found: f"{float(found[0]) * ratio:.4g}", column.text(row))

        title = " ".join(name if word == unit else word for word in words)
        return replace(column, shown=replace(shown, unit=title, width=max(shown.width, len(title)), write=write))

    def label(self, text: str) -> tuple[str, float]:
        """Label of an axis, "Back pressure, kPa", in these units, and the factor on the numbers of that axis."""
        name, comma, unit = text.rpartition(", ")
        if not comma or unit not in self._changed or (unit == "m" and "head" not in name.lower()):  # of pipes
            return text, 1.0
        shown, ratio = self._changed[unit]
        return f"{name}, {shown}", ratio

    def say(self, sentence: str) -> str:
        """A sentence with its numbers in these units, with one digit less than they had."""
        for unit, (name, ratio) in self._changed.items():
            if unit == "m":  # lengths of pipes too
                continue

            def convert(found: re.Match, name: str = name, ratio: float = ratio) -> str:
                return re.sub(_NUMBER, lambda one: _shorter(one[0], ratio), found[1]) + f" {name}"

            sentence = re.sub(rf"({_NUMBERS}) {re.escape(unit)}(?![\w/^]| s\b)", convert, sentence)
        return sentence


def _shorter(number: str, ratio: float) -> str:
    given = len(re.sub(r"e.*|\D", "", number).lstrip("0"))
    return digits(float(number) * ratio, min(max(3, given - 1), 5))
