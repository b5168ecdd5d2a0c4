"""Locating a detected point: Newton on the augmented system, bisection as the safety net."""

from __future__ import annotations

import numpy as np

from continuation.branch import SpecialPoint
from continuation.errors import DerivativeMissing, SingularSystem
from continuation.problem import Problem

#: How far outside its bracket, in chord lengths, a located point may lie.
SLACK = 0.02


def companion(tracer, condition, names=None, system=None, mu=None):
    """A problem in the same units as the tracer's, with a condition."""
    problem, options = tracer.problem, tracer.options
    return Problem(
        system or problem.system,
        mu or problem.fixed,
        names or problem.names,
        condition,
        options.state_scale,
        options.parameter_scales,
    )


def special_at(tracer, kind, here, index, located, reason="", values=None, vectors=None):
    """A `SpecialPoint` at a point of the curve."""
    problem = tracer.problem
    return SpecialPoint(
        kind,
        index,
        problem.u(here.z).copy(),
        problem.mu(here.z),
        here.z.copy(),
        here.tangent.copy(),
        located,
        reason,
        values or {},
        vectors or {},
    )


def safeguarded(tracer, before, after, indicator, attempt, rounds=16):
    """Newton from a guess in the bracket; if it leaves the bracket, halve that and try again.

    Parameters
    ----------
    before, after : Here
        Points where ``indicator`` has opposite signs.
    indicator : callable
        Of a point; its zero is the point sought.
    attempt : callable
        ``attempt(guess, before, after)`` returns ``(z, result)`` or a sentence that says why
        it failed.  ``z`` is checked to lie in the bracket.

    Returns
    -------
    (result, guess, reason)
        ``result`` is None if nothing was located; ``guess`` is then the best bracket point.
    """
    f0, f1 = indicator(before), indicator(after)
    reason = "no attempt was made"
    first = (before, after)
    guess = None
    for _ in range(rounds):
        share = f0 / (f0 - f1) if f0 != f1 else 0.5
        # Close to an end the other half of the bracket would never shrink.
        guess = tracer.at(before, after, float(np.clip(share, 0.02, 0.98)))
        if guess is None:
            return None, before if abs(f0) < abs(f1) else after, "the curve was lost in the bracket"
        try:
            outcome = attempt(guess, before, after)
        except SingularSystem as error:
            outcome = str(error)
        except DerivativeMissing as error:
            outcome = str(error)
            rounds = 0
        if not isinstance(outcome, str):
            z, result = outcome
            s, away = tracer.fraction(*first, z)
            if -SLACK <= s <= 1 + SLACK and away <= 1.0:
                return result, guess, ""
            reason = "Newton's method left the bracket"
        else:
            reason = outcome
        middle = tracer.at(before, after, 0.5)
        if middle is None:
            break
        f = indicator(middle)
        if not np.isfinite(f):
            break
        if (f > 0) == (f0 > 0):
            before, f0 = middle, f
        else:
            after, f1 = middle, f
    return None, guess, reason
