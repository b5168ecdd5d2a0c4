"""A run in time: the pressure that drives it, its options, and the length of its steps, on a fixed grid with halvings
where the iteration fails, or by the estimated local error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from .scheme import Scheme, scheme
from .stepper import MotionState, StepFailure, StepOptions, Stepper, StepResult


@dataclass(frozen=True)
class ControlOptions:
    """Options of the step control."""

    step: float  #: Nominal step, s; with `adaptive` the first and the largest one.
    adaptive: bool = False  #: Follow the local error.
    error: float = 1e-6  #: Local error of the displacements, m, that adaptive steps aim at.
    smallest: float = 1.0 / 4096.0  #: Smallest step over the nominal one.


class FixedSteps:
    """Nominal steps on a grid; one that fails is halved, and steps grow back as soon as they fit the grid.

    Attributes
    ----------
    level : int
        The present step is the nominal one over 2^level.
    offset : int
        Steps of the present length since the last point of the nominal grid.
    """

    coarse = 0  #: No local error is asked for.

    def __init__(self, stepper: Stepper, options: ControlOptions):
        self.stepper, self.options = stepper, options
        self.level = self.offset = self.successes = self.halvings = 0

    def advance(self, state: MotionState, end: float) -> StepResult:
        """One accepted step. Raises StepFailure if the smallest step failed too."""
        while True:
            h = self.options.step / 2**self.level
            try:
                result = self.stepper.step(state, h)
            except StepFailure:
                if self.options.step / 2 ** (self.level + 1) < self.options.smallest * self.options.step:
                    raise
                self.level, self.offset, self.successes = self.level + 1, 2 * self.offset, 0
                self.halvings += 1
                self.stepper.forget(all=False)
                continue
            self._grow()
            return result

    def _grow(self) -> None:
        self.offset += 1
        self.successes += 1
        # two steps in a row before trying twice the length, which must end on the coarser grid
        while self.level and self.offset % 2 == 0 and self.successes >= 2:
            self.level, self.offset, self.successes = self.level - 1, self.offset // 2, 0
        if self.level == 0:
            self.offset = 0

    def pack(self) -> list[float]:
        """Numbers that continue the control elsewhere."""
        return [self.level, self.offset, self.successes, self.options.step]

    def unpack(self, numbers) -> None:
        self.level, self.offset, self.successes = (int(value) for value in numbers[:3])


class AdaptiveSteps:
    """Steps that keep the local error near a target; a step is changed only where it pays for a new factorisation.

    Attributes
    ----------
    coarse : int
        Steps of the smallest length whose error is above the target all the same.
    largest_error : float, m
        Of those.
    """

    def __init__(self, stepper: Stepper, options: ControlOptions):
        self.stepper, self.options = stepper, options
        self.h = options.step
        self.halvings = self.coarse = 0
        self.largest_error = 0.0

    def advance(self, state: MotionState, end: float) -> StepResult:
        """One accepted step, not beyond `end`. Raises StepFailure if the smallest step failed too."""
        smallest = self.options.smallest * self.options.step
        while True:
            h = min(self.h, end - state.time) if end - state.time > 1e-9 * self.options.step else self.h
            try:
                result = self.stepper.step(state, h)
            except StepFailure:
                if 0.5 * h < smallest:
                    raise
                self.h, self.halvings = 0.5 * h, self.halvings + 1
                self.stepper.retry()
                continue
            if np.isnan(result.error):
                return result
            ratio = (self.options.error / max(result.error, 1e-30)) ** (1.0 / 3.0)
            if ratio < 0.7:
                if 0.5 * h >= smallest:
                    self.h = max(smallest, h * max(0.3, 0.9 * ratio))
                    self.stepper.take_back()
                    continue
                self.coarse += 1
                self.largest_error = max(self.largest_error, result.error)
            if h == self.h and not 0.8 < ratio < 1.6:
                self.h = min(self.options.step, max(smallest, self.h * min(2.0, 0.9 * ratio)))
            return result

    def pack(self) -> list[float]:
        return [self.h, 0.0, 0.0, self.options.step]

    def unpack(self, numbers) -> None:
        self.h = float(numbers[0])


def step_control(stepper: Stepper, options: ControlOptions):
    """The control that the options ask for."""
    return AdaptiveSteps(stepper, options) if options.adaptive else FixedSteps(stepper, options)


@dataclass(frozen=True)
class Drive:
    """Pressure through points in time, linear between them and constant beyond; applied at once before the first point.

    Examples
    --------
    >>> Drive((0.0, 0.1), (0.0, 6e3))(0.05)
    3000.0
    """

    times: tuple[float, ...]  #: s.
    pressures: tuple[float, ...]  #: Pa.

    def __call__(self, time: float) -> float:
        return float(np.interp(time, self.times, self.pressures))

    @property
    def settled_at(self) -> float:
        """Time, s, from which on the pressure is constant."""
        changes = [i for i, pressure in enumerate(self.pressures) if pressure != self.pressures[-1]]
        return self.times[changes[-1] + 1] if changes else 0.0

    @classmethod
    def of(cls, case: Case) -> Drive:
        """Drive of a case: constant, a ramp, or a table."""
        transient = case.transient
        if transient.drive_table is not None:
            return cls(*zip(*transient.drive_rows))
        if transient.ramp > 0:
            return cls((0.0, transient.ramp), (0.0, case.drive.pressure))
        return cls((0.0,), (case.drive.pressure,))


#: Fewest adaptive steps between restart points: the error of a step behind one is not known.
FEWEST = 20


@dataclass(frozen=True)
class RunOptions:
    """Options of a run."""

    duration: float  #: s.
    scheme: Scheme
    control: ControlOptions
    step: StepOptions = StepOptions()
    save_every: float = 0.0  #: Distance in time of full states, s; zero for the first and the last alone.
    restart_every: int = 500  #: Steps between restart points.
    stop_when: tuple[str, ...] = ()  #: Verdicts that end the run once they are certain.
    judge_every: int = 100  #: Smallest number of steps between two verdicts.

    @property
    def near(self) -> float:
        """Difference of times, s, that is none: times are sums of steps and rounded as often."""
        return 1e-3 * self.control.step

    @property
    def end(self) -> float:
        """Time, s, from which on no further step is made: that of the last step but for rounding."""
        return self.duration - self.near

    def states_due(self, time: float) -> int:
        """Full states due after the start and up to a time, s, but for that at the end."""
        return math.floor((time + self.near) / self.save_every) if self.save_every else 0

    def next_stop(self, time: float) -> float:
        """Instant, s, that adaptive steps must meet: the next full state or the end."""
        return min(self.duration, self.save_every * (self.states_due(time) + 1)) if self.save_every else self.duration

    @classmethod
    def of(cls, case: Case) -> RunOptions:
        """Options of a case file."""
        t = case.transient
        return cls(
            duration=t.duration,
            scheme=scheme(t.scheme, t.numerical_damping),
            control=ControlOptions(t.step, t.adaptive, t.local_error, t.smallest_step),
            step=StepOptions(tolerance=t.tolerance),
            save_every=t.save_every,
            restart_every=max(t.restart_every, FEWEST) if t.adaptive else t.restart_every,
            stop_when=tuple(t.stop_when),
        )
