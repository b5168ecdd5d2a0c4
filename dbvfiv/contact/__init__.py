"""A shell pressed by a uniform follower load against a rigid, frictionless plane."""

from .inner_face import nodal_thickness, tributary_area
from .law import ContactLaw
from .plane import ContactState, PlaneContact

__all__ = [
    "ContactLaw",
    "ContactState",
    "PlaneContact",
    "nodal_thickness",
    "tributary_area",
]
