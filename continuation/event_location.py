"""Event location along a curve: bifurcations and events of the user's own between two of its points.

A test function that changes sign detects an event.  A bifurcation is then a regular zero of an augmented system, found
by Newton's method from a point of the bracket, with halving as the safety net; an event of the user's own is found by
false position along the curve.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from continuation.branch import CurvePoint, SpecialPoint
from continuation.conditions import FoldCondition, fold_coefficient, null_vectors
from continuation.options import DerivativeMissing, NotConverged, SingularSystem
from continuation.problem import Problem, correct
from continuation.tracer import Monitor

#: Largest distance of a located point from its bracket, in chord lengths.
SLACK = 0.02
#: Halvings of a bracket, after which an event stays bracketed.
HALVINGS = 16
#: Intervals of a step in which two folds are looked for are cut in two so often, where the parabola of a test function
#: comes nearer to zero than this share of its smaller end.
TURNS, TOUCH = 8, 0.3


def special_at(tracer, kind, point, index, located, reason="", values=None, vectors=None) -> SpecialPoint:
    """Special point at a point of the curve."""
    problem = tracer.problem
    return SpecialPoint(
        kind,
        index,
        problem.u(point.z).copy(),
        problem.mu(point.z),
        point.z.copy(),
        point.tangent.copy(),
        located,
        reason,
        values or {},
        vectors or {},
    )


def solve_augmented(tracer, condition, z, frame, names=None, system=None, mu=None):
    """Newton's method for a point of a curve that fulfils conditions besides. Raises NotConverged: there is no solution
    near the guess.

    Parameters
    ----------
    tracer : Tracer
        Its units and tolerances are taken.
    condition : object
        See `continuation.conditions`.
    z : ndarray
        Guess: state, freed parameters, extra unknowns.
    frame : ndarray, shape (k, n + k)
        Rows that complete ``[F_u, F_p]``.
    names, system, mu : optional
        In place of the tracer's own.
    """
    problem, options = tracer.problem, tracer.options
    augmented = Problem(
        system or problem.system,
        mu or problem.fixed,
        names or problem.names,
        condition,
        problem.state_scale,
        options.units(names or problem.names),
    )
    result = correct(augmented, z, frame, options.newton, None, options.location_tolerance)
    if not result.converged:
        raise NotConverged(f"Newton's method on the augmented system: {result.reason}", result.reason.kind, result)
    return result


def locate_zero(tracer, before, after, indicator, attempt):
    """Newton from a guess in the bracket; if it leaves the bracket, halve that and try again.

    Parameters
    ----------
    before, after : CurvePoint
        Points where ``indicator`` has opposite signs.
    indicator : callable
        Of a point; its zero is the point sought.
    attempt : callable
        ``attempt(guess, before, after)`` returns a `Correction`, whose ``z`` begins with the unknowns of the curve and
        is checked to lie in the bracket, or raises `NotConverged`.

    Returns
    -------
    (result, guess, reason)
        ``result`` is None if nothing was located; ``guess`` is then the best bracket point.
    """
    if not tracer.options.locate:
        return None, after, "location was not asked for"
    f0, f1 = indicator(before), indicator(after)
    first = (before, after)
    for _ in range(HALVINGS):
        share = f0 / (f0 - f1) if f0 != f1 else 0.5
        # Close to an end the other half of the bracket would never shrink.
        guess = tracer.at(before, after, float(np.clip(share, 0.02, 0.98)))
        if guess is None:
            return None, before if abs(f0) < abs(f1) else after, "the curve was lost in the bracket"
        try:
            result = attempt(guess, before, after)
            s, away = tracer.fraction(*first, result.z[: guess.z.size])
            if -SLACK <= s <= 1 + SLACK and away <= 1.0:
                return result, guess, ""
            reason = "Newton's method left the bracket"
        except DerivativeMissing as error:
            return None, guess, str(error)
        except (NotConverged, SingularSystem) as error:
            reason = str(error)
        middle = tracer.at(before, after, 0.5)
        f = np.nan if middle is None else indicator(middle)
        if not np.isfinite(f):
            break
        if (f > 0) == (f0 > 0):
            before, f0 = middle, f
        else:
            after, f1 = middle, f
    return None, guess, reason


class FoldMonitor(Monitor):
    """Folds: the parameter's part of the tangent changes sign."""

    kinds = ("fold",)

    def measure(self, tracer, point):
        point.tests["fold"] = float(point.tangent[tracer.problem.n])

    def between(self, tracer, before, after, index, found):
        if before.tests["fold"] * after.tests["fold"] >= 0 and after.tests["fold"] != 0:
            turn = self._turn(tracer, before, after)
            if turn is None:
                return []
            first = self.between(tracer, before, turn, index, found)
            return first + self.between(tracer, turn, after, index, found)
        problem = tracer.problem
        result, guess, reason = locate_zero(
            tracer, before, after, lambda point: point.tangent[problem.n], lambda guess, *_: solve_fold(tracer, guess)
        )
        if result is None:
            return [special_at(tracer, "fold", guess, index, False, reason)]
        local = result.local
        v, w = local.condition.v, local.condition.w
        coefficient = fold_coefficient(problem.system, local.u, local.mu, v, w)
        values = {"iterations": result.iterations, "quadratic_coefficient": coefficient}
        tangent = np.append(v, 0.0)
        fold = CurvePoint(result.z, tangent / problem.norm(tangent))
        return [special_at(tracer, "fold", fold, index, True, "", values, {"right": v, "left": w})]

    def _turn(self, tracer, before, after, depth=TURNS):
        """Point between two folds within one step, or None.

        The parameter's part of the tangent at both ends and its mean, the way of the parameter over the length of the
        step, give a parabola; where that comes near to zero the curve is looked at.
        """
        i, problem = tracer.problem.n, tracer.problem
        length = problem.norm(after.z - before.z)
        t0, t1 = before.tangent[i], after.tangent[i]  # in the units of now, unlike the tests
        sign, mean = np.sign(t0), (after.z[i] - before.z[i]) / max(length, 1e-300)
        bend = 3.0 * sign * (t0 + t1 - 2.0 * mean)
        slope = sign * (t1 - t0) - bend
        if depth == 0 or t0 == 0 or not bend > 0 or not 0 < -slope < 2 * bend:
            return None
        if abs(t0) - slope**2 / (4 * bend) > TOUCH * min(abs(t0), abs(t1)):
            return None
        middle = tracer.at(before, after, float(np.clip(-slope / (2 * bend), 0.05, 0.95)))
        if middle is None:
            return None
        self.measure(tracer, middle)
        if middle.tests["fold"] * t0 < 0:
            return middle
        first = self._turn(tracer, before, middle, depth - 1)
        return first if first is not None else self._turn(tracer, middle, after, depth - 1)


def solve_fold(tracer, guess):
    """Newton on ``F = 0, g = 0`` from a point of the branch; see `solve_augmented`."""
    problem = tracer.problem
    borders = null_vectors(guess.local.linear, guess.local.columns[0], problem.u(guess.tangent))
    return solve_augmented(tracer, FoldCondition(*borders), guess.z, problem.frame(guess.tangent[:, None]))


@dataclass(frozen=True)
class Event:
    """Quantity of the user's own to watch along a branch.

    Attributes
    ----------
    name : str
        Becomes the kind of the special point.
    function : callable
        ``function(u, mu)`` -> float; its sign changes are located.
    stop : bool
        End the branch there.
    """

    name: str
    function: Callable
    stop: bool = False


class EventMonitor(Monitor):
    """Sign changes of an `Event`."""

    def __init__(self, event: Event):
        self.event, self.kinds = event, (event.name,)

    def measure(self, tracer, point):
        value = self.event.function(tracer.problem.u(point.z), tracer.problem.mu(point.z))
        point.tests[self.event.name] = float(value)

    def between(self, tracer, before, after, index, found):
        name = self.event.name
        f0, f1 = before.tests[name], after.tests[name]
        # A value that is not finite is no crossing, and a zero was reported when it was reached.
        if not (f0 * f1 < 0 or (f1 == 0 and f0 != 0)):
            return []
        values = {"stop": float(self.event.stop)} if self.event.stop else {}
        if f1 == 0:
            return [special_at(tracer, name, after, index, True, "", values)]
        zero = self.zero(tracer, before, after, name)
        reason = "" if zero is not None else "the curve was lost in the bracket"
        return [special_at(tracer, name, zero or after, index, zero is not None, reason, values)]
