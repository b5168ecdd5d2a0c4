"""Sizes of the lip's section: a straight or bowed line from the centre, then an arc down to the closing plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Turns of a bow, rad, below which it is straight, and below which its area is taken from the series.
_STRAIGHT, _SMALL = 1e-9, 1e-2


@dataclass(frozen=True)
class LipSizes:
    """Section of the mid-surface of a lip, of a quarter.

    Straight at the height of its radius up to the half width, then a quarter circle (App. A); with a rise a circular
    arc that meets that of the side edge with a common tangent.

    Attributes
    ----------
    half_width : float, m
        From the centre to where the arc of the side edge begins.
    radius : float, m
        Of that arc.
    rise : float, m
        By which the centre stands above that place.
    """

    half_width: float
    radius: float
    rise: float = 0.0

    @property
    def turn(self) -> float:
        """Angle by which the bow turns from the centre to the side edge, rad."""
        turn = 2.0 * math.atan2(self.rise, self.half_width)
        return turn if turn > _STRAIGHT else 0.0

    @property
    def bow(self) -> float:
        """Radius of the bow, m; infinite of a straight lip."""
        return self.half_width / math.sin(self.turn) if self.turn > 0 else math.inf

    @property
    def bow_length(self) -> float:
        """Length of the section up to the arc of the side edge, m."""
        return self.bow * self.turn if self.turn > 0 else self.half_width

    @property
    def edge_length(self) -> float:
        """Length of that arc, m."""
        return (0.5 * math.pi - self.turn) * self.radius

    @property
    def height(self) -> float:
        """Height of the mid-surface at the centre above the closing plane, m."""
        return self.radius * math.cos(self.turn) + self.rise

    @property
    def widest(self) -> float:
        """Distance of the side edge from the centre, m."""
        return self.half_width + self.radius * (1.0 - math.sin(self.turn))

    @property
    def area(self) -> float:
        """Between the section and the symmetry planes, m2."""
        turn, radius = self.turn, self.radius
        corner = math.sin(turn) * math.cos(turn)
        area = self.half_width * radius * math.cos(turn) + 0.5 * radius**2 * (0.5 * math.pi - turn - corner)
        if turn == 0:
            return area
        if turn < _SMALL:
            return area + self.half_width**2 * turn / 3.0 * (1.0 + 2.0 / 15.0 * turn**2)
        return area + 0.5 * self.bow**2 * (turn - corner)

    def wall_area(self, half_wall: float, gap: float) -> float:
        """Part in m2 of the section that half a wall (m) inside it takes (Th. 4.12), less the initial gap (m).

        A half wall up to the radius of the side edge takes h L - pi h^2 / 4, of a straight lip as App. A has it.
        """
        inner = max(self.radius - half_wall, 0.0)
        turn = self.turn
        corner = (0.25 * math.pi - 0.5 * turn) * (self.radius**2 - inner**2)
        if turn == 0:
            return corner + self.half_width * (half_wall - gap)
        return (
            corner + half_wall * self.bow_length - 0.5 * turn * half_wall**2 - max(self.widest - half_wall, 0.0) * gap
        )
