"""Walls that are moulded shut: the shape without stress whose closing presses the faces on each other evenly.

A bill is cured with lips that would cross. Pressed into the shape that it is drawn in, x, it would be in equilibrium
under an even pressure s on the inner faces of the length that is moulded shut, which is what the other lip gives it.
The stress-free shape X is the answer to an inverse problem of elasticity (Govindjee & Mihalic 1996, Comput. Methods
Appl. Mech. Eng. 136, 47-57),

    f(x; X) = s G(x)

with f the internal force of a wall without stress in X. It is found by fixed points: the first X is x under s from
outside; then each X is moved back by how far its equilibrium under s lies from x, and the last ones are mixed. A
constant overlap of the lips would press at its ends only.

Equation (T.32) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import root_scalar

from eigen.factor import DirectFactor

from ..errors import SolveError
from ..shell.mesh import DofMap, ShellMesh
from ..shell.pressure import pressure_force, pressure_stiffness
from ..shell.shell import Shell
from .load_steps import LoadStepOptions, LoadSteps
from .newton import EquilibriumSolver, NewtonOptions


@dataclass(frozen=True)
class PressedTangent:
    """Residual and exact linearisation at one state."""

    residual: np.ndarray  #: (n,), N and N m.
    structure: np.ndarray  #: (nnz,); values of the symmetric tangent of the shell.
    #: (nnz,); values of the whole tangent: structure less the follower stiffness, not symmetric where the loaded
    #: surface has a free edge.
    stiffness: np.ndarray


class PressedShell:
    """Any shell under a uniform follower pressure: the contract of equilibria without a flow.

        r(q; P) = f_shell(q) - sign * P * f(q) = 0

    with f the force of unit pressure along the outward normal. It answers what `dbvfiv.model.newton.EquilibriumSolver`
    and load steps ask of a model. `dbvfiv.model.valve.ValveModel` is one whose pressures vary from station to station.

    Parameters
    ----------
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
        return PressedTangent(force, structure, self.follower_stiffness(nodal, pressure, structure))

    def nodal_pressure(self, pressure: float) -> np.ndarray:
        """Pressures (nn,) at the nodes, Pa, along the outward normal."""
        return np.full(self.shell.mesh.node_count, self.sign * pressure)

    def pressure_force(self, nodal: np.ndarray, pressure: float) -> np.ndarray:
        """Force (n,) of the pressure, as `nodal_pressure` takes it, on the deformed surface."""
        return self.shell.dofs.restrict(self.nodal_pressure_force(nodal, pressure))

    def nodal_pressure_force(self, nodal: np.ndarray, pressure: float) -> np.ndarray:
        """Force (nn, c) of the pressure on all nodes, held or not."""
        out, surface = np.zeros_like(nodal), self.shell.mesh
        pressure_force(surface.quads, surface.nodes, nodal, self.nodal_pressure(pressure), self.loaded, out)
        return out

    def follower_stiffness(
        self, nodal: np.ndarray, pressure: float, structure: np.ndarray, dofs: DofMap | None = None
    ) -> np.ndarray:
        """Values (nnz,) of the structure's tangent less the derivative of the force of constant pressures, by the
        unknowns of the shell, or by others.
        """
        data, surface, slots = structure.copy(), self.shell.mesh, (dofs or self.shell.dofs).slots
        at_nodes = self.nodal_pressure(pressure)
        pressure_stiffness(surface.quads, surface.nodes, nodal, at_nodes, self.loaded, slots, -1.0, data)
        return data

    # -- what solvers ask

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
        """Norm of the residual that rounding of the positions alone can leave, N: machine epsilon times |K| |x|."""
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


#: Unbalanced force over that of the pressure at which the shape is found, and most fixed points on the way.
_BALANCED, _MOST = 1e-8, 60
#: Earlier fixed points that are mixed.
_REMEMBERED = 8
#: Newton's tolerance on that way.
_NEWTON = NewtonOptions(1e-11, 30)
#: Relative accuracy of the sealing pressure that an overlap asks for.
_ACCURACY = 1e-9


def stress_free_shape(shell: Shell, loaded: np.ndarray, pressure: float) -> ShellMesh:
    """Shape in which a wall has no stress that balances an even pressure in the shape of its mesh. Raises SolveError if
    there is none: the wall buckles before, or is too soft.

    Parameters
    ----------
    shell : Shell
        Without stress in the shape of its mesh.
    loaded : (ne,) array
        Share of each element on which the pressure acts.
    pressure : float, Pa
        On the inner face.
    """
    mesh = shell.mesh
    outside = LoadSteps(PressedShell(shell, -1.0, loaded), LoadStepOptions(_NEWTON))
    refused = (
        f"No shape without stress was found from which closing takes {pressure:.6g} Pa: the wall is too soft for such "
        "a preset; take a lower one, or a thicker or shorter bill."
    )
    try:
        outside.reach(pressure)
    except SolveError as error:
        raise SolveError(refused) from error
    nodal = shell.dofs.expand(outside.q)
    place, off = np.hstack([mesh.nodes + nodal[:, :3], shell.directors(nodal)[0]]), np.inf
    mixing, enough = _Mixing(), _BALANCED
    for _ in range(_MOST):
        shape = replace(mesh, nodes=place[:, :3], directors=place[:, 3:])
        pressed = PressedShell(shell.preset(shape, pressure), 1.0, loaded)
        q, before = pressed.rest(), off
        off = np.linalg.norm(pressed.residual(q, pressure)) / pressed.force_scale(q, pressure)
        if off <= enough or _BALANCED * 1e3 >= off > 0.5 * before:  # the latter is rounding
            return shape
        found = EquilibriumSolver(pressed, _NEWTON).solve(q, pressure)
        if not found.converged:
            break
        enough = max(_BALANCED, found.rounding)
        nodal = pressed.nodal(found.q)
        moved = np.hstack([nodal[:, :3], pressed.shell.directors(nodal)[0] - mesh.directors])
        place = mixing.step(place, moved)
        place[:, 3:] /= np.linalg.norm(place[:, 3:], axis=1, keepdims=True)
    raise SolveError(refused)


class _Mixing:
    """Anderson's mixing of fixed points (Walker & Ni 2011, SIAM J. Numer. Anal. 49, 1715-1735): the next place by the
    combination of the last ones whose defect is least.
    """

    def __init__(self):
        self._places: list[np.ndarray] = []
        self._defects: list[np.ndarray] = []

    def step(self, place: np.ndarray, defect: np.ndarray) -> np.ndarray:
        """Place after one with a defect, which a plain iteration would take off."""
        self._places, self._defects = self._places[-_REMEMBERED:] + [place], self._defects[-_REMEMBERED:] + [defect]
        changes = np.array([(a - b).ravel() for a, b in zip(self._defects[1:], self._defects[:-1])]).T
        after = place - defect
        if not changes.size:
            return after
        share = np.linalg.lstsq(changes, defect.ravel(), rcond=1e-12)[0]
        steps = np.array([(a - b).ravel() for a, b in zip(self._places[1:], self._places[:-1])]).T - changes
        return after - (steps @ share).reshape(place.shape)


def pressure_for_overlap(shell: Shell, loaded: np.ndarray, node: int, overlap: float) -> float:
    """Sealing pressure, Pa, with whose shape a node lies beyond the closing plane y = 0 by more than it stands before
    it at rest by an overlap, m. Raises SolveError: as `stress_free_shape` does.
    """

    def excess(pressure: float) -> float:
        shape = stress_free_shape(shell, loaded, pressure)
        return float(shell.mesh.nodes[node, 1] - shape.nodes[node, 1]) / overlap - 1.0

    small = PressedShell(shell, -1.0, loaded)
    steps = LoadSteps(small, LoadStepOptions(_NEWTON))
    steps.reach(1e-3)
    first = 1e-3 * overlap / abs(float(small.nodal(steps.q)[node, 1]))
    found = root_scalar(excess, x0=first, x1=0.9 * first, rtol=_ACCURACY, method="secant")
    if not found.converged or not found.root > 0:
        raise SolveError(f"No sealing pressure was found that gives an overlap of {overlap:.6g} m.")
    return float(found.root)
