"""Cross-sections of the mid-surface, each a curve from the centre line (x = 0), or from one side edge (y = 0), to the
other side edge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from ..case.key_points import KeyProfile, is_whole
from ..case.part import QUARTER, Part
from ..case.valve import LipSizes

#: Places at which the arc length of a key-point curve is kept, and Gauss points between them.
_FINE = 401
_GAUSS = np.polynomial.legendre.leggauss(6)
#: Part of a lip's length up to which its side edge is none: that of a bow of half a circle.
_SHORT = 1e-6


@dataclass(frozen=True)
class Profile:
    """A section of the mid-surface."""

    z: float  #: Axial position, m.
    #: Positions (k, 2) in x and y, m, at normalised arc lengths s (k,) in 0 (centre) .. 1 (side edge); from -1, the
    #: other side edge, on where the section is that of a whole lip.
    points: Callable[[np.ndarray], np.ndarray]
    length: float = np.nan  #: Arc length, m.
    joints: tuple[float, ...] = ()  #: Normalised arc lengths at which the curvature jumps.


def both_sides(profile: Profile, middle: float = 0.0) -> Profile:
    """The section of a whole lip from that of its half at x > 0, with its centre moved to x = `middle`, m."""

    def points(s):
        s = np.asarray(s, float)
        sign = np.stack([np.where(s < 0, -1.0, 1.0), np.ones_like(s)], axis=-1)
        return profile.points(np.abs(s)) * sign + [middle, 0.0]

    joints = (*(-s for s in reversed(profile.joints)), *profile.joints)
    return Profile(profile.z, points, 2.0 * profile.length, joints)


def lip_section(lip: LipSizes) -> Callable[[np.ndarray], np.ndarray]:
    """Lip: straight at y = radius up to the half width, then a quarter circle down to y = 0 (App. A); or bowed by a
    rise.
    """
    radius, bow_length, turn = lip.radius, lip.bow_length, lip.turn
    length = bow_length + lip.edge_length

    def points(s):
        arc = np.asarray(s) * length
        angle = np.clip((arc - bow_length) / radius, 0.0, 0.5 * np.pi - turn)
        if turn == 0.0:
            x = np.where(arc < bow_length, arc, bow_length + radius * np.sin(angle))
            return np.stack([x, radius * np.cos(angle)], axis=-1)
        bent = np.minimum(arc / lip.bow, turn)
        x = lip.bow * np.sin(bent) + radius * (np.sin(turn + angle) - np.sin(turn))
        y = lip.height - 2.0 * lip.bow * np.sin(0.5 * bent) ** 2 + radius * (np.cos(turn + angle) - np.cos(turn))
        return np.stack([x, y], axis=-1)

    return points


def flange_section(radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """Round flange: a quarter circle (App. A)."""

    def points(s):
        angle = 0.5 * np.pi * np.asarray(s)
        return radius * np.stack([np.sin(angle), np.cos(angle)], axis=-1)

    return points


def lip_profile(z: float, lip: LipSizes) -> Profile:
    """Profile of a lip at an axial position, m; the curvature jumps where its side edge begins."""
    length = lip.bow_length + lip.edge_length
    has_edge = lip.edge_length > _SHORT * length
    return Profile(z, lip_section(lip), length, (lip.bow_length / length,) if has_edge else ())


def round_profile(z: float, radius: float) -> Profile:
    """Profile of a round part, radius in m, at an axial position, m."""
    return Profile(z, flange_section(radius), 0.5 * np.pi * radius)


def key_point_sections(profiles: Sequence[KeyProfile], scale: float = 1.0) -> list[Profile]:
    """Profiles through given key points, multiplied by a scale, each at equal normalised arc length, of a
    whole lip from the middle of that length.

    A profile is a spline through its points over the chord length, cubic as the thesis's program draws its lines (App.
    A). Where a table marks joints it is one between each two of them, of degree five as far as their points allow.
    """
    found = [Profile(scale * profile.z, *_spline_section(profile, scale)) for profile in profiles]
    return [_from_edge(of) if is_whole(profile) else of for of, profile in zip(found, profiles)]


def _from_edge(profile: Profile) -> Profile:
    """A section of a whole lip by its parameter from -1 to 1, from one that runs over its length from 0 to 1."""
    return replace(profile, points=lambda s: profile.points(0.5 * (np.asarray(s, float) + 1.0)))


def _spline_section(profile: KeyProfile, scale: float) -> tuple[Callable[[np.ndarray], np.ndarray], float]:
    """Points at normalised arc lengths, and the length, m."""
    xy = scale * np.asarray(profile.points, float)[:, :2]
    ends = [0, *profile.joints, len(xy) - 1]
    degree = 5 if profile.smooth else 3
    pieces = [_Piece.through(xy[a : b + 1], degree) for a, b in zip(ends[:-1], ends[1:])]
    starts = np.concatenate([[0.0], np.cumsum([piece.length for piece in pieces])])

    def points(s):
        arc = np.asarray(s, float) * starts[-1]
        number = np.clip(np.searchsorted(starts, arc, side="right") - 1, 0, len(pieces) - 1)
        out = np.empty((len(arc), 2))
        for i, piece in enumerate(pieces):
            chosen = number == i
            if np.any(chosen):
                out[chosen] = piece.at(arc[chosen] - starts[i])
        return out

    return points, float(starts[-1])


@dataclass(frozen=True)
class _Piece:
    """A smooth curve and its arc length at even places of its parameter."""

    curve: BSpline
    slope: BSpline
    places: np.ndarray
    arc: np.ndarray

    @classmethod
    def through(cls, xy: np.ndarray, degree: int) -> _Piece:
        """Spline through points (k, 2) over their chord length."""
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
        highest = min(degree, len(xy) - 1)
        odd = highest - 1 + highest % 2
        curve = make_interp_spline(chord, xy, k=2 if highest == 2 else odd)  # three points have a parabola
        slope = curve.derivative()
        places = np.unique(np.concatenate([np.linspace(0.0, chord[-1], _FINE), chord]))
        steps = _arc(slope, places[:-1], places[1:])
        return cls(curve, slope, places, np.concatenate([[0.0], np.cumsum(steps)]))

    @property
    def length(self) -> float:
        return float(self.arc[-1])

    def at(self, arc: np.ndarray) -> np.ndarray:
        """Points (k, 2) at arc lengths (k,), found by Newton's method."""
        place = np.interp(arc, self.arc, self.places)
        for _ in range(3):
            before = np.clip(np.searchsorted(self.places, place, side="right") - 1, 0, len(self.places) - 2)
            missed = self.arc[before] + _arc(self.slope, self.places[before], place) - arc
            place = np.clip(place - missed / np.linalg.norm(self.slope(place), axis=1), 0.0, self.places[-1])
        return self.curve(place)


def _arc(slope: BSpline, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Arc lengths (k,) of a curve between parameters (k,)."""
    half, middle = 0.5 * (end - start), 0.5 * (end + start)
    return half * sum(w * np.linalg.norm(slope(middle + x * half), axis=1) for x, w in zip(*_GAUSS))


#: Pieces in which a section is looked at, and how far beyond a plane of symmetry it may run, over its size.
_PIECES, _BEYOND = 240, 1e-3


def check_profiles(profiles: Sequence[Profile], part: Part = QUARTER) -> None:
    """Refuse sections through key points that cross themselves, or that run beyond a plane of symmetry between them.
    Raises ValueError in one sentence.
    """
    for number, profile in enumerate(profiles, 1):
        points = profile.points(np.linspace(part.begin, 1.0, _PIECES * part.quarters + 1))
        where = f"The section through the key points of profile {number} at z = {profile.z:g} m"
        inside = points if part.is_quarter else points[:, 1]
        if inside.min() < -_BEYOND * np.abs(points).max():
            there = "quarter of positive x and y" if part.is_quarter else "half of positive y"
            raise ValueError(
                f"{where} leaves the {there} between its points; give more of them there, or mark "
                "a joint where it has a corner."
            )
        place = crossing(points)
        if place is not None:
            raise ValueError(
                f"{where} crosses itself at x = {place[0]:.4g} m, y = {place[1]:.4g} m; its points must follow each "
                f"other from {'the centre' if part.is_quarter else 'side edge'} to {'the ' * part.is_quarter}side edge."
            )


def crossing(points: np.ndarray) -> np.ndarray | None:
    """Point (2,) at which a polygon through points (k, 2) first crosses itself; None if it does not."""
    begin, way = points[:-1], np.diff(points, axis=0)
    gap = begin[None] - begin[:, None]
    across = _cross(way[:, None], way[None])
    parallel = np.abs(across) <= 1e-12 * np.max(np.sum(way**2, axis=1))
    size = np.where(parallel, 1.0, across)
    ours, theirs = _cross(gap, way[None]) / size, _cross(gap, way[:, None]) / size
    meet = ~parallel & (ours >= 0) & (ours < 1) & (theirs >= 0) & (theirs < 1)
    pairs = np.argwhere(np.triu(meet, 2))
    if not len(pairs):
        return None
    i, j = pairs[0]
    return begin[i] + ours[i, j] * way[i]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
