"""Load steps: from one equilibrium to the next in pressure, for any model that an equilibrium solver takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import SolveError
from ..observer import Observer
from ..texts import digits
from .newton import EquilibriumSolver, NewtonOptions, NewtonResult

#: Farthest that an equilibrium of a wall that may snap lies from its prediction, over the mean wall thickness.
LARGEST_JUMP = 0.15
#: Ratio of the slopes at the ends of a step and of its chord up to which it follows its path: next to a limit point,
#: where slopes rise without bound and lie small again on the other path, a step of any size may cross over unseen.
ALIKE = 4.0
#: Motion, over the largest jump, below which a step need not be resolved.
SMALL = 0.1
#: Share of the way from the first pressure above which a load step is wide.
WIDE = 1 / 16


@dataclass(frozen=True)
class LoadStepOptions:
    """Options of load steps."""

    newton: NewtonOptions = NewtonOptions()
    min_step: float = 1e-4  #: Smallest load step over the target pressure before giving up.
    #: first_step and max_step: Pa; load step from the start, and the largest; without bounds the whole way is tried at
    #: once.
    first_step: float = np.inf
    max_step: float = np.inf
    #: m; an equilibrium farther from the prediction than this is taken for one on another path, and the step is halved;
    #: so is one whose path from the last one is not resolved, see `ALIKE`.
    largest_jump: float = np.inf
    first_jump: float = np.inf  #: m; the same from where the walk starts, whose slope is not known.
    #: Most iterations of a wide step, which is halved then: those that wander longer may end at another equilibrium,
    #: and two halves take fewer. Where the path ends, wide steps may wander.
    straight: int | None = None


@dataclass(frozen=True)
class LoadStepResult:
    """Newton iterations over all load steps to a pressure, number of load steps, last equilibrium iteration."""

    iterations: int
    steps: int
    result: NewtonResult


@dataclass
class LoadSteps:
    """Walks a model from one equilibrium to the next in pressure.

    Steps are predicted along the tangent of the equilibrium path, tried whole first, halved when Newton fails and
    doubled when it succeeds. Steps that may wander try a second line search before they are halved.

    Parameters
    ----------
    model : ValveModel, PressedShell or alike
    options : LoadStepOptions
    pressure : float, Pa
    q : (n,) array
        Where the walk starts; at rest by default.
    observer : Observer
    accepted : callable, optional
        Called as accepted(pressure, q) at every equilibrium on the way, the last included.
    """

    model: Any
    options: LoadStepOptions = LoadStepOptions()
    pressure: float = 0.0
    q: np.ndarray | None = None
    observer: Observer = field(default_factory=Observer)
    accepted: Callable[[float, np.ndarray], None] | None = None

    def __post_init__(self):
        self.q = self.model.rest() if self.q is None else np.asarray(self.q, float)
        self.solver = EquilibriumSolver(self.model, self.options.newton)
        self.fallback = EquilibriumSolver(self.model, replace(self.options.newton, line_search="l2"))
        self.slope: np.ndarray | None = None
        self.step, self.origin = self.options.first_step, self.pressure

    def reach(self, target: float) -> LoadStepResult:
        """Walk to a pressure, Pa; `self.pressure` and `self.q` hold the equilibrium. Raises SolveError if the load
        steps became smaller than allowed; `self.pressure` and `self.q` then hold the last equilibrium.
        """
        smallest = self.options.min_step * max(abs(target - self.origin), abs(self.pressure - self.origin))
        step = np.copysign(min(abs(target - self.pressure), self.step, self.options.max_step), target - self.pressure)
        iterations, steps, straight, refused = 0, 0, self.options.straight, False
        while True:
            remaining = target - self.pressure
            last = abs(step) >= abs(remaining) * (1 - 1e-12)
            aim = target if last else self.pressure + step
            result, slope = self._attempt(aim, straight)
            iterations += result.iterations
            if result.converged:
                steps += 1
                self._take(result, aim, slope)
                if self.accepted is not None:
                    self.accepted(aim, self.q)
                # after a refusal no longer one: it would end where, or beyond where, that did
                grown, refused = abs(step) if refused else 2 * abs(step), False
                self.step = max(grown, self.options.first_step)
                if last:
                    return LoadStepResult(iterations, steps, result)
                step = np.copysign(min(grown, abs(target - self.pressure), self.options.max_step), step)
                self.observer.progress(f"equilibrium at {aim:.6g} Pa, {result.iterations} iterations")
                continue
            step, refused = (aim - self.pressure) / 2, straight is None
            self.observer.progress(
                f"no equilibrium at {aim:.6g} Pa ({result.reason}), step halved to {digits(abs(step))} Pa"
            )
            if straight is not None and abs(step) < max(smallest, WIDE**2 * abs(target - self.origin)):
                # the path ends, as at a limit point: what lies beyond is where Newton's method strays to
                straight, step = None, target - self.pressure
            elif abs(step) < smallest * (1 - 1e-12):
                raise SolveError(
                    f"No equilibrium was found between {self.pressure:.6g} Pa, the last one, and {aim:.6g} "
                    f"Pa on the way to {target:.6g} Pa: "
                    f"{result.reason}; load steps down to {digits(2 * abs(step))} Pa and two line searches were tried."
                )

    def settle(self) -> NewtonResult:
        """Solve again at the present pressure, after something else of the model has changed. Raises SolveError."""
        for solver in (self.solver, self.fallback):
            result = solver.solve(self.q, self.pressure)
            if result.converged:
                self._take(result, self.pressure, _slope(solver, result, self.pressure))
                return result
        raise SolveError(f"The equilibrium at {self.pressure:.6g} Pa was lost: {result.reason}.")

    def _attempt(self, aim: float, straight: int | None) -> tuple[NewtonResult, np.ndarray | None]:
        """Result at a pressure, and dq/dP there if it is known."""
        start = self.q if self.slope is None else self.q + (aim - self.pressure) * self.slope
        wide = abs(aim - self.pressure) > WIDE * max(abs(aim - self.origin), abs(self.pressure - self.origin))
        first = self.solver.solve(start, aim, straight if wide else None)
        if first.converged or (wide and straight is not None):
            return self._judged(self.solver, first, start, aim)
        result, slope = self._judged(self.fallback, self.fallback.solve(self.q, aim), start, aim)
        return replace(result, iterations=result.iterations + first.iterations), slope

    def _judged(
        self, solver: EquilibriumSolver, result: NewtonResult, predicted: np.ndarray, pressure: float
    ) -> tuple[NewtonResult, np.ndarray | None]:
        """The result of a solver, refused if it lies far from the prediction or if the path to it is not resolved, and
        dq/dP there.
        """
        slope = _slope(solver, result, pressure)
        limit = self.options.first_jump if self.slope is None else self.options.largest_jump
        if not result.converged or not np.isfinite(limit):
            return result, slope
        jump, move, reason = self._size(result.q - predicted), result.q - self.q, ""
        if jump > limit:
            reason = f"the equilibrium found lies {jump:.2g} m from the predicted one"
        elif slope is not None and self.slope is not None and self._size(move) > SMALL * limit:
            sizes = [self._size(along) for along in (self.slope, slope, move / (pressure - self.pressure))]
            if max(sizes) > ALIKE * min(sizes):
                reason = "the path to the equilibrium found is not resolved"
        return replace(result, converged=False, reason=reason) if reason else result, slope

    def _size(self, q: np.ndarray) -> float:
        """Largest displacement of a state, or of a motion."""
        return float(np.abs(self.model.nodal(q)[:, :3]).max())

    def _take(self, result: NewtonResult, pressure: float, slope: np.ndarray | None) -> None:
        self.q, self.pressure = result.q, pressure
        self.slope = self.slope if slope is None else slope


def _slope(solver: EquilibriumSolver, result: NewtonResult, pressure: float) -> np.ndarray | None:
    """dq/dP at what a solver has just found; None where it found nothing, or without an iteration, for its tangent is
    that of another state.
    """
    return solver.sensitivity(result.q, pressure) if result.converged and result.iterations else None


class Loading:
    """The contract of equilibria with a share of the whole load in the place of the pressure.

    With gravity the valve without load is no equilibrium at any pressure; it is one without weight.

    Parameters
    ----------
    pressure : float
        That belongs to the whole load, Pa.
    """

    def __init__(self, model: Any, pressure: float):
        self.model, self.whole = model, float(pressure)
        self.mesh, self.size, self.nodal, self.rest = model.mesh, model.size, model.nodal, model.rest
        self.apply, self.rounding = model.apply, model.rounding
        self.factor, self.refactor = model.factor, model.refactor

    def residual(self, q: np.ndarray, share: float) -> np.ndarray:
        """Unbalanced force (n,) under a share of the load."""
        return self.model.residual(q, self.whole, share)

    def tangent(self, q: np.ndarray, share: float) -> Any:
        """Residual and linearisation there."""
        return self.model.tangent(q, self.whole, share)

    def pressure_derivative(self, q: np.ndarray, share: float) -> np.ndarray:
        """Derivative (n,) of the residual by the share."""
        return self.model.residual(q, self.whole, 1.0) - self.model.residual(q, self.whole, 0.0)

    def force_scale(self, q: np.ndarray, share: float) -> float:
        """Force to which residuals are relative, N: that of the whole load."""
        return self.model.force_scale(q, self.whole)
