"""The weight of wall and fluid."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from .described import Described
from .quantity import GRAVITY
from .section import Section, key

#: Along the valve's axis, on which z runs from the lips to the flange: component of gravity over its size.
_ALONG = {"none": 0.0, "-z": -1.0, "+z": 1.0}
_ACROSS = ("x", "+x", "-x", "y", "+y", "-y")


def _direction(given: Any) -> Any:
    if isinstance(given, str) and given.strip() in _ACROSS:
        raise ValueError(
            "which is across the axis, and the part that is computed is symmetric about x = 0 and y = 0, or one of "
            "them, so it carries weight along its axis alone"
        )
    if not isinstance(given, str) or given.strip() not in _ALONG:
        raise ValueError("which is no direction that is known here")
    return given.strip()


Direction = Annotated[str, BeforeValidator(_direction), Described("choice", 'one of "none", "-z", "+z"')]


class Gravity(Section):
    """Weight of the wall, and the pressure of the fluid's levels along a valve that stands upright."""

    direction: Direction = key(
        "none",
        "Where gravity points: none leaves it out, as for a valve that lies; -z to the lips, a valve that discharges "
        "downwards; +z to the flange, one that discharges upwards. The wall then weighs what it does in the fluids on "
        "its sides, and pressures rise with depth, inside by fluid.density, outside by that of outside.fluid. "
        "drive.pressure is then over that of the surroundings at the level of the lips; at the far end of a line it is "
        "referred to the level of the flange, and downstream.pressure to that of the lips.",
    )

    @property
    def is_there(self) -> bool:
        """True where gravity has a direction, so that wall and fluid have weight."""
        return self.direction != "none"

    @property
    def along(self) -> float:
        """Component of gravity along z, m/s2."""
        return GRAVITY * _ALONG[self.direction]
