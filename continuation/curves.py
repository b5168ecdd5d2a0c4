"""Fold and Hopf curves in two parameters, and the points of codimension two on them.

A fold curve is ``F = 0`` with a singular ``F_u``; cusps (quadratic coefficient zero) and Bogdanov-Takens points lie on
it.  A Hopf curve is ``F = 0`` with a singular ``F_u - i omega B``; it ends at Bogdanov-Takens points, and generalised
Hopf and zero-Hopf points lie on it (Kuznetsov, Elements of Applied Bifurcation Theory, ch. 8 and 10).
"""

from __future__ import annotations

import numpy as np

from continuation.branch import Branch, CurvePoint, SpecialPoint
from continuation.checks import options_of, require_names, shown, special_of, spectrum_of, system_of
from continuation.conditions import (
    BogdanovTakensCondition,
    FoldCondition,
    HopfCondition,
    fold_coefficient,
    generic_borders,
    null_pair,
    null_vectors,
)
from continuation.event_location import solve_augmented, special_at
from continuation.normal_form import hopf_normal_form
from continuation.options import (
    ContinuationError,
    ContinuationOptions,
    DerivativeMissing,
    NotABifurcation,
    NotConverged,
    SingularSystem,
)
from continuation.problem import Problem
from continuation.stability import CountMonitor
from continuation.tracer import Monitor, Tracer


def locate_bogdanov_takens(tracer, z, v, w, tangent, index) -> SpecialPoint:
    """Special point of a fold curve where the zero eigenvalue is double, by Newton's method on ``F = 0, g = 0,
    w' B v = 0`` in state and both parameters; see `solve_augmented`.
    """
    result = solve_augmented(tracer, BogdanovTakensCondition(w, v), z[: tracer.problem.n + 2], tracer.frame)
    value = result.local.condition
    values = {"omega": 0.0, "iterations": result.iterations}
    vectors = {"right": value.v / np.linalg.norm(value.v), "left": value.w}
    return special_at(tracer, "bogdanov-takens", CurvePoint(result.z, tangent), index, True, "", values, vectors)


class FoldCurveMonitor(Monitor):
    """Cusps (quadratic coefficient zero) and Bogdanov-Takens points (``w' B v`` zero)."""

    kinds = ("cusp", "bogdanov-takens")

    def measure(self, tracer, point):
        value = point.local.condition
        system = tracer.problem.system
        v = value.v / np.linalg.norm(value.v)
        w = value.w / np.linalg.norm(value.w)
        last = point.data.get("orientation", getattr(self, "_last", (v, w)))
        # Null vectors have no sign of their own; keep that of the point before.
        v = v if v @ last[0] >= 0 else -v
        w = w if w @ last[1] >= 0 else -w
        point.data["orientation"] = (v, w)
        point.tests["bogdanov-takens"] = float(w @ point.local.linear.mass_matvec(v))
        point.tests["cusp"] = float(0.5 * w @ system.d2(point.local.u, point.local.mu, v, v))

    def between(self, tracer, before, after, index, found):
        self._last = before.data["orientation"]
        kinds = [kind for kind in ("cusp", "bogdanov-takens") if before.tests[kind] * after.tests[kind] < 0]
        special = [self._locate(tracer, kind, before, after, index) for kind in kinds]
        self._last = after.data["orientation"]
        return special

    def _locate(self, tracer, kind, before, after, index):
        point = self.zero(tracer, before, after, kind, tolerance=1e-3 if kind != "cusp" else 1e-11)
        if point is None:
            return special_at(tracer, kind, after, index, False, "the curve was lost")
        v, w = point.data["orientation"]
        if kind == "bogdanov-takens":
            try:
                found = locate_bogdanov_takens(tracer, point.z, v, w, point.tangent, index)
            except NotConverged as error:
                return special_at(tracer, kind, point, index, False, str(error))
            if tracer.fraction(before, after, found.z)[1] >= 1.0:
                return special_at(tracer, kind, point, index, False, "Newton's method left the bracket")
            return found
        coefficient = fold_coefficient(tracer.problem.system, point.local.u, point.local.mu, v, w)
        return special_at(
            tracer, kind, point, index, True, "", {"quadratic_coefficient": coefficient}, {"right": v, "left": w}
        )


class HopfCurveMonitor(Monitor):
    """``l1`` and its zeros, zero-Hopf points, and the end of the curve at ``omega = 0``.

    Parameters
    ----------
    lyapunov : bool
        Compute ``l1``; without it generalised Hopf points are not seen.
    """

    def __init__(self, lyapunov=True):
        self.lyapunov = lyapunov
        self.kinds = ("bogdanov-takens", "zero-hopf", *["generalised hopf"] * lyapunov)

    def measure(self, tracer, point):
        value, problem = point.local.condition, tracer.problem
        omega = float(problem.extra(point.z)[0])
        point.tests["omega"] = omega
        point.tests["l1"] = np.nan
        if self.lyapunov and omega > 0:
            try:
                point.tests["l1"] = hopf_normal_form(problem.system, point.local.u, point.local.mu, omega, value.v).l1
            except (ContinuationError, DerivativeMissing):
                pass
        point.tests["zero-hopf"] = self._zero(point)

    def _zero(self, point):
        """Changes sign with a real eigenvalue at zero: by the determinant where there is one.

        The bordered scalar in its point has poles as well, which can hide a zero.
        """
        linear = point.local.linear
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
        for kind, name in (("generalised hopf", "l1"), ("zero-hopf", "zero-hopf")):
            if before.tests[name] * after.tests[name] < 0:
                special += self._root(tracer, kind, name, before, after, index)
        return special

    def _root(self, tracer, kind, name, before, after, index):
        bound = 2 * max(abs(before.tests[name]), abs(after.tests[name]))
        point = self.zero(tracer, before, after, name, tolerance=1e-11)
        if point is None:
            return [special_at(tracer, kind, after, index, False, "the curve was lost")]
        if abs(point.tests[name]) > bound:
            return []  # A pole of the test function, not a zero.
        value = point.local.condition
        v = value.v / np.linalg.norm(value.v)
        values = {"omega": point.tests["omega"], "first_lyapunov_coefficient": point.tests["l1"]}
        return [special_at(tracer, kind, point, index, True, "", values, {"right": v, "left": value.w})]

    def _end(self, tracer, before, after, index):
        """The Bogdanov-Takens point where the frequency reaches zero."""
        n = tracer.problem.n
        share = before.tests["omega"] ** 2 / (before.tests["omega"] ** 2 + after.tests["omega"] ** 2)
        z = before.z + share * (after.z - before.z)
        condition = before.local.condition
        w, v = null_vectors(before.local.linear, condition.w.real, condition.v.real)
        try:
            point = locate_bogdanov_takens(tracer, z, v, w, before.tangent[: n + 2], index)
            point.z, point.tangent = np.append(point.z, 0.0), np.append(point.tangent, 0.0)
        except NotConverged as error:
            point = special_at(tracer, "bogdanov-takens", before, index, False, str(error))
        # Behind the point the equations only mirror omega; that part is not the curve's.
        point.values["beyond"] = 1.0
        return point


#: Kinds of points that curves start from.
STARTS = {"fold curve": ("fold", "bogdanov-takens", "cusp"), "hopf curve": ("hopf", "generalised hopf", "zero-hopf")}


def continue_fold(
    system,
    special: SpecialPoint,
    parameters: tuple[str, str],
    options: ContinuationOptions | None = None,
    observers=None,
    spectrum=None,
) -> Branch:
    """Follow a fold in two parameters; cusps and Bogdanov-Takens points are noted.

    Parameters
    ----------
    system : System
    special : SpecialPoint
        A fold, or a Bogdanov-Takens point.
    parameters : (str, str)
        ``options.direction`` is the sign of the first step in the second one.
    options : ContinuationOptions
    observers : Observer, callable or sequence of them
    spectrum : callable, optional
        In place of the system's own.  With ``options.eigenvalues`` the count of unstable
        eigenvalues besides the critical one is recorded: 0 on the edge of stability.

    Returns
    -------
    Branch
        Of kind ``"fold curve"``.

    Raises
    ------
    NotABifurcation
        The point is no located fold.

    Examples
    --------
    >>> from continuation import JaxSystem, continue_branch
    >>> cusp = JaxSystem(lambda u, mu: mu["a"] + mu["b"] * u - u**3, size=1)
    >>> options = ContinuationOptions(limits={"a": (-2.0, 2.0), "b": (-1.0, 2.0)})
    >>> fold, _ = continue_branch(cusp, [-1.5], {"a": -2.0, "b": 1.0}, "a", options).special
    >>> curve = continue_fold(cusp, fold, ("a", "b"), options)
    >>> bool(abs(27 * curve.values("a")**2 - 4 * curve.values("b")**3).max() < 1e-8)
    True
    """
    return _continue(system, "fold curve", special, parameters, options, observers, spectrum)


def continue_hopf(
    system,
    special: SpecialPoint,
    parameters: tuple[str, str],
    options: ContinuationOptions | None = None,
    observers=None,
    lyapunov: bool = True,
    spectrum=None,
) -> Branch:
    """Follow a Hopf point in two parameters.

    The extra unknown is ``omega``.  The curve ends at a Bogdanov-Takens point
    (``omega = 0``); generalised Hopf points (``l1 = 0``) and zero-Hopf points are noted.

    Parameters
    ----------
    system, special, parameters, options, observers, spectrum
        As in `continue_fold`; the point is a Hopf point.
    lyapunov : bool
        Compute the first Lyapunov coefficient at every point (third derivatives).

    Returns
    -------
    Branch
        Of kind ``"hopf curve"``; ``values("omega")`` is the angular frequency along it,
        ``values("l1")`` the first Lyapunov coefficient.

    Raises
    ------
    NotABifurcation
        The point is no located Hopf point.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem, continue_branch
    >>> brusselator = JaxSystem(lambda u, mu: jnp.stack([
    ...     mu["A"] - (mu["B"] + 1) * u[0] + u[0]**2 * u[1], mu["B"] * u[0] - u[0]**2 * u[1]]), 2)
    >>> options = ContinuationOptions(eigenvalues=2, limits={"A": (0.5, 2.0), "B": (0.0, 6.0)})
    >>> hopf, = continue_branch(brusselator, [1.0, 1.0], {"A": 1.0, "B": 1.0}, "B", options).special
    >>> curve = continue_hopf(brusselator, hopf, ("B", "A"), options)
    >>> bool(abs(curve.values("B") - 1 - curve.values("A")**2).max() < 1e-8)
    True
    """
    return _continue(system, "hopf curve", special, parameters, options, observers, spectrum, lyapunov)


def curve_tracer(system, kind, mu, parameters, borders, options, observers, spectrum, lyapunov=True, omega=0.0):
    """Tracer of a fold or Hopf curve with the left and right vectors, and the frequency, from which it starts."""
    options = options_of(ContinuationOptions, options)
    if isinstance(parameters, str) or len(set(parameters)) != 2:
        raise ValueError(f"A curve needs two different parameters, not {shown(parameters)}.")
    require_names(options, mu, parameters)
    system_of(system)
    fold = kind == "fold curve"
    condition = (FoldCondition if fold else HopfCondition)(*borders)
    problem = Problem(system, mu, parameters, condition, options.state_scale, options.units(parameters), omega or 1.0)
    monitors = [FoldCurveMonitor() if fold else HopfCurveMonitor(lyapunov)]
    return Tracer(
        problem, options, monitors + [CountMonitor(spectrum_of(spectrum))] * bool(options.eigenvalues), observers
    )


def _continue(system, kind, special, parameters, options, observers, spectrum, lyapunov=True):
    """Curve of a kind from a special point, in the direction the options ask for."""
    special_of(special, f"A {kind} starts at")
    if special.kind not in STARTS[kind] or "right" not in special.vectors:
        raise NotABifurcation(
            f"A {kind} starts at a located point of kind {', '.join(STARTS[kind])}; this is {special!r}."
        )
    borders = special.vectors["left"], special.vectors["right"]
    omega = special.values.get("omega", 0.0)
    tracer = curve_tracer(system, kind, special.mu, parameters, borders, options, observers, spectrum, lyapunov, omega)
    problem = tracer.problem
    extra = [omega] if problem.e else []
    n = problem.n
    z = problem.pack(special.u, special.mu, extra)
    frame = None
    if not problem.e:
        # F_u is singular at a fold: one direction is that of the branch with it, the other the second parameter.
        along, second = np.zeros((2, n + 2))
        along[:n], second[n + 1] = special.tangent[:n], 1.0
        frame = problem.frame(np.stack([along, second], axis=1))
    direction = np.zeros(z.size)
    direction[n + 1] = tracer.options.direction
    point = tracer.start(z, direction, frame)
    branch = Branch(kind, n, problem.names, problem.condition.extra_names, dict(special.mu), [point.record()])
    return tracer.run(branch, point, tracer.options.step)
