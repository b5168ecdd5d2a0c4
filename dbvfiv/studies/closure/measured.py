"""Measured data beside states under back pressure: the passage left, sections of the wall."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...case.measured import AREA, SHAPE
from ..measured.curves import MeasuredCurve
from ..measured.kept import joined, kept_tables
from ..measured.sections import MeasuredShapes, WallSections
from .along import value_at

if TYPE_CHECKING:
    from .result import ClosureResult

#: What the files of closure.measured may hold.
KINDS = (AREA, SHAPE)


@dataclass(frozen=True)
class MeasuredClosure:
    """Measurements under back pressure; None for a quantity that was not measured.

    Attributes
    ----------
    passage : MeasuredCurve or None
        Narrowest passage left, m2, over the back pressure.
    shapes : MeasuredShapes or None
        Sections of the wall.
    """

    passage: MeasuredCurve | None = None
    shapes: MeasuredShapes | None = None

    def __iter__(self) -> Iterator[MeasuredCurve | MeasuredShapes]:
        return (part for part in (self.passage, self.shapes) if part is not None)

    def sentences(self) -> list[str]:
        """Sentences that compare each measured quantity with the computed one."""
        return [part.sentence() for part in self]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; empty lists of what was not measured."""
        parts = {"measured_area": self.passage, "measured_sections": self.shapes}
        return {name: part.summary() if part is not None else [] for name, part in parts.items()}


def measured_closure(result: ClosureResult) -> MeasuredClosure:
    """Measured data of a result, against its states and the path between them."""
    tables = kept_tables(result.record)
    areas = joined(tables, AREA, "pressure", "area")
    points = joined(tables, SHAPE, "pressure", "z", "face", "x", "y")
    passage = None
    if areas is not None:
        pressure, area = np.array(areas)
        computed = value_at(result, pressure, "least_opening")
        passage = MeasuredCurve("passage left", "area", pressure, area, computed, ("mm2", 1e6))
    shapes = points and MeasuredShapes.of(points, WallSections(result.mesh, result.states))
    return MeasuredClosure(passage, shapes)
