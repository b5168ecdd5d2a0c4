"""The valve's shape, wall and mesh (defaults: the 12-inch inline valve of App. A)."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import StrictInt, ValidationInfo, field_validator, model_validator

from .key_points import read_key_points
from .quantity import Length, Number
from .section import BrokenRule, Section, key


class WallStep(Section):
    """One piece of the measured wall."""

    to: Length = key(..., "End of the piece, measured along the axis from the lip.", gt=0, le=100)
    thickness: Length = key(..., "Wall thickness of the piece.", gt=0, le=10)


class Valve(Section):
    """Shape and wall of the valve; z runs from the lip (0) to the clamped flange."""

    duckbill_length: Length = key(0.21, "Length of the duckbill, from the lip.", gt=0, le=100)
    saddle_length: Length = key(0.28, "Length of the saddle between duckbill and flange.", gt=0, le=100)
    flange_length: Length = key(0.07, "Length of the round flange at the inlet.", gt=0, le=100)
    lip_half_width: Length = key(0.125, "Half width of the straight part of the lip (W1).", gt=0, le=100)
    lip_radius: Length = key(0.00619, "Mid-surface radius of the side edge of the lip (R1).", gt=0, le=10)
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
    thickness_factor: Number = key(1.0, "Multiplies the wall thickness everywhere.", gt=0, le=10)
    initial_gap: Length = key(1e-4, "Half gap between the closed lips that always lets fluid pass.", gt=0, le=1)
    duckbill_wall_deduction: Length = key(
        0.00619, "Half wall taken off the flow section of the duckbill (TH1, Th. 4.12).", ge=0, le=10
    )
    flange_wall_deduction: Length = key(
        0.00819, "Half wall taken off the flow section of the flange (TH2, Th. 4.14).", ge=0, le=10
    )
    key_points: Path | None = key(
        None,
        "File of 9 x 15 mid-surface key points (x y z on each line; profiles from lip to flange, "
        "each from the centre x = 0 to the side edge y = 0) used instead of the parametric shape; "
        "relative to the case file.",
    )

    @property
    def length(self) -> float:
        """Length of the valve along its axis in m."""
        return self.duckbill_length + self.saddle_length + self.flange_length

    def thickness_at(self, z: float) -> float:
        """Wall thickness in m at the axial position ``z`` in m (``thickness_factor`` included)."""
        if self.wall == "uniform":
            return self.wall_thickness * self.thickness_factor
        step = next((s for s in self.wall_map if z < s.to), self.wall_map[-1])
        return step.thickness * self.thickness_factor

    @field_validator("key_points", mode="after")
    @classmethod
    def _find_key_points(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        context = info.context or {}
        if path is None or not context.get("check_files", True):
            return path
        path = Path(context.get("folder", ".")) / path
        read_key_points(path)
        return path.resolve()

    @model_validator(mode="after")
    def _fits_together(self) -> Valve:
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
        self._check_wall()
        return self

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
    along: StrictInt = key(48, "Elements along the axis, from lip to flange.", ge=6, le=2000)
    grading: Number = key(0.5, "Length of the element at the side edge over that at the centre.", ge=0.05, le=2.0)
    layer_points: StrictInt = key(2, "Gauss points through the thickness of each layer.", ge=1, le=10)
