"""A shell pressed by a uniform follower load against a rigid, frictionless plane."""

from .inner_face import nodal_thickness, tributary_area
from .law import ContactLaw
from .plane import ContactState, PlaneContact
from .step import ContactStep, Rebound
from .together import class_stiffness, together_blocks

__all__ = [
    "ContactLaw",
    "ContactState",
    "ContactStep",
    "PlaneContact",
    "Rebound",
    "class_stiffness",
    "nodal_thickness",
    "together_blocks",
    "tributary_area",
]
