"""What relaxing layers hold in a periodic motion: their slow resultants through the filters of their branches."""

from __future__ import annotations

import numpy as np

from continuation.harmonics import Rates

from ..model.relaxing import Branches
from ..shell import Shell, StepWall, WallMemory


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
        slow, none = shell.section.wall(), shell.section.wall(np.zeros(len(shell.section.layers)))
        self._slow, self._none = slow, none

    def filter(self, group: int):
        """phi(s) of a group."""
        strengths, times = self.branches.strengths[group], self.branches.times

        def share(s):
            x = np.multiply.outer(s, times)
            return (x / (1.0 + x)) @ strengths

        return share

    def held(self, q: np.ndarray, rates: Rates) -> np.ndarray:
        """Resultants (N, ne, 4, 8) that the branches hold at samples q (N, n)."""
        slow = np.stack([self.wall.resultants(x)[1] for x in q])
        return sum(rates.apply(self.filter(g), slow[:, :, :, g]) for g in range(slow.shape[3]))

    def force(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Force (n,) of resultants that are held at positions (n,)."""
        return self.shell.force(q, StepWall(self._none, np.ascontiguousarray(held)))

    def geometric(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Values (nnz,) of its derivative by the positions."""
        return self.shell.force_and_tangent(q, step=StepWall(self._none, np.ascontiguousarray(held)))[1]
