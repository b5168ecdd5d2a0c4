"""Storage of a run in its record: a row of the history for each step, full states, restart points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from time import monotonic
from typing import Any

import numpy as np

from ...errors import CaseError
from ...flow.gas_stepping import GasState, packed_size
from ...flow.line_stepping import LineState
from ...model import ValveModel
from ...motion.control import RunOptions
from ...motion.state import MotionState
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ...shell import Memory, WallMemory
from ..case import Case

HISTORY, STATES, RESTART = "history", "states", "restart"

#: One number a step; of the whole valve.
SCALARS = (
    Column("time", "s", "Time"),
    Column("inlet_pressure", "Pa", "Static pressure at the flange; with a line in front the pressure at its far end"),
    Column("mass_flow", "kg/s", "Mass flow leaving at the lip"),
    Column("inlet_mass_flow", "kg/s", "Mass flow entering at the flange"),
    Column("outlet_area", "m^2", "Flow area at the lip; below zero where the lips cross"),
    Column("smallest_area", "m^2", "Smallest flow area of all rows"),
    Column("throat", "m", "Axial position of the smallest area, from the lip"),
    Column("inlet_velocity", "m/s", "Velocity at the flange"),
    Column("outlet_velocity", "m/s", "Jet velocity at the lip"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("lip_velocity", "m/s", "Rate of the lip displacement"),
    Column("stops", "", "Lip stops, or nodes with their inner face, in contact, of the computed part"),
    Column("kinetic_energy", "J", "Kinetic energy of the wall"),
    Column("outside_energy", "J", "Kinetic energy of the fluid outside the wall"),
    Column(
        "outside_renewed",
        "J",
        "Energy that renewals of the added mass of that fluid have put in since the start, as the shape moved on",
    ),
    Column("strain_energy", "J", "Strain energy of the wall"),
    Column("stop_energy", "J", "Energy stored in the lip stops, or in the contact of the inner faces"),
    Column("weight_energy", "J", "Potential of the wall's weight over that at rest"),
    Column("pressure_work", "J", "Work of the pressure on the wall since the start"),
    Column("dissipation", "J", "Energy lost to Rayleigh damping since the start"),
    Column(
        "numerical_loss",
        "J",
        "Energy that the numerical damping of the scheme took since the start; below zero where it gave",
    ),
    Column(
        "balance",
        "J",
        "Energy gained since the start, by Maxwell branches and the fluid outside too, less work plus dissipation, "
        "what faces that part lost and what numerical damping took, and less what renewals put in: what steps of "
        "finite length and corrections left out add or take",
    ),
    Column("step", "s", "Length of the step"),
    Column("evaluations", "", "Residuals evaluated in the step"),
)
#: One number a row of the mesh and step; of the computed part.
PROFILES = (
    Column(
        "station_pressure",
        "Pa",
        (
            "Pressure at each row, lip first, where the step meets the equations: halfway through it without "
            "numerical damping"
        ),
        "f4",
    ),
    Column("station_area", "m^2", "Flow area at each row", "f4"),
    Column("centre_line", "m", "Displacement in y of the line x = 0 at each row", "f4"),
)
#: One number a group of layers that relax alike and step; of the whole valve, and there where the wall relaxes.
RELAXING = (
    Column("branch_energy", "J", "Energy that the Maxwell branches of each group of layers hold"),
    Column("branch_loss", "J", "Energy that they have dissipated since the start"),
)
#: Energy of an elastic line, of the whole valve, there where the case has one.
LINE = (
    Column("line_kinetic_energy", "J", "Kinetic energy of the fluid in the line"),
    Column("line_elastic_energy", "J", "Energy of its compression and of the pipe's wall"),
    Column("line_supply", "J", "Energy taken in at the far end of the line since the start"),
    Column("line_dissipation", "J", "Energy lost to friction and losses in the line since the start"),
    Column("line_work", "J", "Energy that left it at the flange since the start, by pressure and velocity head"),
)
#: Of a fluid that is compressed, of the whole valve, there where the case has one.
GAS = (
    Column("gas_energy", "J", "Kinetic energy and energy of compression of the fluid in the valve"),
    Column("gas_supply", "J", "Energy that it took in at the flange since the start, by enthalpy and velocity head"),
    Column("gas_outflow", "J", "Energy that left it at the lips since the start, likewise"),
    Column("gas_work", "J", "Work that it did on the wall since the start"),
    Column("gas_loss", "J", "Energy that it lost in the valve since the start: by friction, jets inside, and shocks"),
    Column("gas_step_loss", "J", "Energy that differences in time took from it since the start; below zero: gave"),
    Column("gas_mesh_loss", "J", "Energy that the cells between rows took from it since the start; below zero: gave"),
    Column("mach", "", "Largest Mach number in the valve"),
)
#: Contact of the inner faces, there where the case has it.
FACES = (
    Column("contact_loss", "J", "Energy that touching faces took and did not give back since the start, whole valve"),
    Column("contact_force", "N", "Force with which the two walls press on each other"),
    Column("penetration", "m", "Depth to which faces are pressed into the closing plane"),
)
#: Full states.
STATE_COLUMNS = (
    Column("time", "s", "Time"),
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("nodal_rate", "m/s, rad/s", "Their rates"),
    Column("station_pressure", "Pa", "Pressure at each row"),
    Column("station_area", "m^2", "Flow area at each row, of the part that is computed"),
    Column("inlet_velocity", "m/s", "Velocity at the flange"),
)
#: The state of a motion between two steps, see `dbvfiv.motion.state.MotionState`.
MOTION_COLUMNS = (
    Column("time", "s", "Time"),
    Column("speed", "m/s", "Inlet velocity"),
    Column("q", "m, rad", "Free unknowns"),
    Column("v", "m/s, rad/s", "Their velocities"),
    Column("a", "m/s^2, rad/s^2", "Their accelerations"),
    Column("force", "N, N m", "Internal force of the computed part"),
    Column("force_rate", "N/s, N m/s", "The scheme's value of its rate"),
    Column("load", "N, N m", "Force of the fluid where the equations were last met"),
    Column("psi", "m^2/s", "Integral of the flow's speed from the inlet, at each row"),
    Column("psi_rate", "m^2/s^2", "The scheme's value of its rate"),
)
#: What a wall that relaxes remembers, in the order of the arguments of `dbvfiv.shell.memory.WallMemory.at`.
MEMORY_COLUMNS = (
    Column("branches", "N/m, N", "Section resultants of each Maxwell branch at the Gauss points"),
    Column("stretch", "1, 1/m", "Section strains that the springs of each relaxation time hold there"),
    Column("branch_work", "J", "Work done against the branches of each group of the computed part since the start"),
    Column("branch_loss", "J", "What of it they have dissipated"),
    Column("branch_energy", "J", "Energy that they hold"),
)
#: Waves in an elastic line, as `dbvfiv.flow.line_stepping.LineState` packs them.
LINE_COLUMNS = (Column("line", "m/s, m/s^2, J", "Velocities, scaled pressures, their rates and books of energy"),)
#: A fluid that is compressed, as `dbvfiv.flow.gas_stepping.GasState` packs it.
GAS_COLUMNS = (
    Column("gas", "m/s, m^2/s, m^3, m^2, J", "Unknowns, what balances hold and its rates, areas and books of energy"),
)
#: How far a run has come.
COUNTS = (
    Column("steps", "", "Steps made", "i8"),
    Column("saved", "", "Full states kept", "i8"),
)
#: Books of energy, step control and the mode of a kick.
BOOKS = (
    Column("work", "J", "Work of the pressure on the computed part since the start"),
    Column("dissipation", "J", "Energy of the computed part lost to damping since the start"),
    Column("energy", "J", "Energy of the computed part at the start"),
    Column("renewed", "J", "Energy of the computed part that renewals of the added mass outside have put in"),
    Column("control", "", "Numbers of the step control"),
    Column("eigenvalue", "1/s", "Real and imaginary part of that of the mode of a kick"),
)
#: What numerical damping took; earlier files are without it.
NUMERICAL_BOOKS = (Column("numerical_loss", "J", "Energy of the computed part that numerical damping took"),)
#: Books of contact of the inner faces, there where the case has it.
FACE_BOOKS = (
    Column("contact_loss", "J", "Energy of the computed part that touching faces took and did not give back"),
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a transient run on a mesh."""
    stations, unknowns = len(mesh.z), int(mesh.free.sum())
    by_row = {"station_pressure": (stations,), "station_area": (stations,)}
    motion = dict.fromkeys(("q", "v", "a", "force", "force_rate", "load"), (unknowns,))
    motion |= dict.fromkeys(("psi", "psi_rate"), (stations,)) | {"control": (4,), "eigenvalue": (2,)}
    groups, points = len(mesh.relaxing), (len(mesh.quads), 4)
    by_group = dict.fromkeys(("branch_work", "branch_loss", "branch_energy"), (groups,)) if groups else {}
    if groups:
        motion["branches"] = (*points, len(mesh.branch_time), 8)
        motion["stretch"] = (*points, len(np.unique(mesh.branch_time)), 8)
    waves = len(mesh.line_places)
    if waves:
        motion["line"] = (4 * waves + 1,)
    compressed = len(mesh.gas_unknowns) > 0
    if compressed:
        motion["gas"] = (packed_size(int(mesh.gas_unknowns[0])),)
    history = (*SCALARS, *PROFILES, *added_columns(mesh))
    restart = (*COUNTS, *BOOKS, *NUMERICAL_BOOKS, *MOTION_COLUMNS)
    restart += (*(MEMORY_COLUMNS if groups else ()), *(LINE_COLUMNS if waves else ()))
    restart += GAS_COLUMNS if compressed else ()
    restart += FACE_BOOKS if len(mesh.face_nodes) else ()
    return (
        TableSpec(HISTORY, history, by_row | by_group | {"centre_line": (stations,)}, chunk=512),
        TableSpec(STATES, STATE_COLUMNS, by_row | dict.fromkeys(("nodal", "nodal_rate"), mesh.nodal_shape)),
        TableSpec(RESTART, restart, motion | by_group),
    )


def added_columns(mesh: MeshData) -> tuple[Column, ...]:
    """Columns of the history that a run has besides `SCALARS` and `PROFILES`."""
    fluid = (*(LINE if len(mesh.line_places) else ()), *(GAS if len(mesh.gas_unknowns) else ()))
    return (*(RELAXING if mesh.relaxing else ()), *fluid, *(FACES if len(mesh.face_nodes) else ()))


def row_bytes(table: TableSpec) -> int:
    """Bytes of one row of a table in a file."""
    return sum(int(np.prod(table.shape(c))) * table.dtype(c).itemsize for c in table.columns)


#: Books that not every file has.
_LATER = ("contact_loss", "numerical_loss")


def memory_row(memory: Memory) -> dict[str, Any]:
    """Row of the internal variables of the wall that do not follow from its positions."""
    values = (memory.branches, memory.stretch, memory.work, memory.loss, memory.stored)
    return {column.name: value for column, value in zip(MEMORY_COLUMNS, values, strict=True)}


@dataclass
class Progress:
    """Restart point of a run.

    Attributes
    ----------
    state : MotionState
    steps : int
    saved : int
        Full states kept so far.
    work, dissipation, energy, renewed, contact_loss, numerical_loss : float
        Energy budget, J of the computed part.
    control : tuple of float
        State of the step control.
    eigenvalue : complex
        Eigenvalue, 1/s, of the mode of a kick; not a number without one.
    """

    state: MotionState
    steps: int = 0
    saved: int = 0
    work: float = 0.0
    dissipation: float = 0.0
    energy: float = 0.0
    renewed: float = 0.0
    control: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    eigenvalue: complex = complex(np.nan, np.nan)
    contact_loss: float = 0.0
    numerical_loss: float = 0.0

    @property
    def rows(self) -> int:
        """Rows of the history up to here: one for the start and one for each step."""
        return self.steps + 1

    def row(self) -> dict[str, Any]:
        """A row of the table of restart points."""
        values = {c.name: getattr(self, c.name) for c in (*COUNTS, *BOOKS)}
        values["eigenvalue"] = [self.eigenvalue.real, self.eigenvalue.imag]
        apart = ("memory", "line", "gas")
        values |= {f.name: getattr(self.state, f.name) for f in fields(MotionState) if f.name not in apart}
        values |= {name: part.packed for name in apart[1:] if (part := getattr(self.state, name)) is not None}
        values |= {name: getattr(self, name) for name in _LATER}
        return values if self.state.memory is None else values | memory_row(self.state.memory)

    @classmethod
    def read(cls, record: Record, index: int = -1, wall: WallMemory | None = None) -> Progress:
        """Undo `row` for a restart point of a record, the last one by default; without its memory where no wall is
        given to hold it.
        """
        at = range(record.rows(RESTART))[index]
        values = {c.name: record.value(RESTART, c.name, at) for c in (*COUNTS, *BOOKS, *MOTION_COLUMNS)}
        motion = {c.name: values[c.name] for c in MOTION_COLUMNS}
        state = MotionState(**{name: float(v) if np.ndim(v) == 0 else np.array(v, float) for name, v in motion.items()})
        if wall is not None:
            kept = [record.value(RESTART, c.name, at) for c in MEMORY_COLUMNS]
            state = replace(state, memory=wall.at(state.q, *kept))
        for name, kind in (("line", LineState), ("gas", GasState)):
            if _has(record, name):
                state = replace(state, **{name: kind.unpacked(record.value(RESTART, name, at))})
        return cls(
            state,
            int(values["steps"]),
            int(values["saved"]),
            *(float(values[name]) for name in ("work", "dissipation", "energy", "renewed")),
            tuple(float(value) for value in values["control"]),
            complex(*values["eigenvalue"]),
            *(float(record.value(RESTART, name, at)) if _has(record, name) else 0.0 for name in _LATER),
        )


def _has(record: Record, name: str) -> bool:
    """True where restart points of a record have a column."""
    return any(c.name == name for c in record.tables[RESTART].columns)


#: Rows of the history are held back no longer than this, s, for whoever watches.
BATCH_SECONDS = 5.0
#: Share of what else a run has kept that its restart points may take.
RESTART_SHARE = 0.125
#: Beyond that share, one is kept when so much time, s, or this part of the whole, would be lost without it.
RESTART_SECONDS, RESTART_LOSS = 30.0, 0.02


class Keeper:
    """Keeps a run in a record, which holds the rows of an earlier part already where it goes on.

    The history can be read by the names of its columns at any time.

    Parameters
    ----------
    record : GrowingRecord
    model : ValveModel
    """

    def __init__(self, record: GrowingRecord, model: ValveModel):
        self.record, self.model = record, model
        self._sizes = {name: row_bytes(table) for name, table in record.tables.items()}
        self._kept = {name: record.rows(name) for name in record.tables}
        self._pending: dict[str, list[Any]] = {c.name: [] for c in record.tables[HISTORY].columns}
        self._begun = self._written = self._restarted = monotonic()

    @property
    def rows(self) -> int:
        """Rows of the history, those held back included."""
        return self._kept[HISTORY] + len(self._pending["time"])

    def __contains__(self, name: str) -> bool:
        """True where the history has a column of that name."""
        return name in self._pending

    def __getitem__(self, name: str) -> np.ndarray:
        """A column of the history."""
        self.flush()
        return self.record.column(HISTORY, name)

    def append(self, row: Mapping[str, Any]) -> None:
        """Take a row of the history; it is written with others within some seconds."""
        for name, values in self._pending.items():
            values.append(row[name])
        if monotonic() - self._written > BATCH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write what was held back."""
        rows, self._pending = self._pending, {name: [] for name in self._pending}
        self._written = monotonic()
        count = len(rows["time"])
        if count:
            self.record.extend(HISTORY, rows)
            self._kept[HISTORY] += count

    def state(self, state: MotionState, row: Mapping[str, Any]) -> None:
        """Keep a full state; `row` is that of the history."""
        model = self.model
        values = {
            "time": state.time,
            "nodal": model.nodal(state.q),
            "nodal_rate": model.nodal(state.v),
            "station_pressure": row["station_pressure"],
            "station_area": row["station_area"],
            "inlet_velocity": row["inlet_velocity"],
        }
        self.record.append(STATES, values)
        self._kept[STATES] += 1

    def restart(self, progress: Progress, needed: bool = False) -> None:
        """Keep a point to go on from, after all that came before it.

        They are large: unless one is needed, it is left out while those that there are take their share of the file
        and little would be lost without it.
        """
        self.flush()
        if needed or self._restart_pays():
            self.record.append(RESTART, progress.row())
            self._kept[RESTART] += 1
            self._restarted = monotonic()

    def _restart_pays(self) -> bool:
        others = sum(self._sizes[name] * self._kept[name] for name in (HISTORY, STATES))
        if self._sizes[RESTART] * self._kept[RESTART] <= RESTART_SHARE * others:  # the first is always there
            return True
        now = monotonic()
        return now - self._restarted > max(RESTART_SECONDS, RESTART_LOSS * (now - self._begun))


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows of each table that a run goes on from: those up to its last restart point; none without one.

    Parameters
    ----------
    known : Record
        What the earlier attempt kept.
    case : Case
        The case as it is to go on, perhaps with a later end.

    Raises
    ------
    CaseError
        If the run is over and the case does not ask for more.
    """
    whole = [
        index
        for index in range(known.rows(RESTART))
        if known.value(RESTART, "steps", index) < known.rows(HISTORY)
        and known.value(RESTART, "saved", index) <= known.rows(STATES)
    ]
    if not whole:
        return {HISTORY: 0, STATES: 0, RESTART: 0}
    last = Progress.read(known, whole[-1])
    if known.complete and not known.failures and not _goes_on(last.state.time, known.header.case, case):
        name, advice = f"The run in {str(known.path)!r}", "give a later one with --duration"
        if last.state.time < RunOptions.of(case).end:
            raise CaseError(f"{name} was ended by its verdict at {last.state.time:.6g} s; {advice} to go on.")
        raise CaseError(f"{name} has reached its end at {last.state.time:.6g} s; {advice}.")
    return {HISTORY: last.rows, STATES: last.saved, RESTART: whole[-1] + 1}


def _goes_on(time: float, before: Case, now: Case) -> bool:
    """True where the end of a finished run was moved to a later time."""
    return time < RunOptions.of(now).end and now.transient.duration > before.transient.duration
