"""``dbvfiv closure``: the valve under back pressure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import StrictBool, StrictInt, ValidationInfo, field_validator, model_validator

from ...case.measured import AREA, MEASURED_FILES, SHAPE, find_measured
from ...case.parameters import PARAMETERS
from ...case.physics import LoadPressure
from ...case.quantity import Number, Pressure, number_or_text
from ...case.section import Section, key
from ..request import ClassesOption, Request, pressure_option

ORDER = 35

_PRESSURES = (7e3, 14e3, 21e3, 28e3)
#: Back pressure up to which a rated valve is examined, over the rated one: EN 12266-1 tests shells at 1.5 times theirs.
EXAMINED = 1.5


class Keys(Section):
    """Back pressure on the outside, no flow."""

    told_by_giving = ("pressures",)

    pressures: tuple[LoadPressure, ...] = key(
        _PRESSURES,
        "Static back pressures, outside over inside; where only a rated_pressure is given, the default ones below 1.5 "
        "times that, itself and 1.5 times that.",
        min_length=1,
    )
    rated_pressure: Pressure | None = key(
        None,
        "Back pressure that the safety factor refers to; the largest of pressures without it.",
        **PARAMETERS["pressure"].limits,
    )
    supports: Literal["contact", "held-lips"] = key(
        "contact",
        "Inner faces touching the closing plane, or the simplification of Th. 3.6: duckbill held shut, "
        "mid-surface of the "
        "saddle kept from crossing the plane.",
    )
    max_step: LoadPressure = key(1e3, "Largest load step; the stiffness is watched for buckling at each.")
    shut_fraction: Number = key(
        0.2,
        "A section counts as shut when less than this fraction of the lip's opening at rest is left; of lips that "
        "stand apart there, of their gap alone.",
        ge=0,
        lt=1,
    )
    eigenvalues: StrictInt = key(4, "Lowest eigenvalues of the tangent stiffness to follow.", ge=1, le=100)
    symmetry: Literal["SS", "all"] = key(
        "SS",
        "Symmetry classes watched for buckling: SS is that of the model, all adds those in which the lips sway in y "
        "(SA), the valve sways sideways in x (AS) and twists (AA).",
    )
    arclength: StrictBool = key(
        True,
        "Go on along the equilibrium path by arclength when load steps end at a limit point; false ends there, with "
        "that point located.",
    )
    measured: Annotated[tuple[Path, ...], MEASURED_FILES] = key(
        (),
        "Measured points as in steady.measured: a back pressure with the area of the narrowest passage left (pressure "
        "[kPa], area [mm2]), or with points of sections of the wall.",
    )

    @model_validator(mode="after")
    def reach_rated_pressure(self) -> Keys:
        """Let pressures that were not given go up to 1.5 times the rated one."""
        if "pressures" not in self.model_fields_set:
            self.__dict__["pressures"] = _PRESSURES
            if self.rated_pressure:
                last = EXAMINED * self.rated_pressure
                below = {pressure for pressure in _PRESSURES if pressure < last}
                self.__dict__["pressures"] = tuple(sorted(below | {self.rated_pressure, last}))
        return self

    @field_validator("measured", mode="before")
    @classmethod
    def _find_measured(cls, given: Any, info: ValidationInfo) -> Any:
        return find_measured(given, info, (AREA, SHAPE))


def command(
    pressures: Annotated[list[str] | None, pressure_option("Back pressure, '7 kPa' or '3 m'; may be repeated.")] = None,
    symmetry: ClassesOption = None,
) -> Request:
    """Back pressure: does the valve shut, where and how firmly, what stays open, how far is the wall from buckling?

    The pressures are those of --pressure, else closure.pressures of the case; each state is found from the one before,
    and the last one before a limit is listed too. The safety factor refers to closure.rated_pressure, or to the largest
    of the pressures. closure.supports chooses contact of the inner faces or the simplified supports of the thesis.
    --symmetry all also watches for buckling into motions that the model's symmetry leaves out. How a valve closes in
    time is a run of transient with supports.contact = "faces".

    dbvfiv closure cases/closure.toml -o closure.h5 --plots figures
    """
    return Request({"closure.pressures": [number_or_text(text) for text in pressures] if pressures else None})
