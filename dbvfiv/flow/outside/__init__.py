"""Potential flow on the outer face of the wall; knows panels only."""

from .panels import Panels
from .potential_flow import BODY, ROOM, Impedance, PotentialFlow, Surroundings
from .shape import ShapeDerivative

__all__ = ["BODY", "ROOM", "Impedance", "Panels", "PotentialFlow", "ShapeDerivative", "Surroundings"]
