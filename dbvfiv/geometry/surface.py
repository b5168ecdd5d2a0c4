"""The mid-surface between the sections: parametric (lip, saddle, flange) or skinned over key points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.key_points import read_key_points
from ..case.valve import Valve
from .sections import Profile, flange_section, key_point_sections, lip_section


@dataclass(frozen=True)
class Surface:
    """Profiles joined one to the next at equal normalised arc length.

    Attributes
    ----------
    profiles : tuple of Profile
        From lip to flange.
    smooth : bool
        Blend that leaves and meets the profiles with zero slope instead of straight rulings.
    """

    profiles: tuple[Profile, ...]
    smooth: bool = False

    @property
    def breaks(self) -> np.ndarray:
        """Axial positions of the profiles, m."""
        return np.array([profile.z for profile in self.profiles])

    def section(self, z: float, s: np.ndarray) -> np.ndarray:
        """Points (k, 3) of the section at the axial position z, normalised arc lengths s (k,).

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
        points = self.section(z, np.linspace(0.0, 1.0, 8001))
        return float(np.sum(0.5 * (points[1:, 1] + points[:-1, 1]) * np.diff(points[:, 0])))


def surface_of(valve: Valve) -> Surface:
    """Surface of a valve: from its key points if it has any, else lip, saddle, cuff, flare and flange (App. A)."""
    if valve.key_points is not None:
        return Surface(tuple(key_point_sections(read_key_points(valve.key_points))))
    lip, cuff, flange = lip_section(valve.lip), flange_section(valve.cuff_radius), flange_section(valve.flange_radius)
    profiles, end = [Profile(0.0, lip)], 0.0
    pieces = (
        (valve.duckbill_length, lip),
        (valve.saddle_length, cuff),
        (valve.cuff_length, cuff),
        (valve.flare_length, flange),
        (valve.flange_length, flange),
    )
    for length, section in pieces:
        end += length
        if length > 0:
            profiles.append(Profile(end, section))
    profiles[-1] = Profile(valve.length, flange)
    return Surface(tuple(profiles), smooth=valve.saddle == "smooth")
