"""Walls that do not have all their layers everywhere: zones of elements, each with some of the layers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .section import Section


@dataclass(frozen=True)
class Zones:
    """Zones of the wall: elements that have the same layers.

    Attributes
    ----------
    presence : (nz, nl) bool array
        True where a zone has a layer.
    of_element : (ne,) int array
        Zone of each element.
    """

    presence: np.ndarray
    of_element: np.ndarray

    @classmethod
    def of(cls, present: np.ndarray) -> Zones:
        """Zones of elements that have the same layers; present (ne, nl) bool."""
        presence, zone = np.unique(np.asarray(present, bool), axis=0, return_inverse=True)
        return cls(presence, np.ravel(zone))


@dataclass(frozen=True)
class WallParts:
    """A wall zone by zone.

    Attributes
    ----------
    section : Section
        All its layers.
    zones : Zones
    """

    section: Section
    zones: Zones

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """Section (layers through the thickness) of each zone."""
        return tuple(replace(self.section, present=tuple(map(bool, row))) for row in self.zones.presence)

    @cached_property
    def elements(self) -> tuple[np.ndarray, ...]:
        """Elements of each zone."""
        return tuple(np.flatnonzero(self.zones.of_element == i) for i in range(len(self.sections)))

    def _by_element(self, values: list[np.ndarray]) -> np.ndarray:
        return np.stack(values)[self.zones.of_element]

    @cached_property
    def plane_stiffness(self) -> np.ndarray:
        """(ne, 6, 6): that of the section of each element."""
        return self._by_element([section.plane_stiffness for section in self.sections])

    @cached_property
    def inertia(self) -> np.ndarray:
        """(ne, 3): that of the section of each element."""
        return self._by_element([section.inertia for section in self.sections])

    @cached_property
    def points(self) -> np.ndarray:
        """(ne, np, 2): those of the section of each element."""
        return self._by_element([section.points for section in self.sections])
