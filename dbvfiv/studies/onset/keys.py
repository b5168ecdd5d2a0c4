"""The section onset of the case file."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictBool

from ...case.axis import Axis, StabilityRange, parse_stability_axis
from ...case.parameters import listed
from ...case.quantity import Number
from ...case.section import Section, key


class Keys(Section):
    """Onset of instability along one parameter."""

    over: StabilityRange = key(
        "density",
        f"The parameter to move: {listed(notes=True)}; with =START:STOP:COUNT[:log] behind it for another range than "
        "the usual one.",
    )
    tolerance: Number = key(1e-9, "Relative accuracy of a located onset on its mesh.", gt=0, le=1e-3)
    normal_form: StrictBool = key(
        True, "Also the first Lyapunov coefficient, which tells whether cycles are attracting or repelling."
    )
    coarse_mesh: Number = key(
        0.5,
        (
            "Elements of the second mesh over those of the first, for the uncertainty by Richardson's rule; 0 "
            "leaves it out."
        ),
        ge=0,
        lt=1,
    )

    continuity: Literal["case", "both"] = key("case", "The continuity law of the case, or both laws side by side.")

    symmetry: Literal["SS", "all"] = key(
        "SS",
        "Classes of motion looked at: SS is that of the model, all adds those in which the lips sway in y (SA), the "
        "valve sways sideways in x (AS) and twists (AA).",
    )

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_stability_axis(self.over)
