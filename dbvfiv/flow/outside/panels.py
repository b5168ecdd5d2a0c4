"""Flat quadrilateral panels of a surface in potential flow; rigid and open surfaces beside the outer face of a tube.

These lie in the quarter x > 0, y > 0, or in the half y > 0. Contours run clockwise seen from above to the plane y = 0:
from x = 0 those of a quarter, from y = 0 those of a half.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

#: Across a side of a panel: no panel of the same surface, or its own image about x = 0 or y = 0.
EDGE, IMAGE_X, IMAGE_Y = -1, -2, -3
#: Places of a surface that are this near to each other over its size are one.
SAME = 1e-9


@dataclass(frozen=True)
class Panels:
    """Panels with corners in their mean plane."""

    corners: np.ndarray  #: (k, 4, 3), m; counter-clockwise seen from the fluid; two may coincide.
    centres: np.ndarray  #: (k, 3), m; centroids, where the boundary conditions hold.
    normals: np.ndarray  #: (k, 3); unit vectors into the fluid.
    areas: np.ndarray  #: (k,), m2.
    #: (k,); normal velocity at its centre that a source panel has from its own curvature, see `own_bend`.
    bend: np.ndarray
    #: (k, 4) array of int; panel across each side, from corner a to a + 1; `EDGE`, `IMAGE_X` or `IMAGE_Y` where there
    #: is none.
    beside: np.ndarray

    def __len__(self) -> int:
        return len(self.areas)

    @classmethod
    def of(cls, corners: np.ndarray, corner_normals: np.ndarray | None = None) -> Panels:
        """Panels of quadrilaterals (k, 4, 3), which need not be flat: their corners move to the mean plane, normal to
        the area vector. Raises ValueError if one has no area.

        Parameters
        ----------
        corners : (k, 4, 3) array, m
        corner_normals : (k, 4, 3) array, optional
            Unit normals of the true surface at the corners, for its curvature; flat without.
        """
        corners = np.asarray(corners, float).reshape(-1, 4, 3)
        first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        vector = 0.5 * np.cross(first, second)
        area = np.linalg.norm(vector, axis=1)
        size = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        if np.any(area <= 1e-9 * size):
            raise ValueError(f"Panel {int(np.argmin(area - 1e-9 * size))} has no area.")
        normal = vector / area[:, None]
        middle = corners.mean(axis=1)
        height = np.einsum("kai,ki->ka", corners - middle[:, None], normal)
        flat = corners - height[..., None] * normal[:, None]
        bend = np.zeros(len(area)) if corner_normals is None else own_bend(corners, corner_normals)
        centre = _centroid(flat, normal, area)
        return cls(np.ascontiguousarray(flat), centre, normal, area, bend, panels_beside(corners))

    @classmethod
    def joined(cls, *parts: Panels) -> Panels:
        """All panels of several surfaces, in order."""
        joined = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        first = np.repeat(np.cumsum([0, *map(len, parts[:-1])]), [len(p) for p in parts])[:, None]
        joined["beside"] = joined["beside"] + np.where(joined["beside"] >= 0, first, 0)
        return cls(**joined)

    @property
    def extents(self) -> np.ndarray:
        """Longer diagonal of each panel (k,), m."""
        c = self.corners
        return np.maximum(np.linalg.norm(c[:, 2] - c[:, 0], axis=1), np.linalg.norm(c[:, 3] - c[:, 1], axis=1))


def _centroid(corners, normal, area):
    """Centroids of flat quadrilaterals from those of their two triangles."""
    total = np.zeros((len(corners), 3))
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        p, q, r = corners[:, a], corners[:, b], corners[:, c]
        part = 0.5 * np.einsum("ki,ki->k", np.cross(q - p, r - p), normal)
        total += part[:, None] * (p + q + r) / 3.0
    return total / area[:, None]


def own_bend(corners: np.ndarray, corner_normals: np.ndarray) -> np.ndarray:
    """Normal velocity (k,) at the centre of a curved source panel of unit strength, over the half of a flat one.

    A rectangle a by b with curvatures k1 and k2 along its sides lies k1 u^2/2 + k2 w^2/2 below its tangent plane, so
    that u_n = 1/(8 pi) integral (k1 u^2 + k2 w^2)/r^3 dA = (k1 b asinh(a/b) + k2 a asinh(b/a))/(4 pi). Without it
    flat panels are of first order only.

    Parameters
    ----------
    corners, corner_normals : (k, 4, 3) arrays
    """
    normals = np.asarray(corner_normals, float).reshape(-1, 4, 3)

    def across(field, one, other):
        return 0.5 * (field[:, other[0]] + field[:, other[1]] - field[:, one[0]] - field[:, one[1]])

    total, sides = np.zeros(len(corners)), []
    for one, other in (((0, 3), (1, 2)), ((0, 1), (3, 2))):
        way = across(corners, one, other)
        square = np.einsum("ki,ki->k", way, way)
        sides.append((np.sqrt(square), np.einsum("ki,ki->k", across(normals, one, other), way) / square))
    (a, first), (b, second) = sides
    total = first * b * np.arcsinh(a / b) + second * a * np.arcsinh(b / a)
    return total / (4.0 * np.pi)


def panels_beside(corners: np.ndarray) -> np.ndarray:
    """Panel (k, 4) across each side of panels (k, 4, 3) of one surface, see `Panels.beside`.

    Sides are matched by the places of their ends. One that has no length, or belongs to more than two panels, is an
    edge.
    """
    places = np.round(corners.reshape(-1, 3) / (SAME * np.abs(corners).max())) + 0.0
    nodes = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1, 4)
    ends = np.sort(np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, side, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    side = side.reshape(-1)
    order = np.argsort(side, kind="stable")
    one, other = order[count[side[order]] == 2].reshape(-1, 2).T
    found = np.full(len(side), EDGE)
    on_plane = (places.reshape(-1, 4, 3) == 0.0) & (np.roll(places.reshape(-1, 4, 3), -1, axis=1) == 0.0)
    found[on_plane[..., 0].ravel()], found[on_plane[..., 1].ravel()] = IMAGE_X, IMAGE_Y
    found[one], found[other] = other // 4, one // 4
    found[ends[:, 0] == ends[:, 1]] = EDGE
    return found.reshape(-1, 4)


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
