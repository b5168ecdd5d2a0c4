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
    """Pieces of surface of the part that is computed, and its images.

    Attributes
    ----------
    pieces : tuple of Piece
        Points of two pieces that meet are the same.
    closed : bool
        Whether they bound a body.
    signs : tuple of (int, int)
        Of x and y in the images: those of the whole valve, or of the part alone.
    """

    pieces: tuple[Piece, ...]
    closed: bool
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
