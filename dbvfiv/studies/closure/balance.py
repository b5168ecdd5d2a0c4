"""Do the forces of a pressed state balance? A check that knows nothing of how the state was found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model.pressed_shell import PressedShell


@dataclass(frozen=True)
class ForceBalance:
    """Resultants on the shell of the computed part, N, each (3,).

    Attributes
    ----------
    pressure, contact, supports : (3,) arrays
    error : float
        Norm of their sum over the sum of their norms.
    """

    pressure: np.ndarray
    contact: np.ndarray
    supports: np.ndarray

    @property
    def error(self) -> float:
        parts = (self.pressure, self.contact, self.supports)
        total = sum(float(np.linalg.norm(part)) for part in parts)
        return float(np.linalg.norm(sum(parts))) / total if total > 0 else 0.0


def force_balance(pressed: PressedShell, q: np.ndarray, pressure: float) -> ForceBalance:
    """Resultants at a state: the supports give what the internal forces at held displacements ask for."""
    dofs = pressed.shell.dofs
    nodal = pressed.nodal(q)
    loose = pressed.shell.with_free()
    internal = loose.force(nodal.ravel()).reshape(nodal.shape)
    load = pressed.nodal_pressure_force(nodal, pressure)
    contact = np.zeros_like(nodal)
    if pressed.contact is not None:
        contact[pressed.contact.nodes, pressed.contact.axis] = pressed.contact_state(q).force
    held = np.where(dofs.free, 0.0, internal - load - contact)
    return ForceBalance(load[:, :3].sum(axis=0), contact[:, :3].sum(axis=0), held[:, :3].sum(axis=0))
