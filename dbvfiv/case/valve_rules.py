"""Rules for a valve's shape and wall; each violation is reported in one sentence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .key_points import read_key_points
from .section import BrokenRule

if TYPE_CHECKING:
    from .valve import Valve

#: What key points say in place of the case's keys.
_SHAPE = ("lip_half_width", "lip_rise", "bill_offset", "lip_radius", "cuff_radius", "flange_radius", "saddle")
#: Steepest a transition may run from the axis, rad: beyond it the rows of the mesh lie in its surface.
_STEEPEST = math.radians(80.0)
#: Least passage between the lips at rest, over that of the flange: below it nothing flows, and rounding says how much.
_LEAST_PASSAGE = 1e-8


def check_key_points(valve: Valve) -> None:
    """Refuse keys of the parametric shape beside key points."""
    for name in _SHAPE:
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
        name = "initial_gap" if lip - valve.lip_half_width * valve.initial_gap < flange else "lip_radius"
        name = name if valve.lip_rise == 0 else "lip_rise"
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
    along, around = {0.0}, {0.0}
    for i, patch in enumerate(valve.patches):
        try:
            patch.check_inside(valve.length)
        except BrokenRule as rule:
            raise BrokenRule(f"patches.{i}.{rule.key}", rule.given, rule.allowed) from None
        along |= set(patch.axial_edges)
        around |= set(patch.section_edges)
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
