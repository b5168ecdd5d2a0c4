"""Potential flow on the outer face of the wall; knows panels only."""

from .panels import Panels
from .potential_flow import PotentialFlow, Surroundings

__all__ = ["Panels", "PotentialFlow", "Surroundings"]
