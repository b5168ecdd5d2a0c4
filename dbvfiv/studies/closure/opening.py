"""Open passage between the inner faces, row by row, and the length over which the valve is shut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...contact import PlaneContact, nodal_thickness
from ...geometry import ValveMesh
from ...shell import Shell
from .model import ClosureModel


@dataclass(frozen=True)
class Opening:
    """Passage between the inner faces of one state, of the part that is computed, by mesh row from the lip.

    Attributes
    ----------
    z : (rows,) array, m
    area : (rows,) array, m2
        Between inner face and closing plane; overlapping faces count as shut.
    reference : float, m2
        The same at the lip at rest.
    gap : (rows, columns) array, m
        Height of the inner face above the plane, measured as the contact measures it; zero on the side edge.
    width : (rows,) array, m
        Width of the inner face.
    """

    z: np.ndarray
    area: np.ndarray
    reference: float
    gap: np.ndarray
    width: np.ndarray

    @property
    def narrowest(self) -> int:
        """Row with the least opening."""
        return int(np.argmin(self.area))

    def shut_length(self, fraction: float) -> float:
        """Length along the axis, m, on which the opening is below a fraction of that of the lip at rest."""
        return float(sum(b - a for a, b in self.shut_intervals(fraction)))

    def lip_seal(self, fraction: float) -> float:
        """Length, m, that is shut in that sense from the lip on without a break."""
        intervals = self.shut_intervals(fraction)
        return intervals[0][1] - self.z[0] if intervals and intervals[0][0] <= self.z[0] else 0.0

    def shut_intervals(self, fraction: float) -> list[tuple[float, float]]:
        """Intervals of z, m, on which the valve is shut in that sense.

        Between rows the roots of the areas are taken as linear, because walls that touch part from each other with at
        least the square of the distance.
        """
        excess = np.sqrt(self.area) - np.sqrt(fraction * self.reference)
        cuts: list[tuple[float, float]] = []
        for i in range(len(self.z) - 1):
            a, b, fa, fb = self.z[i], self.z[i + 1], excess[i], excess[i + 1]
            if fa > 0 and fb > 0:
                continue
            start = a if fa <= 0 else a + (b - a) * fa / (fa - fb)
            stop = b if fb <= 0 else a + (b - a) * fa / (fa - fb)
            if cuts and abs(cuts[-1][1] - start) < 1e-12:
                cuts[-1] = (cuts[-1][0], stop)
            elif stop > start:
                cuts.append((start, stop))
        return [(float(a), float(b)) for a, b in cuts]


def opening(model: ClosureModel, q: np.ndarray) -> Opening:
    """Opening of a state (n,)."""
    return measure(model.mesh, model.pressed.shell, model.face, model.pressed.nodal(q), model.held)


def measure(
    mesh: ValveMesh, shell: Shell, face: PlaneContact, nodal: np.ndarray, held: np.ndarray | None = None
) -> Opening:
    """Opening for nodal unknowns (nn, c); `held` (rows,) are rows shut by their supports."""
    rows = mesh.rows
    gap, reach = _gaps(shell, face, nodal, shell.directors(nodal)[0])
    at_rest, rest_reach = _gaps(shell, face, np.zeros_like(nodal), shell.mesh.directors)
    area = _area(gap[rows], reach[rows])
    if held is not None:
        area[held] = 0.0
    return Opening(
        z=mesh.z,
        area=area,
        reference=float(_area(at_rest[rows[:1]], rest_reach[rows[:1]])[0]),
        gap=gap[rows],
        width=np.sum(np.maximum(np.diff(reach[rows], axis=1), 0.0), axis=1),
    )


def _gaps(shell: Shell, face: PlaneContact, nodal, directors) -> tuple[np.ndarray, np.ndarray]:
    """Gap (nn,) and x position (nn,) of the inner face at all nodes; the clamped flange is no contact node but has a
    face all the same.
    """
    depth = 0.5 * nodal_thickness(shell)
    point = shell.mesh.nodes + nodal[:, :3] - depth[:, None] * directors
    lift = np.zeros(len(depth))
    lift[face.nodes] = face.lift
    return point[:, 1] + lift, point[:, 0]


def _area(gap: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Area (rows,) under the gap of rows of points; where the face folds back on itself no width is counted."""
    height = np.maximum(gap, 0.0)
    step = np.maximum(np.diff(x, axis=1), 0.0)
    return np.sum(0.5 * (height[:, 1:] + height[:, :-1]) * step, axis=1)
