"""The valve's mid-surface: sections, surfaces between them, and the graded mesh on it."""

from .sections import Profile, flange_section, key_point_sections, lip_section
from .surface import Surface, key_point_table, surface_of
from .valve_mesh import ValveMesh, valve_mesh

__all__ = [
    "Profile",
    "Surface",
    "ValveMesh",
    "flange_section",
    "key_point_sections",
    "key_point_table",
    "lip_section",
    "surface_of",
    "valve_mesh",
]
