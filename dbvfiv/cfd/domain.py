"""The flow domain along the axis: a pipe upstream, the valve, its jet and a pipe downstream."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..exchange.faces import WallFaces
from .sections import Pattern, Section, section_nodes

#: Lengths of pipe before the flange and behind the lip, in its diameters.
UPSTREAM, DOWNSTREAM = 5.0, 12.0
#: Without a pipe downstream: radius of the room, in radii of the flange.
ROOM = 5.0
#: Axial length of cells beside the lip and inside the valve, over the length of the valve.
AT_LIP, INSIDE = 0.006, 0.02
#: Growth of axial cells away from the valve, and their greatest length over the diameter.
STRETCH, LONGEST = 1.07, 0.22
#: Distance behind the lip, in diameters of the pipe, over which the section of the mesh widens from slit to round.
WIDENING = 4.0
#: Size to which inner and outer face are continued far behind the lip, over the radius of the pipe.
FAR_INNER, FAR_OUTER = 0.5, 0.68


@dataclass(frozen=True)
class Domain:
    """Region of fluid that is meshed: valve, and the pipe or room around it.

    Attributes
    ----------
    faces : WallFaces
    radius : float, m
        Radius of the downstream pipe, or of the room.
    free : bool
        True for a room (free discharge), False for a pipe.
    fineness : float
        Cells in each direction over the usual number.
    """

    faces: WallFaces
    radius: float
    free: bool = False
    fineness: float = 1.0

    @cached_property
    def pattern(self) -> Pattern:
        """Cells of the sections."""
        base = Pattern(outside=20) if self.free else Pattern()
        return base.refined(self.fineness)

    @cached_property
    def bore(self) -> float:
        """Radius of the passage at the flange, m."""
        return float(self.faces.inner[-1, 0, 1])

    @cached_property
    def rows(self) -> np.ndarray:
        """Mean axial place (rows,) of the rows of the inner face, m."""
        return self.faces.inner[..., 2].mean(axis=1)

    @cached_property
    def stations(self) -> np.ndarray:
        """Axial places of the sections from the outlet to the inlet, m, relative to lip and flange within the valve."""
        lip, flange = self.rows[0], self.rows[-1]
        length = flange - lip
        inside = lip + length * _spread(AT_LIP / self.fineness, INSIDE / self.fineness)
        growth = 1.0 + (STRETCH - 1.0) / self.fineness
        down = 2.0 * self.radius if not self.free else 2.0 * self.bore
        behind = _outward(AT_LIP * length / self.fineness, growth, LONGEST * down / self.fineness, DOWNSTREAM * down)
        up = 2.0 * self.bore
        before = _outward(inside[-1] - inside[-2], growth, 2 * LONGEST * up / self.fineness, UPSTREAM * up)
        return np.concatenate([(lip - behind)[::-1], inside[1:-1], flange + before])

    @cached_property
    def lip(self) -> int:
        """Number of the section at the lip."""
        return int(np.argmin(np.abs(self.stations - self.rows[0])))

    @cached_property
    def flange(self) -> int:
        """Number of the section at the flange."""
        return int(np.argmin(np.abs(self.stations - self.rows[-1])))

    @cached_property
    def sections(self) -> list[Section]:
        """Nodes of all sections, the outlet's first."""
        inner, outer = (PchipInterpolator(self.rows, grid) for grid in (self.faces.inner, self.faces.outer))
        found = []
        for number, z in enumerate(self.stations):
            if number < self.lip:
                found.append(self._behind(z))
            elif number <= self.flange:
                found.append(section_nodes(inner(z), outer(z), self.radius, self.pattern))
            else:
                found.append(_moved(found[self.flange], z - self.stations[self.flange]))
        return found

    def _behind(self, z: float) -> Section:
        """A section behind the lip: both faces widen to circles."""
        inner, outer, distance = self.faces.inner[0], self.faces.outer[0], self.rows[0] - z
        share = np.clip(distance / (WIDENING * 2.0 * self.radius), 0.0, 1.0)
        share = share**2 * (3.0 - 2.0 * share)
        slope = max(0.0, 1.0 - distance / (0.5 * self.radius))  # of the lip, which is not quite plane
        faces = []
        for lip, size in ((inner, FAR_INNER), (outer, FAR_OUTER)):
            arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lip[:, :2], axis=0), axis=1))])
            angle = 0.5 * np.pi * arc / arc[-1]
            circle = size * self.radius * np.column_stack([np.sin(angle), np.cos(angle)])
            circle[-1, 1] = 0.0
            points = np.empty_like(lip)
            points[:, :2] = (1.0 - share) * lip[:, :2] + share * circle
            points[:, 2] = z + slope * (lip[:, 2] - self.rows[0])
            faces.append(points)
        return section_nodes(*faces, self.radius, self.pattern)


def _spread(first: float, usual: float) -> np.ndarray:
    """Places 0..1 of steps that grow from `first` at 0 to `usual`."""
    steps = [first]
    while sum(steps) < 1.0:
        steps.append(min(usual, 1.12 * steps[-1]))
    return np.concatenate([[0.0], np.cumsum(steps)]) / sum(steps)


def _outward(first: float, growth: float, longest: float, length: float) -> np.ndarray:
    """Places from 0 to `length` of steps that grow from `first`."""
    steps = [first]
    while sum(steps) < length:
        steps.append(min(longest, growth * steps[-1]))
    return np.concatenate([[0.0], np.cumsum(steps)]) * length / sum(steps)


def _moved(section: Section, way: float) -> Section:
    step = np.array([0.0, 0.0, way])
    return replace(section, core=section.core + step, layer=section.layer + step)
