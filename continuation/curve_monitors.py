"""Points of codimension two along fold and Hopf curves."""

from __future__ import annotations

import numpy as np

from continuation.conditions import BogdanovTakensCondition, generic_borders, null_pair
from continuation.errors import ContinuationError, DerivativeMissing, SingularSystem
from continuation.here import Here
from continuation.locate import special_at
from continuation.normal_form import fold_coefficient, hopf_normal_form
from continuation.problem import Problem, correct


def solve_bogdanov_takens(tracer, z, v, w):
    """Newton on ``F = 0, g = 0, w' B v = 0`` in state and both parameters."""
    problem, options = tracer.problem, tracer.options
    augmented = Problem(
        problem.system,
        problem.fixed,
        problem.names,
        BogdanovTakensCondition(w, v),
        options.state_scale,
        options.parameter_scales,
    )
    return correct(augmented, z[: problem.n + 2], tracer.frame, options.newton, None, options.location_tolerance)


def bogdanov_takens_special(tracer, result, tangent, index):
    """Special point of a fold curve where the zero eigenvalue is double."""
    value = result.local.condition
    here = Here(result.z, tangent, result.local)
    v = value.v / np.linalg.norm(value.v)
    return special_at(
        tracer,
        "bogdanov-takens",
        here,
        index,
        True,
        "",
        {"omega": 0.0, "iterations": result.iterations},
        {"right": v, "left": value.w},
    )


class FoldCurveMonitor:
    """Cusps (quadratic coefficient zero) and Bogdanov-Takens points (``w' B v`` zero)."""

    def measure(self, tracer, here):
        value = here.local.condition
        system = tracer.problem.system
        v = value.v / np.linalg.norm(value.v)
        w = value.w / np.linalg.norm(value.w)
        last = here.data.get("orientation")
        if last is None:
            last = getattr(self, "_last", (v, w))
        # Null vectors have no sign of their own; keep that of the point before.
        v = v if v @ last[0] >= 0 else -v
        w = w if w @ last[1] >= 0 else -w
        here.data["orientation"] = (v, w)
        here.tests["bogdanov-takens"] = float(w @ here.local.linear.mass_matvec(v))
        here.tests["cusp"] = float(0.5 * w @ system.d2(here.local.u, here.local.mu, v, v))

    def between(self, tracer, before, after, index, found):
        special = []
        self._last = after.data["orientation"]
        for kind in ("cusp", "bogdanov-takens"):
            if before.tests[kind] * after.tests[kind] < 0:
                special.append(self._locate(tracer, kind, before, after, index))
        return special

    def _locate(self, tracer, kind, before, after, index):
        def test(here):
            here.data["orientation"] = before.data["orientation"]
            self.measure(tracer, here)
            return here.tests[kind]

        here = tracer.root(before, after, test, tolerance=1e-3 if kind != "cusp" else 1e-11)
        if here is None:
            return special_at(tracer, kind, after, index, False, "the curve was lost")
        v, w = here.data["orientation"]
        if kind == "bogdanov-takens":
            result = solve_bogdanov_takens(tracer, here.z, v, w)
            if result.converged and tracer.fraction(before, after, result.z)[1] < 1.0:
                return bogdanov_takens_special(tracer, result, here.tangent, index)
            return special_at(tracer, kind, here, index, False, result.reason)
        coefficient = fold_coefficient(tracer.problem.system, here.local.u, here.local.mu, v, w)
        return special_at(
            tracer, kind, here, index, True, "", {"quadratic_coefficient": coefficient}, {"right": v, "left": w}
        )


class HopfCurveMonitor:
    """``l1`` and its zeros, zero-Hopf points, and the end of the curve at ``omega = 0``.

    Parameters
    ----------
    lyapunov : bool
        Compute ``l1``; without it generalised Hopf points are not seen.
    """

    def __init__(self, lyapunov=True):
        self.lyapunov = lyapunov

    def measure(self, tracer, here):
        value, problem = here.local.condition, tracer.problem
        omega = float(problem.extra(here.z)[0])
        here.tests["omega"] = omega
        here.tests["l1"] = np.nan
        if self.lyapunov and omega > 0:
            try:
                here.tests["l1"] = hopf_normal_form(
                    problem.system, here.local.u, here.local.mu, omega, value.v, value.w
                ).l1
            except (ContinuationError, DerivativeMissing):
                pass
        here.tests["zero-hopf"] = self._zero(here)

    def _zero(self, here):
        """Changes sign with a real eigenvalue at zero: by the determinant where there is one.

        The bordered scalar in its place has poles as well, which can hide a zero.
        """
        linear = here.local.linear
        try:
            g = float(null_pair(linear, *generic_borders(linear.size))[0])
        except SingularSystem:
            return np.nan
        sign = getattr(linear, "determinant_sign", None)
        return g if sign is None else abs(g) * sign()

    def between(self, tracer, before, after, index, found):
        special = []
        if after.tests["omega"] <= 0.0 < before.tests["omega"]:
            return [self._end(tracer, before, after, index)]
        if before.tests["l1"] * after.tests["l1"] < 0:
            special += self._root(tracer, "generalised hopf", "l1", before, after, index)
        if before.tests["zero-hopf"] * after.tests["zero-hopf"] < 0:
            special += self._root(tracer, "zero-hopf", "zero-hopf", before, after, index)
        return special

    def _root(self, tracer, kind, name, before, after, index):
        bound = 2 * max(abs(before.tests[name]), abs(after.tests[name]))

        def test(here):
            self.measure(tracer, here)
            return here.tests[name]

        here = tracer.root(before, after, test, tolerance=1e-11)
        if here is None:
            return [special_at(tracer, kind, after, index, False, "the curve was lost")]
        if abs(here.tests[name]) > bound:
            return []  # A pole of the test function, not a zero.
        value = here.local.condition
        v = value.v / np.linalg.norm(value.v)
        values = {"omega": here.tests["omega"], "first_lyapunov_coefficient": here.tests["l1"]}
        return [special_at(tracer, kind, here, index, True, "", values, {"right": v, "left": value.w})]

    def _end(self, tracer, before, after, index):
        """The Bogdanov-Takens point where the frequency reaches zero."""
        n = tracer.problem.n
        share = before.tests["omega"] ** 2 / (before.tests["omega"] ** 2 + after.tests["omega"] ** 2)
        z = before.z + share * (after.z - before.z)
        v = before.local.condition.v.real
        w = before.local.condition.w.real
        linear = before.local.linear
        for _ in range(2):
            _, v, w, _ = null_pair(linear, w / np.linalg.norm(w), v / np.linalg.norm(v))
        result = solve_bogdanov_takens(tracer, z, v, w)
        if not result.converged:
            point = special_at(tracer, "bogdanov-takens", before, index, False, result.reason)
        else:
            point = bogdanov_takens_special(tracer, result, before.tangent[: n + 2], index)
            point.z, point.tangent = np.append(point.z, 0.0), np.append(point.tangent, 0.0)
        # Behind the point the equations only mirror omega; that part is not the curve's.
        point.values["beyond"] = 1.0
        return point
