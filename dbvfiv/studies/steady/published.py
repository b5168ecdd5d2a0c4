"""Published numbers that figures of the reference valve show beside the computed ones."""

from __future__ import annotations

from dataclasses import dataclass

from ...case.valve import Valve
from ..case import Case

_WATER = 1000.0


@dataclass(frozen=True)
class Published:
    """Points of a published curve of the 12-inch valve.

    Attributes
    ----------
    label : str
    pressure : tuple, Pa
    mass_flow : tuple, kg/s
        Whole valve.
    source : str
    """

    label: str
    pressure: tuple[float, ...]
    mass_flow: tuple[float, ...]
    source: str


#: Mass flows of the coupled model of Th. 4.3.3: handed to the viscous flow model at the pressures of Fig. 4-4.
HEAD_DISCHARGE = Published(
    "thesis, coupled model", (18e3, 29e3, 36e3), (47.88, 75.52, 90.82), "Th. 4.3.3, Fig. 4-4 and chapter 7"
)


def applies(case: Case) -> bool:
    """True for the 12-inch valve with water flowing through it.

    Layers and materials may differ, shape and wall may not.
    """
    same_shape = case.valve.model_copy(update={"saddle": "ruled"}) == Valve()
    bare = not (case.has_line or case.has_tail or case.rest_pressure)
    return same_shape and case.drive.kind == "flow" and case.fluid.density == _WATER and bare
