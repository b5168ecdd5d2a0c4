"""Sections project and report of the case file: what stands on the first page of a report, and the heads it covers."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, StrictStr, ValidationInfo, field_validator

from .axis import parse_axis
from .physics import LoadPressure
from .section import Described, Section, key
from .units import read_units

Text = Annotated[StrictStr, Described("text", "a text")]


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
        "list, or a range '0.1 m:1 m:6'; where none are given seven, up to the largest of drive.pressure and "
        "steady.pressures.",
    )

    @field_validator("heads", mode="before")
    @classmethod
    def _read_range(cls, given: Any, info: ValidationInfo) -> Any:
        if isinstance(given, str) and ":" in given:
            return parse_axis(f"pressure={given}", density=(info.context or {}).get("density")).values
        return [given] if isinstance(given, (str, float, int)) else given
