"""Layered, thick, finite-rotation four-node shell on any quadrilateral mesh."""

from .memory import Memory, WallMemory
from .mesh import DofMap, ShellMesh, nodal_directors, tangent_frames
from .pressure import Weight
from .section import Layer, Section
from .shell import Shell, StepWall

__all__ = [
    "DofMap",
    "Layer",
    "Memory",
    "Section",
    "Shell",
    "ShellMesh",
    "StepWall",
    "WallMemory",
    "Weight",
    "nodal_directors",
    "tangent_frames",
]
