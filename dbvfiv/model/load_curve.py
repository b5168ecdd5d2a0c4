"""Equilibria over the load as one curve, followed by pseudo-arclength from rest on, or from a given equilibrium.

A wall that snaps, or whose faces part row by row, has several equilibria at one pressure, and which of them load steps
end on depends on the steps. The curve from rest on does not: at a pressure that it passes several times the state is
that of its first passage, which a load that rises slowly from rest comes to. Where the pressure along it turns back is
a limit point: a load that rises on leaves the curve there and jumps to where it passes that pressure again; one that
falls jumps back at the lower limit point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary, proxy

import numpy as np

from continuation.branch import Branch
from continuation.options import ContinuationOptions, NotConverged, Reason
from continuation.options import NewtonOptions as ContinuationNewton
from continuation.problem import Problem
from continuation.system import System
from continuation.tracer import Observer, Tracer

from ..errors import SolveError
from ..observer import Observer as ProgressObserver
from .load_steps import Loading, LoadStepOptions, LoadSteps
from .newton import EquilibriumSolver, NewtonOptions, NewtonResult

#: Curves of models that are in use.
_CURVES: WeakKeyDictionary[Any, LoadCurve] = WeakKeyDictionary()
#: Name of the load in the continuation.
LOAD = "pressure"
#: First, smallest and largest step, in wall thicknesses of mean displacement, and most points of a curve.
_STEP, _SMALLEST, _LARGEST, _MOST = 0.05, 1e-6, 100.0, 600
#: Residual to which points of the curve are found at best; the states that are asked for are settled from there.
_POINTS = 1e-9
#: Newton's iterations for a point ahead, for which a shorter step is cheaper than more of them, and for one between two
#: that are known, where faces may part on the way whatever the step.
_AHEAD, _BETWEEN = 7, 25
#: Largest angles between tangents, rad, tried one after the other: where faces part, displacements of micrometres turn
#: the curve, and one that turns right back has been missed.
_ANGLES = 0.7, 1.4, 0.35
#: Change of the pressure between two limit points below which they are put down to the mesh, over the pressure above
#: that downstream.
_NOISE = 1e-3


class LoadSystem(System):
    """-r(u; P) = 0 with the load P as the parameter: what arclength asks of a model with the contract of equilibria.

    Parameters
    ----------
    model : ValveModel or alike
        With `apply_transposed` besides what `EquilibriumSolver` asks.
    scale : float, Pa
        Residuals are measured against the force of this load over the pressure downstream.
    """

    def __init__(self, model: Any, scale: float):
        self.model, self.size = model, model.size
        rest, load = model.rest(), model.flow.back + scale
        self._scale = model.force_scale(rest, load)
        #: Residual norm that rounding alone leaves.
        self.rounding = model.rounding(rest, model.tangent(rest, load)) / self._scale
        self.factor, self.factored = model.factor(), None
        # One unit of the state is a mean displacement of the gap that faces in contact leave, or a mean rotation by it
        # over the wall: in larger units the curve would turn right back where faces part.
        surface, gap = model.shell.mesh, model.length_unit
        weights = np.full(model.shell.dofs.free.shape, (np.mean(surface.thickness) / gap) ** 2) / surface.node_count
        weights[:, :3] = 1.0 / (surface.node_count * gap**2)
        self.state_weights = model.shell.dofs.restrict(weights)

    def residual_norm(self, residual):
        return float(np.linalg.norm(residual) / self._scale)

    def residual(self, u, mu):
        return -self.model.residual(u, mu[LOAD])

    def linear(self, u, mu):
        return _Linearisation(self, self.model.tangent(u, mu[LOAD]))

    def d_parameter(self, u, mu, name):
        return -self.model.pressure_derivative(u, mu[LOAD])


class _Linearisation:
    """Derivative of a `LoadSystem` by the state; all of them share one factorisation, that of the last one asked."""

    def __init__(self, system: LoadSystem, tangent: Any):
        self.system, self.tangent, self.size = system, tangent, system.size

    def matvec(self, x):
        return -self.system.model.apply(self.tangent, x)

    def rmatvec(self, x):
        return -self.system.model.apply_transposed(self.tangent, x)

    def solve(self, rhs):
        return -self._factor().solve(rhs)

    def solve_transpose(self, rhs):
        return -self._factor().solve_transposed(rhs)

    def _factor(self):
        system = self.system
        if system.factored is not self:
            system.model.refactor(system.factor, self.tangent)
            system.factored = self
        return system.factor


class LimitState(NamedTuple):
    """A limit point solved for: pressure, Pa, unknowns (n,), the shape (n,) by which they change there, and the number
    of the point of the curve before it.
    """

    pressure: float
    q: np.ndarray
    shape: np.ndarray
    before: int


class LimitPoint(NamedTuple):
    """A pressure, Pa, at which the curve turns back; `highest` where it falls beyond it, lowest where it rises."""

    pressure: float
    highest: bool


_Limit = TypeVar("_Limit", LimitState, LimitPoint)


@dataclass
class LoadCurve:
    """The curve of equilibria of one model.

    Parameters
    ----------
    model : ValveModel
    newton : NewtonOptions
    observer : Observer
    origin : (pressure, unknowns), optional
        Equilibrium that the curve starts from; that at rest without it.
    stops_at_limit : bool
        The curve ends where its pressure has turned back to beyond its start.
    """

    model: Any
    newton: NewtonOptions
    observer: ProgressObserver
    origin: tuple[float, np.ndarray] | None = None
    stops_at_limit: bool = False

    def __post_init__(self):
        self._start = float(self.model.flow.back if self.origin is None else self.origin[0])
        self._branch: Branch | None = None
        self._system: LoadSystem | None = None
        self._angle = _ANGLES[0]
        self._solver = EquilibriumSolver(self.model, replace(self.newton, line_search="l2", max_iterations=100))

    def reach(self, target: float) -> tuple[NewtonResult, int]:
        """First equilibrium of the curve at a pressure, Pa, and the number of new points on the way. Raises SolveError
        if the curve does not come to it.
        """
        before = 0 if self._branch is None else len(self._branch)
        if target == self._start:
            return NewtonResult(self._rest(), True, 0, 0.0, 0.0, "at rest without a flow"), 0
        found = self._bracket(target)
        if found is None:
            self.extend(target)
            found = self._bracket(target)
        if found is None:
            last, start = self.pressures[-1], "rest" if self.origin is None else f"{self._start:.6g} Pa"
            raise SolveError(
                f"No equilibrium was found at {target:.6g} Pa: the curve of equilibria from {start} on ends at "
                f"{last:.6g} Pa, where it {self.reason}."
            )
        return self._settle(found, target), len(self._branch) - before

    @property
    def reason(self) -> str:
        """Why the curve ended."""
        if self._branch.reason.kind is not Reason.LIMIT or self.pressures[-1] > self._start:
            return str(self._branch.reason)
        return f"came down to no load again, from {self.pressures.max():.6g} Pa at most"

    @property
    def pressures(self) -> np.ndarray:
        """Pressures (k,), Pa, of the points that are known."""
        return self._branch.values(LOAD)

    @property
    def states(self) -> np.ndarray:
        """Unknowns (k, n) of the points that are known."""
        return self._branch.states

    def limits(self, highest: float = np.inf) -> list[LimitPoint]:
        """Limit points along the curve, as far as it is known and up to where it passes a pressure, Pa."""
        if self._branch is None:
            return []
        below = takewhile(lambda limit: limit.pressure <= highest, self._limits(self._up_to(highest)))
        return self._without_noise(list(below))

    def limit_states(self) -> list[LimitState]:
        """Limit points along the curve, solved for; pairs that `limits` puts down to the mesh are left out."""
        points, tracer, found = self._branch.points, self._tracer(), []
        for i in self._turns(self._slopes(slice(None))):
            at = tracer.root(points[i], points[i + 1], lambda point: point.tangent[-1], 1e-12)
            at = min(points[i : i + 2], key=lambda point: abs(point.tangent[-1])) if at is None else at
            found.append(LimitState(float(at.z[-1]), at.z[:-1], at.tangent[:-1], int(i)))
        return self._without_noise(found)

    def _without_noise(self, limits: list[_Limit]) -> list[_Limit]:
        """Limit points without pairs between which the pressure hardly changes."""
        kept: list[_Limit] = []
        for limit in limits:
            drive = abs(limit.pressure - self.model.flow.back)
            if kept and abs(kept[-1].pressure - limit.pressure) <= _NOISE * drive:
                kept.pop()
            else:
                kept.append(limit)
        return kept

    def _up_to(self, highest: float) -> slice:
        """Points that are known up to the first that passes a pressure, Pa."""
        return slice(int(np.argmax(beyond)) + 1) if (beyond := self.pressures >= highest).any() else slice(None)

    def towards(self, end: int) -> list[int]:
        """Numbers of the points up to one at which the curve goes on from its start, each farther than all before."""
        on = np.sign(self.pressures[min(1, end)] - self.pressures[0])
        far, slopes = on * self.pressures[: end + 1], on * self._slopes(slice(end + 1))
        return [i for i in range(end + 1) if i == 0 or (slopes[i] > 0 and far[i] > far[:i].max())]

    def _slopes(self, part: slice) -> np.ndarray:
        return np.array([point.tangent[-1] for point in self._branch.points[part]])

    @staticmethod
    def _turns(slope: np.ndarray) -> np.ndarray:
        return np.flatnonzero(slope[:-1] * slope[1:] < 0)

    def _limits(self, part: slice) -> list[LimitPoint]:
        pressure, slope = self.pressures[part], self._slopes(part)
        turns = self._turns(slope)
        return [LimitPoint(_turn(pressure[i : i + 2], slope[i : i + 2]), bool(slope[i] > 0)) for i in turns]

    def passages(self, pressure: float, highest: float = np.inf) -> list[np.ndarray]:
        """Unknowns (n,) of all equilibria at a pressure, Pa, in the order of the curve, where `limits` are told too."""
        away = self.pressures[self._up_to(highest)] - pressure
        points = (self.root(lambda z: z[-1] - pressure, int(i) + 1) for i in np.flatnonzero(away[:-1] * away[1:] < 0))
        return [self._settle(z[:-1], pressure).q for z in points if z is not None]

    def first(self, function) -> tuple[float, np.ndarray] | None:
        """Pressure, Pa, up to which the load has to rise until a function of the unknowns (n,) that begins below zero
        is above it, and the unknowns there; None where it stays below as far as the curve is known.
        """
        highest = -np.inf
        for i, point in enumerate(self._branch.points if self._branch is not None else ()):
            if function(point.z[:-1]) >= 0.0:
                at = point if i == 0 else self._between(lambda z: function(z[:-1]), i) or point
                passed = slice(0, i + 1 if at.tangent[-1] < 0.0 else i)  # one that it lies behind too
                turned = [limit.pressure for limit in self._limits(passed) if limit.highest]
                return max(highest, *turned, float(at.z[-1])), at.z[:-1]
            highest = max(highest, float(point.z[-1]))
        return None

    def root(self, function, after: int) -> np.ndarray | None:
        """Point (n + 1,) of the curve between a known one and that after it at which a function of such points
        vanishes; None where the curve is lost.
        """
        point = self._between(function, after)
        return None if point is None else point.z

    def _between(self, function, after: int):
        """Point of `root` with its tangent."""
        before, behind = self._branch.points[after - 1 : after + 1]
        return self._tracer().root(before, behind, lambda p: function(p.z), 1e-8)

    def _rest(self) -> np.ndarray:
        """Unknowns (n,) of the wall at rest; where it has a weight it hangs."""
        if self._branch is not None:
            return self._branch.points[0].z[:-1]
        if self.origin is not None:
            return self.origin[1]
        hanging = LoadSteps(Loading(self.model, self.model.flow.back), LoadStepOptions(self.newton))
        if self.model.weight is not None:
            hanging.reach(1.0)
        return hanging.q

    def _settle(self, guess: np.ndarray, pressure: float) -> NewtonResult:
        found = self._solver.solve(guess, pressure)
        if not found.converged:
            raise SolveError(f"The equilibrium at {pressure:.6g} Pa was lost: {found.reason}.")
        return found

    def _bracket(self, target: float) -> np.ndarray | None:
        """Unknowns (n,) of the first passage of a pressure, from the points around it; None before any."""
        if self._branch is None:
            return None
        pressure = self.pressures
        beyond = np.flatnonzero(pressure >= target * (1 - 1e-12))
        if not len(beyond):
            return None
        i = int(beyond[0])
        points = self._branch.points
        if i == 0 or pressure[i] - target <= 1e-9 * target:
            return points[i].z[:-1]
        found = self.root(lambda z: z[-1] - target, i)
        if found is not None:
            return found[:-1]
        part = (target - pressure[i - 1]) / (pressure[i] - pressure[i - 1])
        return (points[i - 1].z + part * (points[i].z - points[i - 1].z))[:-1]

    def _tracer(self, ahead: tuple[float, float] | None = None):
        """Tracer that follows the curve within limits of the load, or without them finds points between known ones."""
        if self._system is None:
            # residuals against the load at the start, where there is one: rounding of forces is of their size
            self._system = LoadSystem(self.model, max(self._unit, abs(self._start - self.model.flow.back)))
        options = ContinuationOptions(
            step=_STEP,
            min_step=_SMALLEST,
            max_step=_LARGEST,
            max_points=_MOST,
            limits={LOAD: ahead or (-np.inf, np.inf)},
            parameter_scales={LOAD: self._unit},
            locate=False,
            newton=ContinuationNewton(
                max(self.newton.tolerance, _POINTS, self._system.rounding), _AHEAD if ahead else _BETWEEN
            ),
            max_angle=self._angle,
        )
        problem = Problem(self._system, {LOAD: self._start}, (LOAD,), parameter_scales=options.units([LOAD]))
        return Tracer(problem, options, observers=_Told(self.observer))

    def extend(self, target: float) -> None:
        """Follow the curve on to a pressure, towards which it leaves its start, anew with other steps where it comes
        back to that. Raises SolveError if no curve leaves the start.
        """
        start, back, way = self._start, self.model.flow.back, np.copysign(1.0, target - self._start)
        for angle in dict.fromkeys((self._angle, *_ANGLES)):
            if angle != self._angle:
                self._angle, self._branch = angle, None
            if self._branch is None:
                self._unit = max(1e-3 * abs(target - start), 1e-3 * abs(start - back), self.model.load_unit)
            ends = (start - self._unit, start + self._unit) if self.stops_at_limit else (back - self._unit, np.inf)
            tracer = self._tracer((ends[0], target) if way > 0 else (target, ends[1]))
            try:
                if self._branch is None:
                    z = np.append(self._rest(), start)
                    direction = np.zeros(len(z))
                    direction[-1] = way
                    point = tracer.start(z, direction)
                    branch = Branch("equilibria", len(z) - 1, (LOAD,), (), {LOAD: start}, [point.record()])
                    self._branch = tracer.run(branch, point, _STEP)
                else:
                    self._branch = tracer.resume(self._branch)
            except NotConverged as error:
                raise SolveError(f"No curve of equilibria leaves that at {start:.6g} Pa: {error}") from error
            if self._branch.reason.kind is Reason.INTERRUPTED:
                self._branch = None
                raise KeyboardInterrupt
            kind = self._branch.reason.kind
            ended = kind is Reason.POINTS or (self.stops_at_limit and (kind is Reason.LIMIT or bool(self.limits())))
            if ended or way * (self.pressures[-1] - target) >= -1e-12 * abs(target):
                return


def curve_of(model: Any, newton: NewtonOptions, observer: ProgressObserver) -> LoadCurve:
    """The curve of a model, one as long as the model is in use: who asks for it finds what others have followed."""
    curve = _CURVES.get(model)
    if curve is None or curve.newton != newton:
        curve = _CURVES[model] = LoadCurve(proxy(model), newton, observer)
    curve.observer = observer
    return curve


class _Told(Observer):
    """Passes the points of a curve on as progress."""

    def __init__(self, observer: ProgressObserver):
        self._observer = observer

    def accepted(self, branch):
        point = branch.points[-1]
        self._observer.progress(
            f"arclength point {len(branch)} at {point.z[-1]:.6g} Pa, {point.iterations} it, step {point.step:.2g}"
        )

    def refused(self, branch, reason, step):
        self._observer.progress(f"step {step:.2g} refused: {reason}")


def _turn(pressure: np.ndarray, slope: np.ndarray) -> float:
    """Extreme pressure, Pa, between two points of a curve: of the parabola through both with their mean slope, or of
    the nearer one where that has none between them.
    """
    mean, change = 0.5 * (slope[0] + slope[1]), slope[0] - slope[1]
    length = (pressure[1] - pressure[0]) / mean if mean else 0.0
    outer = max(pressure) if slope[0] > 0 else min(pressure)
    return float(pressure[0] + 0.5 * slope[0] ** 2 / change * length) if length > 0 else float(outer)
