"""Opening of the lips at their middle."""

from __future__ import annotations

import numpy as np

from ..geometry import ValveMesh
from ..shell import Shell


class LipCentre:
    """The node in the middle of the lip.

    Parameters
    ----------
    mesh : ValveMesh
    shell : Shell
        On this mesh.
    """

    def __init__(self, mesh: ValveMesh, shell: Shell):
        node = mesh.centre_line[0]
        surface = shell.mesh
        around = np.any(surface.quads == node, axis=1)
        self.half_wall = 0.5 * float(surface.thickness[around].mean())
        self._height = float(surface.nodes[node, 1])
        self._director, self._frame = surface.directors[node], surface.frames[node]
        self._unknowns = shell.dofs.index[node]

    def displacement(self, q: np.ndarray) -> float:
        """Displacement in y, m, of the mid-surface of one lip, from the free unknowns (n,); below zero where the lip
        lies beyond its place at rest.
        """
        return float(self._local(q)[1])

    def opening(self, q: np.ndarray) -> float:
        """Full clear opening, m: the distance between the inner faces of both lips, never below zero.

        The inner face lies half a wall h/2 inside the mid-surface along the director d, so with the height Y of the
        mid-surface at rest and its displacement v the opening is 2 (Y + v - h/2 d_y). At rest it is what the shape
        leaves between the faces, 2 (Y - h/2): 0.38 mm in the 12-inch valve, whose mid-surface is 6.19 mm high and whose
        wall is 12 mm thick; none where the lip radius is half the wall. `valve.initial_gap`, which keeps the flow
        section open at rest, is no part of it.
        """
        local = self._local(q)
        turn = float(np.hypot(*local[3:]))
        across = np.cos(turn) * self._director[1] + np.sinc(turn / np.pi) * float(local[3:] @ self._frame[:, 1])
        return max(0.0, 2.0 * (self._height + float(local[1]) - self.half_wall * float(across)))

    def _local(self, q: np.ndarray) -> np.ndarray:
        """Displacements and rotations (5,) of the node."""
        return np.where(self._unknowns >= 0, np.asarray(q)[np.maximum(self._unknowns, 0)], 0.0)
