"""The section steady of the case file."""

from __future__ import annotations

from pathlib import Path

from pydantic import StrictInt, ValidationInfo, field_validator

from ...case.measured import read_measured
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
    measured: Path | None = key(
        None,
        "CSV of measured points that figures and tables show beside the computed ones: a pressure as drive.pressure "
        "has it, or a head of the fluid, and a flow; the first line names both with units (pressure [kPa], flow "
        "[L/s]); relative to the case file.",
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)

    @field_validator("measured", mode="after")
    @classmethod
    def _find_measured(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        context = info.context or {}
        if path is None or not context.get("check_files", True):
            return path
        path = Path(context.get("folder", ".")) / path
        read_measured(path, context.get("density"))
        return path.resolve()
