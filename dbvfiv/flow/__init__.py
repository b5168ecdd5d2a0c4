"""Unsteady one-dimensional flow through a passage of given areas: laws behind one interface."""

from .channel import Channel
from .law import FlowLaw, FlowMotion, FlowParameter, FluidOperators, UniformLoad
from .rows import RowAreas
from .term import FlowTerm, Stream

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
