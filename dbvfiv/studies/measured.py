"""Measured data in a record, and beside what was computed: curves over the pressure, pressures along the axis, sections
of the deformed wall.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..case.measured import AREA, DISCHARGE, SHAPE, TAPS, MeasuredTable, check_kind, read_measured
from ..case.part import QUARTER, Part
from ..drawing.style import kilopascals
from ..drawing.views import closed_section
from ..errors import CaseError
from ..record.mesh import MeshData
from ..record.record import GrowingRecord
from ..record.vtkhdf import faces
from ..texts import json_value

#: Kind of the note of a record that holds a table.
NOTE = "measured"
#: How near, of the pressure, a state must be to be that of a measured point.
_SAME = 1e-9


def keep_measured(
    record: GrowingRecord, key: str, files: Sequence[Path], kinds: Collection[str], density: float
) -> None:
    """Put the tables of a case into a record that has none yet, so that a result has them when their files have gone.
    Raises CaseError if a file has gone or holds something else.

    Parameters
    ----------
    key : str
        Of the case, for messages.
    files : sequence of Path
    kinds : collection of str
        What they may hold, see `dbvfiv.case.measured`.
    density : float, kg/m3
    """
    if record.notes(NOTE):
        return
    tables = []
    for path in files:
        try:
            tables.append(read_measured(path, density))
            check_kind(tables[-1], kinds)
        except ValueError as error:
            raise CaseError(f"{key} is given as {str(path)!r}, {error}.", key) from None
    for table in tables:
        record.note(NOTE, name=table.name, columns={name: list(values) for name, values in table.columns.items()})


def _joined(tables: Iterable[MeasuredTable], kind: str, *names: str) -> list[tuple[Any, ...]] | None:
    """Columns of all tables of a kind, one below the other; None where there is no such table."""
    chosen = [table for table in tables if kind in table.holds]
    return [tuple(value for table in chosen for value in table.columns[name]) for name in names] if chosen else None


def plain_rows(names: tuple[str, ...], rows: Iterable[Iterable[Any]]) -> list[dict[str, Any]]:
    """Rows for JSON: words as they are, None for what is not finite."""
    return [{name: json_value(value) for name, value in zip(names, row)} for row in rows]


def _spread(values: np.ndarray) -> str:
    low, high = f"{values.min():+.3g}", f"{values.max():+.3g}"
    return low if low == high else f"{low} to {high}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number > 1)}"


# -- curves and taps


@dataclass(frozen=True)
class Quantity:
    """A quantity measured over the pressure."""

    what: str  #: For people.
    key: str  #: Its name in measured tables and in JSON.
    column: str  #: Its name in results.
    unit: str  #: In which people are told of it.
    factor: float = 1.0  #: From SI to that.


FLOW = Quantity("flow", "mass_flow", "mass_flow", "kg/s")
LIP_AREA = Quantity("lip area", "area", "outlet_area", "cm2", 1e4)
PASSAGE = Quantity("passage left", "area", "least_opening", "mm2", 1e6)


@dataclass(frozen=True)
class MeasuredCurve:
    """Points (k,) of a measured curve, SI, and what was computed there; NaN beyond the states."""

    quantity: Quantity
    pressure: np.ndarray
    measured: np.ndarray
    computed: np.ndarray

    @property
    def excess(self) -> np.ndarray:
        """Computed less measured; NaN where there is nothing to compare."""
        return self.computed - self.measured

    @property
    def difference(self) -> np.ndarray:
        """Computed over measured less 1; NaN where there is nothing to compare."""
        return self.computed / np.where(self.measured > 0, self.measured, np.nan) - 1.0

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the deviation, %, at each measured point."""
        points = enumerate(zip(self.pressure, self.quantity.factor * self.measured), 1)
        names = [f"{number}: {p / 1e3:.6g} kPa, {value:.5g} {self.quantity.unit}" for number, (p, value) in points]
        return f"Computed over measured {self.quantity.what}, %", dict(zip(names, 100 * self.difference))

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers, None where there is nothing to compare."""
        key = self.quantity.key
        rows = zip(self.pressure, self.measured, self.computed, self.difference)
        return plain_rows(("pressure", key, f"computed_{key}", "difference"), rows)

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured points."""
        known, what = self.difference[np.isfinite(self.difference)], self.quantity.what
        begin = f"Measured: {_count(len(self.pressure), 'point')} of {what}"
        if not len(known):
            return f"{begin}, none within the pressures computed."
        spread = _spread(100 * known)
        return f"{begin}; computed {what} over measured {spread} % at the {len(known)} within the pressures computed."


def static_pressure(state: Any, case: Any, z: np.ndarray) -> np.ndarray:
    """Static pressure (m,) of a state at stations, Pa, over that of the surroundings at the lips, as drive.pressure is;
    z (m,), m, is their distance from the lips.
    """
    return state.station_pressure + state.outlet_pressure + case.outside_level(z - z[0])


@dataclass(frozen=True)
class MeasuredTaps:
    """Static pressures measured along the axis, and those computed there."""

    pressure: np.ndarray  #: (k,), Pa; as drive.pressure has it.
    z: np.ndarray  #: (k,), m; from the lip, where the valve is at rest.
    #: measured and computed: (k,), Pa; over that of the surroundings; NaN where there is no state of that pressure, and
    #: beyond the valve.
    measured: np.ndarray
    computed: np.ndarray
    without: str = ""  #: Clause on pressures that were not computed.

    @classmethod
    def of(cls, columns: Sequence[Sequence[float]], result: Any) -> MeasuredTaps:
        """Columns of pressure, z and tap beside states that flow, whose pressures run straight between stations."""
        pressure, z, measured = np.array(columns)
        flowing, stations = [state for state in result.states if state.mass_flow > 0], result.mesh.z
        computed = np.full(len(z), np.nan)
        for p in set(pressure):
            chosen, state = pressure == p, state_at(flowing, p)
            if state is not None:
                along = static_pressure(state, result.case, stations)
                computed[chosen] = np.interp(z[chosen], stations, along, left=np.nan, right=np.nan)
        return cls(pressure, z, measured, computed, lacking(flowing, pressure))

    @property
    def excess(self) -> np.ndarray:
        """Computed less measured, Pa; NaN where there is nothing to compare."""
        return self.computed - self.measured

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the deviation, kPa, at each measured point."""
        places = enumerate(zip(self.pressure / 1e3, 1e3 * self.z, self.measured / 1e3), 1)
        names = [f"{number}: {p:.6g} kPa, z = {z:.4g} mm, {tap:.5g} kPa" for number, (p, z, tap) in places]
        return "Pressure along the axis, computed less measured, kPa", dict(zip(names, self.excess / 1e3))

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers, None where there is nothing to compare."""
        rows = zip(self.pressure, self.z, self.measured, self.computed, self.excess)
        return plain_rows(("pressure", "z", "tap", "computed_tap", "difference"), rows)

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured pressures along the axis."""
        share = self.excess / np.where(self.pressure > 0, self.pressure, np.nan)
        known = np.isfinite(share)
        begin = f"Measured: {_count(len(self.z), 'pressure')} along the axis"
        if not known.any():
            return f"{begin}, none at a pressure computed and within the valve{self.without}."
        return (
            f"{begin}; computed less measured {_spread(self.excess[known] / 1e3)} kPa, {_spread(100 * share[known])} % "
            f"of the pressure that drives the flow, at the {known.sum()} at pressures computed and within the "
            f"valve{self.without}."
        )


def state_at(states: Sequence[Any], pressure: float) -> Any:
    """The state of a pressure, Pa; None if there is none."""
    return next((state for state in states if abs(state.pressure - pressure) <= _SAME * pressure), None)


def lacking(states: Sequence[Any], pressures: Iterable[float]) -> str:
    """A clause on the pressures, Pa, of which there is no state; empty if there are all."""
    missing = sorted({pressure for pressure in pressures if state_at(states, pressure) is None})
    named = ", ".join(f"{pressure / 1e3:.6g}" for pressure in missing[:5]) + (", ..." if len(missing) > 5 else "")
    return f"; states at {named} kPa would have to be computed for the others" if missing else ""


# -- sections of the wall


@dataclass(frozen=True, eq=False)
class WallSections:
    """Faces of the wall in states, at their own pressures alone: what folds between two states is not between their
    places. States have a pressure, Pa, and nodal unknowns (nn, c).
    """

    mesh: MeshData
    states: Sequence[Any]
    _known: dict[float, dict[str, np.ndarray] | None] = field(default_factory=dict, repr=False)

    def places(self, pressure: float) -> dict[str, np.ndarray] | None:
        """Faces, and the middle between them, as (rows, columns, 3) places of the part, m, at a pressure, Pa; None
        where there is no state.
        """
        if pressure not in self._known:
            state, rows = state_at(self.states, pressure), self.mesh.rows
            found = None
            if state is not None:
                inner, outer = faces(self.mesh, state.nodal)
                found = {"inner": inner[rows], "outer": outer[rows], "middle": 0.5 * (inner + outer)[rows]}
            self._known[pressure] = found
        return self._known[pressure]

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
    """Measured points of one section at one pressure."""

    pressure: float  #: Pa.
    #: m; of the plane, from the lip where the valve is at rest; None at the edge of the lip, wherever it has moved.
    z: float | None
    face: str  #: "inner", "outer" or "middle".
    points: np.ndarray  #: (k, 2), m.
    #: (c, 2) or None, m; the computed section of a part; None without a state there or beyond the valve.
    curve: np.ndarray | None
    part: Part = QUARTER

    @property
    def distance(self) -> np.ndarray:
        """(k,) m, from the points to the computed section, positive where that lies farther out; NaN without one."""
        if self.curve is None:
            return np.full(len(self.points), np.nan)
        return distances(self.points, self.curve, self.part)

    @property
    def root_mean_square(self) -> float:
        """Root mean square of the distances, m."""
        return float(np.sqrt(np.mean(self.distance**2)))

    @property
    def title(self) -> str:
        """Title of the section: pressure, axial position and face."""
        place = "lip" if self.z is None else f"z = {1e3 * self.z:.4g} mm"
        return f"{kilopascals(self.pressure)}, {place}, {self.face}"

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers, None where there is nothing to compare."""
        distance = self.distance
        names = ("pressure", "z", "face", "mean_distance", "root_mean_square", "largest_distance")
        largest = distance[np.argmax(np.abs(distance))]
        row = (self.pressure, self.z, self.face, distance.mean(), self.root_mean_square, largest)
        points = plain_rows(("x", "y", "distance"), np.column_stack([self.points, distance]))
        return plain_rows(names, [row])[0] | {"points": points}


@dataclass(frozen=True)
class MeasuredShapes:
    """Measured sections beside computed ones."""

    sections: tuple[MeasuredSection, ...]
    walls: WallSections

    @classmethod
    def of(cls, columns: Sequence[Sequence[Any]], walls: WallSections) -> MeasuredShapes:
        """Points in columns of pressure, z, face, x and y, sorted into sections."""
        groups: dict[tuple[float, float | None, str], list[tuple[float, float]]] = {}
        for pressure, z, face, x, y in zip(*columns):
            groups.setdefault((pressure, z, face), []).append((x, y))
        part = walls.mesh.part
        return cls(
            tuple(MeasuredSection(*at, np.array(xy), walls.curve(*at), part) for at, xy in groups.items()), walls
        )

    @property
    def wide(self) -> list[MeasuredSection]:
        """Sections of more than one point."""
        return [section for section in self.sections if len(section.points) > 1]

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the root mean square, mm, of each section."""
        named = {
            f"{number}: {section.title}, {_count(len(section.points), 'point')}": 1e3 * section.root_mean_square
            for number, section in enumerate(self.sections, 1)
        }
        return "Sections, computed from measured, root mean square, mm", named

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers of each section."""
        return [section.summary() for section in self.sections]

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured sections."""
        distance = 1e3 * np.concatenate([section.distance for section in self.sections])
        known = distance[np.isfinite(distance)]
        sections = _count(len(self.sections), "section")
        begin = f"Measured: {_count(len(distance), 'point')} of the wall in {sections}"
        without = lacking(self.walls.states, [section.pressure for section in self.sections])
        if not len(known):
            return f"{begin}, none at a pressure computed and within the valve{without}."
        return (
            f"{begin}; the computed wall lies {known.min():+.3g} to {known.max():+.3g} mm from them, outwards "
            f"positive, {np.sqrt(np.mean(known**2)):.3g} mm root mean square, at the {len(known)} at pressures "
            f"computed and within the valve{without}."
        )


# -- beside a result

#: Keys of the JSON document.
_KEYS = {DISCHARGE: "measured", AREA: "measured_area", SHAPE: "measured_sections", TAPS: "measured_taps"}


class Measured:
    """Measurements beside a result, by the kinds that it may have; `parts` holds those that there are.

    Parameters
    ----------
    result : StudyResult
        With `states`, and ``at(pressure, column)`` for its numbers at pressures (k,), Pa.
    kinds : mapping
        From the kinds that the study takes, see `dbvfiv.case.measured`, to the `Quantity` of those over the pressure.
    """

    def __init__(self, result: Any, kinds: Mapping[str, Quantity | None]):
        self.kinds = tuple(kinds)
        self._tables = [
            MeasuredTable(note["name"], {key: tuple(column) for key, column in note["columns"].items()})
            for note in result.record.notes(NOTE)
        ]
        self.parts: dict[str, Any] = {}
        for kind, quantity in kinds.items():
            names = {SHAPE: ("pressure", "z", "face", "x", "y"), TAPS: ("pressure", "z", "tap")}.get(kind)
            columns = _joined(self._tables, kind, *(names or ("pressure", quantity.key)))
            if columns is None:
                continue
            if kind == SHAPE:
                self.parts[kind] = MeasuredShapes.of(columns, WallSections(result.mesh, result.states))
            elif kind == TAPS:
                self.parts[kind] = MeasuredTaps.of(columns, result)
            else:
                pressure, values = np.array(columns, float)
                self.parts[kind] = MeasuredCurve(quantity, pressure, values, result.at(pressure, quantity.column))

    @property
    def discharge(self) -> MeasuredCurve | None:
        """Mass flow, kg/s, over the pressure."""
        return self.parts.get(DISCHARGE)

    @property
    def area(self) -> MeasuredCurve | None:
        """Flow area at the lip, or narrowest passage left, m2, over the pressure."""
        return self.parts.get(AREA)

    @property
    def shapes(self) -> MeasuredShapes | None:
        """Sections of the wall."""
        return self.parts.get(SHAPE)

    @property
    def taps(self) -> MeasuredTaps | None:
        """Static pressures along the axis."""
        return self.parts.get(TAPS)

    @property
    def discharged_area(self) -> np.ndarray | None:
        """(k, 2) mass flow, kg/s, and area, m2, of the rows of tables that have both; None without any."""
        both = _joined([t for t in self._tables if AREA in t.holds], DISCHARGE, "mass_flow", "area")
        return None if both is None else np.array(both).T

    def sentences(self) -> list[str]:
        """Sentences that compare each measured quantity with the computed one."""
        return [part.sentence() for part in self.parts.values()]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; empty lists of what was not measured."""
        return {_KEYS[kind]: self.parts[kind].summary() if kind in self.parts else [] for kind in self.kinds}
