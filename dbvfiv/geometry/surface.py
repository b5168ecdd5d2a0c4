"""The mid-surface between the sections: parametric or skinned over key points, and written as key points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..case.key_points import is_whole, read_key_points
from ..case.part import HALF, QUARTER, Part
from ..case.valve import Valve
from ..errors import CaseError
from .sections import Profile, both_sides, check_profiles, key_point_sections, lip_profile, round_profile


@dataclass(frozen=True)
class Surface:
    """Profiles joined one to the next at equal normalised arc length."""

    profiles: tuple[Profile, ...]  #: From lip to flange.
    smooth: bool = False  #: Blend that leaves and meets the profiles with zero slope instead of straight rulings.
    part: Part = QUARTER  #: Of the valve, whose sections the profiles are.

    @property
    def breaks(self) -> np.ndarray:
        """Axial positions of the profiles, m."""
        return np.array([profile.z for profile in self.profiles])

    def section(self, z: float, s: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the section at the axial position z, at normalised arc lengths s (k,). Raises ValueError if
        two profiles lie at one place.
        """
        xy = self._through(z, s)
        return np.column_stack([xy, np.full(len(xy), z)])

    def _through(self, z: float, s: np.ndarray) -> np.ndarray:
        i, share = self._piece(z)
        return (1 - share) * self.profiles[i].points(s) + share * self.profiles[i + 1].points(s)

    def _piece(self, z: float) -> tuple[int, float]:
        """Number of the profile before an axial position, and the weight of that after it."""
        breaks = self.breaks
        i = int(np.clip(np.searchsorted(breaks, z, side="right") - 1, 0, len(breaks) - 2))
        if not breaks[i + 1] > breaks[i]:
            raise ValueError(
                f"Two sections of the valve lie at z = {breaks[i]:g} m: one length is nothing beside the rest."
            )
        share = (z - breaks[i]) / (breaks[i + 1] - breaks[i])
        return i, share**2 * (3 - 2 * share) if self.smooth else share

    def area(self, z: float) -> float:
        """Area between the section and the symmetry planes, m2."""
        x, y = self._polygon(z).T
        return float(np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(x)))

    def length(self, z: float) -> float:
        """Arc length of the section, m: of the profile that lies there, else of a polygon of many points."""
        near = next((p for p in self.profiles if abs(p.z - z) <= 1e-9 * self.profiles[-1].z), None)
        if near is not None and np.isfinite(near.length):
            return near.length
        return float(np.linalg.norm(np.diff(self._polygon(z), axis=0), axis=1).sum())

    def _polygon(self, z: float) -> np.ndarray:
        """Many points (k, 2) of the section."""
        i, share = self._piece(z)
        return (1 - share) * self._polygons[i] + share * self._polygons[i + 1]

    @cached_property
    def _polygons(self) -> list[np.ndarray]:
        """Many points (k, 2) of the profiles."""
        return [profile.points(self._many()) for profile in self.profiles]

    def _many(self) -> np.ndarray:
        return np.linspace(self.part.begin, 1.0, 8000 * self.part.quarters + 1)


@dataclass(frozen=True)
class SmoothSurface(Surface):
    """Profiles joined by curves along the axis that do not overshoot (monotone cubics, Fritsch and Carlson 1980)."""

    smooth: bool = True

    @property
    def breaks(self) -> np.ndarray:
        """Axial positions of the ends, m; between them the surface has no joints."""
        return np.array([self.profiles[0].z, self.profiles[-1].z])

    def _polygon(self, z: float) -> np.ndarray:
        return self._through(z, self._many())

    def _through(self, z: float, s: np.ndarray) -> np.ndarray:
        return self._curve(np.asarray(s, float).tobytes())(np.clip(z, *self.breaks))

    @lru_cache(maxsize=8)  # noqa: B019
    def _curve(self, s: bytes) -> PchipInterpolator:
        places = np.frombuffer(s)
        heights = np.stack([profile.points(places) for profile in self.profiles])
        return PchipInterpolator([profile.z for profile in self.profiles], heights, axis=0)


def surface_of(valve: Valve, part: Part = QUARTER) -> Surface:
    """Surface of a part of a valve: from its key points if it has any, else lip, saddle, cuff, flare and flange (App.
    A). Raises ValueError if a section through key points crosses itself.
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


def key_point_table(valve: Valve, points: int = 17, extra: int = 0) -> str:
    """Table of key points that gives a valve's shape back. Raises CaseError if the valve has key points already, or a
    smooth saddle meets a flare without a cuff between.

    Parameters
    ----------
    valve : Valve
        Of a parametric shape; sizes are written as its case gives them, before `scale`.
    points : int
        Points between two joints of a profile, both included.
    extra : int
        Further profiles at even distances inside the saddle.

    Returns
    -------
    str
        As `dbvfiv.case.key_points.read_key_points` takes it. With a smooth saddle `valve.key_point_skin` must be
        "smooth" too.
    """
    valve = valve.as_given
    if valve.key_points is not None:
        raise CaseError(f"valve.key_points is {valve.key_points.name}, so the shape is one of key points already.")
    smooth = valve.saddle == "smooth"
    if smooth and valve.flare_length > 0 and (valve.cuff_length == 0 or valve.cuff_radius != valve.flange_radius):
        raise CaseError(
            "valve.saddle is 'smooth' with a flare, whose blend key points do not have; take a ruled saddle.",
            "valve.saddle",
        )
    surface = surface_of(valve, QUARTER if valve.is_double_symmetric else HALF)
    begin = surface.part.begin
    lines = [
        f"# Key points of a duckbill valve, {valve.length * 1e3:g} mm long; profiles from lip to flange.",
        "# joint: 1 where the curvature jumps; between joints a profile is a smooth curve through its points.",
        "profile, x [mm], y [mm], z [mm], joint",
    ]
    for number, (profile, joints) in enumerate(_profiles(surface, valve, extra), 1):
        ends = [begin, *joints, 1.0]
        each = points if joints else 2 * surface.part.quarters * (points - 1) + 1
        shares = [np.linspace(a, b, each) for a, b in zip(ends[:-1], ends[1:])]
        for i, share in enumerate(shares):
            first = 1 if i else 0
            for place in range(first, each):
                x, y = profile.points(share[place : place + 1])[0] * 1e3
                if share[place] in (begin, 1.0):  # on a plane of symmetry, to the last digit
                    x, y = (0.0, y) if share[place] == 0.0 else (x, 0.0)
                joint = int(place == each - 1 and i < len(shares) - 1)
                lines.append(f"{number}, {x:.15g}, {y:.15g}, {profile.z * 1e3:.15g}, {joint}")
    return "\n".join(lines) + "\n"


def _profiles(surface: Surface, valve: Valve, extra: int):
    """Profiles to write, each with its joints."""
    lip = surface.profiles[0]
    begin, end = valve.duckbill_length, valve.duckbill_length + valve.saddle_length
    between = np.linspace(begin, end, extra + 2)[1:-1]
    inside = [(Profile(z, lambda s, z=z: surface.section(z, s)[:, :2]), lip.joints) for z in between]
    own = [(profile, profile.joints) for profile in surface.profiles]
    return sorted(own + inside, key=lambda pair: pair[0].z)
