"""The coupled valve and its exact linearisation."""

from ..case.parameters import Mu
from .dynamics import LinearisedState, linearise
from .leading import BandOrigin, LeadingSearch, growth_floor, limit_point, select_search
from .valve import Tangent, ValveModel

__all__ = [
    "BandOrigin",
    "Mu",
    "LeadingSearch",
    "LinearisedState",
    "Tangent",
    "ValveModel",
    "growth_floor",
    "limit_point",
    "linearise",
    "select_search",
]
