"""A shell pressed by a uniform follower load against a rigid, frictionless plane."""

from .inner_face import nodal_thickness, tributary_area
from .law import ContactLaw
from .plane import ContactState, PlaneContact
from .together import together_blocks

__all__ = [
    "ContactLaw",
    "ContactState",
    "PlaneContact",
    "nodal_thickness",
    "together_blocks",
    "tributary_area",
]
