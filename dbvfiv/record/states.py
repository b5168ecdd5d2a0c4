"""Steady states in a record: numbers, shape and layers of one, and the load path that goes on from it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..case.model import Case
from ..model.load_steps import LoadSteps
from ..model.state import SteadyState
from ..model.valve import ValveModel
from ..shell.recovery import LayerFields, layer_fields
from .mesh import MeshData
from .record import Record
from .table import TEXT, Column, Shown, TableSpec, document_of

#: Quantities that a user reads off a state under any load.
OPENING = Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0")
LIP = Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0")
LARGEST = Column("max_displacement", "m", "Largest displacement of the mid-surface")
WHERE = Column("max_displacement_position", "m", "Where it occurs, position at rest", shape=(3,))
CONVERGED = Column("converged", "", "Whether the residual fell below the tolerance", "bool")
RESIDUAL = Column("residual", "", "Unbalanced force over pressure force", shown=Shown("residual", "", 9, ".1e"))
ENDED = (
    Column("rounding", "", "Relative residual that rounding alone explains"),
    Column("reason", "", "Why the iteration ended", TEXT),
)


def show_place(title: str, width: int, digits: int) -> Shown:
    """Print format of the largest displacement and its place."""

    def write(s: Any) -> str:
        return f"{s.max_displacement * 1e3:.{digits}f} at {s.max_displacement_position[2] * 1e3:.0f}"

    return Shown(title, "mm at z", width, write)


_FAR_END = "Static pressure at the flange over that of the surroundings; with a line in front that at its far end"
_LEVEL = "Weight of the fluid between flange and lips where gravity acts and these are higher"
_OUTLET = "Static pressure around the jet and the wall over that of the surroundings"
#: Numbers of a steady flow; the names are the keys of the JSON output.
SUMMARY = (
    Column("pressure", "Pa", _FAR_END, shown=Shown("pressure", "static kPa", 10, ".6g")),
    Column("head", "m", "The same as a head of the fluid", shown=Shown("head", "m", 8, ".4g")),
    Column("flange_pressure", "Pa", "Static pressure at the flange"),
    Column("line_loss", "m", "Head lost in a line in front of the valve"),
    Column("outlet_pressure", "Pa", _OUTLET),
    Column("recovered_pressure", "Pa", "By which it rises in a pipe behind the valve"),
    Column("downstream_velocity", "m/s", "Velocity in that pipe"),
    Column("tail_loss", "m", "Head lost in that pipe"),
    Column("level_pressure", "Pa", _LEVEL),
    Column("mass_flow", "kg/s", "Mass flow of the whole valve", shown=Shown("mass flow", "kg/s", 10, ".3f")),
    Column("volume_flow", "m^3/s", "Volume flow of the whole valve", shown=Shown("flow", "L/s", 9, ".5g")),
    Column("outlet_area", "m^2", "Flow area at the lip, whole valve", shown=Shown("lip area", "cm2", 9, ".3f")),
    Column("outlet_velocity", "m/s", "Jet velocity at the lip", shown=Shown("jet", "m/s", 7, ".3f")),
    replace(OPENING, shown=Shown("lip opening", "mm", 12, ".3f")),
    replace(LARGEST, shown=show_place("largest displacement", 21, 3)),
    LIP,
    WHERE,
    Column("stops", "", "Lip stops, or nodes with their inner face, in contact", "i8"),
    CONVERGED,
    Column(
        "iterations", "", "Newton iterations over all load steps that led here", "i8", Shown("iterations", "", 11, "")
    ),
    Column("load_steps", "", "Load steps that led here", "i8"),
    RESIDUAL,
    *ENDED,
)


def shown_summary(case: Case) -> tuple[Column, ...]:
    """`SUMMARY` as it is printed, in the units of a case: with a line in front, pressures at both of its ends."""
    if not case.has_line:
        return case.units.columns(SUMMARY)
    reservoir = case.drive.at == "reservoir"
    far = Shown("reservoir", "kPa", 10, ".6g") if reservoir else Shown("far end", "static kPa", 10, ".6g")
    shown = {"pressure": far, "flange_pressure": Shown("at the flange", "static kPa", 13, ".6g")}
    return case.units.columns(replace(column, shown=shown.get(column.name, column.shown)) for column in SUMMARY)


def by_row(mesh: MeshData) -> tuple[int, ...]:
    """Shape of numbers at each row of a mesh."""
    return (len(mesh.z),)


def by_node(mesh: MeshData) -> tuple[int, ...]:
    """Shape of displacements and rotations of each node."""
    return mesh.nodal_shape


def by_unknown(mesh: MeshData) -> tuple[int, ...]:
    """Shape of the free unknowns."""
    return (int(mesh.free.sum()),)


def by_layer(*components: int):
    """Function from a mesh to the shape of numbers of each element and layer."""
    return lambda mesh: (len(mesh.quads), len(mesh.layer_names), *components)


NODAL = Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node", shape=by_node)
STATION_AREA = Column("station_area", "m^2", "Flow area at each row, of the part that is computed", shape=by_row)
#: Fields of a state.
FIELDS = (
    NODAL,
    STATION_AREA,
    Column("station_velocity", "m/s", "Velocity at each row", shape=by_row),
    Column("station_pressure", "Pa", "Static pressure at each row, over that outside the wall", shape=by_row),
)
_STRAIN = "Green-Lagrange strain E11 E22 2E12 2E13 2E23, element mean"
_STRESS = "Second Piola-Kirchhoff stress S11 S22 S12 S13 S23, element mean"
_STRETCH = "Smallest and largest principal stretch in the plane of the layer"
_MISES = "Von Mises value of the Cauchy stress, largest in the element"
#: Layers, inside to outside, in their own axes.
LAYERS = (
    Column("layers/strain", "", _STRAIN, shape=by_layer(5)),
    Column("layers/stress", "Pa", _STRESS, shape=by_layer(5)),
    Column("layers/von_mises", "Pa", _MISES, shape=by_layer()),
    Column("layers/stretch", "", _STRETCH, shape=by_layer(2)),
)
#: Load path that goes on from a state.
PATH_RESTART = (
    Column("path/slope", "m/Pa, rad/Pa", "Derivative of the free unknowns by the pressure", shape=by_unknown),
    Column("path/step", "Pa", "Load step that is tried next"),
)
STATE_COLUMNS = (*SUMMARY, *FIELDS)


def state_table(name: str, mesh: MeshData, further: Iterable[Column] = ()) -> TableSpec:
    """Table of steady states on a mesh, with columns besides."""
    return TableSpec.on(mesh, name, (*STATE_COLUMNS, *LAYERS, *further))


def state_row(model: ValveModel, state: SteadyState) -> dict[str, Any]:
    """A state of a model as a row of such a table."""
    layers = SimpleNamespace(layers=layer_fields(model.shell, state.q))
    return {c.name: c.of(state) for c in STATE_COLUMNS} | {c.name: c.of(layers) for c in LAYERS}


def read_layers(record: Record, table: str, row: int) -> LayerFields:
    """Strains and stresses of the layers of a state."""
    found = {c.name.split("/")[1]: record.value(table, c.name, row) for c in LAYERS}
    return LayerFields(record.mesh.layer_names, **found)


def read_states(record: Record, table: str) -> list[SteadyState]:
    """States that a table of a record holds."""
    rows, compressed = record.table_rows(TableSpec(table, STATE_COLUMNS)), record.header.case.fluid.compressed
    return [SteadyState(q=record.mesh.restrict(row["nodal"]), compressed=compressed, **row) for row in rows]


def restart_row(path: LoadSteps) -> dict[str, Any]:
    """Restart columns of the state that a load path has just reached."""
    slope = np.full(path.model.size, np.nan) if path.slope is None else path.slope
    return {"path/slope": slope, "path/step": path.step}


def restore_path(path: LoadSteps, record: Record, table: str, row: int, state: SteadyState) -> None:
    """Restore a load path as it was at the state in a row of a table."""
    path.q, path.pressure = state.q, state.pressure
    slope = record.value(table, "path/slope", row)
    path.slope = slope if np.isfinite(slope).all() else None
    path.step = float(record.value(table, "path/step", row))


#: Of the hydraulics, those that stand beside the flow as well.
_COEFFICIENTS = ("loss_coefficient", "discharge_coefficient", "kv")


def summarise(state: SteadyState) -> dict[str, Any]:
    """Plain SI numbers of a state for JSON."""
    found, hydraulics = document_of(SUMMARY, state), state.hydraulics
    if hydraulics is None:
        return found
    return found | {name: getattr(hydraulics, name) for name in _COEFFICIENTS} | {"hydraulics": hydraulics.summary()}
