"""Newton's method for an equilibrium at fixed parameters, with line search and deflation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from continuation.options import NewtonOptions, NotConverged, OutOfDomain, SingularSystem, require


@dataclass(frozen=True)
class Deflation:
    """Factor that pushes Newton's method away from equilibria that are known.

    The residual is multiplied by ``prod_i (|u - u_i|^-power + shift)``: Farrell, Birkisson &
    Funke, SIAM J. Sci. Comput. 37 (2015) A2026.

    Attributes
    ----------
    known : sequence of ndarray, shape (n,)
    power, shift : float
    """

    known: Sequence[np.ndarray] = ()
    power: float = 2.0
    shift: float = 1.0

    def __post_init__(self):
        require(self.power > 0, "The deflation power must be positive.")
        require(self.shift >= 0, "The deflation shift cannot be negative.")

    def step_factor(self, u: np.ndarray, step: np.ndarray) -> float:
        """Factor that turns the Newton step of F into that of the deflated residual."""
        rate = 0.0
        for other in self.known:
            gap = u - other
            distance = np.linalg.norm(gap)
            if distance == 0.0:
                continue
            factor = distance**-self.power + self.shift
            rate += -self.power * distance ** (-self.power - 2) * (gap @ step) / factor
        bottom = 1.0 - rate
        return 1.0 / bottom if abs(bottom) > 1e-12 else 1e12

    def magnitude(self, u: np.ndarray) -> float:
        """The factor itself, infinite at a known equilibrium."""
        value = 1.0
        for other in self.known:
            distance = np.linalg.norm(u - other)
            value *= np.inf if distance == 0 else distance**-self.power + self.shift
        return value


@dataclass(frozen=True)
class NewtonResult:
    """Outcome of Newton's method: the last state and the reason of the end.

    Attributes
    ----------
    u : ndarray, shape (n,)
    mu : dict
    converged : bool
    reason : str
        ``"converged"``, ``"maximum iterations"``, ``"diverged"``, ``"not finite"``,
        ``"singular"`` or ``"line search stalled"``.
    iterations : int
    residual : float
    history : tuple of float
        The norm of the residual before each correction and at the end.
    """

    u: np.ndarray
    mu: dict
    converged: bool
    reason: str
    iterations: int
    residual: float
    history: tuple[float, ...] = field(default=())

    def required(self) -> NewtonResult:
        """The result itself, or `NotConverged` when it is none."""
        if self.converged:
            return self
        where = ", ".join(f"{name} = {value:g}" for name, value in self.mu.items())
        raise NotConverged(
            f"No equilibrium was found at {where}: {self.reason} after {self.iterations} "
            f"iterations, residual {self.residual:.3g}.",
            self.reason,
            self,
        )


def residual_norm(system, residual: np.ndarray) -> float:
    """The system's own norm of a residual, or its largest entry."""
    own = getattr(system, "residual_norm", None)
    return float(own(residual) if own is not None else np.abs(residual).max(initial=0.0))


def equilibrium(
    system,
    u: np.ndarray,
    mu,
    options: NewtonOptions | None = None,
    deflation: Deflation | None = None,
    observer: Callable[[int, float], None] | None = None,
) -> NewtonResult:
    """Solve ``F(u, mu) = 0`` at fixed parameters.

    Parameters
    ----------
    system : System
    u : ndarray, shape (n,)
        First guess.
    mu : mapping of str to float
    options : NewtonOptions
    deflation : Deflation, optional
        Equilibria not to be found again.
    observer : callable, optional
        Called with the iteration and the norm of the residual.

    Returns
    -------
    NewtonResult
        Call its ``required()`` to have a failure raised.

    Examples
    --------
    >>> from continuation.jax_system import JaxSystem
    >>> system = JaxSystem(lambda u, mu: u**2 - mu["c"], size=1)
    >>> float(equilibrium(system, np.array([1.0]), {"c": 2.0}).required().u[0])  # doctest: +ELLIPSIS
    1.41421356...
    """
    options = options or NewtonOptions()
    mu = dict(mu)
    u = np.array(u, float)
    history: list[float] = []
    solver = None

    def done(reason, count):
        last = history[-1] if history else np.inf
        return NewtonResult(u, mu, reason == "converged", reason, count, last, tuple(history))

    def evaluate(position):
        try:
            return system.residual(position, mu)
        except OutOfDomain:
            # Treated like an infinite residual: a line search steps back from it.
            return np.full(system.size, np.inf)

    residual = evaluate(u)
    for iteration in range(options.max_iterations + 1):
        size = residual_norm(system, residual)
        history.append(size)
        if observer is not None:
            observer(iteration, size)
        if not np.isfinite(size):
            return done("not finite", iteration)
        repelled = deflation is not None and deflation.magnitude(u) * size > 1e6 * size + 1.0
        if size <= options.tolerance and not repelled:
            return done("converged", iteration)
        if size > options.divergence * max(history[0], options.tolerance):
            return done("diverged", iteration)
        if iteration == options.max_iterations:
            return done("maximum iterations", iteration)
        slow = len(history) < 2 or size > options.reuse_rate * history[-2]
        if solver is None or slow:
            solver = system.linear(u, mu)
        try:
            step = solver.solve(-residual)
        except (SingularSystem, ArithmeticError, np.linalg.LinAlgError):
            return done("singular", iteration)
        if not np.all(np.isfinite(step)):
            return done("singular", iteration)
        if deflation is not None:
            step = step * deflation.step_factor(u, step)
        trial = evaluate(u + step)
        if options.line_search:

            def merit(position, value):
                factor = 1.0 if deflation is None else deflation.magnitude(position)
                return factor * residual_norm(system, value)

            step, trial = _shortened(evaluate, merit, u, residual, step, trial, options.min_damping)
            if step is None:
                return done("line search stalled", iteration)
        u, residual = u + step, trial
    raise AssertionError("unreachable")


def _shortened(evaluate, merit, u, residual, step, trial, least):
    """Step halved until the merit falls (Armijo), and the residual behind it; None below the least fraction."""
    start, damping = merit(u, residual), 1.0
    while not merit(u + damping * step, trial) <= (1 - 1e-4 * damping) * start:
        damping *= 0.5
        if damping < least:
            return None, trial
        trial = evaluate(u + damping * step)
    return damping * step, trial
