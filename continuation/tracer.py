"""Pseudo-arclength continuation of a curve: predictor, corrector, step control, limits, monitors, observers.

From a point ``z`` with unit tangent ``t`` the next one is sought in the hyperplane through ``z + ds t`` normal to ``t``
(Keller 1977).  The step follows the number of corrections and the angle between tangents.  Monitors measure test
functions at each point and look for events between two of them; observers are told of points and never print here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from continuation.branch import Branch, CurvePoint
from continuation.checks import require_kinds
from continuation.options import NotConverged, Reason, Said, SingularSystem
from continuation.problem import Local, Problem, correct

#: Corrections that a comfortable step takes: fewer lengthen the next one, more shorten it.
COMFORTABLE = 4
#: Largest lengthening of an accepted step, shortening of a refused one.
GROWTH, SHRINK = 1.5, 0.5
#: Times that an interval is halved, or a step tried again, where what is seen in it is contradictory.
SUBDIVISIONS = 6
#: Largest distance of the curve from a chord, in chord lengths: an arc whose ends turn by 1.6 rad reaches 0.4.
FARTHEST = 0.5
#: Unit of a state, or of a frequency, over the range that it has gone through; most of that of a state at the start,
#: over its size.
SHARE, MOST = 0.5, 10.0
#: Unit of a state that may be the rounding of one at rest.
STILL = 1e-8
#: Distance in chord lengths within which two located points are one.
KNOWN = 1e-6


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


class Monitor:
    """Test functions of a curve and the events between two of its points, of some kinds."""

    kinds: tuple[str, ...] = ()

    def measure(self, tracer, point) -> None:
        """Evaluate the test functions at a point."""

    def between(self, tracer, before, after, index, found) -> list:
        """Special points of a step that may still be refused; ``found`` holds those of other monitors."""
        return []

    def accept(self, tracer, before, after, found) -> None:
        """Note that the step was accepted."""

    def zero(self, tracer, before, after, name, tolerance=1e-10) -> CurvePoint | None:
        """Point between two where a test function vanishes; None where the curve is lost."""

        def test(point):
            self.measure(tracer, point)
            return point.tests[name]

        return tracer.root(before, after, test, tolerance)


class Observer:
    """Hooks of a run, which do nothing by default; override those of interest."""

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


class Checkpoint(Observer):
    """Save the branch every few points, so that a killed run can be resumed.

    Parameters
    ----------
    path : path
    every : int
        Points between writes.
    """

    def __init__(self, path: str | Path, every: int = 10):
        if every < 1:
            raise ValueError(f"A checkpoint needs at least one point in between, not {every}.")
        if not isinstance(path, (str, Path)):
            raise TypeError(f"A checkpoint is written to a path, not to {path!r}.")
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
    if not isinstance(observers, Iterable):
        raise TypeError(f"Observers are Observer objects or functions of the branch, not {observers!r}.")
    return [o if isinstance(o, Observer) else _observer_of(o) for o in observers]


def _observer_of(function: Callable) -> Observer:
    observer = Observer()
    observer.accepted = function
    return observer


def notify(observers: list[Observer], hook: str, *arguments) -> None:
    """Call one hook of all observers."""
    for observer in observers:
        getattr(observer, hook)(*arguments)


def run_observed(branch, observers: list[Observer], steps: Callable[[], Said]):
    """Run the steps of a branch between its first and last call of the observers; the branch itself.

    The steps return why they ended.  An interruption ends the branch; an error goes on to the caller, with the branch
    so far as its attribute ``branch``.
    """
    notify(observers, "started", branch)
    try:
        branch.reason = steps()
    except KeyboardInterrupt:
        branch.reason = Reason.INTERRUPTED()
    except Exception as error:
        branch.reason = Reason.ERROR(why=error)
        error.branch = branch
        raise
    finally:
        notify(observers, "ended", branch)
    return branch


class Tracer:
    """Run along one curve.

    Parameters
    ----------
    options : ContinuationOptions
    monitors : sequence of Monitor
    observers
        See `Observer`.
    """

    def __init__(self, problem: Problem, options, monitors=(), observers=None):
        self.problem, self.options = problem, options
        self.monitors = list(monitors)
        require_kinds(options, {kind for monitor in self.monitors for kind in monitor.kinds})
        self.observers = as_observers(observers)
        self.frame = problem.natural_frame()
        # Retries that are left, and the length of the curve for which they must do.
        self._retries, self._doubted = SUBDIVISIONS if options.locate else 0, 0.0

    # -- points

    def correct(self, z, normal):
        return correct(self.problem, z, self.frame, self.options.newton, normal, self.options.location_tolerance)

    def corrected_point(self, correction, reference) -> CurvePoint:
        """Corrected point with its tangent, to the side of ``reference``."""
        local = correction.local
        return CurvePoint(
            correction.z,
            local.tangent(reference),
            iterations=correction.iterations,
            residual=float(local.size),
            local=local,
        )

    def at(self, before: CurvePoint, after: CurvePoint, fraction: float, start=None) -> CurvePoint | None:
        """The point of the curve over a fraction of the chord, or None if there is none near that of the chord, or
        near another start over the same fraction.
        """
        chord = after.z - before.z
        normal = self.problem.weights * chord
        scale = np.abs(normal).max()
        start = before.z + fraction * chord if start is None else start
        correction = self.correct(start, normal / scale)
        far = self.problem.norm(correction.z - start) > FARTHEST * self.problem.norm(chord)
        if not correction.converged or far:
            return None
        return self.corrected_point(correction, chord)

    def fraction(self, before: CurvePoint, after: CurvePoint, z) -> tuple[float, float]:
        """Position of ``z`` along the chord, and its distance from it, both in chord lengths."""
        chord = after.z - before.z
        length2 = max(self.problem.dot(chord, chord), 1e-300)
        s = self.problem.dot(z - before.z, chord) / length2
        away = self.problem.norm(z - before.z - s * chord) / np.sqrt(length2)
        return s, away

    def root(self, before: CurvePoint, after: CurvePoint, function, tolerance: float = 1e-10) -> CurvePoint | None:
        """Zero of a function of points between two of opposite sign (Brent); None where the curve is lost."""
        met = {0.0: before, 1.0: after}

        def value(share: float) -> float:
            below = max(s for s in met if s <= share)
            step = share - below
            least = step / 2**SUBDIVISIONS
            while below < share:
                above, there = min(s for s in met if s > below), min(below + step, share)
                part = (there - below) / (above - below)
                point = self.at(before, after, there, (1 - part) * met[below].z + part * met[above].z)
                if point is not None:
                    met[there], below = point, there
                elif step > least:
                    step /= 2
                else:
                    raise NotConverged(Reason.LOST_AT_LIMIT())
            return function(met[share])

        try:
            return met[brentq(value, 0.0, 1.0, xtol=tolerance, rtol=1e-14)]
        except (NotConverged, RuntimeError, ValueError):  # lost, slow, or no change of sign
            return None

    # -- the run

    def start(self, z, direction, frame=None) -> CurvePoint:
        """Correct the first point and choose the side to leave it on. Raises NotConverged: the first point is not on
        the curve and Newton's method does not reach it.
        """
        n, k = self.problem.n, self.problem.k
        if frame is not None:
            self.frame = frame
        normal = self.problem.weights * direction
        correction = self.correct(z, normal / np.abs(normal).max())
        if not correction.converged and frame is None:
            # The natural frame is singular at a fold; any generic row will do there.
            generic = np.cos(np.arange(1.0, k * (n + k) + 1.0)).reshape(k, n + k)
            self.frame = generic
            correction = self.correct(z, normal / np.abs(normal).max())
        if not correction.converged:
            raise NotConverged(
                f"The first point was not found: {correction.reason} after "
                f"{correction.iterations} iterations, residual {correction.residual:.3g}.",
                correction.reason.kind,
                correction,
            )
        point = self.corrected_point(correction, direction)
        self._origin = self.problem.u(point.z)
        if self.problem.grows:
            self.problem.rescale(self._first_unit(point), self.problem.extra_scale)
        self.frame = self.problem.frame(point.local.basis)
        point.local = Local(self.problem, point.z, self.frame)
        point.tangent = point.local.tangent(point.tangent)
        for monitor in self.monitors:
            monitor.measure(self, point)
        return point

    def _first_unit(self, point) -> float:
        """Unit of the state at a start: its change over the unit of the parameters; 1 where that says nothing."""
        problem = self.problem
        size, change = _rms(problem.u(point.z)), _rms(problem.u(point.tangent))
        along = float(np.linalg.norm(problem.p(point.tangent) / problem.parameter_scale))
        unit = min(change / along if along else np.inf, MOST * size or np.inf)
        return unit if STILL < unit < 1.0 / STILL else 1.0

    def _grow(self, after, step: float) -> float:
        """Let the units of the state and of a frequency follow their ranges; the step in the new metric."""
        problem = self.problem
        own, frequency = problem.state_scale, problem.extra_scale
        unit = max(own, SHARE * _rms(problem.u(after.z) - self._origin)) if problem.grows else own
        faster = max(frequency, SHARE * float(np.abs(problem.extra(after.z)).max(initial=0.0)))
        if (unit, faster) == (own, frequency):
            return step
        problem.rescale(unit, faster)
        length = problem.norm(after.tangent)
        after.tangent = after.tangent / length
        return float(np.clip(step * length, self.options.min_step, self.options.max_step))

    def resume(self, branch: Branch) -> Branch:
        """Copy of a branch with the points that follow its last one."""
        options, last = self.options, branch.points[-1]
        own, kept = self.problem, branch.restart
        own.rescale(*(float(kept.get(name, getattr(own, name))) for name in ("state_scale", "extra_scale")))
        grows, self.problem.grows = self.problem.grows, False
        start = self.start(last.z, last.tangent, branch.restart.get("frame"))
        self.problem.grows, self._origin = grows, self.problem.u(branch.points[0].z)
        step = float(np.clip(branch.next_step or options.step, options.min_step, options.max_step))
        return self.run(branch.reopen(), start, step)

    def run(self, branch: Branch, before: CurvePoint, step: float) -> Branch:
        """Add points to ``branch`` from a point on until something ends it; see `run_observed`."""
        return run_observed(branch, self.observers, lambda: self._steps(branch, before, step))

    def _steps(self, branch, before, step) -> Said:
        options = self.options
        first = branch.points[0]
        for _ in range(options.max_points):
            self._remember(branch, step)
            outcome = self._advance(branch, before, step)
            if isinstance(outcome, Said):
                return outcome
            after, step, ending, found = outcome
            last = [s for s in found if s.values.pop("beyond", None)]
            stopping = [s for s in found if s.kind in options.stop_at or s.values.get("stop")]
            if stopping and stopping[0].index < len(branch) - 1:  # seen a step late: the last point is the one after
                found, last = found[: found.index(stopping[0]) + 1], stopping
            if last:
                branch.special += found
                for special in found:
                    notify(self.observers, "found", branch, special)
                return Reason.STOPPED(kind=last[0].kind)
            if stopping:
                after, found = self._stop_at(before, after, stopping[0], found)
                ending = Reason.STOPPED(kind=stopping[0].kind)
            step = self._grow(after, step)
            branch.points.append(after.record())
            branch.special += found
            self.frame = self.problem.frame(after.local.basis)
            if self.problem.condition is not None:
                self.problem.condition.adapt(after.local.condition)
            for monitor in self.monitors:
                monitor.accept(self, before, after, found)
            closed = self._closed(branch, first, before, after)
            before = after
            self._remember(branch, step)
            notify(self.observers, "accepted", branch)
            for special in found:
                notify(self.observers, "found", branch, special)
            if ending:
                return ending
            if closed:
                return Reason.CLOSED()
        return Reason.POINTS()

    def _stop_at(self, before, after, special, found):
        """Point of the curve at a special point, and what was found up to it; the point after one not located."""
        if not special.located or special.z.size != after.z.size:
            return after, found
        share = self.fraction(before, after, special.z)[0]
        point = self.at(before, after, share)
        if point is None:
            return after, found
        point.z = special.z.copy()
        point.step = self.problem.norm(point.z - before.z)
        for monitor in self.monitors:
            monitor.measure(self, point)
        return point, found[: found.index(special) + 1]

    def _remember(self, branch, step):
        branch.next_step = float(step)
        branch.restart = {name: getattr(self.problem, name) for name in ("state_scale", "extra_scale")}
        branch.restart["frame"] = self.frame
        condition = self.problem.condition
        if condition is not None:
            branch.restart.update(p=condition.p, q=condition.q)

    def _advance(self, branch, before, step):
        """One accepted step: the point, the next step, why the branch ends, if it does, and the special points.

        A step is refused when its corrector fails or leaves the curve.  Test functions that contradict each other are
        a sign of that too, so a step with a special point that cannot be located is tried again, shorter; up to
        `SUBDIVISIONS` times until the curve is past that point.
        """
        options = self.options
        while True:
            z, used, normal, ending = self._predict(before, step)
            if ending and used == 0.0:
                return ending
            after, trouble = self._attempt(before, z, normal)
            if trouble is None:
                after.step = used
                after, ending, trouble = self._land_on_limit(before, after, self.beyond(after.z), ending)
            if trouble is None:
                found = self._between(branch, before, after)
                doubtful = [s for s in found if not s.located and s.kind != "zero eigenvalue"]
                left = [s for s in found if s.located and self.beyond(s.z)]
                if doubtful and self._retries and used > options.min_step * (1 + 1e-9):
                    self._retries -= 1
                    self._doubted = max(self._doubted, used)
                    trouble = Reason.DOUBTFUL(kind=doubtful[0].kind)
                elif left:
                    # The curve left the limits and came back within the step.
                    turn = self.at(before, after, self.fraction(before, after, left[0].z)[0])
                    if turn is None:
                        trouble = Reason.LOST_AT_LIMIT()
                    else:
                        crossed = self.beyond(left[0].z)
                        after, ending, trouble = self._land_on_limit(before, turn, crossed, None)
                        found = [] if trouble else self._between(branch, before, after)
            if trouble is None:
                break
            notify(self.observers, "refused", branch, trouble, used)
            if used <= options.min_step * (1 + 1e-9):
                return Reason.SMALLEST_STEP(why=trouble)
            step = max(used * SHRINK, options.min_step)
        self._doubted -= after.step
        if self._doubted <= 0.0:
            self._retries, self._doubted = SUBDIVISIONS if options.locate else 0, 0.0
        angle = self._angle(before, after)
        factor = (COMFORTABLE + 1) / (after.iterations + 1)
        if angle > 0:
            factor = min(factor, 0.7 * options.max_angle / angle)
        factor = float(np.clip(factor, SHRINK, GROWTH))
        if ending is None:
            step = float(np.clip(used * factor, options.min_step, options.max_step))
        return after, step, ending, found

    def _attempt(self, before, z, normal):
        """The corrected point, and why it is not accepted, if it is not."""
        correction = self.correct(z, normal)
        if not correction.converged:
            return None, correction.reason
        try:
            after = self.corrected_point(correction, before.tangent)
        except SingularSystem:
            return None, Reason.SINGULAR()
        if self._angle(before, after) > self.options.max_angle:
            return None, Reason.TURNED()
        if self._jumped(before, after, z):
            return None, Reason.JUMPED()
        return after, None

    def _angle(self, before, after) -> float:
        return float(np.arccos(np.clip(self.problem.dot(after.tangent, before.tangent), -1.0, 1.0)))

    def _between(self, branch, before, after) -> list:
        """Special points of a step in the order in which the branch meets them, without those it knows."""
        found: list = []
        for monitor in self.monitors:
            monitor.measure(self, after)
        for monitor in self.monitors:
            found += monitor.between(self, before, after, len(branch) - 1, found)
        found.sort(key=lambda s: (s.index, self.fraction(before, after, s.z[: before.z.size])[0]))
        near = KNOWN * self.problem.norm(after.z - before.z)

        def known(special):
            others = (s for s in branch.special[-4:] if s.kind == special.kind and s.z.size == special.z.size)
            return special.located and any(
                s.located and s.z.size == before.z.size and self.problem.norm(s.z - special.z) <= near for s in others
            )

        return [s for s in found if not known(s)]

    def _jumped(self, before, after, prediction) -> bool:
        """True when the correction is too long for the step: likely another branch."""
        share = max(0.5, np.tan(self.options.max_angle))
        correction = self.problem.norm(after.z - prediction)
        return correction > share * self.problem.norm(prediction - before.z)

    def _predict(self, before, step):
        problem, options = self.problem, self.options
        n = problem.n
        direction, used, ending = before.tangent, step, None
        normal = problem.weights * before.tangent
        normal = normal / np.abs(normal).max()
        for i, name in enumerate(problem.names):
            if name not in options.limits or direction[n + i] == 0.0:
                continue
            low, high = options.limits[name]
            limit = high if direction[n + i] > 0 else low
            reach = (limit - before.z[n + i]) / direction[n + i]
            if 0.0 <= reach <= used * (1 + 1e-9):
                used, ending, last = reach, Reason.LIMIT(name=name, value=limit), (n + i, limit)
                normal = np.eye(1, problem.n + problem.k + problem.e, n + i)[0]
        z = before.z + used * direction
        if ending:
            z[last[0]] = last[1]
        return z, used, normal, ending

    def beyond(self, z):
        """Index of the first parameter beyond its limits and the limit, or None."""
        for i, name in enumerate(self.problem.names):
            if name in self.options.limits:
                low, high = self.options.limits[name]
                value = z[self.problem.n + i]
                if value < low or value > high:
                    return i, low if value < low else high
        return None

    def _land_on_limit(self, before, after, crossed, ending):
        """The last point, exactly on the limit that the curve crosses; why the branch ends; what went wrong."""
        if ending is not None or crossed is None:
            return after, ending, None
        (i, limit), n = crossed, self.problem.n
        ending = Reason.LIMIT(name=self.problem.names[i], value=limit)
        landed = self.root(before, after, lambda point: point.z[n + i] - limit)
        if landed is None:
            return after, None, Reason.LOST_AT_LIMIT()
        start = landed.z.copy()
        start[n + i] = limit
        correction = self.correct(start, np.eye(1, start.size, n + i)[0])
        near = KNOWN * self.problem.norm(after.z - before.z)
        if correction.converged and self.problem.norm(correction.z - landed.z) <= near:
            landed = self.corrected_point(correction, landed.tangent)
        # At a fold on the limit only the zero along the curve is left: exact to rounding.
        landed.z[n + i] = limit
        landed.step = self.problem.norm(landed.z - before.z)
        return landed, ending, None

    def _closed(self, branch, first, before, after) -> bool:
        if len(branch) < 6:
            return False
        s, away = self.fraction(before, after, first.z)
        same_way = self.problem.dot(first.tangent, after.tangent) > 0.9 * self.problem.norm(first.tangent)
        return 0.0 < s <= 1.0 and away < 0.1 and same_way
