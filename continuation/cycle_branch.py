"""Branches of periodic motions along one parameter: steps, folds, changes of stability, other events.

The next cycle is sought at a value of the parameter that was asked for, or in the hyperplane through a prediction
normal to the way there (pseudo-arclength).  A fold is the extreme value of the parameter on a parabola through three
cycles; a change of stability or an event is a zero of a test function, by false position along the branch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from continuation.cycle_linearisation import Condition
from continuation.cycle_points import (
    BRANCH_POINT,
    DOUBLING,
    FOLD,
    POINTS,
    TORUS,
    CyclePoint,
    SpecialCycle,
    change_between,
    crossing_of,
    exponent_that_crosses,
    parameter_predicts_better,
    predict_by_arclength,
    predict_by_parameter,
    value_at_zero,
    value_by_arclength,
    zero_ahead,
)
from continuation.cycles import Cycle, CycleSolver
from continuation.harmonics import Harmonics
from continuation.hill import floquet_exponents
from continuation.options import (
    ContinuationError,
    ContinuationOptions,
    NotConverged,
    OrbitOptions,
    Reason,
    Said,
    require,
)
from continuation.periodic import PeriodicMotion
from continuation.tracer import KNOWN

#: Change of the parameter over its unit that is rounding.
STILL = 1e-9
#: Change of it from an origin, which is located no closer, that counts.
BEGUN = 1e-4


class CycleTracer:
    """Follow a branch of cycles.

    Parameters
    ----------
    options : ContinuationOptions
        Used are the steps, ``max_points`` (of the whole branch), ``max_angle``, ``limits``, the scales and
        ``location_tolerance``.
    shape : OrbitOptions
        Used are ``max_harmonics``, ``tail`` and ``exponents``.
    values : sequence of float
        Values of the parameter at which a cycle is wanted.
    events : mapping of str to callable
        Functions of a `Cycle` whose zeros are special points of that name.
    report : callable
        Told of each point and special point as it is found.

    Attributes
    ----------
    points : list of CyclePoint
    special : list of SpecialCycle
    reason : Said
        Why it ended.
    next_step : float
        Arclength step that the step control takes next.
    known : list
        Kinds (or titles) and values of special points that an earlier run has reported, which are not reported again;
        whoever knows some sets it.
    """

    def __init__(
        self,
        solver: CycleSolver,
        parameter: str,
        options: ContinuationOptions,
        shape: OrbitOptions = OrbitOptions(),
        values: Sequence[float] = (),
        events: Mapping[str, Callable[[Cycle], float]] = {},
        report: Callable[[CyclePoint | SpecialCycle], None] = lambda item: None,
    ):
        self.solver, self.parameter, self.options, self.shape = solver, parameter, options, shape
        self.values, self.events, self.report = tuple(values), dict(events), report
        self.scale = options.units([parameter])[parameter]
        self._limits = options.limits.get(parameter, (-np.inf, np.inf))
        self.points: list[CyclePoint] = []
        self.special: list[SpecialCycle] = []
        self.reason, self.next_step = Reason.RUNNING(), options.step
        self._origin: list[CyclePoint] = []
        self._doubtful: tuple[CyclePoint, CyclePoint] | None = None
        self.known: list[tuple[str, float]] = []
        self._weight = 1.0 / (np.asarray(solver.system.scales) * (options.state_scale or 1.0)) ** 2

    # -- the branch

    def extend(self, cycle: Cycle, origin: Cycle | None = None) -> None:
        """Take a cycle as the next point; two of them give the way to go.

        `origin` is what the branch starts from, at rest at an onset; it helps predictions and is no point of the
        branch.
        """
        point = self._accept(cycle)
        if origin is not None:
            self._begin_at(origin)
        if len(self.points) > 1:
            self._report(self._between(*self.points[-2:]))
        self.report(point)

    def restore(self, points: Sequence[CyclePoint], origin: Cycle | None = None) -> None:
        """Go on from points that are known, with the `origin` of `extend`; `extend` where there is but one."""
        require(len(points) >= 1, "A branch goes on from one point at least.")
        self.points = [
            replace(p, tests={name: float(event(p.cycle)) for name, event in self.events.items()}) for p in points
        ]
        if origin is not None:
            self._begin_at(origin)
        if len(self.points) > 1 and self._change(*self.points[-2:]) == FOLD and not self._has_turned():
            self._doubtful = self.points[-2], self.points[-1]

    def _begin_at(self, origin: Cycle) -> None:
        length = self.points[0].arclength - self._distance(self.points[0].cycle, origin)
        self._origin = [CyclePoint(origin, origin.mu[self.parameter], length, None)]

    def run(self, step: float | None = None) -> Said:
        """Go on until the parameter leaves its limits, the cycles shrink to nothing, the points are used up or no cycle
        is found; the reason of the end. `step` is the first step, that of the options by default.
        """
        self.reason = self._steps(self.options.step if step is None else step)
        self._report(self._left_over())
        return self.reason

    def _steps(self, step: float) -> Said:
        while len(self.points) < self.options.max_points:
            if len(self.points) > 1 and self._is_over():
                return self._limit()
            done, step, reason = self._advance(step)
            if done is None:
                self._report(self._ahead())
                return reason
            self.next_step = step
            if self._has_turned_back():
                del self.points[-1]
                return Reason.VANISHED(name=self.parameter, value=self.points[-1].value)
            found = self._between(self.points[-2], self.points[-1])
            self._report(found)
            self.report(self.points[-1])
            stopping = [special for special in found if special.title in self.options.stop_at]
            if stopping:
                return Reason.STOPPED(kind=stopping[0].title)
        return self._limit() if self._is_over() else Reason.POINTS()

    def _report(self, found: list[SpecialCycle]) -> None:
        for special in found:
            alike = (value for kind, value in self.known if kind in (special.kind, special.title))
            if all(abs(value - special.value) > KNOWN * self.scale for value in alike):
                self.special.append(special)
                self.report(special)

    def _limit(self) -> Said:
        return Reason.LIMIT(name=self.parameter, value=self.points[-1].value)

    def _is_over(self) -> bool:
        """True when the branch has left the range, or reached its end."""
        (low, high), ahead, value = self._limits, self._direction(), self.points[-1].value
        return bool((value <= low and ahead < 0) or (value >= high and ahead > 0))

    def _has_turned_back(self) -> bool:
        """True when the last motion is opposite to the one before: between them the branch has met an onset, and goes
        back on itself with the phase turned by half a period.
        """
        a, b = (p.motion for p in self.points[-2:])
        return bool(np.sum(b.harmonics.resized(a.coefficients)[1:] * b.coefficients[1:] * self._weight) < 0)

    def _direction(self) -> float:
        return float(np.sign(self.points[-1].value - self.points[-2].value))

    def _advance(self, step: float) -> tuple[CyclePoint | None, float, Said | None]:
        """Next point, the step after it, and why there is none; the rules for steps are those of equilibria."""
        options, reason = self.options, ""
        while step >= options.min_step:
            target = self._target(step)
            try:
                cycle, expected = self._step(step, target)
                cycle, angle = self._landed(self._checked(cycle, expected))
                point = self._accept(cycle)
            except ContinuationError as error:
                reason = str(error)
                if (
                    getattr(error, "reason", None) is Reason.HARMONICS
                    and self.points[-1].motion.harmonics.count >= self.shape.max_harmonics
                ):
                    break
                step *= 0.4
                continue
            grown = 2.0 if cycle.iterations <= 6 else (0.7 if cycle.iterations >= 10 else 1.0)
            grown = min(grown, 0.7 * options.max_angle / max(angle, 1e-9))
            return point, min(max(step * grown, options.min_step), options.max_step), None
        return None, step, Reason.NO_CYCLE(why=reason)

    def _checked(self, cycle: Cycle, expected: Cycle) -> Cycle:
        """The cycle itself, unless it lies so far from the one expected that it belongs to another part of the branch.
        Raises NotConverged.
        """
        missed, ahead = self._distance(expected, cycle), self._distance(self.points[-1].cycle, expected)
        if missed > max(0.5, np.tan(self.options.max_angle)) * ahead:
            raise NotConverged(Reason.JUMPED(), Reason.JUMPED)
        return cycle

    def _landed(self, cycle: Cycle) -> tuple[Cycle, float]:
        """The cycle, or the one on the limit that the branch crosses before it, and the angle of the branch there.
        Raises NotConverged: the branch turns too far, or is lost at the limit.
        """
        last, value = self.points[-1].cycle, cycle.mu[self.parameter]
        limit = float(np.clip(value, *self._limits))
        if limit != value:
            start = last.mu[self.parameter]
            share = (limit - start) / (value - start)
            h = max(cycle.motion.harmonics, last.motion.harmonics, key=lambda h: h.count)
            ends = [h.resized(one.motion.coefficients) for one in (last, cycle)]
            omega = (1 - share) * last.motion.omega + share * cycle.motion.omega
            motion = PeriodicMotion(h, (1 - share) * ends[0] + share * ends[1], omega)
            expected = replace(cycle, motion=motion, mu=cycle.mu | {self.parameter: limit})
            cycle = self._checked(self._solved(expected), expected)
        angle = self._angle(cycle) if len(self.points) > 1 else 0.0
        if angle > self.options.max_angle:
            raise NotConverged(Reason.TURNED(), Reason.TURNED)
        return cycle, angle

    def _angle(self, cycle: Cycle) -> float:
        """Angle, rad, between the ways to the last point and from there to a cycle."""
        cycles = [*(p.cycle for p in self.points[-2:]), cycle]
        sides = [self._distance(a, b) for a, b in zip(cycles, [*cycles[1:], cycles[0]])]
        cosine = (sides[2] ** 2 - sides[0] ** 2 - sides[1] ** 2) / max(2 * sides[0] * sides[1], 1e-300)
        return float(np.arccos(np.clip(cosine, -1.0, 1.0)))

    def _target(self, step: float) -> float | None:
        """The next value that is asked for, or the limit, where it lies within the step."""
        now, ahead = self.points[-1].value, self._direction()
        reach = (self._value_at(step) - now) * ahead
        wanted = [v for v in (*self.values, *self._limits) if np.isfinite(v)]
        wanted = [v for v in wanted if 1e-9 * self.scale < (v - now) * ahead <= 1.5 * reach]
        return min(wanted, key=lambda v: abs(v - now)) if wanted else None

    def _value_at(self, step: float) -> float:
        """The parameter a step ahead, by the polynomial through the last points."""
        return value_by_arclength(self._last(), self.points[-1].arclength + step)

    def _last(self) -> list[CyclePoint]:
        """Points that predictions are made of."""
        return [*self._origin, *self.points][-POINTS:]

    def _way_to(self, target: float, step: float) -> float:
        """Step at which that polynomial has a value that lies about a step ahead."""
        low, high = 0.0, 2.0 * step
        side = self._direction()
        if (self._value_at(high) - target) * side < 0:
            a, b = self.points[-2:]
            return abs((target - b.value) * (b.arclength - a.arclength) / (b.value - a.value))
        while high - low > 1e-3 * step:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if (self._value_at(middle) - target) * side >= 0 else (middle, high)
        return high

    def _step(self, step: float, target: float | None) -> tuple[Cycle, Cycle]:
        """The cycle a step ahead, or at a value of the parameter, and the one expected there."""
        last = self.points[-1].cycle
        if target is not None:
            expected = replace(last, motion=self._expected(target, step), mu=last.mu | {self.parameter: target})
            return self._solved(expected), expected
        expected = self._predicted(self._last(), self.points[-1].arclength + step, self._series())
        return self._solved(expected, last, expected), expected

    def _predicted(self, near: Sequence[CyclePoint], arclength: float, h: Harmonics) -> Cycle:
        """The cycle at an arclength, by the polynomial through points."""
        mu = near[-1].cycle.mu | {self.parameter: value_by_arclength(near, arclength)}
        return replace(near[-1].cycle, motion=predict_by_arclength(near, arclength, h), mu=mu)

    def _solved(self, expected: Cycle, *way: Cycle) -> Cycle:
        """The cycle near one expected, at its value of the parameter, or in the plane through it normal to the way
        between two cycles.
        """
        free, conditions = ((self.parameter,), (self._plane(*way, expected),)) if way else ((), ())
        return self.solver.resolve(expected.motion, expected.mu, self.shape, free, conditions)

    def _expected(self, target: float, step: float) -> PeriodicMotion:
        """The motion at a value about a step ahead."""
        if parameter_predicts_better(self.points, self._weight):
            motion = predict_by_parameter(self.points, target, self._series(), self._weight)
            if motion is not None:
                return motion
        return predict_by_arclength(
            self._last(), self.points[-1].arclength + self._way_to(target, step), self._series()
        )

    def _series(self) -> Harmonics:
        """Series of the next motion: longer where the last one nearly needed it."""
        last, options = self.points[-1].motion, self.shape
        longer = min(last.harmonics.count + 2, options.max_harmonics)
        return Harmonics(longer) if self.solver.tail(last) > 0.4 * options.tail else last.harmonics

    def _plane(self, start: Cycle, end: Cycle, through: Cycle) -> Condition:
        """Normal to the way of coefficients and of the parameter between two cycles, through a third."""
        motion, value = through.motion, through.mu[self.parameter]
        first, last = (motion.harmonics.resized(one.motion.coefficients) for one in (start, end))
        row, extra = (last - first) * self._weight, np.zeros(len(self.solver.unknowns((self.parameter,))))
        extra[-1] = (end.mu[self.parameter] - start.mu[self.parameter]) / self.scale**2
        size = np.sqrt(np.sum(row**2 / self._weight) + (extra[-1] * self.scale) ** 2)
        return Condition(row / size, extra / size, float(np.vdot(row, motion.coefficients) + extra[-1] * value) / size)

    # -- points

    def _accept(self, cycle: Cycle) -> CyclePoint:
        """Take a cycle as the next point, with the phase of the one before."""
        point = self.describe(cycle)
        self.points.append(point)
        return point

    def describe(self, cycle: Cycle, after: CyclePoint | None = None) -> CyclePoint:
        """A cycle with its exponents and what events make of it; `after` is the point it follows, the last without."""
        after = self.points[-1] if after is None and self.points else after
        exponents = None
        if self.shape.exponents:
            linear = self.solver.linearise(cycle.motion, cycle.mu, perturbed=True)
            exponents = floquet_exponents(self.solver, linear, self.shape.exponents)
        value = cycle.mu[self.parameter]
        tests = {name: float(event(cycle)) for name, event in self.events.items()}
        length = 0.0 if after is None else after.arclength + self._distance(after.cycle, cycle)
        return CyclePoint(cycle, value, length, exponents, value in self.values, tests)

    def _distance(self, one: Cycle, other: Cycle) -> float:
        h = max(one.motion.harmonics, other.motion.harmonics, key=lambda h: h.count)
        change = h.resized(other.motion.coefficients) - h.resized(one.motion.coefficients)
        moved = (other.mu[self.parameter] - one.mu[self.parameter]) / self.scale
        return float(np.sqrt(np.sum(change**2 * self._weight) + moved**2))

    # -- special points

    def _between(self, a: CyclePoint, b: CyclePoint) -> list[SpecialCycle]:
        found, turned = [], self._has_turned()
        if turned:
            before = self._last()[-3]
            if max(abs(a.value - before.value), abs(b.value - a.value)) > STILL * self.scale:
                found.append(self._fold(*self._about_fold(before, a, b)))
        for name in self.events:
            if a.tests[name] * b.tests[name] < 0:
                found.append(self._located(name, a, b, lambda p, n=name: p.tests[n]))
        # A real exponent through zero is that of a fold, if the parameter turns at this step or the next.
        doubtful, self._doubtful = self._doubtful, None
        if doubtful is not None and not turned:
            found.append(self._exchange(BRANCH_POINT, *doubtful))
        change = self._change(a, b)
        if change == FOLD and not turned:
            self._doubtful = a, b
        elif change is not None and change != FOLD:
            found.append(self._exchange(change, a, b))
        return found

    def _has_turned(self) -> bool:
        """True when the parameter went back in the last step; a step from the origin is one too."""
        before = self._origin if len(self.points) == 2 else []
        values = [p.value for p in [*before, *self.points][-3:]]
        if len(values) < 3 or (before and abs(values[1] - values[0]) < BEGUN * self.scale):
            return False
        return (values[1] - values[0]) * (values[2] - values[1]) < 0

    def _change(self, a: CyclePoint, b: CyclePoint) -> str | None:
        """Kind of the change of stability between two points; None without one, or without exponents."""
        known = a.exponents is not None and b.exponents is not None
        return change_between(a.exponents, b.exponents) if known else None

    def _exchange(self, kind: str, a: CyclePoint, b: CyclePoint) -> SpecialCycle:
        """A change of stability between two points."""
        exponent = exponent_that_crosses(a.exponents, b.exponents)
        found = self._located(kind, a, b, lambda point: exponent(point).real)
        turning = exponent(found.point).imag if kind in (TORUS, DOUBLING) else 0.0
        return replace(found, frequency=turning / (2 * np.pi))

    def _left_over(self) -> list[SpecialCycle]:
        """A real exponent through zero in the last step: a fold where the parameter goes beyond its last value."""
        doubtful, self._doubtful = self._doubtful, None
        if doubtful is None:
            return []
        (a, b), found = doubtful, self._exchange(BRANCH_POINT, *doubtful)
        if (found.point.value - b.value) * (b.value - a.value) > 0:
            return [self._fold(a, found.point, b)]
        return [found]

    def _about_fold(self, before: CyclePoint, a: CyclePoint, b: CyclePoint) -> tuple[CyclePoint, ...]:
        """Three points about a fold: the first two of a branch and one between them say on which side of it the origin
        is.
        """
        middle = self._interpolated([a, b], 0.5 * (a.arclength + b.arclength)) if len(self.points) == 2 else None
        if middle is None:
            return before, a, b
        turned = (middle.value - a.value) * (b.value - middle.value) < 0
        return (a, middle, b) if turned else (before, a, middle)

    def _fold(self, before: CyclePoint, a: CyclePoint, b: CyclePoint) -> SpecialCycle:
        """The extreme value of the parameter of a parabola through points, renewed until it stays."""
        near, value, located = [before, a, b], a.value, False
        for _ in range(12):
            s = np.array([p.arclength for p in near])
            fit = np.polyfit(s - s[1], [p.value for p in near], 2)
            at = -0.5 * fit[1] / fit[0]
            new = float(np.polyval(fit, at))
            located = abs(new - value) <= max(1e-4 * self.options.location_tolerance, 1e-12) * max(
                abs(value), self.scale
            )
            value = new
            if located:
                break
            point = self._interpolated(near, s[1] + at)
            if point is None:
                break
            near = sorted([*near, point], key=lambda p: abs(p.arclength - s[1] - at))[:3]
            near.sort(key=lambda p: p.arclength)
        nearest = min(near, key=lambda p: abs(p.value - value))
        return SpecialCycle(FOLD, nearest, value, 0.0, located)

    def _interpolated(self, near: Sequence[CyclePoint], arclength: float) -> CyclePoint | None:
        """A cycle between points, at an arclength; None where it is not found."""
        h = max((p.motion.harmonics for p in near), key=lambda h: h.count)
        try:
            cycle = self._solved(self._predicted(near, arclength, h), near[0].cycle, near[-1].cycle)
        except ContinuationError:
            return None
        return replace(self.describe(cycle, after=near[0]), arclength=arclength, asked=False)

    def _ahead(self) -> list[SpecialCycle]:
        """Events just ahead of a branch that does not go on, as where motions cease to be smooth at one."""
        found = [self._approached(name) for name in self.events] if len(self.points) > 2 else []
        return [special for special in found if special is not None]

    def _approached(self, name: str) -> SpecialCycle | None:
        """A zero of an event that is only met from one side, by secants from there; None if there is none near."""
        near, options = list(self.points[-3:]), self.options
        whole = max(abs(p.tests[name]) for p in self.points)
        for _ in range(8):
            ahead = zero_ahead(near, name)
            if not 0 <= ahead <= options.max_step:
                return None
            if abs(near[-1].tests[name]) <= 1e-3 * whole:
                break
            steps = (near[-1].arclength + share * ahead for share in (0.9, 0.5, 0.2))
            point = next(filter(None, (self._interpolated(near[-3:], s) for s in steps)), None)
            if point is None:
                break
            if point.tests[name] * near[-1].tests[name] <= 0:
                return self._located(name, near[-1], point, lambda p: p.tests[name])
            near.append(point)
        last = near[-1]
        value = value_by_arclength(near[-3:], last.arclength + zero_ahead(near, name))
        return SpecialCycle(name, last, value, 0.0, abs(last.tests[name]) <= 1e-2 * whole)

    def _located(self, kind: str, a: CyclePoint, b: CyclePoint, test) -> SpecialCycle:
        """A zero of a test between two points, by false positions with halving (Illinois)."""
        fa, fb = test(a), test(b)
        width, located = b.arclength - a.arclength, False
        low, high, flow, fhigh = a, b, fa, fb
        met = [(fa, a), (fb, b)]
        for _ in range(16):
            s = (low.arclength * fhigh - high.arclength * flow) / (fhigh - flow)
            # At the zero itself the equations may be singular, and the exponent that of the shift in time.
            nearby = (s + share * (high.arclength - low.arclength) for share in (0.0, 1e-3, -1e-3))
            point = next(filter(None, (self._interpolated([low, high], at) for at in nearby)), None)
            if point is None:
                break
            merged = point.known < min(a.known, b.known) and abs(crossing_of(point.exponents).real) > max(
                map(abs, (fa, fb))
            )
            f = 0.0 if merged else test(point)
            met.append((f, point))
            if f * fhigh < 0:
                low, flow, high, fhigh = high, fhigh, point, f
            else:
                flow, high, fhigh = 0.5 * flow, point, f
            if low.arclength > high.arclength:
                low, high, flow, fhigh = high, low, fhigh, flow
            if min(abs(f) for f, _ in met) <= 0.1 * self.options.location_tolerance * max(
                abs(fa), abs(fb)
            ) or high.arclength - low.arclength <= (self.options.location_tolerance * width):
                located = True
                break
        met.sort(key=lambda one: abs(one[0]))
        nearest, value = met[0][1], value_at_zero(met[:3], low.value, high.value)
        return SpecialCycle(kind, nearest, value, 0.0, located)
