"""Unsteady one-dimensional ideal flow through a passage of given areas."""

from .channel import Channel, FluidOperators, UniformLoad
from .rows import RowAreas

__all__ = ["Channel", "FluidOperators", "RowAreas", "UniformLoad"]
