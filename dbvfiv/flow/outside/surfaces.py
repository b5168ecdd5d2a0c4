"""Rigid and open surfaces beside the outer face of a tube: all in the quarter x > 0, y > 0, or in the half y > 0.

Contours run clockwise seen from above to the plane y = 0: from x = 0 those of a quarter, from y = 0 those of a half.
"""

from __future__ import annotations

import numpy as np

from .panels import SAME, Panels


def extruded(contour: np.ndarray, z: np.ndarray) -> Panels:
    """Sides of a prism on a contour, the fluid outside.

    Parameters
    ----------
    contour : (k, 2) array, m
    z : (l,) array, m
        Ascending.
    """
    normals = _layers(_contour_normals(contour), z, level=0.0)
    return Panels.of(_between(_layers(contour, z), turned=True), _between(normals, turned=True))


def end_face(contour: np.ndarray, z: float, up: bool, rings: int = 6) -> Panels:
    """Flat face inside a contour (k, 2) at z, in rings around the axis, finer at the rim; the fluid above it, or
    below.
    """
    shares = np.sin(np.linspace(0.0, 0.5 * np.pi, rings + 1))
    grid = np.stack([np.column_stack([s * contour, np.full(len(contour), z)]) for s in shares])
    return Panels.of(_between(grid, turned=not up))


def ring_face(inner: np.ndarray, outer: np.ndarray, z: float, up: bool, rings: int = 2) -> Panels:
    """Flat face between two contours (k, 2) of as many points at z."""
    shares = np.linspace(0.0, 1.0, rings + 1)
    grid = np.stack([np.column_stack([(1 - s) * inner + s * outer, np.full(len(inner), z)]) for s in shares])
    return Panels.of(_between(grid, turned=not up))


def pipe(radius: float, z: np.ndarray, angles: np.ndarray) -> Panels:
    """A round pipe about the axis with the fluid inside; z (l,) ascending, angles (k,) falling to 0."""
    circle = arc(radius, angles)
    normals = _layers(circle / radius, z, level=0.0)
    return Panels.of(_between(_layers(circle, z)), -_between(normals))


def arc(radius: float, angles: np.ndarray) -> np.ndarray:
    """Points (k, 2) of a circle."""
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def strip(outer: np.ndarray, inner: np.ndarray, rings: int = 2) -> Panels:
    """Panels between two edges (k, 3), the fluid below them (towards smaller z)."""
    shares = np.linspace(0.0, 1.0, rings + 1)
    grid = np.stack([(1.0 - s) * inner + s * outer for s in shares])
    return Panels.of(_between(grid, turned=True))


def stretched(start: float, first: float, length: float, ratio: float = 1.25) -> np.ndarray:
    """Places from `start` on over a length, steps growing by about a ratio from `first`."""
    count = max(2, int(np.ceil(np.log1p(length / first * (ratio - 1.0)) / np.log(ratio))))
    steps = np.cumsum(first * ratio ** np.arange(count))
    return start + length * np.concatenate([[0.0], steps / steps[-1]])


def _layers(contour, z, level=None):
    """(l, k, 3): the contour at every z, or with its third component `level`."""
    out = np.empty((len(z), len(contour), 3))
    out[..., :2] = contour
    out[..., 2] = np.asarray(z)[:, None] if level is None else level
    return out


def _contour_normals(contour):
    """Outward unit normals (k, 2) at the points of a contour; its ends lie on symmetry planes."""
    mirror = [1, -1] if abs(contour[0, 1]) <= SAME * np.abs(contour).max() else [-1, 1]
    way = np.diff(contour, axis=0)
    side = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.linalg.norm(way, axis=1, keepdims=True)
    side = np.concatenate([side[:1] * mirror, side, side[-1:] * [1, -1]])
    found = side[:-1] + side[1:]
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def _between(grid, turned=False):
    """Corners (..., 4, 3) of the quadrilaterals of a grid (l, k, 3)."""
    quads = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
    return np.stack(quads[::-1] if turned else quads, axis=2).reshape(-1, 4, 3)
