"""The case file: typed, unit-aware, every key declared once.

``load_case`` reads one, ``Case()`` is the 12-inch valve, ``CaseError`` is the
one way in which a case is refused.
"""

from ..errors import CaseError
from .axis import Axis, parse_axis
from .load import load_case, make_case
from .materials import RUBBERS, Card, Layer, Materials
from .model import Case
from .valve import Mesh, Valve

__all__ = [
    "Axis",
    "Card",
    "Case",
    "CaseError",
    "Layer",
    "Materials",
    "Mesh",
    "RUBBERS",
    "Valve",
    "load_case",
    "make_case",
    "parse_axis",
]
