"""Hooks of a run: progress, checkpoints, early stops.  Solvers themselves never print."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path


class Observer:
    """Override what is of interest; everything else does nothing."""

    def started(self, branch) -> None:
        """Before the first step."""

    def accepted(self, branch) -> None:
        """After each new point; ``branch.points[-1]`` is the point."""

    def refused(self, branch, reason: str, step: float) -> None:
        """A step failed or turned too far and is tried again, shorter."""

    def found(self, branch, special) -> None:
        """A special point was detected."""

    def ended(self, branch) -> None:
        """After the last step, also when interrupted."""


class Calling(Observer):
    """Calls a function with the branch after each point."""

    def __init__(self, function: Callable):
        self._function = function

    def accepted(self, branch):
        self._function(branch)


class Checkpoint(Observer):
    """Saves the branch every few points, so that a killed run can be resumed.

    Parameters
    ----------
    path : path
    every : int
        Points between writes.
    """

    def __init__(self, path: str | Path, every: int = 10):
        if every < 1:
            raise ValueError(f"A checkpoint needs at least one point in between, not {every}.")
        self.path, self.every = Path(path), every

    def accepted(self, branch):
        if len(branch) % self.every == 0:
            branch.save(self.path)

    def ended(self, branch):
        branch.save(self.path)


def as_observers(observers) -> list[Observer]:
    """Accept one observer, a plain callable, or a sequence of either."""
    if observers is None:
        return []
    if isinstance(observers, Observer) or callable(observers):
        observers = [observers]
    return [o if isinstance(o, Observer) else Calling(o) for o in observers]


def run_observed(branch, observers: list[Observer], steps: Callable[[], str]):
    """Run the steps of a branch between its first and last call of the observers; the branch itself.

    The steps return why they ended.  An interruption ends the branch; an error goes on to the caller, with the branch
    so far as its attribute ``branch``.
    """
    for observer in observers:
        observer.started(branch)
    try:
        branch.reason = steps()
    except KeyboardInterrupt:
        branch.reason = "interrupted"
    except Exception as error:
        branch.reason = f"error: {error}"
        error.branch = branch
        raise
    finally:
        for observer in observers:
            observer.ended(branch)
    return branch
