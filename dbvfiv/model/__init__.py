"""The coupled valve and its exact linearisation."""

from .dynamics import Conditions, LinearisedState, dynamic_residual, linearise
from .valve import Tangent, ValveModel

__all__ = ["Conditions", "LinearisedState", "Tangent", "ValveModel", "dynamic_residual", "linearise"]
