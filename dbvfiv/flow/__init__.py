"""Unsteady one-dimensional flow through a passage of given areas: laws behind one interface."""

from .channel import Channel
from .law import FlowLaw, FlowMotion, FlowParameter, UniformLoad
from .rows import RowAreas
from .term import FlowTerm, Stream

__all__ = ["Channel", "FlowLaw", "FlowMotion", "FlowParameter", "FlowTerm", "RowAreas", "Stream", "UniformLoad"]
