"""Curves of equilibria under scalar conditions, and Newton's method for them.

Unknowns ``z = (u, p, e)``: the state, ``k`` freed parameters and ``e`` extra numbers (a
frequency).  Equations: ``F(u, mu(p)) = 0`` and ``m`` scalar conditions.  With
``m + 1 = k + e`` this is a curve, with ``m = k + e`` a point.  A branch of equilibria has
``k = 1, m = 0``; a fold curve ``k = 2, m = 1``; a Hopf curve ``k = 2, m = 2, e = 1``.

The full Newton step is taken by block elimination: a bordered solve gives one particular
correction of ``F`` and a basis of the ``k`` directions that keep ``F = 0``; the conditions
then fix the ``k + e`` coefficients.  So conditions are needed only along ``k + 1``
directions, and no gradient of a condition is ever formed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation.checks import numbers_of, options_of, parameters_of, system_of
from continuation.linear import bordered
from continuation.options import NewtonOptions, NotAParameter, NotConverged, OutOfDomain, Reason, Said, SingularSystem


class Problem:
    """Equations of a curve that is continued or of a point that is located.

    Parameters
    ----------
    system : System
    mu : mapping of str to float
        All parameters; those in ``names`` are overridden by the unknowns.
    names : sequence of str
        The ``k`` freed parameters.
    condition : object, optional
        See `continuation.conditions`.
    state_scale, parameter_scales
        Units of the arclength, see `ContinuationOptions`.
    extra_scale : float
        That of the extra numbers.
    """

    def __init__(self, system, mu, names, condition=None, state_scale=None, parameter_scales=None, extra_scale=1.0):
        self.system = system
        self.fixed = {name: float(value) for name, value in mu.items()}
        self.names = tuple(names)
        for name in self.names:
            if name not in self.fixed:
                raise NotAParameter.named(name, self.fixed)
        self.condition = condition
        self.n, self.k = system.size, len(self.names)
        self.e = 0 if condition is None else condition.extra
        self.m = 0 if condition is None else condition.count
        own = getattr(system, "state_weights", None)
        weights = np.full(self.n, 1.0 / self.n) if own is None else np.asarray(own, float)
        scales = parameter_scales or {}
        parameter = [scales.get(name, 1.0) ** -2 for name in self.names]
        #: True where the unit of the state follows the range that a curve goes through.
        self.grows = state_scale is None and own is None
        self.state_scale = state_scale = state_scale or 1.0
        self.parameter_scale = np.array([scales.get(name, 1.0) for name in self.names])
        self.extra_scale = extra_scale
        self.weights = np.concatenate([weights / state_scale**2, parameter, np.full(self.e, extra_scale**-2.0)])

    def rescale(self, state_scale: float, extra_scale: float) -> None:
        """Measure the state and the extra numbers in other units."""
        self.weights[: self.n] *= (self.state_scale / state_scale) ** 2
        self.weights[self.n + self.k :] *= (self.extra_scale / extra_scale) ** 2
        self.state_scale, self.extra_scale = state_scale, extra_scale

    def u(self, z):
        return z[: self.n]

    def p(self, z):
        return z[self.n : self.n + self.k]

    def extra(self, z):
        return z[self.n + self.k :]

    def mu(self, z) -> dict[str, float]:
        return {**self.fixed, **dict(zip(self.names, map(float, self.p(z))))}

    def changes(self, y) -> dict[str, float]:
        """The parameter part of a direction, by name."""
        return dict(zip(self.names, map(float, y[self.n : self.n + self.k])))

    def pack(self, u, mu, extra=()):
        return np.concatenate([u, [mu[name] for name in self.names], np.atleast_1d(extra)])

    def dot(self, a, b) -> float:
        return float(a @ (self.weights * b))

    def norm(self, a) -> float:
        return float(np.sqrt(max(self.dot(a, a), 0.0)))

    def natural_frame(self) -> np.ndarray:
        """Rows that single out the freed parameters; regular where ``F_u`` is."""
        return np.hstack([np.zeros((self.k, self.n)), np.eye(self.k)])

    def frame(self, directions) -> np.ndarray:
        """Rows dual to some directions, shape (n + k, k), orthonormalised in the metric."""
        root = np.sqrt(self.weights[: self.n + self.k])
        q, _ = np.linalg.qr(root[:, None] * directions)
        return (root[:, None] * q).T


class Local:
    """The problem linearised at one point ``z``.

    Parameters
    ----------
    frame : ndarray, shape (k, n + k)
        Rows that complete ``[F_u, F_p]`` to a regular matrix.
    """

    def __init__(self, problem: Problem, z: np.ndarray, frame: np.ndarray):
        self.problem, self.z, self.frame = problem, z, frame
        system, u, mu = problem.system, problem.u(z), problem.mu(z)
        self.u, self.mu = u, mu
        self.residual = system.residual(u, mu)
        if np.shape(self.residual) != u.shape:
            raise ValueError(f"The residual has shape {np.shape(self.residual)}; the state has {u.shape}.")
        self.size = residual_norm(system, self.residual)
        self.finite = bool(np.isfinite(self.size))
        if not self.finite:
            return
        n, k = problem.n, problem.k
        self.linear = system.linear(u, mu)
        self.columns = [system.d_parameter(u, mu, name) for name in problem.names]
        self.solver = bordered(self.linear, self.columns, frame)
        #: Directions along which F stays zero, shape (n + k, k).
        self.basis = np.array([self.solver.solve(row) for row in np.eye(k, n + k, n)]).reshape(k, n + k).T
        self.condition = None
        if problem.condition is not None:
            self.condition = problem.condition.evaluate(system, u, mu, problem.names, self.linear, problem.extra(z))

    @property
    def values(self) -> np.ndarray:
        """The scalar conditions, shape (m,)."""
        return np.zeros(0) if self.condition is None else self.condition.values

    def _rows(self):
        """The conditions' derivatives along the basis and the extra unknowns, (m, k + e)."""
        problem = self.problem
        if self.condition is None:
            return np.zeros((0, problem.k + problem.e))
        along = [self._along(self.basis[:, i]) for i in range(problem.k)]
        return np.hstack([np.stack(along, axis=1), self.condition.d_extra])

    def _along(self, y):
        return self.condition.along(self.problem.u(y), self.problem.changes(y))

    def _assemble(self, particular, coefficients):
        k = self.problem.k
        y = particular + self.basis @ coefficients[:k]
        return np.concatenate([y, coefficients[k:]])

    def correction(self, normal=None, offset=0.0) -> np.ndarray:
        """The Newton step; ``normal . dz = -offset`` closes the equations of a curve. Raises SingularSystem: the
        conditions do not fix the remaining unknowns.
        """
        n, k = self.problem.n, self.problem.k
        particular = self.solver.solve(np.concatenate([-self.residual, np.zeros(k)]))
        rows = self._rows()
        right = -self.values
        if self.condition is not None:
            right = right - self._along(particular)
        if normal is not None:
            last = np.concatenate([normal[: n + k] @ self.basis, normal[n + k :]])
            rows = np.vstack([rows, last])
            right = np.append(right, -offset - normal[: n + k] @ particular)
        try:
            coefficients = np.linalg.solve(rows, right)
        except np.linalg.LinAlgError:
            raise SingularSystem("The conditions of the augmented system are dependent.") from None
        return self._assemble(particular, coefficients)

    def tangent(self, reference) -> np.ndarray:
        """Unit tangent of the curve, pointing to the side of ``reference``."""
        problem = self.problem
        rows = self._rows()
        if rows.shape[0]:
            # Rows are scaled so that conditions of different size count alike.
            rows = rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True), 1e-300)
            coefficients = np.linalg.svd(rows)[2][-1]
        else:
            coefficients = np.ones(1)
        zero = np.zeros(problem.n + problem.k)
        direction = self._assemble(zero, coefficients)
        direction = direction / problem.norm(direction)
        return direction if problem.dot(direction, reference) >= 0 else -direction


#: Relative size of corrections that are rounding, and the share of ``F`` that such a correction leaves at least.
ROUNDING, STALLED = 64 * np.finfo(float).eps, 0.7
#: Growth of the residual at which an iteration is given up.
DIVERGENCE = 1e6


@dataclass(frozen=True, repr=False)
class Correction:
    """Outcome of Newton's method on a `Problem`."""

    z: np.ndarray
    local: Local | None  #: The linearisation at ``z`` when converged.
    reason: Said
    iterations: int
    residual: float  #: Norm of ``F``.

    def __repr__(self) -> str:
        return f"<Correction: {self.reason}, {self.iterations} iterations, residual {self.residual:.3g}>"

    @property
    def converged(self) -> bool:
        return self.reason.kind is Reason.CONVERGED


def correct(problem, z, frame, newton, normal=None, step_tolerance=1e-8) -> Correction:
    """Newton from ``z``; with ``normal`` in the hyperplane through ``z``, else to a point.

    Converged means that ``F`` meets its tolerance and, where there are conditions, that the
    last correction was small, relative to the point: the conditions have no natural size.
    A point whose corrections are rounding and no longer lessen ``F`` has converged too, as
    where large terms cancel; its residual says how far.
    """
    start, size, first, last = z, np.inf, None, np.inf
    for iteration in range(newton.max_iterations + 1):
        previous = size
        try:
            local = Local(problem, z, frame)
            size = local.size
            if not local.finite:
                return Correction(z, None, Reason.NOT_FINITE(), iteration, size)
            first = size if first is None else first
            settled = problem.condition is None or last <= step_tolerance
            rounded = last <= ROUNDING and size > STALLED * previous
            if (size <= newton.tolerance and settled) or rounded:
                return Correction(z, local, Reason.CONVERGED(), iteration, size)
            if size > DIVERGENCE * max(first, newton.tolerance):
                return Correction(z, None, Reason.DIVERGED(), iteration, size)
            if iteration == newton.max_iterations:
                break
            step = local.correction(normal, 0.0 if normal is None else float(normal @ (z - start)))
        except OutOfDomain as error:
            return Correction(z, None, Reason.DOMAIN(why=error), iteration, size)
        except (SingularSystem, ArithmeticError, np.linalg.LinAlgError):
            return Correction(z, None, Reason.SINGULAR(), iteration, size)
        if not np.all(np.isfinite(step)):
            return Correction(z, None, Reason.NOT_FINITE(), iteration, size)
        # Scaled part by part: a frequency of 1e2 must not hide a parameter that moves.
        last = max(
            _relative(problem.u(step), problem.u(z), problem.state_scale),
            _relative(problem.p(step), problem.p(z), problem.parameter_scale),
            _relative(problem.extra(step), problem.extra(z), problem.extra_scale),
        )
        z = z + step
    return Correction(z, None, Reason.ITERATIONS(), iteration, size)


def _relative(step, position, unit) -> float:
    if step.size == 0:
        return 0.0
    return float(np.max(np.abs(step) / (unit + np.abs(position).max())))


def residual_norm(system, residual: np.ndarray) -> float:
    """The system's own norm of a residual, or its largest entry."""
    own = getattr(system, "residual_norm", None)
    return float(own(residual) if own is not None else np.abs(residual).max(initial=0.0))


def equilibrium(system, u, mu, options: NewtonOptions | None = None) -> np.ndarray:
    """Solve ``F(u, mu) = 0`` at fixed parameters by Newton's method.

    Parameters
    ----------
    system : System
    u : ndarray, shape (n,)
        Guess.
    mu : mapping of str to float
    options : NewtonOptions, optional

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    NotConverged
        Its ``reason`` says why, ``result`` is the last `Correction`.

    Examples
    --------
    >>> from continuation import JaxSystem, equilibrium
    >>> float(equilibrium(JaxSystem(lambda u, mu: u**2 - mu["c"], 1), [1.0], {"c": 2.0})[0])  # doctest: +ELLIPSIS
    1.41421356...
    """
    problem, options = Problem(system_of(system), parameters_of(mu), ()), options_of(NewtonOptions, options)
    found = correct(problem, numbers_of(u, "state", (system.size,)), problem.natural_frame(), options)
    if not found.converged:
        where = ", ".join(f"{name} = {value:g}" for name, value in mu.items())
        raise NotConverged(
            f"No equilibrium was found at {where}: {found.reason} after {found.iterations} iterations, "
            f"residual {found.residual:.3g}.",
            found.reason.kind,
            found,
        )
    return found.z
