"""Branch resultants of viscoelastic layers in a periodic motion: slow resultants through the branches' filters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation.harmonics import Rates

from ..model.relaxing import Branches
from ..shell import Shell, StepWall, WallMemory


@dataclass(frozen=True)
class BranchFilter:
    """phi(s) = sum g s tau / (1 + s tau) of the branches of a group.

    Attributes
    ----------
    strengths, times : tuples of float
        1, s.
    """

    strengths: tuple[float, ...]
    times: tuple[float, ...]

    def __call__(self, s):
        x = np.multiply.outer(np.asarray(s), self.times)
        return (x / (1.0 + x)) @ np.asarray(self.strengths)


class PeriodicMemory:
    """Branches of a shell's layers in periodic motions.

    dh/dt + h / tau = g dS/dt makes h_k = g s tau / (1 + s tau) S_k of each harmonic, s = i k omega: the branches of a
    group together are one filter of its slow resultants.

    Parameters
    ----------
    shell : Shell
    branches : Branches
    """

    def __init__(self, shell: Shell, branches: Branches):
        self.shell, self.branches = shell, branches
        self.wall = WallMemory(shell, branches.strengths, branches.times)
        self._none = shell.wall_of(np.zeros(len(shell.section.layers)))
        #: phi(s) of each group.
        self.filters = [BranchFilter(tuple(row), tuple(branches.times)) for row in branches.strengths]

    def held(self, q: np.ndarray, rates: Rates) -> np.ndarray:
        """Resultants (N, ne, 4, 8) that the branches hold at samples q (N, n)."""
        return self.filtered(np.stack([self.wall.resultants(x)[1] for x in q]), rates)

    def filtered(self, slow: np.ndarray, rates: Rates) -> np.ndarray:
        """Branch resultants (N, ne, 4, 8) from slow resultants (N, ne, 4, g, 8)."""
        return sum(rates.apply(phi, slow[:, :, :, g]) for g, phi in enumerate(self.filters))

    def slopes(self, q: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Derivative (ne, 4, g, 8) of the slow resultants at positions (n,) along a way (n,)."""
        return self.wall._slopes(q, way)[1]

    def force(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Force (n,) of resultants that are held at positions (n,)."""
        return self.shell.force(q, StepWall(self._none, np.ascontiguousarray(held)))

    def geometric(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Values (nnz,) of its derivative by the positions."""
        return self.shell.force_and_tangent(q, step=StepWall(self._none, np.ascontiguousarray(held)))[1]


@dataclass(frozen=True, eq=False)
class MemoryTerm:
    """Change of what branches hold with the motion, a term of `continuation.periodic.PeriodicOperator`.

    Attributes
    ----------
    memory : PeriodicMemory
    q : (N, n) array
        Positions at the samples.
    size : int
        Unknowns, those of the flow behind the wall's.
    """

    memory: PeriodicMemory
    q: np.ndarray
    size: int

    def apply(self, samples: np.ndarray, rates: Rates) -> np.ndarray:
        """Samples (N, size) of forces for those of a change."""
        n = self.q.shape[1]
        held = self.memory.filtered(self._slopes(samples[:, :n]), rates)
        out = np.zeros((len(samples), self.size), held.dtype)
        out[:, :n] = self._forces(held)
        return out

    def _slopes(self, ways: np.ndarray) -> np.ndarray:
        if np.iscomplexobj(ways):
            return self._slopes(ways.real) + 1j * self._slopes(ways.imag)
        return np.stack([self.memory.slopes(q, way) for q, way in zip(self.q, ways)])

    def _forces(self, held: np.ndarray) -> np.ndarray:
        if np.iscomplexobj(held):
            return self._forces(held.real) + 1j * self._forces(held.imag)
        return np.stack([self.memory.force(q, h) for q, h in zip(self.q, held)])
