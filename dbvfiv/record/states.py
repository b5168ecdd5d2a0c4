"""Steady states in a record: what a user reads off one, its shape, its layers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ..case.model import Case
from ..model import ValveModel
from ..model.state import SteadyState
from ..shell.recovery import layer_fields
from .mesh import MeshData
from .record import Record, plain
from .table import TEXT, Column, Shown, TableSpec

#: What a user reads off a state; the names are the keys of the JSON output.
SUMMARY = (
    Column(
        "pressure",
        "Pa",
        "Static pressure at the flange over that of the surroundings; with a line in front that at its far end",
        shown=Shown("pressure", "static kPa", 10, lambda s: f"{s.pressure / 1e3:.6g}"),
    ),
    Column("head", "m", "The same as a head of the fluid", shown=Shown("head", "m", 8, lambda s: f"{s.head:.4g}")),
    Column("flange_pressure", "Pa", "Static pressure at the flange"),
    Column("line_loss", "m", "Head lost in a line in front of the valve"),
    Column("outlet_pressure", "Pa", "Static pressure around the jet and the wall over that of the surroundings"),
    Column("recovered_pressure", "Pa", "By which it rises in a pipe behind the valve"),
    Column("downstream_velocity", "m/s", "Velocity in that pipe"),
    Column("tail_loss", "m", "Head lost in that pipe"),
    Column(
        "level_pressure", "Pa", "Weight of the fluid between flange and lips where gravity acts and these are higher"
    ),
    Column(
        "mass_flow",
        "kg/s",
        "Mass flow of the whole valve",
        shown=Shown("mass flow", "kg/s", 10, lambda s: f"{s.mass_flow:.3f}"),
    ),
    Column(
        "volume_flow",
        "m^3/s",
        "Volume flow of the whole valve",
        shown=Shown("flow", "L/s", 9, lambda s: f"{s.volume_flow * 1e3:.5g}"),
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
        "Full clear opening between the inner faces of both lips at x = z = 0",
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
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("max_displacement_position", "m", "Where it occurs, position at rest"),
    Column("stops", "", "Lip stops, or nodes with their inner face, in contact", "i8"),
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


def shown_summary(case: Case) -> tuple[Column, ...]:
    """`SUMMARY` as it is printed: with a line in front, pressures at both of its ends."""
    if not case.has_line:
        return SUMMARY
    there = "reservoir" if case.drive.at == "reservoir" else "far end"
    shown = {
        "pressure": Shown(there, "kPa" if there == "reservoir" else "static kPa", 10, SUMMARY[0].shown.write),
        "flange_pressure": Shown("at the flange", "static kPa", 13, lambda s: f"{s.flange_pressure / 1e3:.6g}"),
    }
    return tuple(replace(column, shown=shown.get(column.name, column.shown)) for column in SUMMARY)


#: Fields of a state.
FIELDS = (
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("station_area", "m^2", "Flow area at each row, of the part that is computed"),
    Column("station_velocity", "m/s", "Velocity at each row"),
    Column("station_pressure", "Pa", "Static pressure at each row, over that outside the wall"),
)
#: Layers, inside to outside, in their own axes.
LAYERS = (
    Column("layers/strain", "", "Green-Lagrange strain E11 E22 2E12 2E13 2E23, element mean"),
    Column("layers/stress", "Pa", "Second Piola-Kirchhoff stress S11 S22 S12 S13 S23, element mean"),
    Column("layers/von_mises", "Pa", "Von Mises value of the Cauchy stress, largest in the element"),
    Column("layers/stretch", "", "Smallest and largest principal stretch in the plane of the layer"),
)
STATE_COLUMNS = (*SUMMARY, *FIELDS)


def layer_shapes(mesh: MeshData) -> dict[str, tuple[int, ...]]:
    """Shape of one row of each of `LAYERS` on a mesh."""
    size = (len(mesh.quads), len(mesh.layer_names))
    components = {"layers/strain": (5,), "layers/stress": (5,), "layers/von_mises": (), "layers/stretch": (2,)}
    return {name: (*size, *shape) for name, shape in components.items()}


def state_table(name: str, mesh: MeshData, further: Iterable[Column] = (), shapes=None) -> TableSpec:
    """Table of steady states on a mesh.

    Parameters
    ----------
    name : str
    mesh : MeshData
    further : iterable of Column
        Columns besides, with their `shapes`.
    """
    row_shapes = (
        layer_shapes(mesh)
        | dict.fromkeys((c.name for c in FIELDS), (len(mesh.z),))
        | {
            "max_displacement_position": (3,),
            "nodal": mesh.nodal_shape,
        }
    )
    return TableSpec(name, (*STATE_COLUMNS, *LAYERS, *further), row_shapes | (shapes or {}))


def state_row(model: ValveModel, state: SteadyState) -> dict[str, Any]:
    """A state of a model as a row of such a table."""
    layers = layer_fields(model.shell, state.q)
    return {c.name: getattr(state, c.name) for c in STATE_COLUMNS} | {
        c.name: getattr(layers, c.name.split("/")[1]) for c in LAYERS
    }


def read_states(record: Record, table: str) -> list[SteadyState]:
    """States that a table of a record holds."""
    columns = {c.name: record.column(table, c.name) for c in STATE_COLUMNS}
    states = []
    for i in range(record.rows(table)):
        row = {name: plain(values[i]) for name, values in columns.items()}
        states.append(SteadyState(q=record.mesh.restrict(row["nodal"]), **row))
    return states


#: Of the hydraulics, those that stand beside the flow as well.
_COEFFICIENTS = ("loss_coefficient", "discharge_coefficient", "kv")


def summarise(state: SteadyState) -> dict[str, Any]:
    """Plain SI numbers of a state for JSON."""
    values = {c.name: getattr(state, c.name) for c in SUMMARY}
    found = {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
    hydraulics = state.hydraulics
    if hydraulics is None:
        return found
    return found | {name: getattr(hydraulics, name) for name in _COEFFICIENTS} | {"hydraulics": hydraulics.summary()}
