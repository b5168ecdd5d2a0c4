"""Choice of the equations of motion of a valve."""

from __future__ import annotations

from ..case.parameters import Mu
from ..flow.gas import GasChannel
from ..model import ValveModel
from .equations import ValveMotion
from .gas import GasMotion
from .staggered import StaggeredMotion


def motion_of(model: ValveModel, mu: Mu | None = None, staggered: bool = False) -> ValveMotion:
    """The equations of a model under conditions, those of its case by default.

    Parameters
    ----------
    staggered : bool
        The thesis's coupling, fluid first.
    """
    if staggered:
        return StaggeredMotion(model, mu)
    compressed = isinstance(model.flow, GasChannel) and model.flow.unsteady
    return (GasMotion if compressed else ValveMotion)(model, mu)
