"""Surfaces and closed bodies made of grids: faces of the wall, the wall itself, the fluid inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .faces import WallFaces

#: What of a state can be had, and what it is.
SHAPES = {
    "inner": "the inner face of the wall, open at lip and flange",
    "middle": "the mid-surface that the shell is computed on, open at lip and flange",
    "outer": "the outer face of the wall, open at lip and flange",
    "wall": "the wall, a closed body",
    "fluid": "the fluid from flange to lip, a closed body",
}
#: Signs of x and y in the quarters of a whole valve.
IMAGES = ((1, 1), (-1, 1), (-1, -1), (1, -1))


#: Parameter of a direction in which a piece has two points only, a straight line.
LINE = np.array([0.0, 1.0])


@dataclass(frozen=True)
class Piece:
    """A piece of surface.

    Attributes
    ----------
    points : (m, n, 3) array, m
        Its normals, from the first direction to the second, point out of a closed body.
    places : (m,) array, (n,) array
        Parameters 0..1 of the points in both directions; the same where two pieces of a shape meet.
    """

    points: np.ndarray
    places: tuple[np.ndarray, np.ndarray]

    def mirrored(self, sx: int, sy: int) -> Piece:
        """Its image, with normals that point out again."""
        points, (first, second) = self.points * [sx, sy, 1.0] + 0.0, self.places
        return Piece(points, self.places) if sx * sy > 0 else Piece(points[::-1], (1.0 - first[::-1], second))


@dataclass(frozen=True)
class Shape:
    """Pieces of surface of one quarter and whether they are mirrored to the whole valve.

    Attributes
    ----------
    pieces : tuple of Piece
        Points of two pieces that meet are the same.
    closed : bool
        Whether they bound a body.
    whole : bool
    """

    pieces: tuple[Piece, ...]
    closed: bool
    whole: bool

    def images(self) -> list[Piece]:
        """All pieces, mirrored where the valve is whole."""
        return [piece.mirrored(*signs) for signs in (IMAGES if self.whole else IMAGES[:1]) for piece in self.pieces]


def shape_of(faces: WallFaces, name: str, whole: bool = True) -> Shape:
    """One of `SHAPES`, of the whole valve or the quarter that was computed."""
    rows, columns = _shares(faces.middle), _shares(faces.middle.swapaxes(0, 1))
    if name in ("inner", "middle", "outer"):
        return Shape((Piece(getattr(faces, name), (rows, columns)),), False, whole)
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
        pieces.append(Piece(np.stack([high[:, 0], low[:, 0]]), (LINE, rows)))
        if name == "wall":
            pieces.append(Piece(np.stack([low[:, -1], high[:, -1]]), (LINE, rows)))
    return Shape(tuple(pieces), True, whole)


def _shares(grid: np.ndarray) -> np.ndarray:
    """Mean chord length along the first direction of a grid (m, n, 3), from 0 to 1."""
    lengths = np.linalg.norm(np.diff(grid, axis=0), axis=2).mean(axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths)]) / lengths.sum()
