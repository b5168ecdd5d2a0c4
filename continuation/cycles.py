"""Periodic motions as Fourier series: Newton's method whose corrections are found by preconditioned Krylov iterations.

The preconditioner has two levels. On a small basis, in which the equations are coupled strongly in time, the
linearisation is projected and solved as a dense matrix, with whatever else is unknown and the conditions that go with
it; in all other directions a smoother solves each harmonic by itself. Directions that corrections need beyond the
basis are added to it, so that neighbours on a branch need ever fewer iterations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from continuation.cycle_linearisation import FREQUENCY, Condition, CycleLinearisation, apply_change, free_values
from continuation.options import NotConverged, OrbitOptions, Reason, require
from continuation.periodic import PeriodicMotion

#: Directions of a motion itself that belong to the basis: those above this share of the largest.
OWN = 1e-4
#: Distance over the size of a motion within which the smoother of another one is used again.
NEAR = 0.1
#: Directions that are learnt at once: at most so many, those above this share of a correction.
MOST_LEARNT, LEARNT = 6, 0.05
#: Contraction that is counted on at most.
LEAST_CONTRACTION = 0.15
#: Corrections; share of its linear equations that one may leave; Krylov iterations for it.
CORRECTIONS, LINEAR, KRYLOV = 25, 3e-2, 40
#: Contraction of two corrections above which the linearisation is renewed.
RENEWED = 0.3
#: Most directions that are learnt of corrections, and of perturbations.
FROM_CORRECTIONS, FROM_PERTURBATIONS = 16, 24


@dataclass(frozen=True, eq=False)
class Cycle:
    """A periodic motion that solves the equations."""

    motion: PeriodicMotion
    mu: dict
    correction: float  #: Size of the last correction over that of the motion about its mean.
    #: iterations and krylov: corrections and Krylov iterations spent on it.
    iterations: int
    krylov: int


class CycleSolver:
    """Corrector of periodic motions of a system, one after another, each from a guess near it.

    Parameters
    ----------
    system : object
        ``size`` n; ``autonomous``, whether a shift in time of a motion is one as well, or the phase is that of a
        forcing; ``scales`` (n,), sizes that changes of the unknowns are measured in; ``residual(motion, mu)``, (N, n)
        at the samples; ``linearise(motion, mu, rough)``, a `continuation.periodic.PeriodicOperator` about a motion that
        need not solve the equations, a rough one with an error of some per cent in how it changes within a period;
        ``smoother(operator, mu)``, approximate solves from coefficients (2 H + 1, n) to coefficients, good in all
        directions but those of the basis, or None.
    basis : (n, r) array
        Directions to start with, see the module.
    tolerance : float
        Error that the last correction leaves, over the size of the motion about its mean: the size of the next one, by
        the contraction seen.
    """

    def __init__(self, system, basis: np.ndarray, tolerance: float = 1e-5):
        require(0 < tolerance < 0.1, "The tolerance of cycles lies between 0 and 0.1.")
        self.system, self.tolerance = system, tolerance
        self._given = la.orth(np.asarray(basis, float) / np.asarray(system.scales)[:, None])
        self._learnt = np.zeros((len(self._given), 0))
        self._of_perturbations = np.zeros((len(self._given), 0))
        self._smoothed: tuple | None = None

    def solve(
        self,
        guess: PeriodicMotion,
        mu: Mapping[str, float],
        free: Sequence[str] = (),
        conditions: Sequence[Condition] = (),
    ) -> Cycle:
        """Correct a guess. Raises NotConverged.

        Parameters
        ----------
        free : sequence of str
            Parameters that are unknown beside the motion, or `FREQUENCY` of a forced one; that of an autonomous one
            always is.
        conditions : sequence of Condition
            One for each of them, their `extra` in the order of `unknowns`.
        """
        free = self.unknowns(free)
        if self.system.autonomous:
            conditions = (self._phase(guess, len(free)), *conditions)
        require(len(free) == len(conditions), "Each free unknown needs a condition.")
        sizes, spent = [], 0
        motion, mu, linear = guess, dict(mu), None
        while len(sizes) < CORRECTIONS:
            unbalance = self._unbalance(motion, mu, free, conditions)
            shape = motion.coefficients.shape
            if not np.isfinite(unbalance).all():
                break
            if linear is None:
                linear, steps = self._for_corrections(motion, mu), []
                linear.prepare(free, conditions, unbalance[: motion.coefficients.size].reshape(shape))
            change, used, missed = linear.solve(-unbalance, LINEAR, KRYLOV)
            change = _update_correction(change, steps, linear.units)
            spent += used
            sizes.append(self._size(change, motion))
            if len(steps) > 1 and sizes[-1] > 2.0 * sizes[-2]:  # a linearisation that does not serve
                linear = None
                continue
            if not sizes[-1] < 10.0 or (len(sizes) > 8 and sizes[-1] > max(0.5 * sizes[-4], 1e-3)):
                break
            motion, mu = apply_change(motion, mu, free, change)
            if motion.omega <= 0:
                break
            learnt = self.learn(change[: motion.coefficients.size].reshape(shape))
            if _remaining_error(sizes[-len(steps) :]) <= self.tolerance:
                return Cycle(motion, mu, sizes[-1], len(sizes), spent)
            if _is_slow(sizes[-len(steps) :], RENEWED) or sizes[-1] > 0.5 or missed > 0.5:
                linear = None
            elif sizes[-1] > 100 * self.tolerance and learnt.shape[1] and linear.extend(learnt):
                linear.factor()
        last = sizes[-1] if sizes else np.nan
        sentence = f"{len(sizes)} corrections, the last of {last:.2g} of its size."
        raise NotConverged(f"No periodic motion was found near the guess: {sentence}", Reason.ITERATIONS)

    def resolve(self, guess, mu, shape: OrbitOptions, free=(), conditions=(), least: float = -1.0) -> Cycle:
        """Correct a guess as `solve` does, with a series that is made longer until its last harmonics hold no more than
        the share allowed. A motion about its mean of a norm up to `least` is none.
        """
        while True:
            cycle = self.solve(guess, mu, free, conditions)
            if np.linalg.norm(cycle.motion.coefficients[1:]) <= least:
                raise NotConverged("The guess shrank to an equilibrium.", Reason.REST, cycle)
            share = self.tail(cycle.motion)
            if share <= shape.tail:
                return cycle
            count = min(cycle.motion.harmonics_for(shape.tail, share), shape.max_harmonics)
            if count <= cycle.motion.harmonics.count:
                said = Reason.HARMONICS(count=shape.max_harmonics, share=share)
                raise NotConverged(said, said.kind)
            guess, mu = cycle.motion.resized(count), cycle.mu
            conditions = tuple(Condition(guess.harmonics.resized(c.row), c.extra, c.value) for c in conditions)

    def unknowns(self, free: Sequence[str]) -> tuple[str, ...]:
        """Free unknowns beside the motion: the frequency first for an autonomous system."""
        free = tuple(free)
        return (FREQUENCY, *free) if self.system.autonomous and FREQUENCY not in free else free

    def _phase(self, guess: PeriodicMotion, count: int) -> Condition:
        """No part of a change goes along the guess."""
        weight = 1.0 / np.asarray(self.system.scales) ** 2
        row = guess.harmonics.rate(guess.coefficients) * weight
        row = row / max(np.sqrt(np.sum(row**2 / weight)), 1e-300)
        return Condition(row, np.zeros(count), float(np.vdot(row, guess.coefficients)))

    def _unbalance(self, motion, mu, free, conditions) -> np.ndarray:
        force = motion.harmonics.project(self.system.residual(motion, mu))
        extra = free_values(motion, mu, free)
        return np.append(force.ravel(), [c.miss(motion.coefficients, extra) for c in conditions])

    def sizes(self, motion: PeriodicMotion) -> np.ndarray:
        """(n,) sizes that changes of a motion are measured in."""
        return self.system.scales

    def tail(self, motion: PeriodicMotion) -> float:
        """Share of the last two harmonics in a motion."""
        return motion.tail

    def _size(self, change: np.ndarray, motion: PeriodicMotion) -> float:
        c, scale = motion.coefficients, self.sizes(motion)
        step = np.abs(change[: c.size].reshape(c.shape) / scale).max()
        return float(step / max(np.abs(c[1:] / scale).max(), 1e-300))

    def _for_corrections(self, motion: PeriodicMotion, mu: Mapping[str, float]):
        """Linearisation that need not be exact; its smoother serves motions nearby too."""
        linear = CycleLinearisation(self.system, motion, mu, self.basis_for(motion), rough=True)
        self._smoothed = motion, linear.smoother
        return linear

    def linearise(self, motion: PeriodicMotion, mu: Mapping[str, float], perturbed: bool = False) -> CycleLinearisation:
        """Linearisation about a motion, with the basis as it is now; with that of perturbations too where these are
        asked for.
        """
        basis, near = self.basis_for(motion, perturbed), None
        if self._smoothed is not None and self._smoothed[0].harmonics.count == motion.harmonics.count:
            known, smoother = self._smoothed
            change = np.append((motion.coefficients - known.coefficients).ravel(), 0.0)
            near = smoother if self._size(change, motion) < NEAR else None
        return CycleLinearisation(self.system, motion, mu, basis, smoother=near)

    def basis_for(self, motion: PeriodicMotion, perturbed: bool = False) -> np.ndarray:
        """Orthonormal directions (n, r) of unknowns over their scales: those of the motion itself, given, learnt; and
        of perturbations.
        """
        scaled = motion.coefficients[1:] / self.system.scales
        _, sizes, found = la.svd(scaled, full_matrices=False)
        own = found[: len(sizes)][sizes > OWN * sizes[0]].T if sizes[0] > 0 else found[:0].T
        others = (self._of_perturbations,) if perturbed else ()
        columns = np.hstack([own, self._given, self._learnt, *others])
        q, r, _ = la.qr(columns, mode="economic", pivoting=True)
        size = np.abs(np.diag(r))
        return np.ascontiguousarray(q[:, : len(size)][:, size > 1e-8 * size[0]])

    def learn(self, rows: np.ndarray) -> np.ndarray:
        """Add the leading directions (n, k) of corrections (k, n) beyond the basis to it, and return these; the oldest
        of those added before give way. They take effect with the next linearisation.
        """
        added = self._beyond(rows, (self._given, self._learnt))
        self._learnt = _append_directions(self._learnt, added, FROM_CORRECTIONS)
        return added

    def learn_perturbations(self, rows: np.ndarray) -> np.ndarray:
        """Add leading directions (n, k) of what perturbations (k, n) lack to the basis for them, and return these."""
        added = self._beyond(rows, (self._given, self._learnt, self._of_perturbations))
        self._of_perturbations = _append_directions(self._of_perturbations, added, FROM_PERTURBATIONS)
        return added

    def _beyond(self, rows: np.ndarray, knowns: Sequence[np.ndarray]) -> np.ndarray:
        scaled = rows / self.system.scales
        whole = np.linalg.norm(scaled)
        if not whole > 0 or self._given.shape[1] == len(self._given):
            return np.zeros((len(self._given), 0))
        for known in knowns:
            scaled = scaled - (scaled @ known) @ known.T
        _, sizes, found = la.svd(scaled, full_matrices=False)
        return found[:MOST_LEARNT][sizes[:MOST_LEARNT] > LEARNT * whole].T


def cycles_beside_onset(
    solver: CycleSolver, small: PeriodicMotion, mu: Mapping[str, float], parameter: str, row: np.ndarray, ratio: float
) -> tuple[Cycle, Cycle, Cycle]:
    """Equilibrium at a Hopf point as a cycle at rest, and two small cycles beside it. Raises NotConverged.

    To leading order parameter, frequency and mean change with the square of the amplitude, as the normal form has it,
    and harmonic k with its power k: the guess of the second cycle follows from the first.

    Parameters
    ----------
    small : PeriodicMotion
        The equilibrium and the critical mode with the amplitude of the first cycle.
    mu : mapping
        Parameters at the Hopf point.
    parameter : str
        The one that is free while the amplitude is held.
    row : (2 H + 1, n) array
        Functional of coefficients that measures the amplitude; zero for the mean.
    ratio : float
        Amplitude of the second cycle over that of the first.
    """
    h, amplitude = small.harmonics, float(np.vdot(row, small.coefficients))
    free = np.zeros(len(solver.unknowns((parameter,))))

    def of_amplitude(guess, mu, value):
        return solver.solve(guess, mu, (parameter,), (Condition(row, free, value),))

    first = of_amplitude(small, mu, amplitude)
    change = first.motion.coefficients - small.coefficients
    powers = np.append(2.0, np.repeat(np.arange(1.0, h.count + 1), 2))[:, None]
    guess = PeriodicMotion(
        h,
        small.coefficients * np.append(1.0, np.full(h.size - 1, ratio))[:, None] + change * ratio**powers,
        small.omega + (first.motion.omega - small.omega) * ratio**2,
    )
    value = mu[parameter] + (first.mu[parameter] - mu[parameter]) * ratio**2
    still = small.coefficients * (np.arange(h.size) == 0)[:, None]
    rest = Cycle(PeriodicMotion(h, still, small.omega), dict(mu), 0.0, 0, 0)
    return rest, first, of_amplitude(guess, dict(mu) | {parameter: value}, ratio * amplitude)


def _update_correction(change: np.ndarray, steps: list[np.ndarray], units: np.ndarray) -> np.ndarray:
    """A correction by a linearisation elsewhere, with what the corrections before it say of the difference: Broyden's
    method, by the steps alone (Kelley 1995, ch. 7). It matters where a perturbation is nearly neutral. Added to the
    steps.
    """
    z = change / units
    for one, other in zip(steps[:-1], steps[1:]):
        z = z + other * (one @ z) / (one @ one)
    if steps:
        share = (steps[-1] @ z) / (steps[-1] @ steps[-1])
        z = z / (1.0 - np.clip(share, -1.0, 0.6))
    steps.append(z)
    return z * units


def _remaining_error(sizes: Sequence[float]) -> float:
    """Error left by corrections of these sizes by one linearisation: the next one, by the contraction they show."""
    if len(sizes) < 2:
        return sizes[-1]
    return max(LEAST_CONTRACTION, *(b / a for a, b in zip(sizes[-3:], sizes[-2:]))) * sizes[-1]


def _is_slow(sizes: Sequence[float], contraction: float) -> bool:
    """True when the last two corrections by one linearisation shrank by less than a contraction."""
    return len(sizes) > 2 and sizes[-1] > contraction * sizes[-2] and sizes[-2] > contraction * sizes[-3]


def _append_directions(known: np.ndarray, added: np.ndarray, most: int) -> np.ndarray:
    """Columns with more behind them, the first of which give way."""
    room = max(most - added.shape[1], 0)
    return np.hstack([known[:, max(known.shape[1] - room, 0) :], added])
