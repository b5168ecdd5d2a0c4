"""The section steady of the case file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import StrictInt, ValidationInfo, field_validator

from ...case.measured import AREA, DISCHARGE, MEASURED_FILES, SHAPE, TAPS, find_measured
from ...case.physics import LoadPressure
from ...case.quantity import Number
from ...case.section import Section, key


class Keys(Section):
    """Equilibria over a list of pressures."""

    pressures: tuple[LoadPressure, ...] = key(
        (2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3),
        "Static inlet pressures of the head-discharge curve.",
        min_length=1,
    )
    cracking_area: Number = key(
        2.0,
        "Where the valve counts as cracked: the passage at the lips over that at rest, which is a gap and not nothing.",
        gt=1,
        le=100,
    )
    measured: Annotated[tuple[Path, ...], MEASURED_FILES] = key(
        (),
        "CSV of measured points that figures and tables show beside the computed ones, one file or several, "
        "relative to the case file. The first line names the columns with units: a pressure as drive.pressure has "
        "it, or a head of the fluid, with a flow, the area at the lip or both (pressure [kPa], flow [L/s], area "
        "[cm2]); with points of sections of the wall (pressure [kPa], z [mm], face, x [mm], y [mm]; without z at "
        "the lip, without face on the inner one); or with static pressures along the axis (pressure [kPa], z [mm], "
        "tap [kPa]).",
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)

    @field_validator("measured", mode="before")
    @classmethod
    def _find_measured(cls, given: Any, info: ValidationInfo) -> Any:
        return find_measured(given, info, (DISCHARGE, AREA, SHAPE, TAPS))
