"""The coupled valve and its exact linearisation."""
from .valve import Tangent, ValveModel

__all__ = ["Tangent", "ValveModel"]
