"""Surfaces as triangles, checked, and written as STL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista

from .bodies import Shape

#: Points closer than this share of the size of the shape are one.
SAME = 1e-9


def triangulated(shape: Shape) -> pyvista.PolyData:
    """Triangles of a shape, m: the diagonals of each image are mirror images of those of the part itself.

    Raises
    ------
    ValueError
        If a body is not watertight.
    """
    points, triangles, count = [], [], 0
    for sx, sy in shape.signs:
        for piece in shape.pieces:
            number = count + np.arange(piece.points[..., 0].size).reshape(piece.points.shape[:2])
            a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
            found = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
            triangles.append(found if sx * sy > 0 else found[:, ::-1])
            points.append(piece.points.reshape(-1, 3) * [sx, sy, 1.0] + 0.0)
            count += len(points[-1])
    joined, triangles = _joined(np.concatenate(points), np.concatenate(triangles))
    surface = pyvista.PolyData.from_regular_faces(joined, triangles)
    if shape.closed and not surface.is_manifold:
        raise ValueError("The body is not watertight.")
    return surface


def _joined(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that fall together made one, triangles that vanish with that left out."""
    size = SAME * np.ptp(points, axis=0).max()
    _, first, number = np.unique(np.round(points / size), axis=0, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def write_stl(shape: Shape, path: str | Path) -> pyvista.PolyData:
    """Write a shape as binary STL in metres, and return its triangles."""
    surface = triangulated(shape)
    surface.save(path)
    return surface
