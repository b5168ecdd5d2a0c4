"""A transient run: steps until the end or until the verdict is certain, told to whoever keeps or watches it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..errors import SolveError
from ..model import ValveModel
from ..model.equilibria import model_warnings
from ..model.valve import QUARTERS
from ..observer import Observer
from .assess import RunVerdict, assess, beyond_model
from .control import step_control
from .drive import Drive
from .equations import ValveMotion
from .history import History, Reader
from .options import RunOptions
from .staggered import StaggeredMotion
from .start import first_state
from .state import MotionState
from .stepper import StepFailure, Stepper


class Keeper(Protocol):
    """Where a run is kept, such as `dbvfiv.transient.file.TransientFile`."""

    def rows(self, columns: dict[str, np.ndarray]) -> None:
        """Rows of the history."""

    def due(self) -> bool:
        """Whether rows have been held back long enough."""

    def state(self, state: MotionState, row: dict[str, Any]) -> None:
        """A full state."""

    def restart(self, numbers: np.ndarray, rows: int) -> None:
        """All that is needed to go on after a number of rows; what was kept before must be safe by then."""

    def verdict(self, verdict: RunVerdict) -> None:
        """The verdict so far."""


@dataclass
class Progress:
    """Where a run stands.

    Attributes
    ----------
    state : MotionState
    steps : int
    saved : int
        Full states kept so far.
    work, dissipation, energy : float
        The books of energy, J of a quarter.
    control : tuple of float
        Of the step control.
    eigenvalue : complex
        Of the mode of a kick; not a number without.
    """

    state: MotionState
    steps: int = 0
    saved: int = 0
    work: float = 0.0
    dissipation: float = 0.0
    energy: float = 0.0
    control: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    eigenvalue: complex = complex(np.nan, np.nan)

    def pack(self) -> np.ndarray:
        """One vector for a file."""
        head = [
            self.steps,
            self.saved,
            self.work,
            self.dissipation,
            self.energy,
            self.eigenvalue.real,
            self.eigenvalue.imag,
            *self.control,
        ]
        return np.concatenate([[len(head)], head, self.state.pack()])

    @classmethod
    def unpack(cls, numbers: np.ndarray, stations: int) -> Progress:
        """Undo `pack`."""
        count = int(numbers[0])
        head = numbers[1 : count + 1]
        state = MotionState.unpack(numbers[count + 1 :], stations)
        steps, saved, work, dissipation, energy, real, imaginary = head[:7]
        return cls(state, int(steps), int(saved), work, dissipation, energy, tuple(head[7:]), complex(real, imaginary))


@dataclass
class TransientRun:
    """What a run found.

    Attributes
    ----------
    model : ValveModel
    history : History
    progress : Progress
    verdict : RunVerdict
    warnings, failures : list of str
    interrupted : bool
    stopped : bool
        Whether the verdict ended it.
    residuals, solves, factorisations, halvings : int
        Work done, of this part of the run if it was resumed.
    """

    model: ValveModel
    history: History
    progress: Progress
    verdict: RunVerdict
    warnings: list[str] = field(default_factory=list)
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
        Of the model's case by default.
    observer : Observer, optional
    keeper : Keeper, optional
    """

    def __init__(
        self,
        model: ValveModel,
        options: RunOptions | None = None,
        observer: Observer | None = None,
        keeper: Keeper | None = None,
    ):
        self.model = model
        self.options = RunOptions.of(model.case) if options is None else options
        self.observer = Observer() if observer is None else observer
        self.keeper = keeper
        self.drive = Drive.of(model.case)
        self.motion = StaggeredMotion(model) if model.case.transient.coupling == "staggered" else ValveMotion(model)
        self.stepper = Stepper(self.motion, self.options.scheme, self.drive, self.options.step)
        self.control = step_control(self.stepper, self.options.control)
        self.gap = QUARTERS * float(model.mesh.rest_area[0] - model.mesh.wall_deduction[0])

    def start(self, first: MotionState | None = None) -> TransientRun:
        """Run from the case's first state, or from a given one.

        Raises
        ------
        SolveError, CaseError
            If there is no first state.
        """
        self._begin(0)
        inlet = self.drive(0.0)
        state, kick = (
            (first, None) if first is not None else first_state(self.motion, self.model.case, inlet, self.observer)
        )
        progress = Progress(
            state, energy=sum(self.motion.energies(state.q, state.v)), control=tuple(self.control.pack())
        )
        if kick is not None:
            progress.eigenvalue = kick.eigenvalue
        self._reader = Reader(self.motion, progress.energy)
        history = History(self.model.stations)
        row = self._reader.first(state, inlet)
        history.append(row)
        self._kept = 0
        self._save(progress, row)
        self._checkpoint(history, progress)
        return self._go(history, progress)

    def resume(self, history: History, numbers: np.ndarray) -> TransientRun:
        """Go on from a restart point with the history up to it."""
        progress = Progress.unpack(numbers, self.model.stations)
        self._begin(progress.steps)
        self.control.unpack(progress.control)
        self._reader = Reader(self.motion, progress.energy, progress.work, progress.dissipation)
        self._kept = history.rows
        self.stepper.forget()
        return self._go(history, progress)

    # -- the loop
    # ----

    def _begin(self, done: int) -> None:
        total = max(done, math.ceil(self.options.duration / self.options.control.step * (1 - 1e-9)))
        self.observer.begin("transient", total)
        self._warnings = list(model_warnings(self.model))
        for sentence in self._warnings:
            self.observer.warn(sentence)

    def _go(self, history: History, progress: Progress) -> TransientRun:
        options, failures = self.options, []
        interrupted = stopped = False
        judged = _next_verdict(progress.steps, options.judge_every)
        before = ""
        row: dict[str, Any] = {}
        try:
            while not stopped and progress.state.time < options.duration * (1 - 1e-12) - 1e-9 * options.control.step:
                row = self._step(history, progress)
                if progress.steps == judged:
                    verdict = self._verdict(history, progress)
                    certain = verdict.name if verdict.decided else ""
                    stopped = bool(certain) and certain in options.stop_when and certain == before
                    before = certain
                    judged = _next_verdict(progress.steps, options.judge_every)
        except StepFailure as failure:
            failures.append(self._failed(progress, failure))
            self.observer.warn(failures[-1])
        except KeyboardInterrupt:
            interrupted = True
        finish = not interrupted and not failures
        if row and not (options.save_every and _multiple(progress.state.time, options.save_every)):
            self._save(progress, row)
        if self.keeper is not None:
            self.keeper.rows(history.since(self._kept))
        self._kept = history.rows
        if finish:
            self._checkpoint(history, progress)
        verdict = self._verdict(history, progress)
        sentence = beyond_model(history)
        if sentence:
            self._warnings.append(sentence)
            self.observer.warn(sentence)
        self.observer.end(interrupted)
        work = (self.stepper.residuals, self.stepper.solves, self.stepper.factorisations, self.control.halvings)
        return TransientRun(
            self.model, history, progress, verdict, self._warnings, failures, interrupted, stopped, *work
        )

    def _step(self, history: History, progress: Progress) -> dict[str, Any]:
        options = self.options
        old = progress.state
        result = self.control.advance(old, self._next_stop(old.time))
        progress.state = result.state
        row = self._reader.row(result, result.state.time - old.time)
        history.append(row)
        progress.steps += 1
        progress.work, progress.dissipation = self._reader.work, self._reader.dissipation
        if (
            options.save_every
            and result.state.time >= (progress.saved * options.save_every) - 1e-9 * options.control.step
        ):
            self._save(progress, row)
        if progress.steps % options.restart_every == 0:
            self._checkpoint(history, progress)
        elif self.keeper is not None and self.keeper.due():
            self.keeper.rows(history.since(self._kept))
            self._kept = history.rows
        self.observer.item(row)
        return row

    def _next_stop(self, time: float) -> float:
        """Instant that adaptive steps must meet: the next full state or the end."""
        every, end = self.options.save_every, self.options.duration
        if not every:
            return end
        return min(end, every * (math.floor(time / every * (1 + 1e-12) + 1e-9) + 1))

    def _save(self, progress: Progress, row: dict[str, Any]) -> None:
        if self.keeper is not None:
            self.keeper.state(progress.state, row)
        progress.saved += 1

    def _checkpoint(self, history: History, progress: Progress) -> None:
        """Make the past safe, and the future independent of it but for the state."""
        self.stepper.forget()
        progress.control = tuple(self.control.pack())
        if self.keeper is not None:
            self.keeper.rows(history.since(self._kept))
            self.keeper.restart(progress.pack(), history.rows)
        self._kept = history.rows

    # -- what the run amounts to
    # ----

    def _verdict(self, history: History, progress: Progress) -> RunVerdict:
        state, inlet = progress.state, self.drive(progress.state.time)
        residual = np.nan
        constant = self.drive.constant_after(state.time)
        if constant and inlet > 0:
            residual = float(
                np.linalg.norm(self.model.residual(state.q, inlet)) / self.model.force_scale(state.q, inlet)
            )
        since = self.drive.times[-1] if constant else 0.0
        if np.count_nonzero(history["time"] >= since) < 2:
            since = 0.0
        verdict = assess(history, self.gap, residual, since=since)
        if self.keeper is not None:
            self.keeper.verdict(verdict)
        self.observer.progress(f"{verdict.name}{'' if verdict.decided else '?'} at {state.time:.4g} s")
        return verdict

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
    model: ValveModel, options: RunOptions | None = None, observer: Observer | None = None, keeper: Keeper | None = None
) -> TransientRun:
    """Run the case of a model; see `Runner`.

    A step that is not found ends the run, which keeps everything up to there and says so in `failures`; so does an
    interrupt.
    """
    return Runner(model, options, observer, keeper).start()


def _next_verdict(steps: int, every: int) -> int:
    """Number of the step after which the next verdict is due; the same sequence wherever a run was resumed."""
    due = every
    while due <= steps:
        due = max(due + every, int(1.05 * due))
    return due


def _multiple(time: float, every: float) -> bool:
    return abs(time / every - round(time / every)) < 1e-6
