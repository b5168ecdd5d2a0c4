"""Contact of the inner faces with the closing plane, as a support of the coupled valve.

Each node's touching point lies half a wall inside the mid-surface along the current director, so contact forces act on
rotations as well. The faces of the duckbill are those that the fluid knows: its passage at rest has the half gap
`valve.initial_gap`, whatever wall and lip radius leave, and the faces meet where `fluid.area_floor` of it is left, so
that lips that lie on each other leave the passage that a shut valve has, and none below zero. Elsewhere the gap is that
of the geometry. Points that start closer to the plane than this gap, or beyond it, as where the wall folds at the side
edge, are measured from where they start plus the gap.

The force is no part of the structure's: neither stiffness damping nor loss factors act on it. Equation (T.26) of
docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..case.model import Case
from ..contact import (
    ContactLaw,
    ContactState,
    PlaneContact,
    class_stiffness,
    contact_form,
    nodal_thickness,
    tributary_area,
)
from ..geometry import ValveMesh
from ..shell import Shell

#: Half width of the rounded kink of the contact law over the initial gap.
ROUNDING = 0.01


@dataclass(frozen=True)
class FaceContact:
    """Contact of a shell's inner face with the plane y = 0, by its free unknowns.

    Attributes
    ----------
    shell : Shell
    plane : PlaneContact
    """

    shell: Shell
    plane: PlaneContact

    @cached_property
    def _none(self) -> np.ndarray:
        return np.zeros(self.plane.count)

    def nodal(self, q: np.ndarray) -> np.ndarray:
        """Nodal displacements and rotations (nn, c) of unknowns (n,)."""
        return self.shell.dofs.expand(q)

    def state(self, q: np.ndarray) -> ContactState:
        """Gaps, pressures and forces of a state (n,), of the part."""
        nodal = self.nodal(q)
        return self.plane.state(nodal, self.shell.directors(nodal)[0], self._none)

    def touching(self, q: np.ndarray) -> int:
        """Number of nodes whose face is pressed."""
        return int(np.count_nonzero(self.state(q).touching))

    def energy(self, q: np.ndarray) -> float:
        """Stored in the contact, J of the part."""
        nodal = self.nodal(q)
        return self.plane.energy(nodal, self.shell.directors(nodal)[0], self._none)

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,), the derivative of the energy."""
        force, nodal = np.zeros(self.shell.size), self.nodal(q)
        d, d1, _ = self.shell.directors(nodal)
        self.plane.add_force(force, nodal, d, d1, self._none)
        return force

    def add_tangent(self, q: np.ndarray, data: np.ndarray) -> None:
        """Add the symmetric tangent to values (nnz,) on the shell's pattern."""
        nodal = self.nodal(q)
        self.plane.add_force_and_tangent(
            np.zeros(self.shell.size), data, nodal, *self.shell.directors(nodal), self._none
        )

    def form(self, q: np.ndarray, *directions: np.ndarray) -> np.ndarray:
        """Derivative (n,) of the force along two or three directions (n,); of the law's pieces, not of their joints."""
        fields = [self.nodal(direction) for direction in directions]
        return self.shell.dofs.restrict(contact_form(self.plane, self.nodal(q), self._none, *fields))

    def stiffness_of_class(self, q: np.ndarray, shell: Shell, apart: bool) -> sp.csr_matrix:
        """Tangent (k, k) in a class of motion with its shell: faces that move against each other resist, those that
        move together turn their force (see `dbvfiv.contact.plane`).
        """
        return class_stiffness(self.plane, self.nodal(q), self._none, shell, apart)


def face_contact(case: Case, mesh: ValveMesh, shell: Shell) -> FaceContact | None:
    """Contact of the inner faces of a case; None where it has stops."""
    supports = case.supports
    if supports.contact != "faces":
        return None
    gap = (1.0 - case.fluid.area_floor) * case.valve.initial_gap
    depth = 0.5 * nodal_thickness(shell)
    at_lips = mesh.nodes[:, 2] <= case.valve.duckbill_length * (1 + 1e-9)
    depth = np.where(at_lips, depth + _inside(case, gap), depth)
    law = ContactLaw(supports.contact_stiffness, ROUNDING * case.valve.initial_gap)
    every = np.arange(shell.mesh.node_count)
    return FaceContact(shell, PlaneContact(shell, every, depth, tributary_area(shell), law, axis=1, least_gap=gap))


def _inside(case: Case, gap: float) -> float:
    """Distance, m, of the faces in contact inside those of the duckbill's wall without patches."""
    valve = case.valve
    return valve.duckbill_wall_deduction - gap - 0.5 * valve.thickness_at(0.0)
