"""Folds along a branch of equilibria."""

from __future__ import annotations

import numpy as np

from continuation.conditions import FoldCondition, null_pair
from continuation.here import Here
from continuation.locate import companion, safeguarded, special_at
from continuation.normal_form import fold_coefficient
from continuation.problem import correct


class FoldMonitor:
    """Folds: the parameter's part of the tangent changes sign."""

    def measure(self, tracer, here):
        here.tests["fold"] = float(here.tangent[tracer.problem.n])

    def between(self, tracer, before, after, index, found):
        if before.tests["fold"] * after.tests["fold"] >= 0 and after.tests["fold"] != 0:
            return []
        n = tracer.problem.n
        if not tracer.options.locate:
            return [special_at(tracer, "fold", after, index, False, "location was not asked for")]

        def attempt(guess, *_):
            point = solve_fold(tracer, guess)
            return point if isinstance(point, str) else (point.z, point)

        result, guess, reason = safeguarded(tracer, before, after, lambda here: here.tangent[n], attempt)
        if result is None:
            return [special_at(tracer, "fold", guess, index, False, reason)]
        v, w = result.local.condition.v, result.local.condition.w
        values = {"iterations": result.iterations}
        values["quadratic_coefficient"] = fold_coefficient(tracer.problem.system, result.local.u, result.local.mu, v, w)
        here = Here(result.z, np.append(v, 0.0), result.local)
        here.tangent = here.tangent / tracer.problem.norm(here.tangent)
        return [special_at(tracer, "fold", here, index, True, "", values, {"right": v, "left": w})]


def solve_fold(tracer, guess):
    """Newton on ``F = 0, g = 0`` from a point of the branch; a `Correction` or a sentence."""
    problem = tracer.problem
    q = problem.u(guess.tangent)
    p = guess.local.columns[0]
    for _ in range(2):
        _, q, p, _ = null_pair(guess.local.linear, p / np.linalg.norm(p), q / np.linalg.norm(q))
    augmented = companion(tracer, FoldCondition(p, q))
    frame = augmented.frame(guess.tangent[:, None])
    result = correct(augmented, guess.z, frame, tracer.options.newton, None, tracer.options.location_tolerance)
    if not result.converged:
        return f"Newton's method on the augmented system: {result.reason}"
    return result
