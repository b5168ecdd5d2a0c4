"""Simple branch points along a branch of equilibria, and the directions that leave them."""

from __future__ import annotations

import numpy as np

from continuation.branch import CurvePoint
from continuation.conditions import BranchPointCondition, generic_borders, null_pair
from continuation.event_location import locate_zero, solve_augmented, special_at
from continuation.linear import Bordered
from continuation.options import NotConverged, SingularSystem
from continuation.system import System
from continuation.tracer import Monitor


class BranchPointMonitor(Monitor):
    """Simple branch points: ``[[F_u, F_p], [t']]`` becomes singular.

    Where the linearisation offers ``determinant_sign`` the sign of that determinant is
    watched, which cannot fail.  Otherwise a bordered scalar is; it has poles too, and a pole
    and a zero within one step hide each other: then only a spectrum tells.
    """

    kinds = ("branch point",)

    def __init__(self):
        self._b = self._c = None

    def measure(self, tracer, point):
        if self._b is None:
            self._b, self._c = generic_borders(tracer.problem.n + 1)
        point.data["borders"] = (self._b, self._c)
        point.tests["branch point"] = self._test(tracer, point)

    def _test(self, tracer, point, borders=None):
        g = self._scalar(tracer, point, borders)[0]
        sign = self._sign(tracer, point)
        return g if sign is None else sign * abs(g)

    def _extended(self, tracer, point):
        row = tracer.problem.weights * point.tangent
        return Bordered(point.local.linear, point.local.columns[0], row[:-1], row[-1])

    def _sign(self, tracer, point):
        own = getattr(point.local.linear, "determinant_sign", None)
        return None if own is None else own() * self._extended(tracer, point).complement_sign

    def _scalar(self, tracer, point, borders=None):
        """``g`` and the null vectors with the borders given or in force."""
        b, c = borders or (self._b, self._c)
        try:
            g, v, w, _ = null_pair(self._extended(tracer, point), b, c)
        except SingularSystem:
            return np.nan, None, None
        return float(g), v, w

    def between(self, tracer, before, after, index, found):
        borders = after.data["borders"]
        g0, g1 = before.tests["branch point"], after.tests["branch point"]
        if before.data["borders"][0] is not borders[0]:
            g0 = self._test(tracer, before, borders)
        return self._examine(tracer, before, after, index, g0, g1, borders)

    def accept(self, tracer, before, point, found):
        """Turn the borders towards the vectors just found, for a well-scaled test function.

        A generic part stays, so that no other vector ever is out of their sight.
        """
        _, v, w = self._scalar(tracer, point)
        if v is None:
            return
        b, c = generic_borders(v.size)
        self._b = w / np.linalg.norm(w) + 0.3 * b
        self._c = v / np.linalg.norm(v) + 0.3 * c
        point.data["borders"] = (self._b, self._c)
        point.tests["branch point"] = self._test(tracer, point)

    def _examine(self, tracer, before, after, index, g0, g1, borders):
        if not np.isfinite(g0 * g1) or (g0 * g1 >= 0 and g1 != 0):
            return []
        sizes = [0.0]

        def indicator(point):
            g = self._test(tracer, point, borders)
            sizes.append(abs(g))
            return g

        result, guess, reason = locate_zero(
            tracer, before, after, indicator, lambda guess, *_: self.solve(tracer, guess, borders)
        )
        if result is None:
            if sizes[-1] > max(abs(g0), abs(g1)):
                return []  # The test function went through infinity: no branch point.
            return [special_at(tracer, "branch point", guess, index, False, reason)]
        return [self.describe(tracer, result, guess, index)]

    def solve(self, tracer, guess, borders):
        """Newton on the augmented system; see `solve_augmented`."""
        problem = tracer.problem
        for _ in range(3):
            _, v, w = self._scalar(tracer, guess, borders)
            if v is None:
                raise NotConverged("The bordered matrix is singular.")
            borders = w / np.linalg.norm(w), v / np.linalg.norm(v)
        unfolded = Unfolded(problem.system, w[: problem.n])
        rows = problem.frame(np.stack([guess.tangent, v], axis=1))
        condition = BranchPointCondition(unfolded.direction, rows)
        name = problem.names[0]
        result = solve_augmented(
            tracer,
            condition,
            np.append(guess.z, 0.0),
            np.hstack([rows, np.zeros((2, 1))]),
            (name, unfolded.name),
            unfolded,
            {**problem.mu(guess.z), unfolded.name: 0.0},
        )
        if abs(result.z[-1]) > 1e-6 * (1 + np.abs(result.z[:-1]).max()):
            raise NotConverged("The point is a branch point of an unfolded system only.")
        return result

    def describe(self, tracer, result, guess, index):
        """The special point, with the directions of both branches."""
        value = result.local.condition
        kernel = np.stack(value.null, axis=1)
        directions = branch_directions(tracer.problem, value, guess.tangent)
        point = CurvePoint(result.z[:-1], directions[0])
        vectors = {"left": value.w, "kernel": kernel}
        if len(directions) == 2:
            vectors["direction"] = directions[1]
        values = {"iterations": result.iterations, "unfolding": float(result.z[-1])}
        reason = "" if len(directions) == 2 else "only one branch direction is real"
        return special_at(tracer, "branch point", point, index, True, reason, values, vectors)


def branch_directions(problem, value, tangent):
    """Tangents of the branches that meet, the one nearest to ``tangent`` first.

    They solve the algebraic bifurcation equation ``w' G_zz [y, y] = 0`` on the kernel of
    ``G_z = [F_u, F_p]`` (Keller 1977).
    """
    name = problem.names[0]
    kernel = np.stack(value.null, axis=1)
    root = np.sqrt(problem.weights)
    kernel = np.linalg.qr(root[:, None] * kernel)[0] / root[:, None]
    form = np.empty((2, 2))
    for j in range(2):
        for i in range(2):
            y = kernel[:, j]
            form[i, j] = value.w @ value.extended_along(kernel[:, i], y[:-1], {name: float(y[-1])})
    form = 0.5 * (form + form.T)
    eigenvalues, rotation = np.linalg.eigh(form)
    # form = l0 x^2 + l1 y^2 = 0 has two real lines when l0 < 0 < l1 (one may be zero).
    low, high = min(eigenvalues[0], 0.0), max(eigenvalues[1], 0.0)
    if high - low <= 0.0 or eigenvalues[0] * eigenvalues[1] > 1e-8 * (high - low) ** 2:
        return [tangent]
    x, y = np.sqrt(high), np.sqrt(-low)
    lines = [kernel @ (rotation @ np.array([x, sign * y])) for sign in (1.0, -1.0)]
    lines = [line / problem.norm(line) for line in lines]
    lines.sort(key=lambda line: -abs(problem.dot(line, tangent)))
    if problem.dot(lines[0], tangent) < 0:
        lines[0] = -lines[0]
    return lines


class Unfolded(System):
    """``F + beta p``, with ``beta`` as one more parameter."""

    name = "unfolding of the branch point"

    def __init__(self, system, direction):
        self.inner, self.size = system, system.size
        self.direction = direction / np.linalg.norm(direction)
        for optional in ("residual_norm", "state_weights"):
            if hasattr(system, optional):
                setattr(self, optional, getattr(system, optional))

    def _rest(self, mu):
        return {name: value for name, value in mu.items() if name != self.name}

    def residual(self, u, mu):
        return self.inner.residual(u, self._rest(mu)) + mu[self.name] * self.direction

    def linear(self, u, mu):
        return self.inner.linear(u, self._rest(mu))

    def d_parameter(self, u, mu, name):
        return self.direction if name == self.name else self.inner.d_parameter(u, self._rest(mu), name)

    def d2(self, u, mu, a, b):
        return self.inner.d2(u, self._rest(mu), a, b)

    def d2_parameter(self, u, mu, name, a):
        return np.zeros(self.size) if name == self.name else self.inner.d2_parameter(u, self._rest(mu), name, a)

    def d_parameters2(self, u, mu, first, second):
        if self.name in (first, second):
            return np.zeros(self.size)
        return self.inner.d_parameters2(u, self._rest(mu), first, second)
