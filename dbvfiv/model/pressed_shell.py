"""Any shell under a uniform follower pressure, before a plane: the contract of equilibria without a flow.

    r(q; P) = f_shell(q) + f_contact(q; multipliers) - sign * P * f(q) = 0

with f the force of unit pressure along the outward normal. It answers what `dbvfiv.model.newton.EquilibriumSolver` and
load steps ask of a model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..contact import ContactState, PlaneContact
from ..shell import Shell
from ..shell.pressure import pressure_force, pressure_stiffness
from .linear import DirectFactor


@dataclass(frozen=True)
class PressedTangent:
    """Residual and exact linearisation at one state.

    Attributes
    ----------
    residual : (n,) array, N and N m
    structure : (nnz,) array
        Values of the symmetric tangent of shell and contact.
    stiffness : (nnz,) array
        Values of the whole tangent: structure less the follower stiffness, not symmetric where the loaded surface has a
        free edge.
    """

    residual: np.ndarray
    structure: np.ndarray
    stiffness: np.ndarray


class PressedShell:
    """A shell, its contact and a uniform pressure.

    Parameters
    ----------
    shell : Shell
    contact : PlaneContact or None
    sign : float
        +1 for a pressure on the side of the first layer (inside), -1 for one from outside.
    loaded : (ne,) array, optional
        Share of each element that carries pressure; all by default.

    Attributes
    ----------
    multiplier : (k,) array, Pa
        Contact multipliers; held during an equilibrium iteration and renewed between them, see `renew_multipliers`.
    """

    def __init__(self, shell: Shell, contact: PlaneContact | None = None, sign: float = -1.0, loaded=None):
        self.shell = shell
        self.mesh = shell.mesh
        self.contact = contact
        self.sign = float(sign)
        self.loaded = np.ones(shell.mesh.element_count) if loaded is None else np.asarray(loaded, float)
        self.multiplier = np.zeros(0 if contact is None else contact.count)

    @property
    def size(self) -> int:
        return self.shell.size

    def rest(self) -> np.ndarray:
        return np.zeros(self.size)

    def nodal(self, q: np.ndarray) -> np.ndarray:
        """Nodal displacements and rotations (nn, c)."""
        return self.shell.dofs.expand(q)

    # -- statics
    # ----

    def residual(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Unbalanced force (n,) at a pressure, Pa."""
        nodal = self.nodal(q)
        force = self.shell.force(q)
        if self.contact is not None:
            d, d1, _ = self.shell.directors(nodal)
            self.contact.add_force(force, nodal, d, d1, self.multiplier)
        return force - self.pressure_force(nodal, pressure)

    def structure(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Internal force (n,) of shell and contact and values (nnz,) of their tangent."""
        force, data = self.shell.force_and_tangent(q)
        if self.contact is not None:
            nodal = self.nodal(q)
            self.contact.add_force_and_tangent(force, data, nodal, *self.shell.directors(nodal), self.multiplier)
        return force, data

    def tangent(self, q: np.ndarray, pressure: float) -> PressedTangent:
        """Residual and linearisation at a pressure, Pa."""
        nodal = self.nodal(q)
        force, structure = self.structure(q)
        force -= self.pressure_force(nodal, pressure)
        stiffness = structure.copy()
        surface = self.mesh
        pressure_stiffness(
            surface.quads,
            surface.nodes,
            nodal,
            self._uniform(pressure),
            self.loaded,
            self.shell.dofs.slots,
            -1.0,
            stiffness,
        )
        return PressedTangent(force, structure, stiffness)

    def pressure_force(self, nodal: np.ndarray, pressure: float) -> np.ndarray:
        """Force (n,) of the pressure on the deformed surface."""
        return self.shell.dofs.restrict(self.nodal_pressure_force(nodal, pressure))

    def nodal_pressure_force(self, nodal: np.ndarray, pressure: float) -> np.ndarray:
        """Force (nn, c) of the pressure on all nodes, held or not."""
        out = np.zeros_like(nodal)
        pressure_force(self.mesh.quads, self.mesh.nodes, nodal, self._uniform(pressure), self.loaded, out)
        return out

    def pressure_force_second(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Second directional derivative (n,) of the force of unit pressure along nodal fields a and b (nn, c); it is
        quadratic in the positions.
        """

        def of(x):
            out = np.zeros_like(x)
            pressure_force(self.mesh.quads, np.zeros_like(self.mesh.nodes), x, self._uniform(1.0), self.loaded, out)
            return out

        return self.shell.dofs.restrict(of(a + b) - of(a) - of(b))

    def _uniform(self, pressure: float) -> np.ndarray:
        return np.full(self.mesh.node_count, self.sign * pressure)

    # -- contact
    # ----

    def contact_state(self, q: np.ndarray) -> ContactState | None:
        """Gaps and contact pressures of a state."""
        if self.contact is None:
            return None
        nodal = self.nodal(q)
        return self.contact.state(nodal, self.shell.directors(nodal)[0], self.multiplier)

    def renew_multipliers(self, q: np.ndarray) -> None:
        """Take the contact pressures of a state as multipliers (Uzawa's update)."""
        state = self.contact_state(q)
        if state is not None:
            self.multiplier = state.pressure.copy()

    def contact_energy(self, q: np.ndarray) -> float:
        """Potential of the contact, J."""
        if self.contact is None:
            return 0.0
        nodal = self.nodal(q)
        return self.contact.energy(nodal, self.shell.directors(nodal)[0], self.multiplier)

    def renewal_force(self, q: np.ndarray) -> np.ndarray:
        """Derivative (k,) of the contact's potential with respect to the multipliers, m3: the work of renewing them."""
        return self.contact_state(q).force / self.contact.law.penalty

    def multiplier_derivative(self, q: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Derivative (n,) of the residual along a change (k,) of the multipliers."""
        out = np.zeros(self.size)
        if self.contact is not None and change.any():
            nodal = self.nodal(q)
            d, d1, _ = self.shell.directors(nodal)
            self.contact.add_multiplier_derivative(out, nodal, d, d1, self.multiplier, change)
        return out

    # -- what solvers ask
    # ----

    def factor(self) -> DirectFactor:
        """A new factorisation object for tangents of this model."""
        return DirectFactor(*self.shell.dofs.pattern)

    @staticmethod
    def refactor(factor: DirectFactor, tangent: PressedTangent) -> None:
        factor.values[:] = tangent.stiffness
        factor.refactor()

    def apply(self, tangent: PressedTangent, direction: np.ndarray) -> np.ndarray:
        return self.shell.dofs.matrix(tangent.stiffness) @ direction

    def rounding(self, q: np.ndarray, tangent: PressedTangent) -> float:
        """Norm of the residual that rounding of the positions alone can leave, N."""
        position = np.abs(self.nodal(q))
        position[:, :3] += np.abs(self.mesh.nodes)
        stiffness = self.shell.dofs.matrix(np.abs(tangent.structure))
        return float(np.finfo(float).eps * np.linalg.norm(stiffness @ self.shell.dofs.restrict(position)))

    def pressure_derivative(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Derivative (n,) of the residual with respect to the pressure."""
        return -self.pressure_force(self.nodal(q), 1.0)

    def force_scale(self, q: np.ndarray, pressure: float) -> float:
        """Norm of the pressure forces, N: what residuals are measured against; with that of a preset wall's closing."""
        own = self.shell.closing_pressure if self.contact is not None else 0.0
        return float(np.linalg.norm(self.pressure_force(self.nodal(q), abs(pressure) + own)))

    def mass(self, q: np.ndarray) -> np.ndarray:
        """Values (nnz,) of the mass matrix at a state."""
        return self.shell.mass(q)
