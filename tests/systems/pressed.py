"""Shells of any shape under a uniform pressure before a plane, for contact and buckling with known answers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from dbvfiv.contact import PlaneContact
from dbvfiv.model.classes import shell_of_class
from dbvfiv.model.preset import PressedShell


class ShellOnPlane(PressedShell):
    """A pressed shell with contact, and what curves of equilibria ask of a model."""

    flow, weight, load_unit = SimpleNamespace(back=0.0), None, 10.0

    def __init__(self, shell, plane: PlaneContact | None = None, sign: float = -1.0):
        super().__init__(shell, sign)
        self.contact = plane
        self.length_unit = float(np.mean(shell.mesh.thickness))

    def internal_force(self, q):
        force = super().internal_force(q)
        return force if self.contact is None else force + self.contact.force(q)

    def structure(self, q):
        force, data = super().structure(q)
        if self.contact is not None:
            force += self.contact.force(q)
            self.contact.add_tangent(q, data)
        return force, data

    def support_energy(self, q):
        return 0.0 if self.contact is None else self.contact.energy(q)

    def apply_transposed(self, tangent, direction):
        return self.shell.dofs.matrix(tangent.stiffness).T @ direction


def class_matrices(model: ShellOnPlane, free, apart: bool, q, pressure: float):
    """Stiffness and mass (k, k) in a class of motion with free unknowns (nn, 5)."""
    nodal = model.nodal(q)
    shell = shell_of_class(model.shell, free, nodal)
    dofs, still = shell.dofs, np.zeros(shell.size)
    structure = shell.force_and_tangent(still)[1]
    stiffness = dofs.matrix(model.follower_stiffness(nodal, pressure, structure, dofs))
    if model.contact is not None:
        stiffness = stiffness + model.contact.stiffness_of_class(q, shell, apart)
    return stiffness.tocsr(), dofs.matrix(shell.mass(still))
