"""History of a run in time: what is read off each step, full states, restart points, and how a record takes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from time import monotonic
from typing import Any

import numpy as np

from ...errors import CaseError
from ...flow.stepping import FluidState, MovingFluid, packed_size
from ...model.state import LipCentre
from ...model.valve import ValveModel
from ...motion.control import Drive, RunOptions
from ...motion.equations import ValveMotion
from ...motion.stepper import MotionState, StepResult
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.states import LIP, NODAL, OPENING, STATION_AREA, by_node, by_row, by_unknown
from ...record.table import Column, TableSpec
from ...shell.memory import WallMemory
from ..case import Case

HISTORY, STATES, RESTART = "history", "states", "restart"


class Instant:
    """A run after a step, from which columns of the history are read; energies of the computed part, J.

    Parameters
    ----------
    load : Load
        Of the fluid.
    step : float, s
    evaluations : int
        Residuals evaluated in the step.
    """

    def __init__(self, reader: Reader, progress: Progress, load: Any, step: float, evaluations: int):
        self.reader, self.books, self.load, self.step, self.evaluations = reader, progress, load, step, evaluations
        self.state, self.motion = progress.state, reader.motion
        self.model, self.copies = reader.motion.model, reader.motion.model.mesh.part.copies
        self.kinetic, self.strain, self.stop = self.motion.energies(self.state.q, self.state.v)
        self.outside = self.motion.outside_energy(self.state.q, self.state.v)
        self.weight = self.model.weight_energy(self.state.q)
        self.renewed = 0.0 if self.motion.outside is None else self.motion.outside.renewed
        self.throat = int(np.argmin(load.area))

    @property
    def inlet(self) -> float:
        """Pressure at the far end, Pa: that of the drive, or of a pump at its flow."""
        return supplied_pressure(self.motion, self.state, self.reader.drive(self.state.time))

    @property
    def balance(self) -> float:
        """Energy gained less what has gone in and out."""
        books, memory = self.books, self.state.memory
        stored = self.kinetic + self.outside + self.strain + self.stop + self.weight
        lost = books.dissipation + books.contact_loss + books.numerical_loss
        balance = stored - books.energy - books.work + lost - self.renewed
        return balance if memory is None else balance + memory.work.sum()

    @cached_property
    def _facing(self) -> MovingFluid:
        """The fluid that the passage has, still where faces shut it."""
        return self.motion.fluid.facing(self.state.fluid.area, self.state.fluid.speed)

    @cached_property
    def flows(self) -> tuple[float, float, float]:
        """Mass flow out at the lip and in at the flange, kg/s of the part, and the largest Mach number."""
        speed, density = self.load.speed, self.motion.mu.density
        if self.motion.fluid.compressed:
            return self._facing.readings(self.load.area, self.state.fluid.inner)
        out = density * speed[0] * float(self.model.flow.open_area(self.load.area[0]))
        return out, density * speed[-1] * self.model.mesh.inlet_passage, 0.0

    @cached_property
    def fluid(self) -> dict[str, float]:
        """Energies that the fluid holds, and what became of it since the start, by the names of the law."""
        held = self._facing.energies(self.load.area, self.state.fluid.inner)
        return held | dict(zip(self.model.flow.book_names, self.state.fluid.books))

    @cached_property
    def touch(self) -> Any:
        """State of touching faces."""
        return self.model.contact.state(self.state.q)


def pumped_flow(model: ValveModel, state: MotionState) -> float:
    """Flow rate at the pump, m3/s."""
    velocity, mesh = model.flow.far_velocity(state.fluid.inner), model.mesh
    return mesh.part.copies * mesh.inlet_passage * velocity


def supplied_pressure(motion: ValveMotion, state: MotionState, drive: float) -> float:
    """Pressure at the far end, Pa: that of the drive, or of a pump at its flow."""
    pump = motion.model.pump
    return drive if pump is None else pump.pressure(drive, pumped_flow(motion.model, state))


def _whole(name: str, words: str, of: Callable[[Instant], Any], units: str = "J") -> Column:
    """Column of the whole valve from a number of the computed part."""
    return Column(name, units, words, read=lambda s: s.copies * of(s))


def _where(shape: Callable[[MeshData], tuple[int, ...] | None], columns: Iterable[Column]) -> tuple[Column, ...]:
    """Columns that a run has where a mesh has a shape for them."""
    return tuple(replace(column, shape=shape) for column in columns)


def _by_group(mesh: MeshData) -> tuple[int, ...] | None:
    return (len(mesh.relaxing),) if mesh.relaxing else None


def _number_where(name: str) -> Callable[[MeshData], tuple[int, ...] | None]:
    """Shape of a number that a run has where its mesh has any of a field, by the name of that."""
    return lambda mesh: () if len(getattr(mesh, name)) else None


_FAR_END = "Static pressure at the flange; with a line in front the pressure at its far end"
_RENEWED = "Energy that renewals of the added mass of that fluid have put in since the start, as the shape moved on"
_BALANCE = (
    "Energy gained since the start, by Maxwell branches and the fluid outside too, less work plus dissipation, what "
    "faces that part lost and what numerical damping took, and less what renewals put in: what steps of finite length "
    "and corrections left out add or take"
)
_TOOK = "Energy that the numerical damping of the scheme took since the start; below zero where it gave"
_MET = (
    "Pressure at each row, lip first, where the step meets the equations: halfway through it without numerical damping"
)
_STOPS = "Lip stops, or nodes with their inner face, in contact, of the computed part"
#: One number a step; of the whole valve.
SCALARS = (
    Column("time", "s", "Time", read=lambda s: s.state.time),
    Column("inlet_pressure", "Pa", _FAR_END, read=lambda s: s.inlet),
    _whole("mass_flow", "Mass flow leaving at the lip", lambda s: s.flows[0], "kg/s"),
    _whole("inlet_mass_flow", "Mass flow entering at the flange", lambda s: s.flows[1], "kg/s"),
    _whole("outlet_area", "Flow area at the lip; below zero where lips cross", lambda s: s.load.area[0], "m^2"),
    _whole("smallest_area", "Smallest flow area of all rows", lambda s: s.load.area[s.throat], "m^2"),
    Column("throat", "m", "Axial position of it, from the lip", read=lambda s: float(s.model.mesh.z[s.throat])),
    Column("inlet_velocity", "m/s", "Velocity at the flange", read=lambda s: s.load.speed[-1]),
    Column("outlet_velocity", "m/s", "Jet velocity at the lip", read=lambda s: s.load.speed[0]),
    replace(OPENING, read=lambda s: s.reader.lip.opening(s.state.q)),
    replace(LIP, read=lambda s: s.reader.lip.displacement(s.state.q)),
    Column("lip_velocity", "m/s", "Its rate", read=lambda s: s.reader.lip.displacement(s.state.v)),
    Column("stops", "", _STOPS, read=lambda s: s.model.touching(s.state.q)),
    _whole("kinetic_energy", "Kinetic energy of the wall", lambda s: s.kinetic),
    _whole("outside_energy", "Kinetic energy of the fluid outside the wall", lambda s: s.outside),
    _whole("outside_renewed", _RENEWED, lambda s: s.renewed),
    _whole("strain_energy", "Strain energy of the wall", lambda s: s.strain),
    _whole("stop_energy", "Energy stored in the lip stops, or in the contact of the inner faces", lambda s: s.stop),
    _whole("weight_energy", "Potential of the wall's weight over that at rest", lambda s: s.weight),
    _whole("pressure_work", "Work of the pressure on the wall since the start", lambda s: s.books.work),
    _whole("dissipation", "Energy lost to Rayleigh damping since the start", lambda s: s.books.dissipation),
    _whole("numerical_loss", _TOOK, lambda s: s.books.numerical_loss),
    _whole("balance", _BALANCE, lambda s: s.balance),
    Column("step", "s", "Length of the step"),
    Column("evaluations", "", "Residuals evaluated in the step"),
)
#: One number a row of the mesh and step; of the computed part.
PROFILES = (
    Column("station_pressure", "Pa", _MET, "f4", shape=by_row, read=lambda s: s.load.pressure),
    Column("station_area", "m^2", "Flow area at each row", "f4", shape=by_row, read=lambda s: s.load.area),
    Column(
        "centre_line",
        "m",
        "Displacement in y of the line x = 0 at each row",
        "f4",
        shape=by_row,
        read=lambda s: s.reader.centre_line(s.state.q),
    ),
)
#: One number a group of layers that relax alike and step; of the whole valve, and there where the wall relaxes.
RELAXING = _where(
    _by_group,
    (
        _whole(
            "branch_energy", "Energy that the branches of each group of layers hold", lambda s: s.state.memory.stored
        ),
        _whole("branch_loss", "Energy that they have dissipated since the start", lambda s: s.state.memory.loss),
    ),
)


def _of_fluid(name: str, words: str) -> Column:
    return _whole(name, words, lambda s: float(s.fluid[name]))


#: Energy of an elastic line, of the whole valve, there where the case has one.
LINE = _where(
    _number_where("line_places"),
    (
        _of_fluid("line_kinetic_energy", "Kinetic energy of the fluid in the line"),
        _of_fluid("line_elastic_energy", "Energy of its compression and of the pipe's wall"),
        _of_fluid("line_supply", "Energy taken in at the far end of the line since the start"),
        _of_fluid("line_dissipation", "Energy lost to friction and losses in it since the start"),
        _of_fluid("line_work", "Energy that left it at the flange since the start"),
        _of_fluid("line_step_loss", "Energy that differences in time took from it since the start; below zero: gave"),
    ),
)
#: Of a fluid that is compressed, of the whole valve, there where the case has one.
GAS = _where(
    _number_where("gas_unknowns"),
    (
        _of_fluid("gas_energy", "Kinetic energy and energy of compression of the fluid in the valve"),
        _of_fluid("gas_supply", "Energy that it took in at the flange since the start, by enthalpy and velocity head"),
        _of_fluid("gas_outflow", "Energy that left it at the lips since the start, likewise"),
        _of_fluid("gas_work", "Work that it did on the wall since the start"),
        _of_fluid("gas_loss", "Energy that it lost in the valve since the start: by friction, jets inside, and shocks"),
        _of_fluid("gas_step_loss", "Energy that differences in time took from it since the start; below zero: gave"),
        _of_fluid("gas_mesh_loss", "Energy that the cells between rows took from it since the start; below zero: gave"),
        Column("mach", "", "Largest Mach number in the valve", read=lambda s: s.flows[2]),
    ),
)
_KEPT = "Energy that touching faces took and did not give back since the start, whole valve"
#: Contact of the inner faces, there where the case has it.
FACES = _where(
    _number_where("face_nodes"),
    (
        _whole("contact_loss", _KEPT, lambda s: s.books.contact_loss),
        Column("contact_force", "N", "Force of the walls", read=lambda s: s.model.mesh.part.walls * s.touch.total),
        Column("penetration", "m", "Depth of faces in the closing plane", read=lambda s: s.touch.penetration),
    ),
)
#: Full states.
STATE_COLUMNS = (
    SCALARS[0],
    NODAL,
    Column("nodal_rate", "m/s, rad/s", "Their rates", shape=by_node),
    Column("station_pressure", "Pa", "Pressure at each row", shape=by_row),
    STATION_AREA,
    Column("inlet_velocity", "m/s", "Velocity at the flange"),
)


def _of_state(name: str, units: str, words: str, shape: Any = ()) -> Column:
    """Column of the state of a motion between two steps, see `dbvfiv.motion.stepper.MotionState`."""
    return Column(name, units, words, shape=shape, read=lambda p: getattr(p.state, name))


MOTION = (
    _of_state("time", "s", "Time"),
    _of_state("q", "m, rad", "Free unknowns", by_unknown),
    _of_state("v", "m/s, rad/s", "Their velocities", by_unknown),
    _of_state("a", "m/s^2, rad/s^2", "Their accelerations", by_unknown),
    _of_state("force", "N, N m", "Internal force of the computed part", by_unknown),
    _of_state("force_rate", "N/s, N m/s", "The scheme's value of its rate", by_unknown),
    _of_state("load", "N, N m", "Force of the fluid where the equations were last met", by_unknown),
)


def _of_memory(name: str, of: str, units: str, words: str, shape: Callable = _by_group) -> Column:
    return Column(name, units, words, shape=shape, read=lambda p: getattr(p.state.memory, of))


def _by_branch(mesh: MeshData) -> tuple[int, ...] | None:
    return (len(mesh.quads), 4, len(mesh.branch_time), 8) if mesh.relaxing else None


def _by_time(mesh: MeshData) -> tuple[int, ...] | None:
    return (len(mesh.quads), 4, len(np.unique(mesh.branch_time)), 8) if mesh.relaxing else None


#: Memory of a wall that relaxes, in the order of the arguments of `dbvfiv.shell.memory.WallMemory.at`.
MEMORY = (
    _of_memory("branches", "branches", "N/m, N", "Section resultants of each branch at the Gauss points", _by_branch),
    _of_memory("stretch", "stretch", "1, 1/m", "Section strains that springs of each relaxation time hold", _by_time),
    _of_memory("branch_work", "work", "J", "Work done against the branches of each group since the start"),
    _of_memory("branch_loss", "loss", "J", "What of it they have dissipated"),
    _of_memory("branch_energy", "stored", "J", "Energy that they hold"),
)


def _fluid_size(mesh: MeshData) -> int:
    """Numbers of the fluid's state."""
    unknowns = mesh.gas_unknowns[0] if len(mesh.gas_unknowns) else max(1, 2 * len(mesh.line_places) - 1)
    return packed_size(len(mesh.z), int(unknowns))


#: The fluid, as `dbvfiv.flow.stepping.FluidState` packs it.
_FLUID = Column(
    "fluid",
    "m/s, m^2/s, m^3, m^2, J",
    "Unknowns of the fluid, what balances hold and its rates, areas, speeds and energy budget",
    read=lambda p: p.state.fluid.packed,
    shape=lambda mesh: (_fluid_size(mesh),),
)
_CONTACT = "Energy of the computed part that touching faces took and did not give back"
#: How far a run has come, books of energy of the computed part, step control and the mode of a kick.
PROGRESS = (
    Column("steps", "", "Steps made", "i8"),
    Column("saved", "", "Full states kept", "i8"),
    Column("work", "J", "Work of the pressure on the computed part since the start"),
    Column("dissipation", "J", "Energy of the computed part lost to damping since the start"),
    Column("energy", "J", "Energy of the computed part at the start"),
    Column("renewed", "J", "Energy of the computed part that renewals of the added mass outside have put in"),
    Column("control", "", "Numbers of the step control", shape=(4,)),
    Column(
        "eigenvalue",
        "1/s",
        "Real and imaginary part of that of the mode of a kick",
        shape=(2,),
        read=lambda p: [p.eigenvalue.real, p.eigenvalue.imag],
    ),
    Column("numerical_loss", "J", "Energy of the computed part that numerical damping took"),
    Column("contact_loss", "J", _CONTACT, shape=_number_where("face_nodes")),
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a transient run on a mesh."""
    history = (*SCALARS, *PROFILES, *RELAXING, *LINE, *GAS, *FACES)
    restart = (*PROGRESS, *MOTION, *MEMORY, _FLUID)
    return (
        TableSpec.on(mesh, HISTORY, history, chunk=512),
        TableSpec.on(mesh, STATES, STATE_COLUMNS),
        TableSpec.on(mesh, RESTART, restart),
    )


@dataclass
class Progress:
    """Restart point: progress of a run."""

    state: MotionState
    steps: int = 0
    saved: int = 0  #: Full states kept so far.
    #: work, dissipation, energy, renewed, contact_loss and numerical_loss: energy budget, J of the computed part.
    work: float = 0.0
    dissipation: float = 0.0
    energy: float = 0.0
    renewed: float = 0.0
    control: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  #: State of the step control.
    eigenvalue: complex = complex(np.nan, np.nan)  #: Eigenvalue, 1/s, of the mode of a kick; not a number without one.
    contact_loss: float = 0.0
    numerical_loss: float = 0.0

    @property
    def rows(self) -> int:
        """Rows of the history up to here: one for the start and one for each step."""
        return self.steps + 1

    def advance(self, result: StepResult) -> None:
        """Take a finished step."""
        self.state, self.steps = result.state, self.steps + 1
        for book in ("work", "dissipation", "contact_loss", "numerical_loss"):
            setattr(self, book, getattr(self, book) + getattr(result, book))

    @classmethod
    def read(cls, record: Record, index: int = -1, wall: WallMemory | None = None) -> Progress:
        """Restart point of a record, the last one by default; without its memory where no wall is given to hold it."""
        at, held = range(record.rows(RESTART))[index], {c.name for c in record.tables[RESTART].columns}

        def value(name: str) -> Any:
            found = record.value(RESTART, name, at)
            return float(found) if np.ndim(found) == 0 else np.array(found, float)

        motion = {c.name: value(c.name) for c in MOTION}
        state = MotionState(**motion, fluid=FluidState.unpacked(value("fluid") if "fluid" in held else np.zeros(0)))
        if wall is not None:
            state = replace(state, memory=wall.at(state.q, *(value(c.name) for c in MEMORY)))
        known = {f.name: value(f.name) for f in fields(cls) if f.name in held}
        known |= {name: int(known[name]) for name in ("steps", "saved")}
        known |= {"control": tuple(known["control"].tolist()), "eigenvalue": complex(*known["eigenvalue"])}
        return cls(state, **known)


class Reader:
    """Makes rows of the history of one run."""

    def __init__(self, motion: ValveMotion, columns: Iterable[Column], drive: Drive):
        self.motion, self.columns, self.drive = motion, tuple(columns), drive
        model = motion.model
        self.lip = LipCentre(model.mesh, model.shell)
        self._centre = model.shell.dofs.index[model.mesh.centre_line, 1]

    def centre_line(self, q: np.ndarray) -> np.ndarray:
        """(m,) displacement in y of the middle of the lips and the line behind it, m."""
        return np.where(self._centre >= 0, q[np.maximum(self._centre, 0)], 0.0)

    def first(self, progress: Progress, inlet: float) -> dict[str, Any]:
        """Row of the start."""
        motion, state = self.motion, progress.state
        load = motion.load(state.q, state.v, state.q, state.v, motion.instant(state, inlet))
        return self.row(progress, load, 0.0, 0)

    def row(self, progress: Progress, load: Any, step: float, evaluations: int) -> dict[str, Any]:
        """Row of a step that has been taken."""
        instant = Instant(self, progress, load, step, evaluations)
        return {c.name: c.of(instant) for c in self.columns}


#: Rows of the history are held back no longer than this, s, for whoever watches.
BATCH_SECONDS = 5.0
#: Share of what else a run has kept that its restart points may take.
RESTART_SHARE = 0.125
#: Beyond that share, one is kept when so much time, s, or this part of the whole, would be lost without it.
RESTART_SECONDS, RESTART_LOSS = 30.0, 0.02


class Keeper:
    """Keeps a run in a record, which holds the rows of an earlier part already where it goes on.

    The history can be read by the names of its columns at any time.
    """

    def __init__(self, record: GrowingRecord, model: ValveModel):
        self.record, self.model = record, model
        self._sizes = {name: table.row_bytes for name, table in record.tables.items()}
        self._names = tuple(c.name for c in record.tables[HISTORY].columns)
        self._pending: list[Mapping[str, Any]] = []
        self._begun = self._written = self._restarted = monotonic()

    @property
    def rows(self) -> int:
        """Rows of the history, those held back included."""
        return self.record.rows(HISTORY) + len(self._pending)

    def __contains__(self, name: str) -> bool:
        """True where the history has a column of that name."""
        return name in self._names

    def __getitem__(self, name: str) -> np.ndarray:
        """A column of the history."""
        self.flush()
        return self.record.column(HISTORY, name)

    def append(self, row: Mapping[str, Any]) -> None:
        """Take a row of the history; it is written with others within some seconds."""
        self._pending.append(row)
        if monotonic() - self._written > BATCH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write what was held back."""
        rows, self._pending = self._pending, []
        self._written = monotonic()
        if rows:
            self.record.extend(HISTORY, {name: [row[name] for row in rows] for name in self._names})

    def state(self, state: MotionState, row: Mapping[str, Any]) -> None:
        """Keep a full state; `row` is that of the history."""
        moved = {"nodal": self.model.nodal(state.q), "nodal_rate": self.model.nodal(state.v)}
        self.record.append(STATES, {**row, **moved})

    def restart(self, progress: Progress, needed: bool = False) -> None:
        """Keep a point to go on from, after all that came before it.

        They are large: unless one is needed, it is left out while those that there are take their share of the file
        and little would be lost without it.
        """
        self.flush()
        if needed or self._restart_pays():
            self.record.append(RESTART, self.record.tables[RESTART].row(progress))
            self._restarted = monotonic()

    def _restart_pays(self) -> bool:
        kept = {name: size * self.record.rows(name) for name, size in self._sizes.items()}
        if kept[RESTART] <= RESTART_SHARE * (kept[HISTORY] + kept[STATES]):  # the first is always there
            return True
        now = monotonic()
        return now - self._restarted > max(RESTART_SECONDS, RESTART_LOSS * (now - self._begun))


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows of each table that a run goes on from: those up to its last restart point; none without one. Raises
    CaseError if the run is over and the case does not ask for more.

    Parameters
    ----------
    known : Record
        What the earlier attempt kept.
    case : Case
        The case as it is to go on, perhaps with a later end.
    """
    whole = [
        index
        for index in range(known.rows(RESTART))
        if known.value(RESTART, "steps", index) < known.rows(HISTORY)
        and known.value(RESTART, "saved", index) <= known.rows(STATES)
    ]
    if not whole:
        return {HISTORY: 0, STATES: 0, RESTART: 0}
    last, end = Progress.read(known, whole[-1]), RunOptions.of(case).end
    time, before = last.state.time, known.header.case.transient.duration
    if known.complete and not known.failures and not (time < end and case.transient.duration > before):
        name, advice = f"The run in {str(known.path)!r}", "give a later one with --duration"
        if time < end:
            raise CaseError(f"{name} was ended by its verdict at {time:.6g} s; {advice} to go on.")
        raise CaseError(f"{name} has reached its end at {time:.6g} s; {advice}.")
    return {HISTORY: last.rows, STATES: last.saved, RESTART: whole[-1] + 1}
