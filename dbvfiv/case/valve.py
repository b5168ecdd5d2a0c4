"""The valve's shape and wall (defaults: the 12-inch inline valve of App. A), and the rules for both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import PrivateAttr, model_validator

from .key_points import is_whole, read_key_points, readable_key_points
from .parameters import PARAMETERS
from .quantity import Length, LineForce, Number, Pressure, Quantity
from .section import BrokenRule, FollowingSection, key
from .tables import readable_file
from .wall import WallPatch, WallStep, edges_of, multiplied

#: Turns of a bow, rad, below which it is straight, and below which its area is taken from the series.
_STRAIGHT, _SMALL = 1e-9, 1e-2


@dataclass(frozen=True)
class LipSizes:
    """Section of the mid-surface of a lip, of a quarter.

    Straight at the height of its radius up to the half width, then a quarter circle (App. A); with a rise a circular
    arc that meets that of the side edge with a common tangent.
    """

    half_width: float  #: m; from the centre to where the arc of the side edge begins.
    radius: float  #: m; of that arc.
    rise: float = 0.0  #: m; by which the centre stands above that place.

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
        return corner + half_wall * self.bow_length - 0.5 * turn * half_wall**2 - self.slit(half_wall) * gap

    def slit(self, half_wall: float) -> float:
        """Width in m of the slit between inner faces half a wall (m) inside the section, of a quarter."""
        return self.half_width if self.turn == 0 else max(self.widest - half_wall, 0.0)


#: What key points say in place of the case's keys.
SHAPE = ("lip_half_width", "lip_rise", "bill_offset", "lip_radius", "cuff_radius", "flange_radius", "saddle")
#: Steepest a transition may run from the axis, rad: beyond it the rows of the mesh lie in its surface.
_STEEPEST = math.radians(80.0)
#: Least passage between the lips at rest, over that of the flange: below it nothing flows, and rounding says how much.
_LEAST_PASSAGE = 1e-8


def check_key_points(valve: Valve) -> None:
    """Refuse keys of the parametric shape beside key points."""
    for name in SHAPE:
        value = getattr(valve, name)
        if name not in valve.following and value != type(valve).model_fields[name].default:
            unit = "" if name == "bill_offset" else " m"
            given = f"{value:g}{unit}" if isinstance(value, float) else repr(value)
            raise BrokenRule(name, f"{given} beside key_points", "the points give the shape, so leave it out")
    try:
        end = read_key_points(valve.key_points)[-1].z
    except ValueError:  # said where the file is looked for
        return
    if abs(end - valve.length) > 1e-6 * valve.length:
        raise BrokenRule(
            "key_points",
            f"{valve.key_points.name}, whose profiles end at z = {end:g} m",
            f"the lengths of duckbill, saddle, cuff, flare and flange must add up to that, and they make "
            f"{valve.length:g} m",
        )


def check_sections(valve: Valve) -> None:
    """Refuse sections that leave no passage, and shapes that cannot be meshed."""
    half_wall = 0.5 * valve.wall_at(0.0)
    if 2 * valve.lip.height < half_wall:
        raise BrokenRule(
            "lip_radius",
            f"{valve.lip_radius:g} m, so that the middle of one lip lies inside the other",
            f"half the wall, {half_wall:g} m, lets their faces touch at rest",
        )
    if valve.initial_gap > valve.lip.height:
        raise BrokenRule(
            "initial_gap",
            f"{valve.initial_gap:g} m, while the middle of a lip's wall stands {valve.lip.height:g} m above the slit",
            "the gap is that between faces at rest",
        )
    if valve.lip_rise > valve.lip_half_width:
        raise BrokenRule(
            "lip_rise", f"{valve.lip_rise:g} m", f"it must be at most lip_half_width = {valve.lip_half_width:g} m"
        )
    if valve.duckbill_wall_deduction - valve.initial_gap >= valve.lip_radius:
        raise BrokenRule(
            "duckbill_wall_deduction",
            f"{valve.duckbill_wall_deduction:g} m, which leaves no flow area between the lips",
            f"it must be less than lip_radius + initial_gap = {valve.lip_radius + valve.initial_gap:g} m",
        )
    for name in ("flange_radius", "cuff_radius"):
        if valve.flange_wall_deduction >= getattr(valve, name):
            raise BrokenRule(
                "flange_wall_deduction",
                f"{valve.flange_wall_deduction:g} m, which leaves no flow area at the {name.split('_')[0]}",
                f"it must be less than {name} = {getattr(valve, name):g} m",
            )
    lip, flange = valve.rest_areas
    if lip >= flange:
        name = "lip_radius" if valve.lip_rise == 0 else "lip_rise"
        raise BrokenRule(
            name,
            f"{getattr(valve, name):g} m, which leaves {4e4 * lip:.4g} cm2 between the lips at rest",
            f"the passage there must be smaller than that of the flange, {4e4 * flange:.4g} cm2",
        )
    if lip < _LEAST_PASSAGE * flange:
        name = "initial_gap" if valve.initial_gap < 1e-3 * valve.lip_half_width else "lip_half_width"
        raise BrokenRule(
            name,
            f"{getattr(valve, name):g} m, which leaves {4e4 * lip:.4g} cm2 between the lips at rest",
            f"the passage there must be at least {_LEAST_PASSAGE:g} of that of the flange, {4e4 * flange:.4g} cm2",
        )
    _check_transitions(valve)


def _check_transitions(valve: Valve) -> None:
    """Refuse transitions as steep as a wall across the pipe."""
    if valve.cuff_radius != valve.flange_radius and valve.flare_length == 0:
        raise BrokenRule(
            "flare_length",
            f"0 m between a cuff of radius {valve.cuff_radius:g} m and a flange of {valve.flange_radius:g} m",
            "the two need a transition, or the same radius",
        )
    lip, steepest = valve.lip, math.tan(_STEEPEST)
    wider = lip.widest > valve.cuff_radius
    aside = (1.0 + valve.bill_offset) * abs(lip.widest - valve.cuff_radius)  # of the side edge that moves farther
    across = max(aside, abs(valve.cuff_radius - lip.height))
    blend = 1.5 if valve.saddle == "smooth" else 1.0
    flare = abs(valve.flange_radius - valve.cuff_radius)
    for name, rise in (("saddle_length", across), ("flare_length", flare)):
        if blend * rise > steepest * getattr(valve, name):
            least = blend * rise / steepest
            what = "lips this much wider than the pipe" if wider else "lip and pipe"
            between = what if name == "saddle_length" else "cuff and flange"
            raise BrokenRule(
                name,
                f"{getattr(valve, name):g} m between {between}, which is steeper than 80 degrees from the axis",
                f"it must be at least {least:.4g} m",
            )


def check_preset(valve: Valve) -> None:
    """Refuse a bill that is moulded shut in two ways, or on more than its duckbill."""
    told = [name for name in PRESETS if getattr(valve, name)]
    if len(told) > 1:
        raise BrokenRule(
            told[1],
            f"{getattr(valve, told[1]):g} beside {told[0]} = {getattr(valve, told[0]):g}",
            f"one of {', '.join(PRESETS)} says how firmly the bill is moulded shut, so leave the others out",
        )
    if valve.moulded_length > valve.duckbill_length * (1 + 1e-9):
        raise BrokenRule(
            "moulded_length",
            f"{valve.moulded_length:g} m",
            f"it must be at most duckbill_length = {valve.duckbill_length:g} m: behind it the walls stand apart",
        )
    if not told and not valve._follows("moulded_length"):
        raise BrokenRule(
            "moulded_length",
            f"{valve.moulded_length:g} m of a bill that is not moulded shut",
            f"give one of {', '.join(PRESETS)} with it, or leave it out",
        )
    if told and valve.lip_rise > 0:
        raise BrokenRule(
            told[0],
            f"{getattr(valve, told[0]):g} with lip_rise = {valve.lip_rise:g} m",
            "lips that leave a lens between them at rest are not moulded shut",
        )


def check_wall(valve: Valve) -> None:
    """Refuse a wall that does not cover the valve or fills the pipe."""
    if valve.wall == "measured":
        ends = [step.to for step in valve.wall_map]
        if any(b <= a for a, b in zip(ends, ends[1:])):
            raise BrokenRule("wall_map", f"a list whose ends go {ends}", "they must increase from lip to flange")
        if ends[-1] < valve.length * (1 - 1e-9):
            raise BrokenRule(
                "wall_map",
                f"a list that ends at {ends[-1]:g} m",
                f"it must reach the valve's length of {valve.length:g} m",
            )
        thickest = max(step.thickness for step in valve.wall_map)
        name = "wall_map"
    else:
        thickest, name = valve.wall_thickness, "wall_thickness"
    _check_thickest(valve, name, thickest)
    _check_patches(valve)


def _check_thickest(valve: Valve, name: str, thickest: float) -> None:
    """Refuse a wall that fills the pipe."""
    radius = valve.inlet_radius
    if thickest * valve.thickness_factor >= 2 * radius:
        raise BrokenRule(
            name,
            f"{thickest * valve.thickness_factor:g} m at its thickest, which fills the pipe",
            f"it must be less than twice flange_radius = {2 * radius:g} m",
        )


def _check_patches(valve: Valve) -> None:
    """Refuse patches beside the valve and those that leave no wall, looked for between all edges."""
    along, around = edges_of(valve.patches, "patches", valve.length)
    along |= {step.to for step in valve.wall_map} if valve.wall == "measured" else set()
    for z in along:
        for s in around:
            if valve.patches and z < valve.length and s < 1:
                thickness = valve.wall_at(z, s)
                _check_thickest(valve, "patches", thickness)
                if thickness <= 0:
                    raise BrokenRule(
                        "patches",
                        f"a list that leaves {thickness:g} m of wall at z = {z:g} m and {s:g} of the section",
                        "the wall must be thicker than 0 everywhere",
                    )


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
#: Half gap between lips at rest, m: of lips that stand apart (the thesis), and of lips that are moulded shut, between
#: whose faces the roughness of rubber leaves it.
_APART, _ROUGH = 1e-4, 3e-5
#: How a bill that is moulded shut is told; one of them at most.
PRESETS = ("sealing_pressure", "sealing_force", "overlap", "cracking_head")
#: Lengths that `scale` multiplies, beside those of the wall map.
_SIZES = (
    *("duckbill_length", "saddle_length", "cuff_length", "flare_length", "flange_length", "lip_half_width"),
    *("lip_rise", "lip_radius", "cuff_radius", "flange_radius", "wall_thickness", "initial_gap"),
    *("duckbill_wall_deduction", "flange_wall_deduction", "moulded_length", "overlap"),
)


class Valve(FollowingSection):
    """Shape and wall of the valve; z runs from the lip (0) to the clamped flange.

    Behind the saddle come a round cuff and a flared transition to the flange, both of no length unless given.
    `lip_radius`, `cuff_radius`, `duckbill_wall_deduction` and `flange_wall_deduction` hold numbers also where they were
    not given, and all sizes are those of the valve as it is built: `scale` times what the case gives.
    """

    needs = {"key_point_skin": "key_points"}

    duckbill_length: Length = key(0.21, "Length of the duckbill, from the lip.", gt=0, le=100)
    saddle_length: Length = key(
        0.28, "Length of the saddle between the duckbill and the round part behind it.", gt=0, le=100
    )
    cuff_length: Length = key(0.0, "Length of a round cuff behind the saddle; 0 for none.", ge=0, le=100)
    flare_length: Length = key(
        0.0,
        "Length of a conical transition from the radius of the cuff to that of the flange; 0 for none.",
        ge=0,
        le=100,
    )
    flange_length: Length = key(0.07, "Length of the round flange at the inlet.", gt=0, le=100)
    lip_half_width: Length = key(
        0.125,
        "Half width of the lip up to the arc of its side edge (W1); the bill may be narrower or wider than the pipe.",
        gt=0,
        le=100,
    )
    lip_rise: Length = key(
        0.0,
        "By how much the middle of a curved lip stands above its ends: both lips are bowed away from each other by an "
        "arc of a circle and leave a lens between them at rest; 0 for straight lips.",
        ge=0,
        le=10,
    )
    bill_offset: Number = key(
        0.0,
        "By how much the bill stands off the pipe's axis along its slit: 0 in the middle, 1 where its side edge at "
        "negative x runs straight on from the pipe (a flat bottom), in between in proportion. A half of the valve is "
        "computed then; not with key_points, which may run from side edge to side edge instead.",
        ge=0,
        le=1,
    )
    lip_radius: Length | None = key(
        None,
        "Mid-surface radius of the side edge of the lip, and height of its straight part above the closing plane (R1); "
        "where not given half the wall at the lip, so that the faces touch at rest (6.19 mm in the 12-inch valve, "
        "App. A).",
        gt=0,
        le=10,
    )
    cuff_radius: Length | None = key(
        None, "Mid-surface radius of the cuff; that of the flange where not given.", gt=0, le=100
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
    patches: tuple[WallPatch, ...] = key(
        (),
        "Parts of the wall that are thicker or thinner than it says, later ones on top of earlier ones. The "
        "mid-surface stays; the flow section follows the inner face, as far as the faces do not meet.",
    )
    thickness_factor: Number = key(
        1.0,
        "Multiplies the wall thickness everywhere; mid-surface and flow section stay, so below 1 the lips are further "
        "apart than the section says.",
        gt=0,
        le=10,
    )
    initial_gap: Length | None = key(
        None,
        "Half gap between the closed lips that always lets fluid pass; 0.1 mm where not given, of a bill that is "
        "moulded shut 0.03 mm, which is what rough faces in contact leave and which carries no flow.",
        gt=0,
        le=1,
    )
    sealing_pressure: Pressure | None = key(
        None,
        "Even pressure with which the faces of a bill that is moulded shut press on each other at rest, on "
        "moulded_length: the wall then has no stress in a shape whose lips cross. The bill cracks at a little more. "
        'Needs supports.contact = "faces", which is taken where it is not given.',
        **PARAMETERS["sealing"].limits,
    )
    sealing_force: LineForce | None = key(
        None, "The same as a force per width of the lips: sealing_pressure times moulded_length.", gt=0, le=1e8
    )
    overlap: Length | None = key(
        None,
        "The same by how far the middle of either lip would stand beyond the closing plane without contact; "
        "0 for lips without a preset.",
        ge=0,
        le=10,
    )
    cracking_head: Annotated[float, Quantity("m", "m")] | None = key(
        None,
        "The same by the head of the fluid at which the bill cracks, as measured: see steady.cracking_area. The "
        "sealing pressure is found for it.",
        gt=0,
        le=1e3,
    )
    moulded_length: Length | None = key(
        None, "Length from the lip on that is moulded shut; that of the duckbill where not given.", gt=0, le=100
    )
    duckbill_wall_deduction: Length | None = key(
        None,
        "Half wall taken off the flow section of the duckbill (TH1, Th. 4.12), at the lip where wall_map has steps in "
        "it; where not given half the wall there, at most lip_radius (6.19 mm in the 12-inch valve, App. A).",
        ge=0,
        le=10,
    )
    flange_wall_deduction: Length | None = key(
        None,
        "Half wall taken off the flow section of the flange (TH2, Th. 4.14); where not given half the wall at the "
        "flange (8.19 mm in the 12-inch valve, App. A); it holds for cuff and flare too.",
        ge=0,
        le=10,
    )
    key_points: Annotated[Path, readable_file(read_key_points)] | None = key(
        None,
        "File of mid-surface key points, any number of profiles and points, used instead of lip_half_width, lip_rise, "
        "lip_radius, cuff_radius, flange_radius and saddle: a table of x, y and z with units (profile, x [mm], y [mm], "
        "z [mm], joint; profiles from lip to flange, each from the centre x = 0 to the side edge y = 0, or of a valve "
        "that is symmetric about y = 0 alone from side edge to side edge with x increasing) or bare lines "
        "x y z in m; the lengths say where duckbill and saddle end on it; relative to the case file.",
    )
    key_point_skin: Literal["ruled", "smooth"] = key(
        "ruled",
        "How profiles of key points are joined: by straight rulings, with a row of nodes on each, or by curves along "
        "the axis that do not overshoot.",
    )
    scale: Number = key(
        1.0,
        "Multiplies every length of this section, wall and gap included, and the positions in mesh.breaks, "
        "mesh.row_positions and key_points, and where layers begin and end, which keep their shares of the wall. "
        "Lengths of other sections stay.",
        ge=1e-3,
        le=1000,
    )
    _given: Any = PrivateAttr(None)

    @property
    def as_given(self) -> Valve:
        """The valve with its sizes as the case gives them, before `scale` multiplies them."""
        return self if self._given is None else self._given

    @property
    def is_preset(self) -> bool:
        """True for a bill that is moulded shut: its faces press on each other at rest."""
        return any(getattr(self, name) for name in PRESETS)

    @property
    def is_double_symmetric(self) -> bool:
        """True for symmetry about x = 0, the middle of the lips, besides that about y = 0, the plane of their slit."""
        return self.bill_offset == 0.0 and not any(map(is_whole, readable_key_points(self.key_points)))

    @property
    def bill_shift(self) -> float:
        """Distance in x, m, of the middle of the lips from the pipe's axis, of the parametric shape."""
        return self.bill_offset * (self.lip.widest - self.cuff_radius)

    @property
    def length(self) -> float:
        """Length of the valve along its axis in m."""
        return self.duckbill_length + self.saddle_length + self.cuff_length + self.flare_length + self.flange_length

    def thickness_at(self, z: float, s: float | None = None) -> float:
        """Wall thickness in m as `wall_at` has it, times `thickness_factor`."""
        return self.wall_at(z, s) * self.thickness_factor

    def wall_at(self, z: float, s: float | None = None) -> float:
        """Wall thickness in m at the axial position z, m, with patches where the share s of the section is given."""
        thickness = self.wall_thickness
        if self.wall == "measured":
            thickness = next((step for step in self.wall_map if z < step.to), self.wall_map[-1]).thickness
        for patch in self.patches if s is not None else ():
            if patch.covers(z, s):
                thickness = patch.on(thickness)
        return thickness

    @property
    def lip(self) -> LipSizes:
        """Sizes of the lip's section, of the parametric shape."""
        return LipSizes(self.lip_half_width, self.lip_radius, self.lip_rise)

    @property
    def rest_areas(self) -> tuple[float, float]:
        """Flow areas in m2 of a quarter at rest, at the lip and at the flange, of the parametric shape."""
        inner = self.flange_radius - self.flange_wall_deduction
        return self.lip.area - self.duckbill_wall_area, 0.25 * math.pi * inner**2

    @property
    def duckbill_wall_area(self) -> float:
        """Part in m2 of the duckbill's section that the wall takes (Th. 4.12), of a quarter, less the initial gap."""
        return self.lip.wall_area(self.duckbill_wall_deduction, self.initial_gap)

    @property
    def inlet_radius(self) -> float:
        """Mid-surface radius in m at the inlet end: that of the flange, or the mean one of key points."""
        profiles, factor = readable_key_points(self.key_points), 1.0 if self._given is None else self.scale
        return factor * profiles[-1].radius if profiles else self.flange_radius

    @property
    def bore(self) -> float:
        """Diameter in m of the passage at the inlet end."""
        return 2.0 * (self.inlet_radius - self.flange_wall_deduction)

    @property
    def bill_reach(self) -> float:
        """Distance in m from the axis that the outer face of the lip reaches at rest."""
        profiles, factor = readable_key_points(self.key_points), 1.0 if self._given is None else self.scale
        aside = factor * profiles[0].reach if profiles else self.lip.widest + abs(self.bill_shift)
        return aside + 0.5 * self.thickness_at(0.0, 1.0)

    @property
    def outer_diameter(self) -> float:
        """Largest extent in m of the outer face at rest across the axis, of flange, lip and parametric cuff."""
        flange = 2 * self.inlet_radius + self.thickness_at(self.length)
        has_cuff = self.key_points is None and self.cuff_length + self.flare_length > 0
        cuff = 2 * self.cuff_radius + self.thickness_at(self.length) if has_cuff else 0
        return max(flange, cuff, 2 * self.bill_reach)

    def _follow_wall_and_shape(self) -> None:
        """Numbers for the keys that were not given."""
        lip, flange = self.wall_at(0.0), self.wall_at(self.length)
        twelve_inch = (
            self.key_points is None
            and all(getattr(self, name) == size for name, size in _TWELVE_INCH.items())
            and (lip, flange) == _TWELVE_INCH_WALLS[self.wall]
        )
        own = _R1 if twelve_inch else 0.5 * lip
        radius = own if self._follows("lip_radius") else self.lip_radius
        touching = 0.5 * lip if self.key_points is not None else min(0.5 * lip, radius)
        numbers = {
            "lip_radius": radius,
            "cuff_radius": self.flange_radius,
            "duckbill_wall_deduction": _TH1 if twelve_inch and radius == _R1 else touching,
            "flange_wall_deduction": _TH2 if twelve_inch else 0.5 * flange,
            "initial_gap": _ROUGH if self.is_preset else _APART,
            "moulded_length": self.duckbill_length,
        }
        self._fill(numbers)

    def numbers_beside_key_points(self, points: Path) -> dict[str, float]:
        """Numbers, m, that were not given and that follow otherwise where a file of key points gives the shape."""
        own = self.as_given
        other = own.model_copy(update={"key_points": points})
        other._follow_wall_and_shape()
        names = sorted(own.following - set(SHAPE))
        return {name: getattr(own, name) for name in names if getattr(own, name) != getattr(other, name)}

    @model_validator(mode="after")
    def _fits_together(self) -> Valve:
        if self._given is not None:  # a valve is checked again when it becomes part of a case
            return self
        self._follow_wall_and_shape()
        check_preset(self)
        check_wall(self)
        if self.key_points is None:
            check_sections(self)
        else:
            check_key_points(self)
        self._enlarge()
        return self

    def _enlarge(self) -> None:
        """Multiply all sizes by the scale; what was given is remembered."""
        if self.scale == 1.0:
            return
        self._given = self.model_copy()
        self.__dict__.update(multiplied(self, _SIZES, self.scale))
        for name in ("wall_map", "patches"):
            self.__dict__[name] = tuple(piece.enlarged(self.scale) for piece in getattr(self, name))
