"""Unsteady one-dimensional flow through a passage of given areas: laws behind one interface."""

from .channel import Channel
from .law import FlowLaw, FlowMotion, FlowParameter, FluidOperators
from .rows import RowAreas
from .term import FlowTerm, Stream
from .uniform import UniformLoad

__all__ = [
    "Channel",
    "FlowLaw",
    "FlowMotion",
    "FlowParameter",
    "FlowTerm",
    "FluidOperators",
    "RowAreas",
    "Stream",
    "UniformLoad",
]
