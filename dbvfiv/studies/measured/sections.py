"""Sections of the deformed wall, and how far measured points lie from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ...case.part import QUARTER, Part
from ...drawing.style import kilopascals
from ...drawing.views import closed_section, faces
from ...record.mesh import MeshData
from .curves import lacking, plain_rows, state_at


class Deformed(Protocol):
    """A state with a pressure, Pa, and nodal unknowns (nn, c)."""

    pressure: float
    nodal: np.ndarray


@dataclass(frozen=True, eq=False)
class WallSections:
    """Faces of the wall in states, at their own pressures alone: what folds between two states is not between their
    places.

    Attributes
    ----------
    mesh : MeshData
    states : sequence of Deformed
    """

    mesh: MeshData
    states: Sequence[Deformed]
    _known: dict[float, dict[str, np.ndarray] | None] = field(default_factory=dict, repr=False)

    def places(self, pressure: float) -> dict[str, np.ndarray] | None:
        """Faces, and the middle between them, as (rows, columns, 3) places of the part, m, at a pressure, Pa; None
        where there is no state.
        """
        if pressure not in self._known:
            self._known[pressure] = self._find(pressure)
        return self._known[pressure]

    def _find(self, pressure: float) -> dict[str, np.ndarray] | None:
        state = state_at(self.states, pressure)
        if state is None:
            return None
        inner, outer = faces(self.mesh, state.nodal)
        rows = self.mesh.rows
        return {"inner": inner[rows], "outer": outer[rows], "middle": 0.5 * (inner + outer)[rows]}

    def curve(self, pressure: float, z: float | None, face: str) -> np.ndarray | None:
        """(columns, 2) x and y, m, of a face in the plane of z, m, or at the edge of the lip, along the section of the
        part; None where there is none.
        """
        places = self.places(pressure)
        return None if places is None else cut(places[face], z)

    def centre_line(self, pressure: float, face: str) -> np.ndarray | None:
        """(rows, 2) z and y, m, of a face in the middle of the lips."""
        places = self.places(pressure)
        return None if places is None else places[face][:, self.mesh.part.centre(self.mesh.rows.shape[1]), [2, 1]]


def cut(places: np.ndarray, z: float | None) -> np.ndarray | None:
    """(columns, 2) x and y of a surface (rows, columns, 3), m, where it first meets the plane of z, m, from the lip on:
    at its edge without z, and where that has withdrawn behind the plane; None beyond its other end.
    """
    if z is None:
        return places[0, :, :2]
    along = places[:, :, 2]
    if z > along[-1].min():
        return None
    beyond = along > z
    before = np.maximum(np.argmax(beyond, axis=0) - 1, 0)
    column = np.arange(places.shape[1])
    low, high = places[before, column], places[before + 1, column]
    share = np.clip((z - low[:, 2]) / np.where(high[:, 2] > low[:, 2], high[:, 2] - low[:, 2], 1.0), 0.0, 1.0)
    reached = beyond.any(axis=0)
    found = np.where(reached[:, None], low + share[:, None] * (high - low), places[-1])
    return found[:, :2]


def distances(points: np.ndarray, curve: np.ndarray, part: Part = QUARTER) -> np.ndarray:
    """Signed distances (k,), m, of a curve (c, 2) of a part from points (k, 2) of any image of it: positive where the
    curve lies farther out.
    """
    folded = np.abs(points) if part.is_quarter else np.column_stack([points[:, 0], np.abs(points[:, 1])])
    begin, way = curve[:-1], np.diff(curve, axis=0)
    size = np.maximum(np.sum(way**2, axis=1), 1e-300)
    share = np.clip(np.einsum("kci,ci->kc", folded[:, None] - begin, way) / size, 0.0, 1.0)
    nearest = np.linalg.norm(begin + share[:, :, None] * way - folded[:, None], axis=2).min(axis=1)
    return np.where(_inside(folded, closed_section(curve, part)), nearest, -nearest)


def _inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Mask of points (k, 2) inside a polygon (c, 2): its edges cross a ray from there an odd number of times."""
    (x, y), a, b = points.T[:, :, None], polygon, np.roll(polygon, -1, axis=0)
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] != a[:, 1], b[:, 1] - a[:, 1], 1.0)
    return np.count_nonzero(crosses & (x < a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])), axis=1) % 2 == 1


@dataclass(frozen=True)
class MeasuredSection:
    """Measured points of one section at one pressure.

    Attributes
    ----------
    pressure : float, Pa
    z : float or None, m
        Of the plane, from the lip where the valve is at rest; None at the edge of the lip, wherever it has moved.
    face : str
        "inner", "outer" or "middle".
    points : (k, 2) array, m
    curve : (c, 2) array or None, m
        The computed section of a part; None without a state there or beyond the valve.
    part : Part
    """

    pressure: float
    z: float | None
    face: str
    points: np.ndarray
    curve: np.ndarray | None
    part: Part = QUARTER

    @property
    def distance(self) -> np.ndarray:
        """(k,) m, from the points to the computed section, positive where that lies farther out; NaN without one."""
        return (
            np.full(len(self.points), np.nan) if self.curve is None else distances(self.points, self.curve, self.part)
        )

    @property
    def title(self) -> str:
        """Title of the section: pressure, axial position and face."""
        place = "lip" if self.z is None else f"z = {1e3 * self.z:.4g} mm"
        return f"{kilopascals(self.pressure)}, {place}, {self.face}"

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers, None where there is nothing to compare."""
        distance, count = self.distance, len(self.points)
        mean, square, largest = distance.mean(), np.sqrt(np.mean(distance**2)), distance[np.argmax(np.abs(distance))]
        names = ("pressure", "z", "face", "points", "mean_distance", "root_mean_square", "largest_distance")
        return plain_rows(names, [(self.pressure, self.z, self.face, count, mean, square, largest)])[0] | {
            "points": plain_rows(("x", "y", "distance"), np.column_stack([self.points, distance]))
        }


@dataclass(frozen=True)
class MeasuredShapes:
    """Measured sections beside computed ones.

    Attributes
    ----------
    sections : tuple of MeasuredSection
    walls : WallSections
    """

    sections: tuple[MeasuredSection, ...]
    walls: WallSections

    @classmethod
    def of(cls, columns: Sequence[Sequence[Any]], walls: WallSections) -> MeasuredShapes:
        """Points in columns of pressure, z, face, x and y, sorted into sections."""
        groups: dict[tuple[float, float | None, str], list[tuple[float, float]]] = {}
        for pressure, z, face, x, y in zip(*columns):
            groups.setdefault((pressure, z, face), []).append((x, y))
        return cls(
            tuple(MeasuredSection(*at, np.array(xy), walls.curve(*at), walls.mesh.part) for at, xy in groups.items()),
            walls,
        )

    @property
    def distance(self) -> np.ndarray:
        """(k,) m, of all points."""
        return np.concatenate([section.distance for section in self.sections])

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the root mean square, mm, of each section."""
        square = [float(np.sqrt(np.mean(section.distance**2))) for section in self.sections]
        names = [
            f"{number}: {section.title}, {len(section.points)} point{'s' * (len(section.points) > 1)}"
            for number, section in enumerate(self.sections, 1)
        ]
        return "Sections, computed from measured, root mean square, mm", dict(zip(names, 1e3 * np.array(square)))

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers of each section."""
        return [section.summary() for section in self.sections]

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured sections."""
        known = 1e3 * self.distance[np.isfinite(self.distance)]
        count, sections = len(self.distance), len(self.sections)
        begin = f"Measured: {count} point{'s' * (count > 1)} of the wall in {sections} section{'s' * (sections > 1)}"
        without = lacking(self.walls.states, [section.pressure for section in self.sections])
        if not len(known):
            return f"{begin}, none at a pressure computed and within the valve{without}."
        return (
            f"{begin}; the computed wall lies {known.min():+.3g} to {known.max():+.3g} mm from them, outwards "
            f"positive, {np.sqrt(np.mean(known**2)):.3g} mm root mean square, at the {len(known)} at pressures "
            f"computed and within the valve{without}."
        )
