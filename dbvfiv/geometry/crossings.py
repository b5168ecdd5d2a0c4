"""Sections that no wall can have: curves that cross themselves or leave their part between the key points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..case.part import QUARTER, Part
from .sections import Profile

#: Pieces in which a section is looked at, and how far beyond a plane of symmetry it may run, over its size.
_PIECES, _BEYOND = 240, 1e-3


def check_profiles(profiles: Sequence[Profile], part: Part = QUARTER) -> None:
    """Refuse sections through key points that cross themselves, or that run beyond a plane of symmetry between them.

    Raises
    ------
    ValueError
        In one sentence.
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
