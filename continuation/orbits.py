"""Periodic orbits: find one, grow one from a Hopf point, follow them, read their stability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from continuation.branch import Branch, SpecialPoint
from continuation.collocation import OrbitSystem
from continuation.errors import NotABifurcation, NotConverged
from continuation.floquet import FloquetMonitor, multipliers_of
from continuation.newton import equilibrium
from continuation.normal_form import hopf_normal_form
from continuation.options import ContinuationOptions, NewtonOptions, require
from continuation.problem import Problem
from continuation.tracer import Tracer


@dataclass(frozen=True)
class OrbitOptions:
    """Discretisation of periodic orbits.

    Attributes
    ----------
    intervals : int
        Mesh intervals.
    degree : int
        Gauss points per interval, 2 to 7.
    adaptations : int
        How often `find_orbit` moves the mesh to where the orbit needs it.
    newton : NewtonOptions
    """

    intervals: int = 40
    degree: int = 4
    adaptations: int = 2
    newton: NewtonOptions = NewtonOptions(tolerance=1e-9, max_iterations=30, line_search=True)

    def __post_init__(self):
        require(self.intervals >= 3, "An orbit needs at least 3 mesh intervals.")
        require(2 <= self.degree <= 7, "The degree of the collocation is 2 to 7.")
        require(self.adaptations >= 0, "The number of mesh adaptations cannot be negative.")


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit.

    Attributes
    ----------
    mu : dict
    period : float
    nodes : ndarray, shape (nodes, n)
    multipliers : ndarray, complex, shape (n,)
        Floquet multipliers, largest first; one of them is 1.
    discretisation : OrbitSystem
    residual : float
    """

    mu: dict
    period: float
    nodes: np.ndarray
    multipliers: np.ndarray
    discretisation: OrbitSystem
    residual: float

    def __call__(self, time) -> np.ndarray:
        """States at times, shape (times, n)."""
        return self.discretisation.evaluate(self.nodes, np.atleast_1d(time) / self.period)

    def extrema(self, samples: int = 4000) -> tuple[np.ndarray, np.ndarray]:
        """Smallest and largest value of each unknown, with parabolic refinement."""
        x = self(np.linspace(0.0, self.period, samples, endpoint=False))
        return -_peak(-x), _peak(x)

    def amplitude(self) -> np.ndarray:
        """Half of peak to peak of each unknown."""
        low, high = self.extrema()
        return 0.5 * (high - low)

    @property
    def nontrivial(self) -> np.ndarray:
        """Multipliers without the trivial one."""
        return np.delete(self.multipliers, np.argmin(np.abs(self.multipliers - 1.0)))

    @property
    def exponents(self) -> np.ndarray:
        """Non-trivial Floquet exponents, imaginary part within half a turn per period."""
        return np.log(self.nontrivial.astype(complex)) / self.period

    @property
    def stable(self) -> bool:
        return bool(np.all(np.abs(self.nontrivial) < 1.0))


def _peak(x):
    top = np.argmax(x, axis=0)
    k = np.arange(x.shape[1])
    size = x.shape[0]
    a, b, c = x[top - 1, k], x[top, k], x[(top + 1) % size, k]
    bend = a - 2 * b + c
    safe = np.where(bend == 0, 1.0, bend)
    return np.where(bend < 0, b - 0.125 * (c - a) ** 2 / safe, b)


def find_orbit(system, states, period: float, mu, options: OrbitOptions | None = None) -> Orbit:
    """Correct a guess to a periodic orbit.

    Parameters
    ----------
    system : System
    states : ndarray, shape (samples, n)
        Guess at equally spaced times over one period, the end point not repeated.
    period : float
        Guess.
    mu : mapping of str to float

    Raises
    ------
    NotConverged
        No orbit near the guess, or only an equilibrium.
    """
    options = options or OrbitOptions()
    require(period > 0, f"The period must be positive, not {period}.")
    states = np.asarray(states, float)
    mesh = np.linspace(0.0, 1.0, options.intervals + 1)
    mu = {name: float(value) for name, value in dict(mu).items()}

    def sample(times):
        closed = np.vstack([states, states[:1]])
        grid = np.linspace(0.0, 1.0, closed.shape[0])
        return np.stack([np.interp(times, grid, column) for column in closed.T], axis=1)

    nodes = None
    for _ in range(options.adaptations + 1):
        blank = np.zeros((options.intervals * options.degree, system.size))
        frame = OrbitSystem(system, mesh, options.degree, blank)
        guess = sample(frame.node_times())
        frame.set_reference(guess)
        result = equilibrium(frame, np.append(guess.ravel(), period), mu, options.newton)
        if not result.converged:
            raise NotConverged(
                f"No periodic orbit was found near the guess: {result.reason} after "
                f"{result.iterations} iterations, residual {result.residual:.3g}.",
                result.reason,
                result,
            )
        nodes, period = frame.split(result.u)
        spread = np.ptp(nodes, axis=0).max()
        if not period > 0 or spread <= 1e-6 * (1e-300 + np.ptp(states, axis=0).max()):
            raise NotConverged("The guess shrank to an equilibrium.", "equilibrium", result)
        mesh = frame.adapted_mesh(nodes)
        sample = _sampler(frame, nodes)
    return _orbit(frame, result.u, mu, result.residual)


def _sampler(frame, nodes):
    return lambda times: frame.evaluate(nodes, times)


def _orbit(frame, u, mu, residual):
    nodes, period = frame.split(u)
    return Orbit(mu, period, nodes, multipliers_of(frame.monodromy(u, mu)), frame, residual)


def continue_orbits(
    system,
    orbit: Orbit,
    parameter: str,
    options: ContinuationOptions | None = None,
    observers=None,
) -> Branch:
    """Follow a periodic orbit in one parameter on its mesh.

    Folds of cycles, period doublings and torus bifurcations are located by the multipliers.

    Returns
    -------
    Branch
        Of kind ``"orbits"``; tests hold ``period``, and per-point ``eigenvalues`` the
        multipliers; `orbit_at` turns a point into an `Orbit`.
    """
    options = options or ContinuationOptions(newton=NewtonOptions(tolerance=1e-9))
    own = orbit.discretisation
    frame = OrbitSystem(system, own.mesh, own.degree, orbit.nodes, orbit.period)
    u = np.append(orbit.nodes.ravel(), orbit.period)
    direction = np.zeros(frame.size + 1)
    direction[-1] = options.direction
    return _follow(frame, u, orbit.mu, parameter, direction, options, observers)


def orbits_from_hopf(
    system,
    special: SpecialPoint,
    parameter: str,
    amplitude: float,
    options: ContinuationOptions | None = None,
    discretisation: OrbitOptions | None = None,
    observers=None,
) -> Branch:
    """Follow the periodic orbits born at a located Hopf point.

    Parameters
    ----------
    amplitude : float
        Of the first orbit: largest norm of its first-harmonic motion.
    """
    if special.kind != "hopf" or not special.located:
        raise NotABifurcation(f"Orbits start at a located Hopf point, not at a {special.kind}.")
    require(amplitude > 0, f"The first amplitude must be positive, not {amplitude}.")
    options = options or ContinuationOptions(newton=NewtonOptions(tolerance=1e-9))
    shape = discretisation or OrbitOptions()
    form = hopf_normal_form(
        system,
        special.u,
        special.mu,
        special.values["omega"],
        special.vectors["right"],
        special.vectors["left"],
        parameter,
    )
    mesh = np.linspace(0.0, 1.0, shape.intervals + 1)
    blank = np.zeros((shape.intervals * shape.degree, system.size))
    period = 2 * np.pi / form.omega
    frame = OrbitSystem(system, mesh, shape.degree, blank, period)
    phases = 2 * np.pi * frame.node_times()
    harmonic = 2 * (np.exp(1j * phases)[:, None] * form.q).real
    radius = amplitude / np.linalg.norm(harmonic, axis=1).max()
    nodes = form.orbit(radius, phases)
    # Amplitude is held, the parameter free: the equilibrium is no solution of that.
    change = -form.c1.real / form.crossing.real * radius**2
    mu = dict(special.mu)
    mu[parameter] += change
    frame.set_reference(special.u + harmonic)
    direction = np.concatenate([harmonic.ravel(), [0.0, 0.0]])
    u = np.append(nodes.ravel(), 2 * np.pi / (form.omega + form.crossing.imag * change + form.c1.imag * radius**2))
    return _follow(frame, u, mu, parameter, direction, options, observers)


def resume_orbits(system, branch: Branch, options: ContinuationOptions | None = None, observers=None) -> Branch:
    """Go on from the last point of a branch of orbits, e.g. one loaded from a file."""
    require(branch.kind == "orbits", f"This needs a branch of orbits, not {branch.kind}.")
    options = options or ContinuationOptions(newton=NewtonOptions(tolerance=1e-9))
    data, last = branch.restart, branch.points[-1]
    frame = OrbitSystem(system, data["mesh"], int(data["degree"]), data["reference"], float(data["period_scale"]))
    tracer = _tracer(frame, branch.fixed, branch.names[0], options, observers)
    here = tracer.start(last.z, last.tangent, data["frame"])
    longer = replace(
        branch, points=list(branch.points), special=list(branch.special), reason="running", restart=dict(branch.restart)
    )
    step = float(np.clip(branch.next_step or options.step, options.min_step, options.max_step))
    return tracer.run(longer, here, step)


def _tracer(frame, mu, parameter, options, observers):
    problem = Problem(frame, mu, (parameter,), None, options.state_scale, options.parameter_scales)
    return Tracer(problem, options, [FloquetMonitor()], observers)


def _follow(frame, u, mu, parameter, direction, options, observers):
    tracer = _tracer(frame, mu, parameter, options, observers)
    here = tracer.start(tracer.problem.pack(u, mu), direction)
    branch = Branch("orbits", frame.size, (parameter,), (), dict(mu), [here.point()])
    return tracer.run(branch, here, options.step)


def orbit_at(system, branch: Branch, index: int) -> Orbit:
    """The orbit at a point of a branch of orbits (also one loaded from a file)."""
    require(branch.kind == "orbits", f"This needs a branch of orbits, not {branch.kind}.")
    data = branch.restart
    frame = OrbitSystem(system, data["mesh"], int(data["degree"]), data["reference"])
    point = branch.points[index]
    return _orbit(frame, point.z[: branch.size], branch.mu(index), point.residual)


def special_orbit(system, branch: Branch, special: SpecialPoint) -> Orbit:
    """The orbit at a special point of a branch of orbits."""
    data = branch.restart
    frame = OrbitSystem(system, data["mesh"], int(data["degree"]), data["reference"])
    return _orbit(frame, special.u, special.mu, float("nan"))
