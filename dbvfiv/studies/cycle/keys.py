"""The section cycle of the case file."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictInt

from ...case.axis import Axis
from ...case.parameters import listed
from ...case.quantity import Length, Number
from ...case.section import Section, key
from ...case.stability_axis import StabilityRange, parse_stability_axis


class Keys(Section):
    """Branches of limit cycles along one parameter."""

    over: StabilityRange = key(
        "density=20:60:9",
        f"The parameter to move: {listed(notes=True)}; with =START:STOP:COUNT[:log] behind it for another range than "
        "the usual one. Cycles are given at these values, and at those that the branch needs between them.",
    )
    start: Literal["last", "first"] = key(
        "last", "The onset that the branch starts at: that of the largest value of the range, or of the smallest."
    )
    amplitude: Length = key(
        1e-3, "Displacement of one lip in y, half its swing, of the first cycle, near the onset.", gt=0, le=0.1
    )
    tolerance: Number = key(
        2e-3,
        "Largest share of the motion that its last two harmonics may hold; amplitude and period are then some ten "
        "times as exact.",
        gt=0,
        le=0.1,
    )
    max_harmonics: StrictInt = key(20, "Most harmonics; a branch that needs more ends there.", ge=3, le=100)
    exponents: StrictInt = key(4, "Floquet exponents looked for; 0 leaves stability out.", ge=0, le=20)
    max_step: Number = key(0.5, "Largest step along the branch, a step of one being 10 mm of the lip.", gt=0, le=10)
    max_points: StrictInt = key(100, "Most cycles of the branch.", ge=2, le=100_000)

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_stability_axis(self.over)
