"""A shell pressed by a uniform follower load against a rigid, frictionless plane."""

from .plane import (
    ContactLaw,
    ContactState,
    PlaneContact,
    class_stiffness,
    contact_form,
    nodal_thickness,
    tributary_area,
)
from .step import ContactStep, Rebound

__all__ = [
    "ContactLaw",
    "ContactState",
    "ContactStep",
    "PlaneContact",
    "Rebound",
    "class_stiffness",
    "contact_form",
    "nodal_thickness",
    "tributary_area",
]
