"""Equilibria over a list of pressures: what their file holds and what can be read off them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from ...model import ValveModel
from ...model.state import SteadyState
from ...plots import deformed, discharge, layers, passage, shapes
from ...record.fields import layer_field_names, motion
from ...record.layout import TEXT, Column, Shown
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record, plain
from ...record.table import TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step
from ...record.whole_valve import WholeValve
from ...shell.recovery import LayerFields, layer_fields
from ..result import StudyResult

#: What a user reads off a state; the names are the keys of the JSON output.
SUMMARY = (
    Column("pressure", "Pa", "Inlet pressure", shown=Shown("pressure", "kPa", 9, lambda s: f"{s.pressure / 1e3:.6g}")),
    Column(
        "mass_flow",
        "kg/s",
        "Mass flow of the whole valve",
        shown=Shown("mass flow", "kg/s", 10, lambda s: f"{s.mass_flow:.3f}"),
    ),
    Column(
        "outlet_area",
        "m^2",
        "Flow area at the lip, whole valve",
        shown=Shown("lip area", "cm2", 9, lambda s: f"{s.outlet_area * 1e4:.3f}"),
    ),
    Column(
        "outlet_velocity",
        "m/s",
        "Jet velocity at the lip",
        shown=Shown("jet", "m/s", 7, lambda s: f"{s.outlet_velocity:.3f}"),
    ),
    Column(
        "lip_opening",
        "m",
        "Displacement in y of the lip at x = z = 0",
        shown=Shown("lip opening", "mm", 12, lambda s: f"{s.lip_opening * 1e3:.3f}"),
    ),
    Column(
        "max_displacement",
        "m",
        "Largest displacement of the mid-surface",
        shown=Shown(
            "largest displacement",
            "mm at z",
            21,
            lambda s: f"{s.max_displacement * 1e3:.3f} at {s.max_displacement_position[2] * 1e3:.0f}",
        ),
    ),
    Column("max_displacement_position", "m", "Where it occurs, position at rest"),
    Column("stops", "", "Lip stops in contact", "i8"),
    Column("converged", "", "Whether the residual fell below the tolerance", "bool"),
    Column(
        "iterations",
        "",
        "Newton iterations over all load steps that led here",
        "i8",
        shown=Shown("iterations", "", 11, lambda s: f"{s.iterations}"),
    ),
    Column("load_steps", "", "Load steps that led here", "i8"),
    Column(
        "residual",
        "",
        "Unbalanced force over pressure force",
        shown=Shown("residual", "", 9, lambda s: f"{s.residual:.1e}"),
    ),
    Column("rounding", "", "Relative residual that rounding alone explains"),
    Column("reason", "", "Why the iteration ended", TEXT),
)
#: Fields of a state.
FIELDS = (
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("station_area", "m^2", "Flow area of a quarter at each row"),
    Column("station_velocity", "m/s", "Velocity at each row"),
    Column("station_pressure", "Pa", "Pressure at each row"),
)
#: Layers, inside to outside, in their own axes.
LAYERS = (
    Column("layers/strain", "", "Green-Lagrange strain E11 E22 2E12 2E13 2E23, element mean"),
    Column("layers/stress", "Pa", "Second Piola-Kirchhoff stress S11 S22 S12 S13 S23, element mean"),
    Column("layers/von_mises", "Pa", "Von Mises value of the Cauchy stress, largest in the element"),
    Column("layers/stretch", "", "Smallest and largest principal stretch in the plane of the layer"),
)
#: Where the walk over the pressures goes on from.
PATH = (
    Column("path/slope", "m/Pa, rad/Pa", "Derivative of the free unknowns by the pressure"),
    Column("path/step", "Pa", "Load step that is tried next"),
)
STATES = "states"
STATE_COLUMNS = (*SUMMARY, *FIELDS)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a steady result on a mesh."""
    elements, count = len(mesh.quads), len(mesh.layer_names)
    row_shapes = dict.fromkeys((c.name for c in FIELDS), (len(mesh.z),)) | {
        "max_displacement_position": (3,),
        "nodal": (len(mesh.nodes), 5),
        "path/slope": (int(mesh.free.sum()),),
        "layers/strain": (elements, count, 5),
        "layers/stress": (elements, count, 5),
        "layers/von_mises": (elements, count),
        "layers/stretch": (elements, count, 2),
    }
    return (TableSpec(STATES, (*STATE_COLUMNS, *PATH, *LAYERS), row_shapes),)


def row_of(model: ValveModel, state: SteadyState) -> dict[str, Any]:
    """A state of a model as a row of the table."""
    layers_ = layer_fields(model.shell, state.q)
    return {c.name: getattr(state, c.name) for c in STATE_COLUMNS} | {
        c.name: getattr(layers_, c.name.split("/")[1]) for c in LAYERS
    }


def read_states(record: Record, table: str = STATES) -> list[SteadyState]:
    """States that a record holds."""
    columns = {c.name: record.column(table, c.name) for c in STATE_COLUMNS}
    states = []
    for i in range(record.rows(table)):
        row = {name: plain(values[i]) for name, values in columns.items()}
        states.append(SteadyState(q=record.mesh.restrict(row["nodal"]), **row))
    return states


@dataclass(frozen=True, eq=False)
class State(SteadyState):
    """An equilibrium of a result, and what can be asked about it.

    Attributes
    ----------
    results : SteadyResult
        The run it belongs to.
    index : int
        Its place there.

    Examples
    --------
    >>> state = dbvfiv.load().steady(pressure=36e3)     # doctest: +SKIP
    >>> state.mass_flow, state.layers.von_mises.max()   # doctest: +SKIP
    """

    results: SteadyResult = field(repr=False)
    index: int = field(repr=False)

    def __repr__(self) -> str:
        numbers = f"{self.mass_flow:.4g} kg/s, lip opening {self.lip_opening * 1e3:.4g} mm"
        return f"<State at {self.pressure / 1e3:.6g} kPa: {numbers}>"

    @cached_property
    def layers(self) -> LayerFields:
        """Strains and stresses of the layers."""
        record = self.results.record
        found = {c.name.split("/")[1]: record.value(STATES, c.name, self.index) for c in LAYERS}
        return LayerFields(record.mesh.layer_names, **found)

    @property
    def model(self) -> ValveModel:
        """The coupled model it is a state of."""
        return self.results.model

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        values = {c.name: getattr(self, c.name) for c in SUMMARY}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    def solution(self) -> SteadyState:
        """The state by itself, to start from for instance."""
        return SteadyState(**{f.name: getattr(self, f.name) for f in fields(SteadyState)})

    def plot(self, folder: str | Path = ".", format: str = "png") -> list[Path]:
        """Write the figures of this state alone."""
        return self.results.only(self).plot(folder, format)

    def save(self, path: str | Path) -> Path:
        """Write a result file with this state alone."""
        return self.results.only(self).save(path)

    def export(self, path: str | Path, quarter: bool = False, deformed: bool = False) -> Path:
        """Write this state for ParaView."""
        return self.results.only(self).export(path, quarter, deformed)


class SteadyResult(StudyResult):
    """Equilibria in the order they were found.

    Attributes
    ----------
    states : tuple of State
    """

    kind = "steady"

    @cached_property
    def states(self) -> tuple[State, ...]:
        found = enumerate(read_states(self.record))
        return tuple(State(**vars(state), results=self, index=i) for i, state in found)

    def only(self, *states: State) -> SteadyResult:
        """A result with some of its states."""
        (table,) = tables_of(self.mesh)
        record = GrowingRecord(self.header, self.mesh, (table,))
        for sentence in self.warnings:
            record.warn(sentence)
        for state in states:
            record.append(STATES, {c.name: self.record.value(STATES, c.name, state.index) for c in table.columns})
        record.conclude(self.complete)
        return SteadyResult(record, self.session)

    def nearest(self, pressure: float) -> State:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    def summary(self) -> dict[str, Any]:
        """Keys as scripts rely on, in SI units."""
        return {
            "points": [state.summary() for state in self.states],
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def lines(self) -> list[str]:
        return [*printed_head(SUMMARY), *(printed_row(SUMMARY, state) for state in self.states)]

    def remarks(self) -> list[str]:
        return []

    def shortfall(self) -> str | None:
        if not self.failures:
            return None
        asked = len(self.case.steady.pressures)
        if not self.states:
            return "No pressure was reached"
        kept = f"; those states are kept in {self.path}" if self.path else ""
        return f"{len(self.states)} of {asked} pressures were reached{kept}"

    def drawers(self, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
        """Figures over the pressure, and of one state: that of the highest pressure unless another is chosen."""
        if not self.states:
            return
        yield from discharge.draw(self)
        yield from shapes.draw(self)
        yield from passage.draw(self)
        yield from deformed.draw(self, pressure)
        yield from layers.draw(self, pressure)

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        ordered = sorted({state.pressure: state for state in self.states}.values(), key=lambda state: state.pressure)
        return StateSteps(self, ordered, valve)


@dataclass(frozen=True)
class StateSteps(Sequence):
    """States as steps, made one at a time; "time" is the pressure in Pa."""

    result: SteadyResult
    states: Sequence[State]
    valve: WholeValve

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, number: int) -> Step:
        state, valve, mesh = self.states[number], self.valve, self.result.mesh
        stress = state.layers
        rows = mesh.element_rows()
        cell_data = {
            "thickness": mesh.thickness,
            "pressure": 0.5 * (state.station_pressure[rows] + state.station_pressure[rows + 1]),
            "velocity": 0.5 * (state.station_velocity[rows] + state.station_velocity[rows + 1]),
        }
        for name, values in zip(layer_field_names(mesh, "von_mises"), stress.von_mises.T):
            cell_data[name] = values
        for name, values in zip(layer_field_names(mesh, "largest_stretch"), stress.stretch[:, :, 1].T):
            cell_data[name] = values
        return Step(
            state.pressure,
            motion(mesh, valve, state.nodal),
            {name: valve.cells(values) for name, values in cell_data.items()},
        )
