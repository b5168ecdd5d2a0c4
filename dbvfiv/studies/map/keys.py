"""The section map of the case file."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictBool, StrictInt, model_validator

from ...case.axis import Axis, StabilityRange, parse_stability_axis
from ...case.section import BrokenRule, Section, key


class Keys(Section):
    """Stability over two parameters."""

    x: StabilityRange = key(
        "pressure=500:50000:64", "Horizontal range: PARAMETER=START:STOP:COUNT[:log]; parameters as in onset.over."
    )
    y: StabilityRange = key("density=1:1000:64:log", "Vertical range, likewise.")
    continuity: Literal["case", "both"] = key("case", "The continuity law of the case, or both laws side by side.")
    curve: StrictBool = key(True, "Put in columns until the onset curves are known everywhere.")
    refine: StrictInt = key(
        2, "How often columns are put in between neighbours with different numbers of onsets.", ge=0, le=6
    )
    checks: StrictInt = key(4, "Cells compared with the full pencil, spread over the map.", ge=0, le=1000)
    workers: StrictInt = key(1, "Processes that share the columns.", ge=1, le=1024)
    cycles: StrictBool = key(
        False,
        "Follow limit cycles from the onsets of each column of the grid, as the section cycle says: their amplitude in "
        "each cell.",
    )
    symmetry: Literal["SS", "all"] = key(
        "SS",
        "Classes of motion looked at: SS is that of the model, all adds those in which the lips sway in y (SA), the "
        "valve sways sideways in x (AS) and twists (AA), cell by cell.",
    )

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """The parsed ranges."""
        return parse_stability_axis(self.x), parse_stability_axis(self.y)

    @model_validator(mode="after")
    def _two_parameters(self) -> Keys:
        x, y = self.axes
        if x.parameter == y.parameter:
            raise BrokenRule("y", f"{self.y!r}", f"it must range over another parameter than map.x = {self.x!r}")
        return self
