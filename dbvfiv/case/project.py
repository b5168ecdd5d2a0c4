"""Sections project, report and life of the case file: the first page of a report, the heads it covers, and the crack
and the rubber by which the life of a valve is told.
"""

from __future__ import annotations

from datetime import date
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, StrictStr, ValidationInfo, field_validator, model_validator

from .axis import parse_axis
from .physics import LoadPressure
from .quantity import Length, Quantity
from .section import BrokenRule, Described, Section, key
from .units import read_units


def _as_text(given: Any) -> Any:
    """Text of a whole number or a date, as TOML reads revision = 2 and date = 2026-05-01; 1.10 has lost its 0."""
    return str(given) if isinstance(given, (int, date)) and not isinstance(given, bool) else given


Text = Annotated[StrictStr, BeforeValidator(_as_text), Described("text", "a text")]


def _known_units(text: str) -> str:
    read_units(text)
    return text


class Project(Section):
    """Purpose of a sheet or a report; free text, and the units in which results are read."""

    project: Text = key("", "Project or site, for the first page of a report.")
    customer: Text = key("", "Who it is for.")
    tag: Text = key("", "Tag or position of the valve.")
    revision: Text = key("", "Revision of the report.")
    author: Text = key("", "Who answers for it.")
    date: Text = key("", "Date that stands on it; the day it is made where not given.")
    units: Annotated[
        StrictStr, AfterValidator(_known_units), Described("text", "units such as 'm, L/s' or 'ft, gpm'")
    ] = key(
        "",
        "Units of tables, sentences and the report, 'm, L/s' or 'ft, gpm, ft/s, in': m or ft for pressures as heads "
        "of the fluid, or kPa, Pa, bar, psi; L/s, m3/h, m3/s, gpm, MGD or cfs; m/s or ft/s; mm, cm or in. JSON and "
        "result files stay SI. Where none is given, pressures are read in the unit of drive.pressure.",
    )


class Report(Section):
    """Extent of a report."""

    heads: tuple[LoadPressure, ...] = key(
        (),
        "Static inlet pressures, or heads of the fluid, at which a report says whether the valve opens and chatters: a "
        "list, or a range '0.1 m:1 m:6'; where none are given seven, up to the largest of drive.pressure and, where "
        "they are given, steady.pressures.",
    )

    @field_validator("heads", mode="before")
    @classmethod
    def _read_range(cls, given: Any, info: ValidationInfo) -> Any:
        if isinstance(given, str) and ":" in given:
            try:
                return parse_axis(f"pressure={given}", density=(info.context or {}).get("density")).values
            except ValueError as error:
                raise ValueError(f"{error}, START:STOP:COUNT") from None
        return [given] if isinstance(given, (str, float, int)) else given


_LENGTH, _TOUGHNESS, _NUMBER = Quantity("m", "mm"), Quantity("J/m^2", "J/m^2"), Quantity("")


def _spread(quantity: Quantity, least: float, most: float, word: str) -> Any:
    """Type of a key that is one value, or two between which the middle 80 % lies."""

    def check(given: tuple[float, ...]) -> tuple[float, ...]:
        if len(given) not in (1, 2):
            raise ValueError("which is neither")
        if not least <= min(given) <= max(given) <= most:
            raise ValueError("which is out of range")
        if given[0] > given[-1]:
            raise ValueError("which descends")
        return given

    ends = f"{least:g} to {most:g} {quantity.si}".rstrip()
    return Annotated[
        tuple[Annotated[float, quantity], ...],
        BeforeValidator(lambda given: given if isinstance(given, (list, tuple)) else [given]),
        AfterValidator(check),
        Described("value or pair", f"{word} from {ends}, or two in ascending order", quantity),
    ]


class Life(Section):
    """Fatigue life: growth of a flaw in the rubbers to a crack (`dbvfiv life`)."""

    crack: Length = key(2e-3, "Length of the crack at which the valve is to be replaced.", gt=0, le=1)
    precursor: _spread(_LENGTH, 1e-7, 1e-2, "a length") = key(
        (20e-6, 50e-6),
        "Length of the flaws that every rubber has. Of this and the keys below one value, or two between which the "
        "middle 80 % lies.",
    )
    rubber: Literal["auto", "NR", "SBR", "CR", "EPDM"] = key(
        "auto",
        "Rubber whose shipped constants of crack growth hold for all rubber layers; with auto each has those of its "
        "name.",
    )
    rate: _spread(_LENGTH, 1e-13, 1e-2, "a length") | None = key(
        None, "Growth a cycle at an energy release rate of 1 kJ/m2 from zero load; the shipped one where not given."
    )
    exponent: _spread(_NUMBER, 1.0, 20.0, "a number") | None = key(
        None, "Exponent of the energy release rate in the growth a cycle; the shipped one where not given."
    )
    threshold: _spread(_TOUGHNESS, 1e-3, 1e5, "an energy per area") | None = key(
        None, "Energy release rate below which no crack grows; the shipped one where not given."
    )
    crystallisation: _spread(_NUMBER, 0.0, 20.0, "a number") | None = key(
        None,
        "By how much a minimum load slows the growth in a rubber that crystallises when stretched: the exponent grows "
        "as exp(this times minimum over maximum); 0 of others; the shipped one where not given.",
    )

    @model_validator(mode="after")
    def _flaw_is_no_crack(self) -> Life:
        if self.precursor[-1] >= self.crack:
            raise BrokenRule("crack", f"{self.crack:g} m", f"it must exceed the precursor, {self.precursor[-1]:g} m")
        return self
