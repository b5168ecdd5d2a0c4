"""The valve's shape, wall and mesh (defaults: the 12-inch inline valve of App. A)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from pydantic import PrivateAttr, StrictInt, ValidationInfo, field_validator, model_serializer, model_validator

from .key_points import read_key_points
from .quantity import Length, Number
from .section import BrokenRule, Section, key

#: Sizes of the 12-inch valve and its wall at lip and flange, m, and what App. A sets for it: R1, TH1, TH2.
_TWELVE_INCH = {
    "duckbill_length": 0.21,
    "saddle_length": 0.28,
    "flange_length": 0.07,
    "lip_half_width": 0.125,
    "flange_radius": 0.13919,
}
_TWELVE_INCH_WALLS = {"measured": (0.012, 0.016), "uniform": (0.01438, 0.01438)}
_R1, _TH1, _TH2 = 0.00619, 0.00619, 0.00819
#: What follows from wall and shape where it is not given.
_FOLLOWING = ("lip_radius", "duckbill_wall_deduction", "flange_wall_deduction")
#: What key points say in place of the case's keys.
_SHAPE = ("lip_half_width", "lip_radius", "flange_radius", "saddle")


class WallStep(Section):
    """One piece of the measured wall."""

    to: Length = key(..., "End of the piece, measured along the axis from the lip.", gt=0, le=100)
    thickness: Length = key(..., "Wall thickness of the piece.", gt=0, le=10)


class Valve(Section):
    """Shape and wall of the valve; z runs from the lip (0) to the clamped flange.

    `lip_radius`, `duckbill_wall_deduction` and `flange_wall_deduction` hold numbers also where they were not given.
    """

    duckbill_length: Length = key(0.21, "Length of the duckbill, from the lip.", gt=0, le=100)
    saddle_length: Length = key(0.28, "Length of the saddle between duckbill and flange.", gt=0, le=100)
    flange_length: Length = key(0.07, "Length of the round flange at the inlet.", gt=0, le=100)
    lip_half_width: Length = key(0.125, "Half width of the straight part of the lip (W1).", gt=0, le=100)
    lip_radius: Length | None = key(
        None,
        "Mid-surface radius of the side edge of the lip, and height of its straight part above the closing plane (R1); "
        "where not given half the wall at the lip, so that the faces touch at rest (6.19 mm in the 12-inch valve, "
        "App. A).",
        gt=0,
        le=10,
    )
    flange_radius: Length = key(0.13919, "Mid-surface radius of the flange (Rin).", gt=0, le=100)
    saddle: Literal["ruled", "smooth"] = key(
        "ruled", "How the saddle joins duckbill and flange: straight rulings or a smooth blend."
    )
    wall: Literal["measured", "uniform"] = key(
        "measured", "Wall thickness from wall_map (measured) or from wall_thickness (uniform)."
    )
    wall_map: tuple[WallStep, ...] = key(
        (
            WallStep(to=0.21, thickness=0.012),
            WallStep(to=0.30, thickness=0.015),
            WallStep(to=0.49, thickness=0.019),
            WallStep(to=0.56, thickness=0.016),
        ),
        "Measured wall, piece by piece from the lip to the flange.",
        min_length=1,
    )
    wall_thickness: Length = key(0.01438, "Wall thickness where wall is uniform.", gt=0, le=10)
    thickness_factor: Number = key(
        1.0, "Multiplies the wall thickness everywhere; mid-surface and flow section stay.", gt=0, le=10
    )
    initial_gap: Length = key(1e-4, "Half gap between the closed lips that always lets fluid pass.", gt=0, le=1)
    duckbill_wall_deduction: Length | None = key(
        None,
        "Half wall taken off the flow section of the duckbill (TH1, Th. 4.12); where not given half the wall at the "
        "lip, at most lip_radius (6.19 mm in the 12-inch valve, App. A).",
        ge=0,
        le=10,
    )
    flange_wall_deduction: Length | None = key(
        None,
        "Half wall taken off the flow section of the flange (TH2, Th. 4.14); where not given half the wall at the "
        "flange (8.19 mm in the 12-inch valve, App. A).",
        ge=0,
        le=10,
    )
    key_points: Path | None = key(
        None,
        "File of 9 x 15 mid-surface key points (x y z on each line; profiles from lip to flange, "
        "each from the centre x = 0 to the side edge y = 0) used instead of lip_half_width, lip_radius, flange_radius "
        "and saddle; the lengths say where duckbill and saddle end on it; relative to the case file.",
    )
    _following: frozenset[str] = PrivateAttr(frozenset())

    @property
    def following(self) -> frozenset[str]:
        """Keys that were not given and follow from wall and shape."""
        return self._following

    @property
    def length(self) -> float:
        """Length of the valve along its axis in m."""
        return self.duckbill_length + self.saddle_length + self.flange_length

    def thickness_at(self, z: float) -> float:
        """Wall thickness in m at the axial position ``z`` in m (``thickness_factor`` included)."""
        return self._wall_at(z) * self.thickness_factor

    def _wall_at(self, z: float) -> float:
        if self.wall == "uniform":
            return self.wall_thickness
        return next((s for s in self.wall_map if z < s.to), self.wall_map[-1]).thickness

    @property
    def rest_areas(self) -> tuple[float, float]:
        """Flow areas in m2 of a quarter at rest, at the lip and at the flange, of the parametric shape."""
        lip = self.lip_half_width * self.lip_radius + 0.25 * math.pi * self.lip_radius**2
        inner = self.flange_radius - self.flange_wall_deduction
        return lip - self.duckbill_wall_area, 0.25 * math.pi * inner**2

    @property
    def duckbill_wall_area(self) -> float:
        """Part in m2 of the duckbill's section that the wall takes (Th. 4.12), of a quarter, less the initial gap."""
        inner = max(self.lip_radius - self.duckbill_wall_deduction, 0.0)
        corner = 0.25 * math.pi * (self.lip_radius**2 - inner**2)
        return corner + self.lip_half_width * (self.duckbill_wall_deduction - self.initial_gap)

    @field_validator("key_points", mode="after")
    @classmethod
    def _find_key_points(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        context = info.context or {}
        if path is None or not context.get("check_files", True):
            return path
        path = Path(context.get("folder", ".")) / path
        read_key_points(path)
        return path.resolve()

    @model_serializer(mode="wrap")
    def _leave_what_follows(self, handler: Any) -> dict[str, Any]:
        """Without the numbers that follow, so that they follow anew after a change."""
        return {name: None if name in self._following else value for name, value in handler(self).items()}

    def _fill(self) -> None:
        """Numbers for the keys that were not given."""
        before = self._following  # a valve is checked again when it becomes part of a case
        self._following = frozenset(name for name in _FOLLOWING if getattr(self, name) is None or name in before)
        lip, flange = self._wall_at(0.0), self._wall_at(self.length)
        twelve_inch = (
            self.key_points is None
            and all(getattr(self, name) == size for name, size in _TWELVE_INCH.items())
            and (lip, flange) == _TWELVE_INCH_WALLS[self.wall]
        )
        numbers = {"lip_radius": _R1 if twelve_inch else 0.5 * lip} if "lip_radius" in self._following else {}
        radius = numbers.get("lip_radius", self.lip_radius)
        touching = 0.5 * lip if self.key_points is not None else min(0.5 * lip, radius)
        numbers["duckbill_wall_deduction"] = _TH1 if twelve_inch and radius == _R1 else touching
        numbers["flange_wall_deduction"] = _TH2 if twelve_inch else 0.5 * flange
        self.__dict__.update({name: numbers[name] for name in self._following})

    @model_validator(mode="after")
    def _fits_together(self) -> Valve:
        self._fill()
        self._check_wall()
        if self.key_points is None:
            self._check_sections()
        else:
            self._check_key_points()
        return self

    def _check_key_points(self) -> None:
        for name in _SHAPE:
            value = getattr(self, name)
            if name not in self._following and value != type(self).model_fields[name].default:
                given = f"{value:g} m" if isinstance(value, float) else repr(value)
                raise BrokenRule(name, f"{given} beside key_points", "the points give the shape, so leave it out")

    def _check_sections(self) -> None:
        if self.lip_half_width + self.lip_radius > self.flange_radius:
            widest = self.flange_radius - self.lip_radius
            raise BrokenRule(
                "lip_half_width",
                f"{self.lip_half_width:g} m, which makes the lips wider than the pipe",
                f"it must be at most flange_radius - lip_radius = {widest:g} m",
            )
        if self.duckbill_wall_deduction - self.initial_gap >= self.lip_radius:
            raise BrokenRule(
                "duckbill_wall_deduction",
                f"{self.duckbill_wall_deduction:g} m, which leaves no flow area between the lips",
                f"it must be less than lip_radius + initial_gap = {self.lip_radius + self.initial_gap:g} m",
            )
        if self.flange_wall_deduction >= self.flange_radius:
            raise BrokenRule(
                "flange_wall_deduction",
                f"{self.flange_wall_deduction:g} m, which leaves no flow area at the flange",
                f"it must be less than flange_radius = {self.flange_radius:g} m",
            )
        lip, flange = self.rest_areas
        if lip >= flange:
            name = "initial_gap" if lip - self.lip_half_width * self.initial_gap < flange else "lip_radius"
            raise BrokenRule(
                name,
                f"{getattr(self, name):g} m, which leaves {4e4 * lip:.4g} cm2 between the lips at rest",
                f"the passage there must be smaller than that of the flange, {4e4 * flange:.4g} cm2",
            )

    def _check_wall(self) -> None:
        if self.wall == "measured":
            ends = [step.to for step in self.wall_map]
            if any(b <= a for a, b in zip(ends, ends[1:])):
                raise BrokenRule("wall_map", f"a list whose ends go {ends}", "they must increase from lip to flange")
            if ends[-1] < self.length * (1 - 1e-9):
                raise BrokenRule(
                    "wall_map",
                    f"a list that ends at {ends[-1]:g} m",
                    f"it must reach the valve's length of {self.length:g} m",
                )
            thickest = max(step.thickness for step in self.wall_map)
            name = "wall_map"
        else:
            thickest, name = self.wall_thickness, "wall_thickness"
        if thickest * self.thickness_factor >= 2 * self.flange_radius:
            raise BrokenRule(
                name,
                f"{thickest * self.thickness_factor:g} m at its thickest, which fills the pipe",
                f"it must be less than twice flange_radius = {2 * self.flange_radius:g} m",
            )


class Mesh(Section):
    """The shell mesh of the quarter model."""

    around: StrictInt = key(28, "Elements along the section, from the centre to the side edge.", ge=4, le=1000)
    along: StrictInt = key(48, "Elements along the axis, from lip to flange, in all.", ge=6, le=2000)
    grading: Number = key(0.5, "Length of the element at the side edge over that at the centre.", ge=0.05, le=2.0)
    layer_points: StrictInt = key(2, "Gauss points through the thickness of each layer.", ge=1, le=10)
    element: Literal["MITC4+EAS", "MITC4+", "MITC4"] = key(
        "MITC4+EAS",
        "What is assumed about the in-plane strains: as the shape gives them (MITC4), bending of warped elements "
        "without stretching (MITC4+), and with that free bending in the plane of the element (MITC4+EAS).",
    )
    rows: Literal["graded", "breaks", "uniform"] = key(
        "graded",
        "Rows of nodes on every joint of the surface and step of the wall, and closer towards joints at which the "
        "surface turns (graded); evenly between them (breaks); or evenly between the joints alone, whatever the wall "
        "does (uniform).",
    )
    row_grading: Number = key(
        0.4,
        "Length of the rows at a joint at which the surface turns by 20 degrees over that far from it.",
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
    columns: Literal["graded", "breaks", "uniform"] = key(
        "graded",
        "Columns of nodes on the edge of the loaded columns, of those with a lip stop and of the bend at the side of "
        "the lip, and closer in that bend (graded); evenly between them (breaks); or even columns whatever these do "
        "(uniform).",
    )
    column_grading: Number = key(
        1 / 3, "Length of the columns in the bend at the side of the lip over that beside it.", ge=0.05, le=1.0
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
