"""Frictionless one-sided contact of points on a shell's face with a plane.

The point that touches lies at a depth below the mid-surface along the current director, x - depth * d, so a contact
force acts on the displacement across the plane and on both rotations of the node. A depth of zero makes the mid-surface
itself touch.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..shell import Shell
from .law import ContactLaw


@dataclass(frozen=True)
class ContactState:
    """Contact of one state, an entry for each contact node.

    Attributes
    ----------
    gap : (k,) array, m
        Negative where the face penetrates the plane.
    pressure : (k,) array, Pa
        Per area of the mid-surface at rest.
    force : (k,) array, N
    """

    gap: np.ndarray
    pressure: np.ndarray
    force: np.ndarray

    @property
    def touching(self) -> np.ndarray:
        """(k,) true where a pressure acts."""
        return self.pressure > 0

    @property
    def penetration(self) -> float:
        """Deepest penetration, m."""
        return float(max(0.0, -self.gap.min(initial=0.0)))

    @property
    def total(self) -> float:
        """Sum of the contact forces, N."""
        return float(self.force.sum())


class PlaneContact:
    """Contact nodes of a shell before the plane where one coordinate vanishes; the shell stands on its positive side.

    Parameters
    ----------
    shell : Shell
    nodes : (k,) int array
        Nodes without a free displacement across the plane take no part and are dropped.
    depth : (k,) array, m
        Distance of the touching point from the mid-surface, against the director.
    area : (k,) array, m2
        Share of the surface that each node stands for.
    law : ContactLaw
    axis : int
        Normal of the plane: 0, 1 or 2.
    least_gap : float, m
        Points that start closer to the plane than this, or beyond it, are measured from where they start plus this gap,
        so that only further closing meets resistance. See `lifted`.
    """

    def __init__(self, shell: Shell, nodes, depth, area, law: ContactLaw, axis: int = 1, least_gap: float = 0.0):
        nodes = np.asarray(nodes, int)
        index = shell.dofs.index
        keep = index[nodes, axis] >= 0
        self.shell, self.law, self.axis = shell, law, axis
        self.nodes = nodes[keep]
        self.depth = np.broadcast_to(np.asarray(depth, float), nodes.shape)[keep].copy()
        self.area = np.broadcast_to(np.asarray(area, float), nodes.shape)[keep].copy()
        start = shell.mesh.nodes[self.nodes, axis] - self.depth * shell.mesh.directors[self.nodes, axis]
        self.start = start
        self.lift = np.maximum(least_gap - start, 0.0)
        # Numbers and matrix slots of the displacement across the plane and the two rotations.
        self._unknowns = index[self.nodes][:, [axis, 3, 4]]

    @property
    def count(self) -> int:
        """Number of contact nodes k."""
        return len(self.nodes)

    @property
    def lifted(self) -> np.ndarray:
        """(k,) true for nodes whose gap is measured from their start because they begin too close to the plane or
        beyond it.
        """
        return self.lift > 0

    def gap(self, nodal: np.ndarray, directors: np.ndarray) -> np.ndarray:
        """Gaps (k,), m, of nodal unknowns (nn, c) with directors (nn, 3)."""
        n, a = self.nodes, self.axis
        return self.shell.mesh.nodes[n, a] + nodal[n, a] - self.depth * directors[n, a] + self.lift

    def points(self, nodal: np.ndarray, directors: np.ndarray) -> np.ndarray:
        """Touching points (k, 3), m, in the deformed state, without the lift."""
        n = self.nodes
        return self.shell.mesh.nodes[n] + nodal[n, :3] - self.depth[:, None] * directors[n]

    def state(self, nodal: np.ndarray, directors: np.ndarray, multiplier: np.ndarray) -> ContactState:
        """Gaps, pressures and forces with multipliers (k,), Pa."""
        gap = self.gap(nodal, directors)
        _, pressure, _ = self.law.respond(gap, multiplier)
        return ContactState(gap, pressure, self.area * pressure)

    def energy(self, nodal, directors, multiplier) -> float:
        """Potential of the contact, J; with zero multipliers the energy stored by the penalty."""
        return float(self.area @ self.law.respond(self.gap(nodal, directors), multiplier)[0])

    def add_force(self, force, nodal, directors, first, multiplier) -> None:
        """Add the internal force, the derivative of the potential, to force (n,).

        `first` (nn, 2, 3) are the derivatives of the directors.
        """
        _, pressure, _ = self.law.respond(self.gap(nodal, directors), multiplier)
        self.add_pressure_force(force, pressure, first)

    def add_pressure_force(self, force, pressure, first) -> None:
        """Add the internal force of contact pressures (k,), Pa, to force (n,)."""
        _add(force, self._unknowns, -(self.area * pressure)[:, None] * self.slope(first))

    def add_multiplier_derivative(self, force, nodal, directors, first, multiplier, change) -> None:
        """Add the derivative of the internal force along a change (k,) of the multipliers to force (n,)."""
        _, _, stiffness = self.law.respond(self.gap(nodal, directors), multiplier)
        self.add_pressure_force(force, stiffness / self.law.penalty * change, first)

    def add_force_and_tangent(self, force, data, nodal, directors, first, second, multiplier) -> None:
        """Add force and symmetric tangent values on the shell's pattern; `second` (nn, 3, 3) as `Shell.directors`
        returns.
        """
        self.add_force(force, nodal, directors, first, multiplier)
        self.add_blocks(data, self.tangent_blocks(nodal, directors, first, second, multiplier))

    def add_blocks(self, data, block) -> None:
        """Add blocks (k, 3, 3) of each contact node in its displacement across the plane and its rotations to matrix
        values on the shell's pattern.
        """
        slots = self._slots
        keep = slots >= 0
        data[slots[keep]] += block[keep]

    def tangent_blocks(self, nodal, directors, first, second, multiplier) -> np.ndarray:
        """Tangent (k, 3, 3) of each contact node in its displacement across the plane and its rotations."""
        _, pressure, stiffness = self.law.respond(self.gap(nodal, directors), multiplier)
        slope = self.slope(first)
        block = (self.area * stiffness)[:, None, None] * slope[:, :, None] * slope[:, None, :]
        return block + self.bending_blocks(pressure, second)

    def bending_blocks(self, pressure, second) -> np.ndarray:
        """Tangent (k, 3, 3) of pressures (k,) that stay: gaps bend with the rotations."""
        # -pressure * d2 gap, d2 gap = -depth * d2 director
        block = np.zeros((self.count, 3, 3))
        bend = (self.area * pressure * self.depth)[:, None] * second[self.nodes][:, :, self.axis]
        block[:, 1, 1] += bend[:, 0]
        block[:, 2, 2] += bend[:, 1]
        block[:, 1, 2] += bend[:, 2]
        block[:, 2, 1] += bend[:, 2]
        return block

    def slope(self, first: np.ndarray) -> np.ndarray:
        """(k, 3) derivative of the gaps with respect to displacement and rotations."""
        slope = np.empty((self.count, 3))
        slope[:, 0] = 1.0
        slope[:, 1:] = -self.depth[:, None] * first[self.nodes][:, :, self.axis]
        return slope

    @cached_property
    def _slots(self) -> np.ndarray:
        """(k, 3, 3) positions of the nodal blocks among the matrix values, -1 where constrained."""
        dofs = self.shell.dofs
        indptr, indices = dofs.pattern
        number = sp.csr_matrix((np.arange(1, len(indices) + 1), indices, indptr), shape=(dofs.size, dofs.size))
        rows = np.repeat(self._unknowns[:, :, None], 3, axis=2)
        columns = np.repeat(self._unknowns[:, None, :], 3, axis=1)
        keep = (rows >= 0) & (columns >= 0)
        slots = np.full(rows.shape, -1, np.int64)
        if keep.any():
            slots[keep] = np.asarray(number[rows[keep], columns[keep]]).ravel() - 1
        return slots


def _add(force: np.ndarray, unknowns: np.ndarray, values: np.ndarray) -> None:
    keep = unknowns >= 0
    force[unknowns[keep]] += values[keep]  # every unknown belongs to one contact node only
