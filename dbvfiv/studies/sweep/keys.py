"""The section sweep of the case file."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictInt

from ...case.axis import Axis, Range, parse_axis
from ...case.quantity import Number
from ...case.section import Section, key


class Keys(Section):
    """Modes tracked along one parameter."""

    over: Range = key("density=1:1000:40:log", "Parameter and its values: PARAMETER=START:STOP:COUNT[:log].")
    count: StrictInt = key(6, "How many leading modes to follow.", ge=1, le=100)
    checks: StrictInt = key(3, "Values at which eigenvalues and the count of unstable modes are checked.", ge=1, le=50)
    tolerance: Number = key(
        1e-6,
        "Accepted relative error of eigenvalues of the reduced-order model; beyond it values are solved in full.",
        gt=0,
        le=1e-2,
    )
    least_confidence: Number = key(
        0.6, "A step is halved while the match of a leading mode is less certain than this.", gt=0, lt=1
    )

    symmetry: Literal["SS", "SA", "AS", "AA", "S", "A"] = key(
        "SS",
        "Class of motion followed: SS opens and closes the lips, SA sways them together in y, AS sideways in x, AA "
        "twists; S or A where a half is computed, see modes.symmetry.",
    )

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_axis(self.over)
