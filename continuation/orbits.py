"""Periodic orbits of ``B(u, mu) u' = F(u, mu)`` as Fourier series (harmonic balance), and branches of them.

With ``u = c_0 + sum c_k exp(i k omega t)`` the equations are projected on the harmonics kept, ``|k| <= H``; the
unknowns are the coefficients and the frequency.  The error falls geometrically with ``H`` for a smooth orbit, and the
share of the last two harmonics measures it; the series is made longer until that share is small enough.  Floquet
exponents follow from the same linearisation by Hill's method (`continuation.hill`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from continuation.checks import number_of, numbers_of, options_of, parameters_of, system_of
from continuation.cycles import Cycle, CycleSolver
from continuation.first_order import DirectLinearisation, FirstOrderSystem
from continuation.harmonics import Harmonics
from continuation.hill import Exponents, floquet_exponents
from continuation.options import NotConverged, OrbitOptions, Reason, require
from continuation.periodic import PeriodicMotion


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
        return -_peak(-x), _peak(x)

    def amplitude(self) -> np.ndarray:
        """Half of peak to peak of each unknown, (n,)."""
        low, high = self.extrema()
        return 0.5 * (high - low)

    @property
    def exponents(self) -> np.ndarray:
        """Non-trivial Floquet exponents, complex, by growth; imaginary parts within half a turn per period."""
        return np.array(
            [v for value in self.floquet.values for v in ([value] if self._is_real(value) else [value, value.conj()])],
            complex,
        )

    def _is_real(self, value: complex) -> bool:
        return self.floquet.is_real(value)

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
    series = np.fft.rfft(states, axis=0)[: min(options.harmonics, (len(states) - 1) // 2) + 1] / len(states)
    h = Harmonics(len(series) - 1)
    guess = PeriodicMotion(h, h.real(series), 2 * np.pi / period).resized(options.harmonics)
    solver = OrbitSolver(system, options)
    least = 1e-6 * np.linalg.norm(guess.coefficients[1:])
    require(least != 0.0, "The guess of an orbit must vary over its period.")
    while True:
        cycle = solver.solve(guess, mu)
        if np.linalg.norm(cycle.motion.coefficients[1:]) <= least:
            raise NotConverged("The guess shrank to an equilibrium.", Reason.REST, cycle)
        count = cycle.motion.harmonics.count
        if cycle.motion.tail <= options.tail:
            return add_exponents(solver, cycle, options)
        if count >= options.max_harmonics:
            raise NotConverged(Reason.HARMONICS(count=count, share=cycle.motion.tail), Reason.HARMONICS)
        guess = cycle.motion.resized(min(cycle.motion.harmonics_for(options.tail), options.max_harmonics))


def add_exponents(solver: CycleSolver, cycle: Cycle, options: OrbitOptions) -> Orbit:
    """Add Floquet exponents to a cycle."""
    count = min(options.exponents, max(solver.system.size - 1, 1))
    if not count:
        return Orbit(cycle.mu, cycle.motion, Exponents.unknown(cycle.motion.omega))
    linear = solver.linearise(cycle.motion, cycle.mu)
    return Orbit(cycle.mu, cycle.motion, floquet_exponents(solver, linear, count))
