"""The mesh of the part of the valve that is computed."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictInt

from .quantity import Length, Number
from .section import BrokenRule, Section, key


class Mesh(Section):
    """The shell mesh of the part that is computed."""

    around: StrictInt = key(28, "Elements along the section, from the centre to the side edge.", ge=4, le=1000)
    part: Literal["auto", "half"] = key(
        "auto",
        "Part of the valve that is meshed: the least that its symmetry allows, a quarter (auto), or one lip from side "
        "edge to side edge, around elements on each side of its middle (half).",
    )
    along: StrictInt = key(48, "Elements along the axis, from lip to flange, in all.", ge=6, le=2000)
    grading: Number = key(0.5, "Length of the element at the side edge over that at the centre.", ge=0.05, le=2.0)
    layer_points: StrictInt = key(2, "Gauss points through the thickness of each layer.", ge=1, le=10)
    element: Literal["MITC4+EAS", "MITC4"] = key(
        "MITC4+EAS",
        "What is assumed about the in-plane strains: free bending of warped elements, and of all in their plane "
        "(MITC4+EAS), or strains as the shape gives them (MITC4), for comparison.",
    )
    rows: Literal["lip", "graded", "uniform"] = key(
        "lip",
        "Rows of nodes on every joint of the surface and step of the wall, and closer towards joints at which the "
        "surface turns and towards the lip (lip); towards those joints alone (graded, earlier versions); or evenly "
        "between the joints, whatever the wall does (uniform).",
    )
    row_grading: Number = key(
        0.4,
        "Length of the rows at the lip, and at a joint at which the surface turns by 20 degrees, over that far away.",
        ge=0.05,
        le=1.0,
    )
    breaks: tuple[Length, ...] = key(
        (), "Further axial positions to put a row on, from the lip; not with uniform rows."
    )
    row_positions: tuple[Length, ...] = key(
        (),
        "Axial positions of all rows from the lip (0) to the flange, in place of rows and breaks; where along is not "
        "one less than their number, along rows are spread as these are.",
    )
    columns: Literal["graded", "uniform"] = key(
        "graded",
        "Columns of nodes on the edge of the loaded columns, of those with a lip stop and of the bend at the side of "
        "the lip, and closer in that bend (graded); or even columns whatever these do (uniform).",
    )
    column_grading: Number = key(
        1 / 3, "Length of the columns in the bend at the side of the lip over that beside it.", ge=0.05, le=1.0
    )
    inertia: Literal["parabolic", "linear"] = key(
        "parabolic",
        "Course between rows of the pressure by which the fluid resists being accelerated: the parabola that straight "
        "courses of the velocity make (parabolic), or straight (linear, the thesis); straight with fluid.sound_speed.",
    )

    def check_positions(self, length: float) -> None:
        """Refuse rows that do not lie on a valve of this length, m."""
        outside = next((z for z in self.breaks if not 0 < z < length), None)
        if outside is not None:
            raise BrokenRule(
                "mesh.breaks",
                f"a list with {outside:g} m",
                f"a row lies between the lip, 0 m, and the flange, {length:g} m",
            )
        if not self.row_positions:
            if self.breaks and self.rows == "uniform":
                given = f"a list with {self.breaks[0]:g} m with rows = 'uniform'"
                raise BrokenRule("mesh.breaks", given, "rows that are even lie on no break, so leave one of them out")
            return
        if len(self.row_positions) < 7:
            given = f"a list of {len(self.row_positions)}"
            raise BrokenRule("mesh.row_positions", given, "a mesh has at least 7 rows of nodes, 6 elements along")
        if any(b <= a for a, b in zip(self.row_positions, self.row_positions[1:])):
            raise BrokenRule("mesh.row_positions", "a list that falls", "rows must increase from lip to flange")
        first, last = self.row_positions[0], self.row_positions[-1]
        if abs(first) > 1e-9 * length or abs(last - length) > 1e-9 * length:
            ends = f"a list from {first:g} to {last:g} m"
            raise BrokenRule("mesh.row_positions", ends, f"rows reach from the lip, 0 m, to the flange, {length:g} m")
