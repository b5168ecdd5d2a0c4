"""Layered, thick, finite-rotation four-node shell on any quadrilateral mesh."""

from .mesh import ShellMesh, nodal_directors, tangent_frames
from .section import Layer, Section
from .shell import Shell
from .supports import DofMap

__all__ = ["DofMap", "Layer", "Section", "Shell", "ShellMesh", "nodal_directors", "tangent_frames"]
