"""Harmonic balance of ``B(u, mu) u' = F(u, mu)``: residual, and its linearisation factorised whole, dense or sparse.

The coefficients of one unknown lie side by side, so that an entry of the Jacobian becomes a block of ``2 H + 1`` rows
and columns, and the factors of a discretised differential equation stay as sparse as its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from continuation.cycle_linearisation import FREQUENCY, Condition, units_of
from continuation.harmonics import Rates
from continuation.linear import SYMMETRIC, bordered, factorise
from continuation.periodic import PeriodicMotion

#: Entries of the Jacobian whose blocks are made at once.
TOGETHER = 256
#: Share of the mean in the size of an unknown that hardly moves.
LITTLE = 1e-2


class FirstOrderSystem:
    """``B(u, mu) u' - F(u, mu)`` of a `System` as an autonomous system whose periodic motions are sought.

    Parameters
    ----------
    system : System
        Its linearisation must hold matrices ``jacobian`` and ``mass``, dense or sparse.
    """

    autonomous = True

    def __init__(self, system):
        self.system, self.size, self.scales = system, system.size, np.ones(system.size)

    def sizes(self, motion: PeriodicMotion) -> np.ndarray:
        """(n,) sizes of the unknowns in a motion: how far they move, and a little of where they are."""
        c = motion.coefficients
        moved = np.linalg.norm(c[1:], axis=0) + LITTLE * np.abs(c[0])
        return np.where(moved > 0, moved, moved.max(initial=0.0) or 1.0)

    def residual(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> np.ndarray:
        """Residual (N, n) at the samples."""
        rates = self.momentum_rates(motion, mu)
        return rates - np.array([self.system.residual(u, mu) for u in motion.samples])

    def momentum_rates(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> np.ndarray:
        """``B u'`` (N, n) at the samples."""
        rates = motion.rates.apply(1, motion.samples)
        if getattr(self.system, "identity_mass", False):
            return rates
        return np.array([self.system.linear(u, mu).mass_matvec(v) for u, v in zip(motion.samples, rates)])

    def slope(self, motion: PeriodicMotion, mu: Mapping[str, float], name: str) -> np.ndarray:
        """Derivative (N, n) of the residual by the frequency or a parameter."""
        if name == FREQUENCY:
            return self.momentum_rates(motion, mu) / motion.omega
        rates, system = motion.rates.apply(1, motion.samples), self.system
        return np.array(
            [
                system.mass_parameter(u, mu, name, v) - system.d_parameter(u, mu, name)
                for u, v in zip(motion.samples, rates)
            ]
        )

    def matrices(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> list[tuple]:
        """``d(B u' - F)/du`` and ``B`` at each sample."""
        pairs = []
        for u, v in zip(motion.samples, motion.rates.apply(1, motion.samples)):
            linear = self.system.linear(u, mu)
            slope = -linear.jacobian
            if not getattr(self.system, "constant_mass", True):
                moved = np.stack([self.system.mass_d(u, mu, v, e) for e in np.eye(self.size)], axis=1)
                slope = slope + (sp.csc_matrix(moved) if sp.issparse(slope) else moved)
            pairs.append((slope, linear.mass))
        return pairs


class DirectLinearisation:
    """Linear equations about one motion of a first-order system, bordered by free unknowns and conditions.

    It serves corrections as `continuation.cycle_linearisation.CycleLinearisation` does, and Hill's method as its own
    projection: perturbations ``exp(sigma t)`` fulfil ``(L0 + sigma L1) x = 0``.

    Parameters
    ----------
    mu : mapping of str to float
    """

    exact, polynomial, smoother = True, True, None

    def __init__(self, system: FirstOrderSystem, motion: PeriodicMotion, mu: Mapping[str, float]):
        self.system, self.motion, self.mu = system, motion, dict(mu)
        pairs = system.matrices(motion, mu)
        self._is_sparse = sp.issparse(pairs[0][0])
        #: Numbers of the entries by columns, and their values (entries, N) in both matrices.
        if self._is_sparse:
            known = [[_entries_of(matrix) for matrix in pair] for pair in pairs]
            self._entries = np.unique(np.concatenate([keys for pair in known for keys, _ in pair]))
            self._values = np.zeros((2, len(self._entries), len(pairs)))
            for i, pair in enumerate(known):
                for values, (keys, data) in zip(self._values, pair):
                    values[np.searchsorted(self._entries, keys), i] = data
        else:
            self._entries = np.arange(system.size**2)
            self._values = np.stack([[matrix.T.ravel() for matrix in pair] for pair in pairs]).transpose(1, 2, 0)
        # All unknowns are measured by their sizes, and the equations with them.
        self.scale = system.sizes(motion)
        columns, rows = np.divmod(self._entries, system.size)
        self._values = self._values * (self.scale[columns] / self.scale[rows])[:, None]

    def _matrix_of(self, blocks: np.ndarray):
        """Whole matrix of blocks (entries, S, S), dense or sparse."""
        n, s = self.system.size, self.motion.harmonics.size
        if not self._is_sparse:
            return blocks.reshape(n, n, s, s).transpose(1, 2, 0, 3).reshape(n * s, n * s)
        columns, rows = np.divmod(self._entries, n)
        ends = np.searchsorted(columns, np.arange(n + 1))
        indptr = np.concatenate([[0], np.cumsum(np.repeat(s * np.diff(ends), s))])
        at = (rows[:, None] * s + np.arange(s)).astype(np.int32)
        parts = [slice(a, b) for a, b in zip(ends[:-1], ends[1:])]
        data = np.concatenate([blocks[part].transpose(2, 0, 1).ravel() for part in parts])
        indices = np.concatenate([np.tile(at[part].ravel(), s) for part in parts])
        return sp.csc_matrix((data, indices, indptr), shape=(n * s, n * s))

    def _blocks(self, samples: np.ndarray) -> np.ndarray:
        """(entries, S, S): what multiplication by samples (entries, N) makes of coefficients."""
        h = self.motion.harmonics
        groups = (samples[i : i + TOGETHER, :, None] * h.basis for i in range(0, len(samples), TOGETHER))
        return np.concatenate([np.matmul(h.basis.T, group) for group in groups]) / h.samples

    @cached_property
    def _parts(self) -> tuple:
        """L0 and L1."""
        mass = self._blocks(self._values[1])
        turn = self.motion.omega * self.motion.harmonics.rate(np.eye(self.motion.harmonics.size))
        return self._matrix_of(self._blocks(self._values[0]) + mass @ turn), self._matrix_of(mass)

    def quadratic(self, middle: complex) -> tuple:
        """L0, L1 and nothing of second order, exact for all exponents."""
        return (*self._parts, None)

    def shaped(self, vector: np.ndarray) -> np.ndarray:
        """Coefficients (S, n) in a vector of the matrices."""
        return vector.reshape(self.system.size, -1).T

    def lift(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (S, n) of unknowns from those measured by their sizes."""
        return coefficients * self.scale

    @property
    def reduced(self) -> DirectLinearisation:
        return self

    def on_samples(self, samples: np.ndarray, shift: complex) -> np.ndarray:
        """Change (N, n) of the residual for samples (N, n) of a change ``exp(shift t)`` of the motion, by sizes."""
        rates = Rates(self.motion.harmonics, self.motion.omega, shift).apply(1, samples)
        columns, rows = np.divmod(self._entries, self.system.size)
        slopes, masses = self._values
        out = np.zeros((self.system.size, len(samples)), rates.dtype)
        np.add.at(out, rows, slopes * samples.T[columns] + masses * rates.T[columns])
        return out.T

    def extend(self, directions: np.ndarray) -> bool:
        """Nothing is new to the whole space."""
        return False

    def prepare(self, free: Sequence[str], conditions: Sequence[Condition], force: np.ndarray) -> None:
        """Factor the equations with free unknowns and as many conditions. Raises SingularSystem."""
        self.free = tuple(free)
        h, motion = self.motion.harmonics, self.motion
        slopes = (self.system.slope(motion, self.mu, name) for name in free)
        columns = [h.project(slope / self.scale).T.ravel() for slope in slopes]
        rows = [np.concatenate([(c.row * self.scale).T.ravel(), c.extra]) for c in conditions]
        solver = factorise(self._parts[0], SYMMETRIC)
        self._solver = bordered(solver, columns, rows)

    def solve(self, rhs: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, float]:
        """Change of coefficients and free unknowns for a change of the unbalance; no iterations, nothing left."""
        shape = self.motion.coefficients.shape
        size = self.motion.coefficients.size
        force = (rhs[:size].reshape(shape) / self.scale).T.ravel()
        found = self._solver.solve(np.concatenate([force, rhs[size:]]))
        return np.concatenate([self.lift(self.shaped(found[:size])).ravel(), found[size:]]), 0, 0.0

    @property
    def units(self) -> np.ndarray:
        """Sizes that changes of coefficients and free unknowns are measured in."""
        return units_of(self.motion, self.mu, self.free, self.scale)


def _entries_of(matrix) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the entries of a sparse matrix, by columns, and their values."""
    matrix = sp.csc_matrix(matrix)
    matrix.sum_duplicates()
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    return columns * matrix.shape[0] + matrix.indices, matrix.data
