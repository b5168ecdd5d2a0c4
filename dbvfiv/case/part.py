"""Computed part of the valve, cut at its planes of symmetry.

Every factor from the part to the whole valve is taken from here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .mesh import Mesh
    from .valve import Valve


@dataclass(frozen=True)
class Part:
    """The part of the valve that is meshed; its mirror images make up the whole.

    A section is a curve over its parameter s, which runs from `begin` to 1; s = 0 is the centre, |s| = 1 a side edge on
    y = 0.
    """

    name: str  #: "quarter" or "half".
    #: (int, int); mirror signs in x and y of the pieces of the whole valve, the part itself first.
    images: tuple[tuple[int, int], ...]
    begin: float  #: Parameter at which sections begin: 0, the centre on x = 0, or -1, the other side edge.
    #: Names of the classes of small motions about a state of its symmetry, that of the equilibria first; see
    #: `dbvfiv.model.symmetry`.
    classes: tuple[str, ...]

    @property
    def copies(self) -> int:
        """Number of copies of the part, mirror images included, that make up the whole valve."""
        return len(self.images)

    @property
    def walls(self) -> int:
        """Number of copies of the part that make up one lip; each meets its mirror image in the closing plane y = 0."""
        return self.copies // 2

    @property
    def quarters(self) -> int:
        """Number of quarters of the valve that the part covers."""
        return QUARTER.copies // self.copies

    @property
    def turn(self) -> float:
        """Angle by which a section turns from its first end to its last, rad."""
        return 0.5 * math.pi * (1.0 - self.begin)

    @property
    def is_quarter(self) -> bool:
        """True where the part begins in the plane of symmetry x = 0."""
        return self.begin == 0.0

    @property
    def middle(self) -> str:
        """Location of the middle of the lips and of the sections behind it, in words."""
        return "x = 0" if self.is_quarter else "the middle of the lips"

    @property
    def edges(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First and last column of a mesh, each with the axis, 0 or 1, across the plane of symmetry it lies in."""
        return (0, 0 if self.is_quarter else 1), (-1, 1)

    def centre(self, columns: int) -> int:
        """Index of the column of nodes at the centre, out of a number of columns."""
        return 0 if self.is_quarter else columns // 2


QUARTER = Part("quarter", ((1, 1), (-1, 1), (-1, -1), (1, -1)), 0.0, ("SS", "SA", "AS", "AA"))
HALF = Part("half", ((1, 1), (1, -1)), -1.0, ("S", "A"))
#: By their names.
PARTS = {part.name: part for part in (QUARTER, HALF)}


def part_of(valve: Valve, mesh: Mesh) -> Part:
    """The part of a valve that a mesh has: the least that its symmetry allows, unless a half is asked for."""
    return HALF if mesh.part == HALF.name or not valve.is_double_symmetric else QUARTER
