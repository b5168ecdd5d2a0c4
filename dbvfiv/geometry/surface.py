"""The mid-surface between the sections: parametric (lip, saddle, flange) or skinned over key points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..case.key_points import is_whole, read_key_points
from ..case.part import HALF, QUARTER, Part
from ..case.valve import Valve
from .crossings import check_profiles
from .sections import Profile, both_sides, key_point_sections, lip_profile, round_profile


@dataclass(frozen=True)
class Surface:
    """Profiles joined one to the next at equal normalised arc length.

    Attributes
    ----------
    profiles : tuple of Profile
        From lip to flange.
    smooth : bool
        Blend that leaves and meets the profiles with zero slope instead of straight rulings.
    part : Part
        Of the valve, whose sections the profiles are.
    """

    profiles: tuple[Profile, ...]
    smooth: bool = False
    part: Part = QUARTER

    @property
    def breaks(self) -> np.ndarray:
        """Axial positions of the profiles, m."""
        return np.array([profile.z for profile in self.profiles])

    def section(self, z: float, s: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the section at the axial position z, at normalised arc lengths s (k,).

        Raises
        ------
        ValueError
            If two profiles lie at one place.
        """
        breaks = self.breaks
        i = int(np.clip(np.searchsorted(breaks, z, side="right") - 1, 0, len(breaks) - 2))
        if not breaks[i + 1] > breaks[i]:
            raise ValueError(
                f"Two sections of the valve lie at z = {breaks[i]:g} m: one length is nothing beside the rest."
            )
        share = (z - breaks[i]) / (breaks[i + 1] - breaks[i])
        if self.smooth:
            share = share**2 * (3 - 2 * share)
        xy = (1 - share) * self.profiles[i].points(s) + share * self.profiles[i + 1].points(s)
        return np.column_stack([xy, np.full(len(xy), z)])

    def area(self, z: float) -> float:
        """Area between the section and the symmetry planes, m2."""
        points = self.section(z, self._fine())
        return float(np.sum(0.5 * (points[1:, 1] + points[:-1, 1]) * np.diff(points[:, 0])))

    def _fine(self) -> np.ndarray:
        return np.linspace(self.part.begin, 1.0, 8000 * self.part.quarters + 1)

    def length(self, z: float) -> float:
        """Arc length of the section, m: of the profile that lies there, else of a polygon of many points."""
        near = next((p for p in self.profiles if abs(p.z - z) <= 1e-9 * self.profiles[-1].z), None)
        if near is not None and np.isfinite(near.length):
            return near.length
        return float(np.linalg.norm(np.diff(self.section(z, self._fine()), axis=0), axis=1).sum())


@dataclass(frozen=True)
class SmoothSurface(Surface):
    """Profiles joined by curves along the axis that do not overshoot (monotone cubics, Fritsch and Carlson 1980)."""

    @property
    def breaks(self) -> np.ndarray:
        """Axial positions of the ends, m; between them the surface has no joints."""
        return np.array([self.profiles[0].z, self.profiles[-1].z])

    def section(self, z: float, s: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the section at the axial position z, normalised arc lengths s (k,)."""
        s = np.asarray(s, float)
        xy = self._curve(s.tobytes())(np.clip(z, *self.breaks))
        return np.column_stack([xy, np.full(len(xy), z)])

    @lru_cache(maxsize=8)  # noqa: B019
    def _curve(self, s: bytes) -> PchipInterpolator:
        places = np.frombuffer(s)
        heights = np.stack([profile.points(places) for profile in self.profiles])
        return PchipInterpolator([profile.z for profile in self.profiles], heights, axis=0)


def surface_of(valve: Valve, part: Part = QUARTER) -> Surface:
    """Surface of a part of a valve: from its key points if it has any, else lip, saddle, cuff, flare and flange
    (App. A).

    Raises
    ------
    ValueError
        If a section through key points crosses itself.
    """
    if valve.key_points is not None:
        given = read_key_points(valve.key_points)
        own = HALF if is_whole(given[0]) else QUARTER
        profiles = tuple(key_point_sections(given, valve.scale))
        check_profiles(profiles, own)
        if part is not own:
            profiles = tuple(both_sides(profile) for profile in profiles)
        skin = SmoothSurface if valve.key_point_skin == "smooth" else Surface
        return skin(profiles, part=part)
    profiles, end = [lip_profile(0.0, valve.lip)], 0.0
    pieces = (
        (valve.duckbill_length, lip_profile, valve.lip),
        (valve.saddle_length, round_profile, valve.cuff_radius),
        (valve.cuff_length, round_profile, valve.cuff_radius),
        (valve.flare_length, round_profile, valve.flange_radius),
        (valve.flange_length, round_profile, valve.flange_radius),
    )
    for length, profile, size in pieces:
        end += length
        if length > 0:
            profiles.append(profile(end, size))
    profiles[-1] = replace(profiles[-1], z=valve.length)
    if part is HALF:
        shifts = [valve.bill_shift * (profile.z <= valve.duckbill_length) for profile in profiles]
        profiles = [both_sides(profile, shift) for profile, shift in zip(profiles, shifts)]
    return Surface(tuple(profiles), valve.saddle == "smooth", part)
