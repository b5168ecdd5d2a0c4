"""Options of a run in time."""

from __future__ import annotations

from dataclasses import dataclass

from ..case.model import Case
from .control import ControlOptions
from .scheme import Scheme, scheme
from .stepper import StepOptions


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes
    ----------
    duration : float, s
    scheme : Scheme
    control : ControlOptions
    step : StepOptions
    save_every : float
        Distance in time of full states, s; zero for none but the last.
    restart_every : int
        Steps between restart points.
    stop_when : tuple of str
        Verdicts that end the run once they are certain.
    judge_every : int
        Smallest number of steps between two verdicts.
    """

    duration: float
    scheme: Scheme
    control: ControlOptions
    step: StepOptions = StepOptions()
    save_every: float = 0.0
    restart_every: int = 500
    stop_when: tuple[str, ...] = ()
    judge_every: int = 100

    @property
    def end(self) -> float:
        """Time, s, from which on no further step is made: that of the last step but for rounding."""
        return self.duration * (1 - 1e-12) - 1e-9 * self.control.step

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
            restart_every=t.restart_every,
            stop_when=tuple(t.stop_when),
        )
