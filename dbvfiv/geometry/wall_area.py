"""Cross-sectional area that the wall takes from the flow sections (Th. 4.12-4.14), patches included."""

from __future__ import annotations

import numpy as np

from ..case.valve import Valve
from .surface import Surface

#: Pieces of a section over which a wall that varies around it is summed up.
_FINE = 1000


def wall_deduction(valve: Valve, z: np.ndarray, surface: Surface) -> np.ndarray:
    """Part of the section taken by the wall (Th. 4.12-4.14, App. A): constant on duckbill, cuff and flange, linear
    over saddle and flare.

    Raises
    ------
    ValueError
        If the wall fills the section of the lip or of the flange that key points give, if these leave a wider passage
        at the lip than at the flange, or if patches fill a section.
    """
    return _even_deduction(valve, z, surface) + (_patched(valve, z, surface) if valve.patches else 0.0)


def _even_deduction(valve: Valve, z: np.ndarray, surface: Surface) -> np.ndarray:
    """Area (k,), m2, that a wall without patches takes from the sections at z (k,), m."""
    place = np.asarray(z, float)
    share = np.clip((place - valve.duckbill_length) / valve.saddle_length, 0.0, 1.0)
    quarters = surface.part.quarters
    if valve.key_points is not None:
        duckbill, cuff, flange = _key_point_deductions(valve, surface)
    else:
        duckbill = quarters * valve.duckbill_wall_area
        radii = valve.cuff_radius, valve.flange_radius
        cuff, flange = (quarters * _round_deduction(radius, valve) for radius in radii)
    taken = duckbill + share * (cuff - duckbill)
    if valve.flare_length > 0:
        begin = valve.duckbill_length + valve.saddle_length + valve.cuff_length
        taken = taken + np.clip((place - begin) / valve.flare_length, 0.0, 1.0) * (flange - cuff)
    return taken


def _round_deduction(radius: float, valve: Valve) -> float:
    """Area taken by the wall inside a quarter circle, m2 (Th. 4.14)."""
    inner = radius - valve.flange_wall_deduction
    return 0.25 * np.pi * (radius**2 - inner**2)


def _key_point_deductions(valve: Valve, surface: Surface) -> tuple[float, float, float]:
    """Areas taken by the wall at the lip, at the cuff and at the flange that key points give.

    A face at the distance h inside a section of length L that turns by a right angle takes h L - pi h^2/4, which is
    Th. 4.12 and 4.14 for the sections of App. A; where it turns by two, h L - pi h^2/2.
    """
    found = []
    lip, flange = surface.breaks[[0, -1]]
    cuff = flange if valve.flare_length == 0 else valve.duckbill_length + valve.saddle_length
    halves = {"duckbill": valve.duckbill_wall_deduction, "flange": valve.flange_wall_deduction}
    for place, name, z in (("lip", "duckbill", lip), ("cuff", "flange", cuff), ("flange", "flange", flange)):
        half, (other, edge) = halves[name], surface.section(z, np.array([surface.part.begin, 1.0]))[:, 0]
        width = edge - (0.0 if surface.part.is_quarter else other)
        gap = valve.initial_gap * max(width - surface.part.quarters * half, 0.0) if place == "lip" else 0.0
        found.append(half * surface.length(z) - 0.5 * surface.part.turn * half**2 - gap)
        if found[-1] >= surface.area(z):
            raise ValueError(
                f"The key points of the {place} leave no flow area inside a half wall of {half:g} m; it must be less, "
                f"see valve.{name}_wall_deduction."
            )
    inside = [
        1e4 * surface.part.copies * (surface.area(z) - taken) for z, taken in ((lip, found[0]), (flange, found[2]))
    ]
    if inside[0] >= inside[1]:
        raise ValueError(
            f"The key points leave {inside[0]:.4g} cm2 between the lips at rest; the passage there must be smaller "
            f"than that of the flange, {inside[1]:.4g} cm2."
        )
    return found[0], found[1], found[2]


def _patched(valve: Valve, z: np.ndarray, surface: Surface) -> np.ndarray:
    """Areas (k,), m2, that patches take off the sections at z beyond what an even wall does.

    A half wall h(s) inside a section takes the integral of h ds - h^2/2 dtheta, theta being the direction of the
    section. Where the inner faces of both lips would cross they meet, as those of an even wall do.
    """
    edges = [s for patch in valve.patches for s in patch.section_edges]
    places = np.unique([*np.linspace(0.0, 1.0, _FINE + 1), *edges])
    if not surface.part.is_quarter:
        places = np.concatenate([-places[:0:-1], places])
    middle = 0.5 * (places[1:] + places[:-1])
    joint, end = valve.duckbill_length, valve.duckbill_length + valve.saddle_length
    taken = []
    for level in z:
        points = surface.section(level, places)[:, :2]
        steps = np.diff(points, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        between = np.concatenate([angle[:1], 0.5 * (angle[1:] + angle[:-1]), angle[-1:]])
        turn = between[:-1] - between[1:]
        room = 0.5 * (points[1:, 1] + points[:-1, 1]) * lengths / np.maximum(steps[:, 0], 1e-9 * lengths)
        even = np.interp(level, (joint, end), (valve.duckbill_wall_deduction, valve.flange_wall_deduction))
        added = 0.5 * (_sides(valve, level, np.abs(middle)) - _sides(valve, level))
        half = np.minimum(even + added, np.maximum(room, even))
        more = np.sum((half - even) * lengths - 0.5 * (half**2 - even**2) * turn)
        taken.append(float(more))
    return np.array(taken)


def _sides(valve: Valve, z: float, shares: np.ndarray | None = None) -> np.ndarray | float:
    """Mean wall thickness before and behind an axial position, m, `thickness_factor` left out; with patches at
    shares (k,) of the section.
    """
    near = 1e-6 * valve.length
    places = [place for place in (z - near, z + near) if 0.0 < place < valve.length]
    if shares is None:
        return float(np.mean([valve.thickness_at(place) for place in places])) / valve.thickness_factor
    return np.mean([[valve.wall_at(place, s) for s in shares] for place in places], axis=0)
