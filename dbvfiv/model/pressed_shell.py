"""Any shell under a uniform follower pressure: the contract of equilibria without a flow.

    r(q; P) = f_shell(q) - sign * P * f(q) = 0

with f the force of unit pressure along the outward normal. It answers what `dbvfiv.model.newton.EquilibriumSolver` and
load steps ask of a model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigen.factor import DirectFactor

from ..shell import Shell
from ..shell.pressure import pressure_force, pressure_stiffness


@dataclass(frozen=True)
class PressedTangent:
    """Residual and exact linearisation at one state.

    Attributes
    ----------
    residual : (n,) array, N and N m
    structure : (nnz,) array
        Values of the symmetric tangent of the shell.
    stiffness : (nnz,) array
        Values of the whole tangent: structure less the follower stiffness, not symmetric where the loaded surface has a
        free edge.
    """

    residual: np.ndarray
    structure: np.ndarray
    stiffness: np.ndarray


class PressedShell:
    """A shell and a uniform pressure.

    Parameters
    ----------
    shell : Shell
    sign : float
        +1 for a pressure on the side of the first layer (inside), -1 for one from outside.
    loaded : (ne,) array, optional
        Share of each element that carries pressure; all by default.
    """

    def __init__(self, shell: Shell, sign: float = -1.0, loaded=None):
        self.shell = shell
        self.mesh = shell.mesh
        self.sign = float(sign)
        self.loaded = np.ones(shell.mesh.element_count) if loaded is None else np.asarray(loaded, float)

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
        return self.internal_force(q) - self.pressure_force(self.nodal(q), pressure)

    def internal_force(self, q: np.ndarray) -> np.ndarray:
        """Force (n,) of the shell."""
        return self.shell.force(q)

    def structure(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """`internal_force` (n,) and values (nnz,) of its tangent."""
        return self.shell.force_and_tangent(q)

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

    def _uniform(self, pressure: float) -> np.ndarray:
        return np.full(self.mesh.node_count, self.sign * pressure)

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
        """Norm of the pressure forces, N: what residuals are measured against."""
        return float(np.linalg.norm(self.pressure_force(self.nodal(q), abs(pressure))))

    def mass(self, q: np.ndarray) -> np.ndarray:
        """Values (nnz,) of the mass matrix at a state."""
        return self.shell.mass(q)
