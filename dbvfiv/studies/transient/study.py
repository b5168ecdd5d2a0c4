"""A transient run: steps until the end or until the verdict is certain, kept in a record as it goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import CaseError, SolveError
from ...model import ValveModel
from ...model.equilibria import model_warnings
from ...model.material_stability import material_stability
from ...motion.control import Drive, RunOptions, step_control
from ...motion.equations import ValveMotion
from ...motion.start import first_state
from ...motion.state import MotionState, consistent_state
from ...motion.stepper import StepFailure, Stepper
from ...record.files import kind_of
from ...record.header import Header
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record, StoredRecord
from ...record.states import state_table
from ..case import Case
from ..comparing import labels
from ..session import Session
from ..study import Study
from . import figures
from .history import Reader
from .keeping import RESTART, STATES, Keeper, Progress, rows_to_keep, tables_of
from .result import REFUSAL, RunVerdict, TransientResult, assess, beyond_model


def stored_state(motion: ValveMotion, case: Case, inlet: float) -> MotionState:
    """State `transient.start_state` of `transient.start_file`, a steady or a transient result on the same mesh.

    A wall that relaxes starts without stress in its branches: states do not hold what it remembered.

    Parameters
    ----------
    motion : ValveMotion
    case : Case
    inlet : float
        Inlet pressure of the first instant, Pa.

    Raises
    ------
    CaseError
        If the file cannot be read, has no such state, or belongs to another mesh.
    """
    path, index, model = Path(case.transient.start_file), case.transient.start_state, motion.model
    record, moving = _read(path)
    count = record.rows(STATES)
    if not count:
        raise CaseError(f"{str(path)!r} holds no states to start from.")
    if not -count <= index < count:
        raise CaseError(f"{str(path)!r} holds {count} states, so there is no state {index}.")
    if record.mesh.nodes.shape != model.mesh.nodes.shape:
        raise CaseError(
            f"The states of {str(path)!r} belong to a mesh of {len(record.mesh.nodes)} nodes and this case's has "
            f"{len(model.mesh.nodes)}."
        )
    q = model.shell.dofs.restrict(record.value(STATES, "nodal", index))
    if not moving:
        speed = float(record.value(STATES, "station_velocity", index)[-1])
        return consistent_state(motion, 0.0, q, np.zeros(model.size), speed, inlet)
    v = model.shell.dofs.restrict(record.value(STATES, "nodal_rate", index))
    return consistent_state(motion, 0.0, q, v, float(record.value(STATES, "inlet_velocity", index)), inlet)


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


@dataclass
class TransientRun:
    """Result of a run, besides its record.

    Attributes
    ----------
    model : ValveModel
    history : Keeper
        Columns of the history by their names.
    progress : Progress
    verdict : RunVerdict or None
        None if not even one step was made.
    failures : list of str
    interrupted : bool
    stopped : bool
        True where the verdict ended the run.
    residuals, solves, factorisations, halvings : int
        Work done, of this part of the run if it was resumed.
    """

    model: ValveModel
    history: Keeper
    progress: Progress
    verdict: RunVerdict | None
    failures: list[str] = field(default_factory=list)
    interrupted: bool = False
    stopped: bool = False
    residuals: int = 0
    solves: int = 0
    factorisations: int = 0
    halvings: int = 0


class Runner:
    """Runs one case.

    Parameters
    ----------
    model : ValveModel
    options : RunOptions, optional
        Of the case by default.
    record : GrowingRecord, optional
        Keeps the run and is told of its progress; one in memory by default.
    case : Case, optional
        That of the model by default; it may differ in keys of the study.
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
        self.record = _in_memory(model, case) if record is None else record
        self.options = RunOptions.of(case) if options is None else options
        self.drive = Drive.of(case)
        self.motion = ValveMotion(model, staggered=case.transient.coupling == "staggered")
        self.stepper = Stepper(self.motion, self.options.scheme, self.drive, self.options.step)
        self.control = step_control(self.stepper, self.options.control)
        self.keeper = Keeper(self.record, model)

    def start(self, first: MotionState | None = None) -> TransientRun:
        """Run from the case's first state, or from a given one.

        Raises
        ------
        SolveError, CaseError
            If there is no first state.
        """
        self._begin(0)
        inlet = self.drive(0.0)
        state, kick = (first, None) if first is not None else self._first(inlet)
        energy = sum(self.motion.energies(state.q, state.v)) + self.motion.outside_energy(state.q, state.v)
        energy += self.motion.model.weight_energy(state.q)
        progress = Progress(state, energy=energy, control=tuple(self.control.pack()))
        if kick is not None:
            progress.eigenvalue = kick.eigenvalue
            self._judge_rubber(state, inlet)
        self._reader = Reader(self.motion, progress.energy)
        row = self._reader.first(state, inlet)
        self.keeper.append(row)
        self._save(progress, row)
        self._checkpoint(progress, needed=True)
        return self._go(progress)

    def resume(self) -> TransientRun:
        """Go on from the last restart point of the record, which must hold the rows up to that and no more."""
        progress = Progress.read(self.record, wall=self.motion.wall)
        self._begin(progress.steps)
        self.control.unpack(progress.control)
        books = progress.energy, progress.work, progress.dissipation, progress.contact_loss, progress.numerical_loss
        self._reader = Reader(self.motion, *books)
        self.stepper.forget()
        if self.motion.outside is not None:
            self.motion.outside.start_afresh(progress.state.q, progress.state.v)
            self.motion.outside.renewed = progress.renewed
        return self._go(progress)

    def _first(self, inlet: float):
        if self.case.transient.start == "state":
            return stored_state(self.motion, self.case, inlet), None
        return first_state(self.motion, self.case, inlet, self.record)

    def _judge_rubber(self, state: MotionState, inlet: float) -> None:
        """Note where the constants of rubbers with loss factors do not hold at the state that is kicked."""
        loss = self.motion.mu.loss_factor
        found = material_stability(self.model, state.q, inlet, loss) if loss else None
        if found is not None and not found.holds:
            self.record.note(REFUSAL, text=found.sentence)
            self.record.warn(found.sentence)

    # -- the loop
    # ----

    def _begin(self, done: int) -> None:
        total = max(done, math.ceil(self.options.duration / self.options.control.step * (1 - 1e-9)))
        self.record.begin("transient", total)
        for sentence in model_warnings(self.model):
            self.record.warn(sentence)

    def _go(self, progress: Progress) -> TransientRun:
        failures: list[str] = []
        interrupted = stopped = False
        judged = _next_verdict(progress.steps, self.options.judge_every)
        before = self._certain_before(progress)
        row: dict[str, Any] = {}
        try:
            while not stopped and progress.state.time < self.options.end:
                row = self._step(progress)
                gone = self._beyond_pump(progress.state)
                if gone:
                    failures.append(gone)
                    self.record.fail(gone)
                    break
                if progress.steps == judged:
                    verdict = self._verdict(progress)
                    certain = verdict.name if verdict.decided else ""
                    stopped = bool(certain) and certain in self.options.stop_when and certain == before
                    before = certain
                    judged = _next_verdict(progress.steps, self.options.judge_every)
        except StepFailure as failure:
            failures.append(self._failed(progress, failure))
            self.record.fail(failures[-1])
        except KeyboardInterrupt:
            interrupted = True
        if row and not (self.options.save_every and _multiple(progress.state.time, self.options.save_every)):
            self._save(progress, row)
        self.keeper.flush()
        if not interrupted and not failures:
            self._checkpoint(progress, needed=True)
        verdict = self._verdict(progress) if self.keeper.rows > 1 else None
        sentence = beyond_model(self.keeper)
        if sentence:
            self.record.warn(sentence)
        work = (self.stepper.residuals, self.stepper.solves, self.stepper.factorisations, self.control.halvings)
        return TransientRun(self.model, self.keeper, progress, verdict, failures, interrupted, stopped, *work)

    def _certain_before(self, progress: Progress) -> str:
        """The certain verdict that a run had before it goes on, as the same once more may end it."""
        due = _last_verdict(progress.steps, self.options.judge_every)
        found = [note for note in self.record.notes("verdict") if note["steps"] == due > 0]
        if not found and due == progress.steps > 0:  # ended before it was judged
            found = [self._verdict(progress).summary()]
        return found[-1]["verdict"] if found and found[-1]["decided"] else ""

    def _step(self, progress: Progress) -> dict[str, Any]:
        options = self.options
        old = progress.state
        result = self.control.advance(old, self._next_stop(old.time))
        progress.state = result.state
        row = self._reader.row(result, result.state.time - old.time)
        self.keeper.append(row)
        progress.steps += 1
        progress.work, progress.dissipation = self._reader.work, self._reader.dissipation
        progress.contact_loss, progress.numerical_loss = self._reader.contact_loss, self._reader.numerical_loss
        if (
            options.save_every
            and result.state.time >= (progress.saved * options.save_every) - 1e-9 * options.control.step
        ):
            self._save(progress, row)
        if progress.steps % options.restart_every == 0:
            self._checkpoint(progress)
        self.record.item(row)
        return row

    def _next_stop(self, time: float) -> float:
        """Instant that adaptive steps must meet: the next full state or the end."""
        every, end = self.options.save_every, self.options.duration
        if not every:
            return end
        return min(end, every * (math.floor(time / every * (1 + 1e-12) + 1e-9) + 1))

    def _save(self, progress: Progress, row: dict[str, Any]) -> None:
        self.keeper.state(progress.state, row)
        progress.saved += 1

    def _checkpoint(self, progress: Progress, needed: bool = False) -> None:
        """Make the past safe, and the future independent of it but for the state."""
        self.stepper.forget()
        outside = self.motion.outside
        if outside is not None:
            outside.start_afresh(progress.state.q, progress.state.v)
            progress.renewed = outside.renewed
        progress.control = tuple(self.control.pack())
        self.keeper.restart(progress, needed)

    # -- what the run amounts to
    # ----

    def _verdict(self, progress: Progress) -> RunVerdict:
        state, inlet = progress.state, self.drive(progress.state.time)
        residual = np.nan
        constant = self.drive.constant_after(state.time)
        if constant and inlet > self.model.flow.back:
            residual = float(
                np.linalg.norm(self.model.residual(state.q, inlet)) / self.model.force_scale(state.q, inlet)
            )
        since = self.drive.times[-1] if constant else 0.0
        if np.count_nonzero(self.keeper["time"] >= since) < 2:
            since = 0.0
        verdict = assess(self.keeper, self.model, residual, since=since)
        self.record.note("verdict", **verdict.summary())
        self.record.progress(f"{verdict.name}{'' if verdict.decided else '?'} at {state.time:.4g} s")
        return verdict

    def _beyond_pump(self, state: MotionState) -> str:
        """Sentence where the flow has left the pump's table; empty otherwise."""
        pump = self.model.pump
        if pump is None or not self.motion.moving_fluid:
            return ""
        velocity = state.speed if state.line is None else float(state.line.velocity[0])
        mesh = self.model.mesh
        flow = mesh.part.copies * float(mesh.rest_area[-1] - mesh.wall_deduction[-1]) * velocity
        if pump.holds(flow):
            return ""
        return (
            f"At {state.time:.6g} s the flow at the pump is {1e3 * flow:.4g} L/s, and its table goes from "
            f"{1e3 * pump.flow[0]:.4g} to {1e3 * pump.flow[-1]:.4g} L/s; the run ends there."
        )

    def _failed(self, progress: Progress, failure: StepFailure) -> str:
        time, smallest = progress.state.time, self.options.control.step * self.options.control.smallest
        return str(
            SolveError(
                f"No step was found from {time:.6g} s on, after {progress.steps} steps: "
                f"{str(failure).rstrip('.')}; steps down to "
                f"{smallest:.3g} s and a line search were tried."
            )
        )


def run_transient(
    model: ValveModel, options: RunOptions | None = None, record: GrowingRecord | None = None
) -> TransientRun:
    """Run the case of a model; see `Runner`.

    A step that is not found ends the run, which keeps everything up to there and says so in `failures`; so does an
    interrupt.
    """
    return Runner(model, options, record).start()


def _in_memory(model: ValveModel, case: Case) -> GrowingRecord:
    mesh = MeshData.of(model)
    return GrowingRecord(Header.of("transient", case), mesh, tables_of(mesh))


def _next_verdict(steps: int, every: int) -> int:
    """Number of the step after which the next verdict is due; the same sequence wherever a run was resumed."""
    due = every
    while due <= steps:
        due = max(due + every, int(1.05 * due))
    return due


def _last_verdict(steps: int, every: int) -> int:
    """Number of the step of the last verdict that was due up to a number of steps; 0 without one."""
    last, due = 0, every
    while due <= steps:
        last, due = due, max(due + every, int(1.05 * due))
    return last


def _multiple(time: float, every: float) -> bool:
    return abs(time / every - round(time / every)) < 1e-6


def run(session: Session, record: GrowingRecord) -> None:
    """The history that the section transient of the case asks for, from where the record ends."""
    runner = Runner(session.model, record=record, case=session.case)
    found = runner.resume() if record.rows(RESTART) else runner.start()
    if found.interrupted:
        raise KeyboardInterrupt


@dataclass(frozen=True)
class Together:
    """Several runs, their verdicts in one table, their histories in one figure."""

    results: Sequence[TransientResult]
    labels: list[str]

    def lines(self) -> list[str]:
        """Table for people: last values, amplitude, frequency and verdict of each run."""
        width = max(len(name) for name in self.labels) + 2
        lines = [f"{'':<{width}}{'last kg/s':>11}{'lip mm':>9}{'amplitude mm':>14}{'Hz':>8}  verdict"]
        for name, result in zip(self.labels, self.results):
            lip, h = result.verdict["lip_displacement"], result.history
            frequency = "-" if lip["frequency"] is None else f"{lip['frequency']:.3f}"
            lines.append(
                f"{name:<{width}}{h['mass_flow'][-1]:>11.5g}{1e3 * h['lip_displacement'][-1]:>9.4g}"
                f"{1e3 * lip['amplitude']:>14.4g}{frequency:>8}  {result.verdict['verdict']}"
            )
        return lines

    def document(self) -> dict[str, Any]:
        """Part of the JSON document beside the runs themselves: nothing."""
        return {}

    def draw(self) -> Figure:
        """Figure of the runs."""
        return figures.draw_together(self.results)


def compare(results: Sequence[TransientResult]) -> Together:
    """Several runs side by side.

    Raises
    ------
    CaseError
        If one of them has no step.
    """
    for result in results:
        result.require_steps()
    return Together(results, labels(results, figures.QUIET))


STUDY = Study("transient", tables_of, run, TransientResult, rows_to_keep=rows_to_keep, compare=compare)
