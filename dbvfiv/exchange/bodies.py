"""Surfaces and closed bodies of a state as grids: faces of the wall, the wall itself, the fluid inside.

At the side edge half the wall may exceed the radius of the mid-surface; the inner face then turns over itself or passes
through the plane y = 0 before it ends. Fluid meets what lies in front of such folds only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.part import QUARTER, Part
from ..errors import CaseError
from ..record.mesh import MeshData
from ..record.vtkhdf import faces


def trim_section(points: np.ndarray) -> np.ndarray:
    """The part of a section that bounds the passage. Raises ValueError if no passage is left: the section begins at or
    below y = 0.

    Parameters
    ----------
    points : (k, 3) array, m
        From the centre line (x = 0) to the side edge (y = 0).

    Returns
    -------
    (m, 3) array, m
        From x = 0, y > 0 to y = 0, x never falling: loops are left out, what lies beyond the first crossing of y = 0 is
        cut off, and so is what an overhang hides from y = 0.
    """
    points = np.asarray(points, float)
    if not points[0, 1] > 0.0:
        raise ValueError("The inner faces meet at the centre line.")
    path = _without_loops(points)
    below = np.flatnonzero(path[1:, 1] <= 0.0)
    if len(below):
        last = int(below[0]) + 1
        a, b = path[last - 1], path[last]
        share = a[1] / (a[1] - b[1]) if a[1] > b[1] else 1.0
        path = np.concatenate([path[:last], [a + share * (b - a)]])
    path[-1, 1] = 0.0
    kept = np.concatenate([[True], path[1:, 0] > np.maximum.accumulate(path[:-1, 0])])
    if not kept[-1]:  # the end lies under an overhang, so the widest point takes its place
        end = path[-1].copy()
        end[0] = path[kept][-1, 0]
        if path[kept][-1, 1] > 0.0:
            return np.concatenate([path[kept], [end]])
    return path[kept]


def _without_loops(points: np.ndarray) -> np.ndarray:
    """A plane path (k, 3) with each loop replaced by the point at which it begins and ends; crossings in x and y."""
    found, i = [points[0]], 0
    while i < len(points) - 1:
        start, step = found[-1], points[i + 1] - found[-1]
        crossing = _last_crossing(start, step, points, i + 2)
        if crossing is None:
            found.append(points[i + 1])
            i += 1
        else:
            share, i = crossing
            found.append(start + share * step)
    return np.array(found)


def _last_crossing(start, step, points, first):
    """Share of the step from `start` at which the last later piece of the path crosses it, and that piece."""
    for j in range(len(points) - 2, first - 1, -1):
        other, way = points[j], points[j + 1] - points[j]
        turn = step[0] * way[1] - step[1] * way[0]
        if turn == 0.0:
            continue
        gap = other - start
        share = (gap[0] * way[1] - gap[1] * way[0]) / turn
        along = (gap[0] * step[1] - gap[1] * step[0]) / turn
        if 0.0 < share < 1.0 and 0.0 <= along < 1.0:
            return share, j
    return None


def passage_grid(inner: np.ndarray) -> np.ndarray:
    """Inner face of the passage, row by row. Raises CaseError if the passage is shut somewhere.

    Parameters
    ----------
    inner : (rows, columns, 3) array, m
        Inner face of the wall, from the lip, columns from x = 0 to y = 0.

    Returns
    -------
    (rows, columns, 3) array, m
        Rows that need no trimming keep their points; the others are divided anew in the shares of arc length of their
        points before.
    """
    rows = []
    for row in np.asarray(inner, float):
        try:
            path = trim_section(row)
        except ValueError:
            raise CaseError(
                f"The inner faces of the lips meet at z = {1e3 * row[0, 2]:.4g} mm (x = 0), so this state has no open "
                "passage; a higher pressure opens one, and the shapes middle and outer need none."
            ) from None
        rows.append(path if len(path) == len(row) and np.array_equal(path[:-1], row[:-1]) else _divided(path, row))
    return np.array(rows)


def _divided(path: np.ndarray, row: np.ndarray) -> np.ndarray:
    length = _arc(path)
    wanted = _arc(row) / _arc(row)[-1] * length[-1]
    points = np.column_stack([np.interp(wanted, length, path[:, i]) for i in range(3)])
    points[0], points[-1] = path[0], path[-1]
    return points


def _arc(path: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])


@dataclass(frozen=True)
class WallFaces:
    """Grids (rows, columns, 3), m, of the part that is computed: rows from the lip to the flange, columns from x = 0,
    of a half from y = 0, to y = 0.
    """

    inner: np.ndarray  #: The inner face that fluid meets, see `dbvfiv.exchange.bodies`.
    middle: np.ndarray
    outer: np.ndarray
    part: Part = QUARTER  #: Of the valve.

    @classmethod
    def of(cls, mesh: MeshData, nodal: np.ndarray, open_passage: bool = True) -> WallFaces:
        """Faces of the deformed wall from nodal unknowns (nn, c). Raises CaseError if the passage is shut; without an
        open one the inner faces may cross.
        """
        inner, outer = faces(mesh, nodal)
        grids = [inner[mesh.rows], 0.5 * (inner + outer)[mesh.rows], outer[mesh.rows]]
        for grid in grids:  # the planes of symmetry, to the last digit
            for column, across in mesh.part.edges:
                grid[:, column, across] = 0.0
        if not open_passage:
            return cls(*grids, mesh.part)
        if mesh.part.is_quarter:
            grids[0] = passage_grid(grids[0])
        else:
            centre = mesh.part.centre(grids[0].shape[1])
            right, left = grids[0][:, centre:], grids[0][:, centre::-1] * [-1.0, 1.0, 1.0]
            left = passage_grid(left)[:, :0:-1] * [-1.0, 1.0, 1.0]
            grids[0] = np.concatenate([left, passage_grid(right)], axis=1)
        return cls(*grids, mesh.part)

    def section_areas(self) -> np.ndarray:
        """Area (rows,) of the part's passage at each row, m2, as seen along the axis."""
        x, y = self.inner[..., 0], self.inner[..., 1]
        return np.sum(0.5 * (y[:, 1:] + y[:, :-1]) * np.diff(x, axis=1), axis=1)

    @property
    def base(self) -> np.ndarray:
        """Points of the plane y = 0 below those of the inner face: the other side of the part's fluid."""
        return self.inner * [1.0, 0.0, 1.0]


#: What of a state can be had, and what it is.
SHAPES = {
    "inner": "the inner face of the wall, open at lip and flange",
    "middle": "the mid-surface that the shell is computed on, open at lip and flange",
    "outer": "the outer face of the wall, open at lip and flange",
    "wall": "the wall, a closed body",
    "fluid": "the fluid from flange to lip, a closed body",
}
#: Parameter of a direction in which a piece has two points only, a straight line.
LINE = np.array([0.0, 1.0])


@dataclass(frozen=True)
class Piece:
    """A piece of surface."""

    #: (m, n, 3), m; its normals, from the first direction to the second, point out of a closed body.
    points: np.ndarray
    #: (m,), (n,); parameters 0..1 of the points in both directions; the same where two pieces of a shape meet.
    places: tuple[np.ndarray, np.ndarray]

    def mirrored(self, sx: int, sy: int) -> Piece:
        """Its image, with normals that point out again."""
        points, (first, second) = self.points * [sx, sy, 1.0] + 0.0, self.places
        return Piece(points, self.places) if sx * sy > 0 else Piece(points[::-1], (1.0 - first[::-1], second))


@dataclass(frozen=True)
class Shape:
    """Pieces of surface of the part that is computed, and its images."""

    pieces: tuple[Piece, ...]  #: Points of two pieces that meet are the same.
    closed: bool  #: Whether they bound a body.
    #: (int, int); of x and y in the images: those of the whole valve, or of the part alone.
    signs: tuple[tuple[int, int], ...]

    def images(self) -> list[Piece]:
        """All pieces, mirrored where the valve is whole."""
        return [piece.mirrored(*signs) for signs in self.signs for piece in self.pieces]


def shape_of(faces: WallFaces, name: str, whole: bool = True) -> Shape:
    """One of `SHAPES`, of the whole valve or the part that was computed."""
    signs = faces.part.images if whole else faces.part.images[:1]
    rows, columns = _shares(faces.middle), _shares(faces.middle.swapaxes(0, 1))
    if name in ("inner", "middle", "outer"):
        return Shape((Piece(getattr(faces, name), (rows, columns)),), False, signs)
    low = faces.inner if name == "wall" else faces.base
    high = faces.outer if name == "wall" else faces.inner
    pieces = [
        Piece(high, (rows, columns)),
        Piece(np.stack([low[0], high[0]]), (LINE, columns)),  # at the lip
        Piece(np.stack([high[-1], low[-1]]), (LINE, columns)),  # at the flange
    ]
    if name == "wall" or not whole:
        pieces.append(Piece(low[::-1], (1.0 - rows[::-1], columns)))
    if not whole:
        for column, across in faces.part.edges:  # the fluid ends on y = 0 as it is
            if across == 0 or name == "wall":
                sides = (high, low) if column == 0 else (low, high)
                pieces.append(Piece(np.stack([side[:, column] for side in sides]), (LINE, rows)))
    return Shape(tuple(pieces), True, signs)


def _shares(grid: np.ndarray) -> np.ndarray:
    """Mean chord length along the first direction of a grid (m, n, 3), from 0 to 1."""
    lengths = np.linalg.norm(np.diff(grid, axis=0), axis=2).mean(axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
