"""A run in time: steps until the end or until the verdict is certain, kept in a record as it goes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...errors import CaseError
from ...model.equilibria import state_warnings
from ...model.material_stability import material_stability
from ...model.valve import ValveModel
from ...motion.control import Drive, RunOptions, step_control
from ...motion.equations import ValveMotion
from ...motion.start import first_state, steady_fluid
from ...motion.stepper import MotionState, StepFailure, Stepper, consistent_state
from ...record.files import Header, kind_of
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record, StoredRecord
from ...record.states import state_table
from ...texts import digits, json_value, listed
from ...verdict import Shuttings, Verdict, judge
from ..case import Case
from .history import HISTORY, STATES, Keeper, Progress, Reader, pumped_flow, supplied_pressure, tables_of

#: Columns of a history by name.
Columns = Mapping[str, np.ndarray]
#: Smallest area over that of lips in touch up to which faces shut a valve; those of a bill that is moulded shut part at
#: another.
SHUT = 0.5
#: Load on the lips, over the unit of loads, from which stops bear one: rounding is some 1e-8 of that unit.
BORNE = 1e-3
#: Numbers of the mass flow that stand in the document of a verdict itself.
NUMBERS = ("amplitude", "frequency", "mean", "cycles_observed", "periodicity_error")
#: Kinds of notes: why the constants of the rubber do not hold in the first state, and what else was said of it there.
REFUSAL, RUBBER = "not valid", "rubber"


@dataclass(frozen=True)
class RunVerdict:
    """Verdicts on the signals and what mass flow and lip displacement say together."""

    mass_flow: Verdict
    lip_displacement: Verdict
    #: Of the clear opening, which is cut off at zero and says nothing more; amplitudes are about twice as large.
    lip_opening: Verdict
    residual: float  #: Unbalanced force at the end over pressure force; not a number while the pressure changes.
    steps: int
    time: float  #: s.
    #: Numbers of the shuttings of a valve that chatters; empty of others.
    chatter: Mapping[str, Any] = field(default_factory=dict)

    @property
    def _telling(self) -> tuple[Verdict, ...]:
        """Verdicts on mass flow and lip displacement; a flow that never was tells nothing."""
        lip = self.lip_displacement
        return (self.mass_flow, lip) if self.mass_flow.largest > self.mass_flow.smallest else (lip,)

    @property
    def name(self) -> str:
        """The livelier of the two: a flow can look settled while the lip still moves."""
        return max((verdict.name for verdict in self._telling), key=_LIVELINESS.index)

    @property
    def decided(self) -> bool:
        """True where the verdicts on mass flow and lip displacement agree and a longer run would not change them."""
        return all(verdict.decided and verdict.name == self.name for verdict in self._telling)

    @property
    def governing(self) -> Verdict:
        """The verdict that gives the name."""
        return next(verdict for verdict in self._telling if verdict.name == self.name)

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON: name and numbers of the mass flow, then each signal by itself."""
        flow = self.mass_flow.summary()
        return {
            "verdict": self.name,
            "decided": bool(self.decided),
            "reason": self.governing.reason,
            **{key: flow[key] for key in NUMBERS},
            "steps": self.steps,
            "time": self.time,
            "residual": json_value(self.residual),
            "mass_flow": flow,
            "lip_opening": self.lip_opening.summary(),
            "lip_displacement": self.lip_displacement.summary(),
        } | ({"chatter": dict(self.chatter)} if self.chatter else {})


_LIVELINESS = ("closed", "steady", "decaying", "limit cycle", "growing", "undecided", "irregular", "chatters")


#: Drive that never changes.
STILL = Drive((0.0,), (0.0,))


def assess(history: Columns, model: ValveModel, residual: float = np.nan, drive: Drive = STILL) -> RunVerdict:
    """Verdict on a history, from where the drive holds still on, once it has held for two steps; nothing is certain of
    one that ends before.

    A valve is closed where its lips are shut and nothing flows, see `openness`. Faces that part and meet again and
    again chatter, periodically or not.

    Parameters
    ----------
    history : mapping of str to array
        See `dbvfiv.studies.transient.history.SCALARS`.
    residual : float
        Of the equilibrium at the end; not a number if it is not known.
    drive : Drive
        What the run was driven by.
    """
    time, since = history["time"], drive.settled_at
    chosen = time >= (since if np.count_nonzero(time >= since) > 1 else 0.0)
    judged = partial(judge, time[chosen], gaps=False)
    known = residual if np.isfinite(residual) else None
    signals = ("mass_flow", "lip_displacement", "lip_opening")
    found = [judged(history[name][chosen], residual=known) for name in signals]
    chatter: dict[str, Any] = {}
    if judged(openness(history, model)[chosen], closed_below=1.0).name == "closed":
        reason = "Its lips are shut, and nothing flows."
        found = [replace(v, name="closed", decided=True, reason=reason) for v in found]
    elif model.contact is not None:
        parted = parting(history, model)[chosen]
        shuttings = Shuttings.of(time[chosen], parted, 1.0)
        if shuttings.chatters:
            opens = judged(parted, closed_below=1.0)
            signals = (history[name][chosen] for name in ("lip_opening", "lip_velocity", "mass_flow"))
            chatter = shuttings.evidence(time[chosen], *signals)
            told = {name: getattr(opens, name) for name in ("decided", "reason", "period", "cycles")}
            found = [replace(v, name="chatters", **told) for v in found]
    if time[-1] < since * (1 - 1e-9):
        found = [replace(v, decided=False, reason=f"{v.reason} The drive changes until {since:.4g} s.") for v in found]
    return RunVerdict(*found, residual, len(time) - 1, float(time[-1]), chatter)


def shut_share(model: ValveModel) -> float:
    """Smallest area over that of lips in touch up to which the faces of a valve are shut."""
    return model.parting if model.case.valve.is_preset else SHUT


def parting(history: Columns, model: ValveModel) -> np.ndarray:
    """Distance of the faces of a valve (k,) over that at which they meet, in the middle of the lips, or shut the
    passage.
    """
    share, gap = shut_share(model), model.case.valve.initial_gap
    if model.case.valve.is_preset:  # drawn without a gap
        middle = 0.5 * history["lip_opening"] / ((share - 1.0) * gap)
    else:
        middle = (gap + model.lens + history["lip_displacement"]) / (share * gap)
    return np.minimum(history["smallest_area"] / (share * lip_gap(model)), middle)


def openness(history: Columns, model: ValveModel) -> np.ndarray:
    """Distance of a valve from shut (k,), at most 1 where it is: passage and flows over those of a shut one.

    Faces shut it where they leave at most `shut_share` of what lips in touch do. Stops hold lips where they are at
    rest; they shut it where nothing drives fluid out and as many as a row has bear a load, which the rounding of a
    valve that stands at rest is not. A shut valve leaks at most what a jet through that gap carries.
    """
    gap = lip_gap(model)
    area = history["smallest_area"] / (shut_share(model) * gap)
    drive = history["inlet_pressure"] - model.case.rest_pressure
    if model.contact is None:
        row = max(len(model.stops.unknowns) / np.count_nonzero(model.mesh.z <= model.case.valve.duckbill_length), 1.0)
        valve = model.case.valve
        load = BORNE * model.load_unit * 2 * valve.bill_reach * valve.duckbill_length
        borne = history["stop_energy"] >= 0.5 * load**2 / np.max(model.stops.stiffness)
        held = borne & (history["stops"] >= row) & (drive <= 0) & (history["smallest_area"] <= gap)
        area = np.where(held, 1.0, area)
    head = abs(drive) + 2.0 * model.load_unit  # faces that close squeeze out what is between them, and speed it up
    leak = shut_share(model) * gap * np.sqrt(2.0 * model.case.fluid.density * head)
    flow = np.maximum(abs(history["mass_flow"]), abs(history["inlet_mass_flow"]))
    return np.maximum(area, flow / leak)


def lip_gap(model: ValveModel) -> float:
    """Flow area of the whole valve at the lip, m2, that lips in touch leave."""
    return model.mesh.part.copies * model.mesh.lip_gap


def rise_around(history: Columns, model: ValveModel) -> np.ndarray | float:
    """Pressure (k,), Pa, around the jet over that at the far end of a pipe behind the valve; 0 without one."""
    tail = model.tail
    if tail is None or model.case.is_compressed:
        return 0.0
    speed = tail.speed(model.mesh.inlet_passage, history["inlet_velocity"])
    jet_area = model.flow.open_area(history["outlet_area"] / model.mesh.part.copies)
    gained = np.asarray(tail.gained(jet_area, history["outlet_velocity"], speed))
    faster = tail.length * np.gradient(speed, history["time"]) if model.flow.unsteady else 0.0
    return model.case.fluid.density * (faster + np.asarray(tail.lost_head(speed)) - gained)


def beyond_model(history: Columns, vacuum: float, around: np.ndarray | float = 0.0) -> str | None:
    """Sentence on speeds and pressures beyond what the equations are for, None without any.

    An ideal incompressible fluid pays any price for passing a gap that shuts; a real one separates, cavitates or is
    compressed. What follows such an instant is the solution of the equations and no prediction.

    Parameters
    ----------
    history : mapping of str to array
    vacuum : float, Pa
        Pressure of a vacuum, over that at the far end downstream; no fluid's pressure falls below it.
    around : (k,) array or float, Pa
        See `rise_around`.
    """
    fastest = np.asarray(history["mach"]) if "mach" in history else np.zeros(1)
    if fastest.max() > 1.0:
        where = int(np.argmax(fastest > 1.0))
        return (
            f"The fluid is faster than sound in the valve from {history['time'][where]:.4g} s on, in "
            f"{digits(100 * np.mean(fastest > 1.0), 2)} % of the steps and up to Mach {fastest.max():.3g}: what shocks "
            "take is a loss of head here, and the air that lips draw in then is a rough estimate."
        )
    lowest = np.min(history["station_pressure"], axis=1) + around
    beyond = np.flatnonzero(lowest < vacuum)
    if not len(beyond):
        return None
    time, share = history["time"][beyond[0]], len(beyond) / len(lowest)
    return (
        f"Pressures fall below vacuum from {time:.4g} s on, in {digits(100 * share, 2)} % of the steps and down to "
        f"{1e-3 * lowest.min():.4g} kPa, where the valve slams "
        "shut: the fluid's equations are beyond their range there, and the motion afterwards is no prediction."
    )


def stored_state(motion: ValveMotion, case: Case, inlet: float) -> MotionState:
    """State `transient.start_state` of `transient.start_file`, a steady or a transient result on the same mesh. Raises
    CaseError if the file cannot be read, has no such state, or belongs to another mesh.

    A wall that relaxes starts without stress in its branches: states do not hold what it remembered.

    Parameters
    ----------
    inlet : float
        Inlet pressure of the first instant, Pa.
    """
    path, index, model = Path(case.transient.start_file), case.transient.start_state, motion.model
    record, moving = _read(path)
    count = record.rows(STATES)
    if not count:
        raise CaseError(f"{str(path)!r} holds no states to start from.")
    if not -count <= index < count:
        raise CaseError(f"{str(path)!r} holds {count} states, so there is no state {index}.")
    if other := record.mesh.differs_from(model):
        raise CaseError(f"The states of {str(path)!r} belong to {other}.")
    q = model.shell.dofs.restrict(record.value(STATES, "nodal", index))
    if not moving:
        speed = float(record.value(STATES, "station_velocity", index)[-1])
        return consistent_state(motion, 0.0, q, np.zeros(model.size), inlet, steady_fluid(motion, q, inlet, speed))
    v = model.shell.dofs.restrict(record.value(STATES, "nodal_rate", index))
    speed = float(record.value(STATES, "inlet_velocity", index))
    return consistent_state(motion, 0.0, q, v, inlet, steady_fluid(motion, q, inlet, speed))


def _read(path: Path) -> tuple[Record, bool]:
    """The record of a file, and whether its states move."""
    kind = kind_of(path)
    if kind == "transient":
        return StoredRecord(path, tables_of, Case), True
    if kind == "steady":
        return StoredRecord(path, lambda mesh: (state_table(STATES, mesh),), Case), False
    raise CaseError(
        f"{str(path)!r} holds a result of kind {kind!r}; a run starts from a state of a steady or a transient result."
    )


class Runner:
    """One run in time, kept in a record as it goes.

    Parameters
    ----------
    options : RunOptions, optional
        Of the case by default.
    record : GrowingRecord, optional
        Keeps the run and is told of its progress; one in memory by default.
    case : Case, optional
        That of the model by default; it may differ in keys of the study.

    Attributes
    ----------
    history : Keeper
        Columns of the history by their names.
    progress : Progress
    verdict : RunVerdict or None
        None if not even one step was made.
    failures : list of str
    interrupted : bool
    stopped : bool
        True where the verdict ended the run.
    """

    def __init__(
        self,
        model: ValveModel,
        options: RunOptions | None = None,
        record: GrowingRecord | None = None,
        case: Case | None = None,
    ):
        self.model = model
        self.case = case = model.case if case is None else case
        if record is None:
            mesh = MeshData.of(model)
            record = GrowingRecord(Header.of("transient", case), mesh, tables_of(mesh))
        self.record = record
        self.options = RunOptions.of(case) if options is None else options
        self.drive = Drive.of(case)
        self.motion = ValveMotion(model, staggered=case.transient.coupling == "staggered")
        self.stepper = Stepper(self.motion, self.options.scheme, self.drive, self.options.step)
        self.control = step_control(self.stepper, self.options.control)
        self.history = Keeper(record, model)
        self._reader = Reader(self.motion, record.tables[HISTORY].columns, self.drive)
        self.failures: list[str] = []
        self.interrupted = self.stopped = False
        self._row: dict[str, Any] = {}  # the last one of the history that this run has made
        self._saved_at: float | None = None

    def start(self, first: MotionState | None = None) -> Runner:
        """Run from the case's first state, or from a given one; a step that is not found ends the run, which keeps
        everything up to there and says so in `failures`; so does an interrupt. Raises SolveError, CaseError if there is
        no first state.
        """
        self._begin(0)
        inlet = self.drive(0.0)
        state, resting, eigenvalue = (first, first.q, None) if first is not None else self._first(inlet)
        energy = sum(self.motion.energies(state.q, state.v)) + self.motion.outside_energy(state.q, state.v)
        energy += self.model.weight_energy(state.q)
        self.progress = progress = Progress(state, energy=energy, control=tuple(self.control.pack()))
        if eigenvalue is not None:
            progress.eigenvalue = eigenvalue
        self._judge_rubber(resting, inlet)
        row = self._reader.first(progress, inlet)
        self.history.append(row)
        self._row = row
        self._save()
        self._checkpoint(needed=True)
        return self._go()

    def resume(self) -> Runner:
        """Go on from the last restart point of the record, which must hold the rows up to that and no more."""
        self.progress = progress = Progress.read(self.record, wall=self.motion.wall)
        self._begin(progress.steps)
        for note in (*self.record.notes(REFUSAL), *self.record.notes(RUBBER)):
            self.record.warn(note["text"])
        self.control.unpack(progress.control)
        self.stepper.forget()
        if self.motion.outside is not None:
            self.motion.outside.start_afresh(progress.state.q, progress.state.v)
            self.motion.outside.renewed = progress.renewed
        return self._go()

    def _first(self, inlet: float) -> tuple[MotionState, np.ndarray, complex | None]:
        if self.case.transient.start == "state":
            self._say_what_is_lost()
            state = stored_state(self.motion, self.case, inlet)
            return state, state.q, None
        return first_state(self.motion, self.case, inlet, self.record)

    def _say_what_is_lost(self) -> None:
        """Warn of what states of a run do not hold, without which a run that starts from one begins."""
        parts = {
            "what its relaxing layers remember": self.motion.wall is not None,
            "the flow of its gas": self.model.case.is_compressed,
            "the waves in its line": self.model.case.has_waves,
        }
        lost = listed(words for words, there in parts.items() if there)
        if lost and kind_of(self.case.transient.start_file) == "transient":
            said = f"A state of a run does not hold {lost}, so this run begins without"
            self.record.warn(f"{said}; `dbvfiv resume` goes on with all of it.")

    def _judge_rubber(self, q: np.ndarray, inlet: float) -> None:
        """Say what is worth knowing of the rubbers in the first state (n,), before a push, and note where constants of
        those with loss factors do not hold.
        """
        for sentence in state_warnings(self.model, [SimpleNamespace(q=q, pressure=inlet)]):
            self.record.note(RUBBER, text=sentence)
            self.record.warn(sentence)
        loss = self.motion.mu.loss_factor
        if loss and not (found := material_stability(self.model, q, inlet, loss)).holds:
            self.record.note(REFUSAL, text=found.sentence)

    # -- the loop

    def _begin(self, done: int) -> None:
        total = max(done, math.ceil(self.options.duration / self.options.control.step * (1 - 1e-9)))
        self.record.begin("transient", total)

    def _go(self) -> Runner:
        progress, every = self.progress, self.options.judge_every
        _, judged = _verdicts_beside(progress.steps, every)
        before, stop_when = self._certain_before(), self._verdicts_to_stop_at()
        try:
            while not self.stopped and progress.state.time < self.options.end:
                self._step()
                if gone := self._beyond_pump(progress.state):
                    self._fail(gone)
                    break
                if progress.steps == judged:
                    verdict = self._judge()
                    certain = verdict.name if verdict.decided else ""
                    self.stopped = bool(certain) and certain in stop_when and certain == before
                    before, (_, judged) = certain, _verdicts_beside(progress.steps, every)
        except StepFailure as failure:
            smallest = self.options.control.step * self.options.control.smallest
            self._fail(
                f"No step was found from {progress.state.time:.6g} s on, after {progress.steps} steps: "
                f"{str(failure).rstrip('.')}; steps down to {smallest:.3g} s and a line search were tried."
            )
        except KeyboardInterrupt:
            self.interrupted = True
        if progress.state.time == self._row.get("time") != self._saved_at:  # a row may be missing when interrupted
            self._save()
        self.history.flush()
        if not self.interrupted and not self.failures:
            self._checkpoint(needed=True)
        self.verdict = self._judge() if self.history.rows > 1 else None
        around = rise_around(self.history, self.model) if self.history.rows > 1 else 0.0
        said = beyond_model(self.history, self.case.vacuum_pressure, around) if self.model.flow.has_fluid else None
        if said:
            self.record.warn(said)
        if coarse := self.control.coarse:
            step = self.options.control.step * self.options.control.smallest
            self.record.warn(
                f"The local error of {coarse} of {progress.steps} steps is above transient.local_error, "
                f"{1e3 * self.options.control.error:.3g} mm, up to {1e3 * self.control.largest_error:.3g} mm: "
                f"transient.smallest_step allows none shorter than {step:.3g} s."
            )
        return self

    def _fail(self, sentence: str) -> None:
        self.failures.append(sentence)
        self.record.fail(sentence)

    def _certain_before(self) -> str:
        """The certain verdict that a run had before it goes on, as the same once more may end it."""
        steps = self.progress.steps
        due, _ = _verdicts_beside(steps, self.options.judge_every)
        found = [note for note in self.record.notes("verdict") if note["steps"] == due > 0]
        if not found and due == steps > 0:  # ended before it was judged
            found = [self._judge().summary()]
        return found[-1]["verdict"] if found and found[-1]["decided"] else ""

    def _verdicts_to_stop_at(self) -> set[str]:
        """Verdicts of `stop_when` but those at which the run was complete before it was asked to go on."""
        asked, last = set(self.options.stop_when), ""
        for note in self.record.log:
            if note["what"] == "verdict":
                last = note["verdict"] if note["decided"] else ""
            elif note["what"] == "end" and note["complete"]:
                asked.discard(last)
        return asked

    def _step(self) -> None:
        options, progress = self.options, self.progress
        before = progress.state.time
        result = self.control.advance(progress.state, options.next_stop(before))
        progress.advance(result)
        time = progress.state.time
        row = self._reader.row(progress, result.load, time - before, result.residuals)
        self.history.append(row)
        self._row = row
        if options.states_due(time) > options.states_due(before):
            self._save()
        if progress.steps % options.restart_every == 0:
            self._checkpoint()
        self.record.item(row)

    def _save(self) -> None:
        """Keep the full state of the last row."""
        self._saved_at = self._row["time"]  # before: Ctrl-C comes when the state is written
        self.progress.saved += 1
        self.history.state(self.progress.state, self._row)

    def _checkpoint(self, needed: bool = False) -> None:
        """Make the past safe, and the future independent of it but for the state."""
        progress, outside = self.progress, self.motion.outside
        self.stepper.forget()
        if outside is not None:
            outside.start_afresh(progress.state.q, progress.state.v)
            progress.renewed = outside.renewed
        progress.control = tuple(self.control.pack())
        self.history.restart(progress, needed)

    # -- what the run amounts to

    def _judge(self) -> RunVerdict:
        state, model = self.progress.state, self.model
        inlet, residual = self.drive(state.time), np.nan
        if state.time >= self.drive.settled_at:
            inlet = supplied_pressure(self.motion, state, inlet)
            if inlet > model.flow.back:
                scale = model.force_scale(state.q, inlet)
                residual = float(np.linalg.norm(model.residual(state.q, inlet)) / scale)
        verdict = assess(self.history, model, residual, self.drive)
        self.record.note("verdict", **verdict.summary())
        self.record.progress(f"{verdict.name}{'' if verdict.decided else '?'} at {state.time:.4g} s")
        return verdict

    def _beyond_pump(self, state: MotionState) -> str:
        """Sentence where the flow has left the pump's table; empty otherwise."""
        pump = self.model.pump
        if pump is None:
            return ""
        flow = pumped_flow(self.model, state)
        if pump.holds(flow):
            return ""
        return (
            f"At {state.time:.6g} s the flow at the pump is {1e3 * flow:.4g} L/s, and its table goes from "
            f"{1e3 * pump.flow[0]:.4g} to {1e3 * pump.flow[-1]:.4g} L/s; the run ends there."
        )


def _verdicts_beside(steps: int, every: int) -> tuple[int, int]:
    """Numbers of the steps after which the last verdict was due, 0 without one, and the next one will be; the same
    sequence wherever a run was resumed.
    """
    last, due = 0, every
    while due <= steps:
        last, due = due, max(due + every, int(1.05 * due))
    return last, due
