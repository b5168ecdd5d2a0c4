"""The case file: typed, unit-aware, every key declared once.

``Case()`` is the 12-inch valve in its fluid, ``CaseError`` is the one way in which a case is refused. The keys of the
studies are theirs: the whole case, and what loads one, is `dbvfiv.studies.case`.
"""

from ..errors import CaseError
from .axis import Axis, parse_axis
from .load import make_case
from .materials import RUBBERS, Card, Layer, Materials
from .mesh import Mesh
from .model import Case
from .valve import Valve

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
    "make_case",
    "parse_axis",
]
