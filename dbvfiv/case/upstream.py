"""The line in front of the valve."""

from __future__ import annotations

from typing import Annotated

from pydantic import model_validator

from .parameters import PARAMETERS
from .quantity import Length, Number, Quantity
from .section import BrokenRule, Section, key

#: Roughness over diameter up to which the law of fully rough pipes was measured.
_ROUGHEST = 0.05


class Upstream(Section):
    """A straight pipe in front of the valve: a rigid column of fluid with friction and losses."""

    length: Annotated[float, PARAMETERS["pipe_length"].quantity] = key(
        0.0,
        "Length of the pipe between the flange and its far end, where drive.pressure is given; 0 for no line, whatever "
        "the other keys say.",
        ge=0,
        le=PARAMETERS["pipe_length"].high,
    )
    diameter: Length | None = key(
        None,
        "Inner diameter of the pipe; where not given that of the valve's flow section at the flange. A change of "
        "section at the flange takes no head: put that of a reducer into loss.",
        gt=0,
        le=100,
    )
    friction: Number = key(
        0.0, "Darcy's friction factor f: f length/diameter velocity heads are lost on the way.", ge=0, le=1
    )
    roughness: Annotated[float, Quantity("m", "mm")] = key(
        0.0,
        "Height of the sand grain roughness, in place of friction: f of Colebrook and White's law in a fully rough "
        "pipe, 1/sqrt(f) = 2 log10(3.7 diameter/roughness), which turbulent flow tends to and which does not change "
        "with speed; laminar flow is not meant.",
        ge=0,
        le=1,
    )
    loss: Number = key(
        0.0,
        "Sum of the loss coefficients K of entrance, bends, valves and reducers, of the velocity head in the pipe.",
        ge=0,
        le=1e6,
    )

    @property
    def has_friction(self) -> bool:
        """Whether more length loses more head."""
        return self.friction > 0 or self.roughness > 0

    def check_roughness(self, inlet: float) -> None:
        """Refuse a roughness that no pipe of its diameter has; `inlet` is the diameter of the valve's inlet, m.

        Raises
        ------
        BrokenRule
        """
        diameter = inlet if self.diameter is None else self.diameter
        if self.length > 0 and self.roughness > _ROUGHEST * diameter:
            raise BrokenRule(
                "upstream.roughness",
                f"{1e3 * self.roughness:g} mm in a pipe of {1e3 * diameter:g} mm",
                f"it must be at most {_ROUGHEST:g} of the diameter, {1e3 * _ROUGHEST * diameter:.4g} mm",
            )

    @model_validator(mode="after")
    def _one_friction(self) -> Upstream:
        if self.friction > 0 and self.roughness > 0:
            raise BrokenRule(
                "roughness",
                f"{1e3 * self.roughness:g} mm beside friction = {self.friction:g}",
                "both say how rough the pipe is, so leave one of them out",
            )
        return self
