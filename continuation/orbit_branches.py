"""Periodic orbits of ``B(u, mu) u' = F(u, mu)``, branches of them in one parameter, and those born at a Hopf point.

The orbits are Fourier series (harmonic balance): with ``u = c_0 + sum c_k exp(i k omega t)`` the equations are
projected on the harmonics kept, ``|k| <= H``; the unknowns are the coefficients and the frequency.  The error falls
geometrically with ``H`` for a smooth orbit, and the share of the last two harmonics measures it; the series is made
longer until that share is small enough.  Floquet exponents follow from the same linearisation by Hill's method
(`continuation.hill`).

Orbits are followed by `continuation.cycle_branch.CycleTracer`; the result is a `Branch` like that of equilibria.  Its
state holds the coefficients of the series, shape (2 H + 1, n), flattened, and the period; shorter series of other
points are filled with zeros.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from continuation.branch import Branch, CurvePoint, SpecialPoint
from continuation.branches import branch_tracer
from continuation.checks import (
    number_of,
    numbers_of,
    options_of,
    parameters_of,
    require_kinds,
    require_names,
    shown,
    special_of,
    system_of,
)
from continuation.curves import STARTS, curve_tracer
from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import BRANCH_POINT, DOUBLING, TORUS, CyclePoint, SpecialCycle
from continuation.cycles import Cycle, CycleSolver, cycles_beside_onset
from continuation.first_order import DirectLinearisation, FirstOrderSystem
from continuation.harmonics import Harmonics
from continuation.hill import Exponents, floquet_exponents
from continuation.normal_form import hopf_normal_form
from continuation.options import (
    ContinuationError,
    ContinuationOptions,
    DerivativeMissing,
    NotABifurcation,
    NotConverged,
    OrbitOptions,
    Reason,
    Said,
    require,
)
from continuation.periodic import PeriodicMotion, peak
from continuation.tracer import as_observers, notify, run_observed

#: Share of the largest motion, and of its own mean, below which the size of an unknown does not go in its series.
LITTLE_MOVED = 1e-6


class OrbitSolver(CycleSolver):
    """Corrector of periodic orbits of a `System`, whose linear equations are solved directly."""

    def __init__(self, system, options: OrbitOptions):
        every = np.zeros((system.size, 0))
        super().__init__(FirstOrderSystem(system), every, options.tolerance)

    def _for_corrections(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> DirectLinearisation:
        return DirectLinearisation(self.system, motion, mu)

    def linearise(self, motion, mu, perturbed: bool = False) -> DirectLinearisation:
        """Linearisation about a motion."""
        return DirectLinearisation(self.system, motion, mu)

    def sizes(self, motion: PeriodicMotion) -> np.ndarray:
        """(n,) sizes that changes of a motion are measured in."""
        return self.system.sizes(motion)

    def tail(self, motion: PeriodicMotion) -> float:
        """Share of the last two harmonics in a motion, its unknowns by how far each moves."""
        c = motion.coefficients
        moved = np.linalg.norm(c[1:], axis=0)
        least = LITTLE_MOVED * np.maximum(moved.max(), np.abs(c[0]))  # what moves less is near rounding
        size = np.maximum(moved, least)
        return replace(motion, coefficients=c / np.where(size > 0, size, 1.0)).tail

    def learn(self, rows: np.ndarray) -> np.ndarray:
        """Nothing: there is no basis to extend."""
        return np.zeros((self.system.size, 0))


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit.

    Attributes
    ----------
    mu : dict
        Parameters.
    motion : PeriodicMotion
        The Fourier series, with ``harmonics``, ``coefficients`` of shape (2 H + 1, n) and ``omega`` in rad per unit of
        time.
    floquet : Exponents
        Leading Floquet exponents by Hill's method, one of each conjugate pair.
    """

    mu: dict
    motion: PeriodicMotion
    floquet: Exponents

    def __repr__(self) -> str:
        at = ", ".join(f"{name} = {value:.8g}" for name, value in self.mu.items())
        return f"<Orbit: period {self.period:.8g}, {len(self.motion.coefficients) // 2} harmonics, {at}>"

    @property
    def period(self) -> float:
        return self.motion.period

    def __call__(self, time) -> np.ndarray:
        """States at times, shape (times, n)."""
        return self.motion.at(self.motion.omega * np.atleast_1d(time))

    def extrema(self, samples: int = 4000) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest value of each unknown, (n,) each, with parabolic refinement."""
        x = self(np.linspace(0.0, self.period, samples, endpoint=False))
        return -peak(-x), peak(x)

    def amplitude(self) -> np.ndarray:
        """Half of peak to peak of each unknown, (n,)."""
        low, high = self.extrema()
        return 0.5 * (high - low)

    @property
    def exponents(self) -> np.ndarray:
        """Non-trivial Floquet exponents, complex, by growth; imaginary parts within half a turn per period."""
        each = zip(self.floquet.values, self.floquet.dimensions)
        return np.array([v for value, size in each for v in (value, value.conj())[:size]], complex)

    @property
    def nontrivial(self) -> np.ndarray:
        """Multipliers ``exp(sigma T)`` without the trivial one, complex, largest first."""
        return np.exp(self.exponents * self.period)

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers with the trivial one, 1, complex, largest first."""
        values = np.append(self.nontrivial, 1.0)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def stable(self) -> bool | None:
        """True without growing perturbations; None where the exponents are not to be trusted."""
        return None if self.floquet.unstable < 0 else self.floquet.stable


def find_orbit(system, states, period: float, mu, options: OrbitOptions | None = None) -> Orbit:
    """Correct a guess to a periodic orbit.

    Relaxation oscillations with steep flanks need many harmonics: the van der Pol oscillator takes 40 at mu = 1, 90 at
    mu = 2 and 200 at mu = 4; each step towards a stiffer one needs the orbit before as its guess and ``max_harmonics``
    raised.  Much stiffer orbits are out of reach.

    Parameters
    ----------
    system : System
    states : ndarray, shape (samples, n)
        Guess at equally spaced times over one period, the end point not repeated.
    period : float
        Guess.
    mu : mapping of str to float
    options : OrbitOptions, optional

    Raises
    ------
    NotConverged
        No orbit near the guess, only an equilibrium, or more harmonics needed than allowed.

    Examples
    --------
    >>> import jax.numpy as jnp, numpy as np
    >>> from continuation import JaxSystem, find_orbit
    >>> system = JaxSystem(lambda u, mu: jnp.stack([
    ...     u[1], mu["mu"] * (1 - u[0]**2) * u[1] - u[0]]), 2)
    >>> phase = 2 * np.pi * np.arange(40) / 40
    >>> orbit = find_orbit(system, 2 * np.stack([np.cos(phase), -np.sin(phase)], 1), 6.3, {"mu": 1.0})
    >>> round(orbit.period, 6), orbit.stable
    (6.663287, True)
    """
    options, period, mu = options_of(OrbitOptions, options), number_of(period, "period"), parameters_of(mu)
    require(period > 0, f"The period must be positive, not {period}.")
    states = numbers_of(states, "orbit", (None, system_of(system).size))
    require(len(states) >= 3, f"An orbit needs three states at least, not {len(states)}.")
    guess = PeriodicMotion.of_samples(states, options.harmonics, 2 * np.pi / period)
    solver = OrbitSolver(system, options)
    least = 1e-6 * np.linalg.norm(guess.coefficients[1:])
    require(least != 0.0, "The guess of an orbit must vary over its period.")
    return add_exponents(solver, solver.resolve(guess, mu, options, least=least), options)


def add_exponents(solver: CycleSolver, cycle: Cycle, options: OrbitOptions) -> Orbit:
    """Add Floquet exponents to a cycle."""
    count = min(options.exponents, max(solver.system.size - 1, 1))
    if not count:
        return Orbit(cycle.mu, cycle.motion, Exponents.unknown(cycle.motion.omega))
    linear = solver.linearise(cycle.motion, cycle.mu)
    return Orbit(cycle.mu, cycle.motion, floquet_exponents(solver, linear, count))


#: Amplitude of the second orbit of a branch over that of the first.
SECOND = 1.5
#: Second harmonic and shift of the mean over the critical mode in the first orbit, at most.
SMALL = 0.3
#: Halvings of the first orbit until it is where the normal form has it.
HALVINGS = 12


def continue_orbits(
    system,
    orbit: Orbit,
    parameter: str,
    options: ContinuationOptions | None = None,
    discretisation: OrbitOptions | None = None,
    observers=None,
) -> Branch:
    """Follow a periodic orbit in one parameter.

    Folds of cycles, period doublings, torus bifurcations and branch points are located by the Floquet exponents.

    Parameters
    ----------
    system : System
    orbit : Orbit
        The first point.
    parameter : str
    options : ContinuationOptions
        Used are the steps, ``max_points``, ``limits``, ``direction``, the scales, ``location_tolerance`` and
        ``stop_at``.
    discretisation : OrbitOptions
    observers : Observer, callable or sequence of them

    Returns
    -------
    Branch
        Of kind ``"orbits"``; tests hold ``period`` and ``harmonics``, ``eigenvalues`` of a point the multipliers, the
        tangent is the chord from the point before; `orbit_at` turns a point into an `Orbit`.

    Raises
    ------
    NotConverged
        No second orbit was found beside the first.
    ValueError
        The first orbit lies at the limit of the parameter.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem, find_orbit
    >>> system = JaxSystem(lambda u, mu: jnp.stack([  # z' = (1/4 + i) z + z|z|^2 (r - |z|^2)
    ...     u[0] / 4 - u[1] + u[0] * (u @ u) * (mu["r"] - u @ u),
    ...     u[0] + u[1] / 4 + u[1] * (u @ u) * (mu["r"] - u @ u)]), 2)
    >>> phase = 2 * np.pi * np.arange(30) / 30
    >>> orbit = find_orbit(system, np.stack([np.cos(phase), np.sin(phase)], 1), 6.0, {"r": 0.5})
    >>> branch = continue_orbits(system, orbit, "r", ContinuationOptions(limits={"r": (0.0, 1.0)}))
    >>> branch.reason
    'ended on the limit r = 1'
    """
    if not isinstance(orbit, Orbit):
        raise TypeError(f"Branches of orbits start at an Orbit, such as find_orbit gives, not at {shown(orbit)}.")
    follower = _Follower(system, parameter, options, discretisation, orbit.mu)
    first = Cycle(orbit.motion, dict(orbit.mu), 0.0, 0, 0)

    def steps():
        follower.tracer.extend(first)
        follower.tracer.extend(follower.second_orbit(first))
        return follower.tracer.run()

    return follower.run(steps, observers)


def orbits_from_hopf(
    system,
    special: SpecialPoint,
    parameter: str,
    options: ContinuationOptions | None = None,
    discretisation: OrbitOptions | None = None,
    observers=None,
) -> Branch:
    """Follow the periodic orbits born at a located Hopf point.

    The first orbit lies a first step along the branch from the Hopf point by the normal form, or nearer where that does
    not hold so far away.

    Parameters
    ----------
    system : System
    special : SpecialPoint
        A located Hopf point.
    parameter : str
    options, discretisation, observers
        As in `continue_orbits`.

    Raises
    ------
    NotABifurcation
        The point is no located Hopf point.
    NotConverged
        No orbit was found beside it.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem, continue_branch
    >>> system = JaxSystem(lambda u, mu: jnp.stack([  # z' = (r + i) z - z|z|^2
    ...     mu["r"] * u[0] - u[1] - u[0] * (u @ u), u[0] + mu["r"] * u[1] - u[1] * (u @ u)]), 2)
    >>> options = ContinuationOptions(eigenvalues=2, limits={"r": (-1.0, 1.0)})
    >>> hopf, = continue_branch(system, [0.0, 0.0], {"r": -1.0}, "r", options).special
    >>> orbits = orbits_from_hopf(system, hopf, "r", options)
    >>> last = orbit_at(system, orbits, -1)
    >>> last.amplitude().round(6), bool(last.stable)
    (array([1., 1.]), True)
    """
    special_of(special, "Orbits start at")
    if special.kind != "hopf" or not special.located:
        raise NotABifurcation(f"Orbits start at a located Hopf point; this is {special!r}.")
    follower = _Follower(system, parameter, options, discretisation, special.mu)

    def steps():
        rest, first, second = follower.beside_hopf(special)
        follower.tracer.extend(first, rest)
        follower.tracer.extend(second)
        return follower.tracer.run()

    return follower.run(steps, observers)


def resume(
    system,
    branch: Branch,
    options: ContinuationOptions | None = None,
    discretisation: OrbitOptions | None = None,
    observers=None,
    events=(),
    spectrum=None,
    lyapunov: bool = True,
) -> Branch:
    """Go on from the last point of a branch or curve of any kind, e.g. one loaded from a file.

    The branch handed over stays as it is; the one returned holds its points and the new ones.  The other arguments are
    those of the function that started it.

    Examples
    --------
    >>> from continuation import JaxSystem, continue_branch
    >>> system, limits = JaxSystem(lambda u, mu: mu["r"] + u**2, size=1), {"r": (-1.0, 0.5)}
    >>> part = continue_branch(system, [-1.0], {"r": -1.0}, "r", ContinuationOptions(limits=limits, max_points=5))
    >>> resume(system, part, ContinuationOptions(limits=limits)).of_kind("fold")
    [<SpecialPoint: fold at r = 0, located>]
    """
    if not isinstance(branch, Branch):
        raise TypeError(f"A Branch is resumed, not {shown(branch)}.")
    if branch.kind == "equilibria":
        tracer = branch_tracer(system, branch.mu(-1), branch.names[0], options, events, spectrum, observers)
        return tracer.resume(branch)
    if branch.kind in STARTS:
        borders = branch.restart["p"], branch.restart["q"]
        return curve_tracer(
            system, branch.kind, branch.mu(-1), branch.names, borders, options, observers, spectrum, lyapunov
        ).resume(branch)
    require(len(branch) > 1, "A branch of orbits goes on from two points at least.")
    follower = _Follower(system, branch.names[0], options, discretisation, branch.mu(-1))
    follower.restore(branch)
    step = float(np.clip(branch.next_step or follower.options.step, *follower.step_limits))
    # an interruption may have met a special point before the orbit behind it
    met = [special for special in branch.special if special.index >= len(branch) - 2]
    follower.tracer.known = [(special.kind, special.mu[follower.parameter]) for special in met]
    return follower.run(lambda: follower.tracer.run(step), observers)


def orbit_at(system, branch: Branch, index: int, discretisation: OrbitOptions | None = None) -> Orbit:
    """Orbit at a point of a branch of orbits, also one loaded from a file."""
    require(branch.kind == "orbits", f"This needs a branch of orbits, not {branch.kind}.")
    if not -len(branch) <= index < len(branch):
        raise IndexError(f"The branch has {len(branch)} points, so there is no point {index}.")
    return _orbit(system, branch.points[index].z[: branch.size], branch.mu(index), discretisation)


def special_orbit(system, branch: Branch, special: SpecialPoint, discretisation: OrbitOptions | None = None) -> Orbit:
    """Orbit at a special point of a branch of orbits."""
    return _orbit(system, special.u, special.mu, discretisation)


def _orbit(system, u, mu, options):
    options = options_of(OrbitOptions, options)
    cycle = Cycle(_motion(u, system.size), mu, 0.0, 0, 0)
    return add_exponents(OrbitSolver(system, options), cycle, options)


def _motion(u: np.ndarray, size: int) -> PeriodicMotion:
    """Fourier series and frequency of the state of a branch of orbits, without trailing zeros."""
    coefficients = u[:-1].reshape(-1, size)
    kept = np.flatnonzero(np.abs(coefficients).max(axis=1)).max(initial=1)
    h = Harmonics((int(kept) + 1) // 2)
    return PeriodicMotion(h, h.resized(coefficients), 2 * np.pi / float(u[-1]))


class _Follower:
    """Tracer of orbits of a `System` that records what it finds in a `Branch`."""

    def __init__(self, system, parameter, options, discretisation, mu):
        self.options, self.shape = options_of(ContinuationOptions, options), options_of(OrbitOptions, discretisation)
        options, n = self.options, system_of(system).size
        require_names(options, mu, (parameter,))
        require_kinds(options, {"fold of cycles", *[BRANCH_POINT, DOUBLING, TORUS] * bool(self.shape.exponents)})
        self.branch = Branch("orbits", 0, (parameter,), (), {name: float(value) for name, value in mu.items()})
        self.step_limits = options.min_step, options.max_step
        unit = (options.state_scale or 1.0) * np.sqrt(n)
        kept = replace(options, state_scale=unit, max_points=options.max_points + 1)
        shape = replace(self.shape, exponents=min(self.shape.exponents, max(n - 1, 1)))
        self.parameter = parameter
        self.tracer = CycleTracer(OrbitSolver(system, shape), parameter, kept, shape, report=self.take)
        self.observers: list = []

    def second_orbit(self, first: Cycle) -> Cycle:
        """Orbit a first step along the parameter away from the first one."""
        options, value, scale = self.options, first.mu[self.parameter], self.tracer.scale
        limits = options.limits.get(self.parameter, (-np.inf, np.inf))
        step, reason = options.step * scale, ""
        while step >= options.min_step * scale:
            target = float(np.clip(value + options.direction * step, *limits))
            require(target != value, f"The branch starts at its limit, {self.parameter} = {value:g}.")
            try:
                return self.tracer.solver.solve(first.motion, first.mu | {self.parameter: target})
            except NotConverged as error:
                reason, step = str(error), 0.5 * step
        raise NotConverged(f"No second orbit was found beside the first: {reason}", Reason.NO_CYCLE)

    def beside_hopf(self, special: SpecialPoint) -> tuple[Cycle, Cycle, Cycle]:
        """Equilibrium at a Hopf point as a cycle at rest, and two small orbits beside it."""
        kept, scale, system = self.tracer.options, self.tracer.scale, self.tracer.solver.system.system
        omega = float(special.values["omega"])
        q = np.asarray(special.vectors["right"], complex)
        q, rate, most = q / np.linalg.norm(q), 0.0, np.inf
        try:
            form = hopf_normal_form(system, special.u, special.mu, omega, q, self.parameter)
            if not form.crossing.real:
                raise NotABifurcation(f"The growth rate does not change with {self.parameter}: no orbits begin there.")
            rate = -form.c1.real / form.crossing.real
            most = SMALL / max(np.linalg.norm(form.h20), np.linalg.norm(form.h11), 1e-300)
        except DerivativeMissing:
            pass
        # |z|^2 of the orbit a step away: (a |z|)^2 + (b |z|^2)^2 = step^2
        a, b = np.sqrt(2.0) / kept.state_scale, rate / scale
        radius = min(kept.step * np.sqrt(2.0 / (a**2 + np.sqrt(a**4 + (2 * b * kept.step) ** 2))), most)
        (low, high), reason = self.options.limits.get(self.parameter, (-np.inf, np.inf)), ""
        for _ in range(HALVINGS):
            small = PeriodicMotion.of_waves([special.u, radius * q], self.shape.harmonics, omega)
            row = small.coefficients / np.linalg.norm(small.coefficients[1:])
            row[0] = 0.0
            try:
                cycles = cycles_beside_onset(self.tracer.solver, small, dict(special.mu), self.parameter, row, SECOND)
                missed = (cycles[1].mu[self.parameter] - special.mu[self.parameter] - rate * radius**2) / scale
                inside = all(low <= cycle.mu[self.parameter] <= high for cycle in cycles[1:])
                if inside and abs(missed) <= 0.5 * np.hypot(a * radius, b * radius**2):
                    return cycles
                reason = Reason.NOT_NORMAL.value if inside else "its orbits lie beyond the limits"
            except ContinuationError as error:
                reason = str(error)
            radius *= 0.5
        raise NotConverged(f"No orbit was found beside the Hopf point: {reason}", Reason.NO_CYCLE)

    def restore(self, branch: Branch) -> None:
        """Take the points of a branch; the last two with their exponents."""
        self.branch = branch.reopen()
        lengths = np.cumsum([point.step for point in branch.points])
        points = []
        for i, (point, length) in enumerate(zip(branch.points, lengths)):
            motion = _motion(point.z[: branch.size], self.tracer.solver.system.size)
            cycle = Cycle(motion, branch.mu(i), point.residual, point.iterations, 0)
            points.append(CyclePoint(cycle, cycle.mu[self.parameter], float(length), None))
        points[-2:] = [replace(p, exponents=self.tracer.describe(p.cycle, after=p).exponents) for p in points[-2:]]
        self.tracer.restore(points)
        self.tracer.options = replace(self.tracer.options, max_points=len(points) + self.options.max_points)

    def run(self, steps: Callable[[], Said], observers) -> Branch:
        self.observers = as_observers(observers)
        return run_observed(self.branch, self.observers, steps)

    def take(self, item: CyclePoint | SpecialCycle) -> None:
        """Record a point or a special point, and notify the observers."""
        branch = self.branch
        branch.next_step = self.tracer.next_step
        if isinstance(item, CyclePoint):
            self._add(self._point(item))
            notify(self.observers, "accepted", branch)
        else:
            branch.special.append(self._special(item))
            notify(self.observers, "found", branch, branch.special[-1])

    def _z(self, cycle: Cycle) -> np.ndarray:
        return np.concatenate([cycle.motion.coefficients.ravel(), [cycle.motion.period, cycle.mu[self.parameter]]])

    def _orbit(self, point: CyclePoint) -> Orbit:
        return Orbit(point.cycle.mu, point.motion, point.exponents or Exponents.unknown(point.motion.omega))

    def _point(self, item: CyclePoint) -> CurvePoint:
        z, cycle = self._z(item.cycle), item.cycle
        before = self.tracer.points[-2].arclength if len(self.tracer.points) > 1 else item.arclength
        tests = {"period": cycle.motion.period, "harmonics": float(cycle.motion.harmonics.count)}
        return CurvePoint(
            z,
            np.zeros_like(z),
            item.arclength - before,
            cycle.iterations,
            cycle.correction,
            tests,
            self._orbit(item).floquet.unstable,
            self._orbit(item).multipliers,
        )

    def _add(self, point: CurvePoint) -> None:
        """Add a point with its tangent, and give all the length of the longest series, in copies: shorter ones may be
        those of a branch handed over.
        """
        points = [*self.branch.points, point]
        longest = max(len(point.z) for point in points)
        points = [
            p if len(p.z) == longest else replace(p, z=_padded(p.z, longest), tangent=_padded(p.tangent, longest))
            for p in points
        ]
        if len(points) > 1:
            chord = points[-1].z - points[-2].z
            points[-1].tangent = chord / max(np.linalg.norm(chord), 1e-300)
        self.branch.points[:], self.branch.size = points, longest - 1

    def _special(self, item: SpecialCycle) -> SpecialPoint:
        orbit = self._orbit(item.point)
        lengths = [point.arclength for point in self.tracer.points]
        index = int(np.clip(np.searchsorted(lengths, item.point.arclength, "right") - 1, 0, len(lengths) - 2))
        values = {"period": orbit.period}
        if item.kind == TORUS:
            values["angle"] = 2 * np.pi * item.frequency * orbit.period
        z = self._z(item.point.cycle)
        mu = orbit.mu | {self.parameter: item.value}
        z[-1] = item.value
        reason = "" if item.located else "the location did not settle"
        vectors = {"multipliers": orbit.multipliers}
        return SpecialPoint(item.title, index, z[:-1], mu, z, np.zeros_like(z), item.located, reason, values, vectors)


def _padded(z: np.ndarray, size: int) -> np.ndarray:
    return np.concatenate([z[:-2], np.zeros(size - len(z)), z[-2:]])
