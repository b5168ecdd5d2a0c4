"""Supports of the valve: clamped flange, symmetry planes and one-sided lip stops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.physics import Supports
from ..geometry import ValveMesh


def free_unknowns(mesh: ValveMesh) -> np.ndarray:
    """(nn, 5) free displacements and rotations of the part of the valve that is computed (App. A).

    The frames' first vector lies in each symmetry plane, so a plane of symmetry fixes the second rotation.
    """
    free = np.ones((len(mesh.nodes), 5), bool)
    for column, across in mesh.part.edges:
        free[np.ix_(mesh.rows[:, column], [across, 4])] = False
    free[mesh.rows[-1]] = False
    return free


@dataclass(frozen=True)
class LipStops:
    """One-sided springs against y displacements below zero, as the links of App. A act: on displacement and not on y,
    for each joins a node to a fixed copy of it 10 mm below (Th. 3.5.5 has them reach the plane y = 0).

    Attributes
    ----------
    unknowns : (k,) int array
        Numbers of the free unknowns that the stops act on.
    stiffness : float or (k,) array, N/m
    """

    unknowns: np.ndarray
    stiffness: float | np.ndarray

    def energy(self, q: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.stiffness * np.minimum(q[self.unknowns], 0.0) ** 2))

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (k,) on the unknowns with a stop."""
        return self.stiffness * np.minimum(q[self.unknowns], 0.0)

    def tangent(self, q: np.ndarray) -> np.ndarray:
        """Diagonal stiffness (k,)."""
        return np.where(q[self.unknowns] < 0.0, self.stiffness, 0.0)

    def touching(self, q: np.ndarray) -> int:
        """Number of stops in contact."""
        return int(np.count_nonzero(q[self.unknowns] < 0.0))


def lip_stops(mesh: ValveMesh, index: np.ndarray, supports: Supports, joint: float) -> LipStops:
    """Stops on the duckbill nodes of the inner half of the columns, or of all; none where faces touch instead."""
    if not supports.lip_stop or supports.contact != "stops":
        return LipStops(np.zeros(0, int), supports.lip_stop_stiffness)
    limit = 0.5 if supports.lip_stop_columns == "inner-half" else 1.0 + 1e-9
    rows = mesh.z <= joint * (1 + 1e-9)
    nodes = mesh.rows[np.ix_(rows, np.abs(mesh.columns) < limit - 1e-9)].ravel()
    unknowns = index[nodes, 1]
    moving = unknowns >= 0
    stiffness = supports.lip_stop_stiffness
    if not mesh.part.is_quarter:  # two quarters meet in the middle of the lips, each with its stop
        stiffness = np.where(np.isin(nodes, mesh.centre_line), 2.0 * stiffness, stiffness)[moving]
    return LipStops(unknowns[moving].astype(int), stiffness)
