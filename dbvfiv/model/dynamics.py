"""The valve in motion: the time-dependent residual of the coupled system and its exact linearisation about a steady
state.

    M(q) a + h(q, v) + alpha M v + beta K_s(q) v + f(q) - G(q) p = 0,     e = 0

with h the inertia quadratic in the velocities (turning directors), K_s the structure's own tangent, which has no part
of the contact of inner faces in f, p the station pressures of the unsteady flow through the areas A(q) with rates A' =
J v and A'' = J a + d2A[v, v]. The unknowns are q and those of the flow law, the inlet velocity U for one. Small motions
see K_s and, of layers with Maxwell branches, sum_g phi_g(lambda) K_g, with K_g the material part of the tangent of
layers that relax alike.

Equations (T.15) and (T.16) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from eigen import CoupledPencil, Relaxation
from eigen.pencil import FLUID_PARTS

from ..case.parameters import Mu
from ..errors import SolveError
from ..flow import FlowLaw, FlowMotion
from .outside import AddedMass
from .valve import ValveModel


def dynamic_residual(model: ValveModel, mu: Mu, inlet: float, q, v, a, inner, inner_rate):
    """Residual of the coupled equations of motion.

    Parameters
    ----------
    inlet : float
        Inlet pressure, Pa.
    q, v, a : (n,) arrays
        Unknowns, their velocities and accelerations.
    inner, inner_rate : (l,) arrays
        The flow's own unknowns and their rates; one number will do where there is one, the inlet velocity, m/s.

    Returns
    -------
    force : (n,) array, N and N m
    rest : (l,) array
        Residuals of the flow's own equations: the pressure at the outlet, Pa, to vanish.
    """
    matrix = model.shell.dofs.matrix
    nodal, nodal_rate = model.nodal(q), model.nodal(v)
    force, structure = model.structure(q)
    force += model.contact_force(q)
    mass = matrix(model.mass(q))
    force += mass @ (a + mu.alpha * v) + mu.beta * (matrix(structure) @ v) + model.shell.convective_inertia(q, v)
    slope = model.rows.jacobian(nodal)
    passage = model.rows.areas(nodal), slope @ v, slope @ a + model.rows.second(nodal_rate, nodal_rate)
    given = {"inlet": inlet, "density": mu.density}
    p, rest = model.flow.evaluate(FlowMotion(*passage, inner, inner_rate), given)
    return force - model.pressure_force(nodal, p), rest


@dataclass(frozen=True)
class LinearisedState:
    """Matrices of a steady state that do not depend on fluid density, damping or continuity law.

    Attributes
    ----------
    model : ValveModel
    q : (n,) array
    inlet : float
        Inlet pressure, Pa.
    mass, structure, stiffness : (n, n) sparse matrices
        M, the structure's own tangent K_s, and K = K_s, with contact of inner faces, less the follower stiffness of
        the pressures.
    forces : (n, m) sparse matrix G
    slope : (m, n) sparse matrix J
    area : (m,) array, m2
    added : AddedMass or None
        Of the fluid outside, at unit density; None where there is none.
    """

    model: ValveModel
    q: np.ndarray
    inlet: float
    mass: object
    structure: object
    stiffness: object
    forces: object
    slope: object
    area: np.ndarray
    added: AddedMass | None = None
    _damped: dict = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def relaxing(self) -> tuple:
        """K_g (n, n): material part of the tangent of each group of layers that relax alike."""
        return self.model.relaxing_stiffness(self.q)

    @cached_property
    def coupling(self) -> tuple:
        """G and J with what couples the fluid outside behind what couples the flow."""
        return (self.forces, self.slope) if self.added is None else self.added.coupling(self.forces, self.slope)

    def fluid_parts(self, density: float, storage: float | None = None, line: Mapping[str, float] = {}):
        """Matrices of the unsteady fluid's response to `slope`, see `fluid_parts` of this module."""
        self.check_pump()
        return fluid_parts(self.model.flow, self.area, self.inlet, density, storage, line)

    def steady_parts(self) -> dict[str, np.ndarray]:
        """Matrix of the response of a fluid without inertia to `slope`."""
        return {"A0": self.model.flow.steady_operator(self.area, self.inlet)[1]}

    def nodal(self, q: np.ndarray) -> np.ndarray:
        """Nodal displacements and rotations (nn, c) of unknowns (n,)."""
        return self.model.nodal(q)

    def relaxation(self, loss_factor: float) -> Relaxation | None:
        """Viscoelastic part of the stiffness, with a factor on all loss factors; None for an elastic wall."""
        return self.model.relaxation.stiffness(loss_factor, lambda: self.relaxing)

    def damped(self, alpha: float, beta: float, loss_factor: float = 0.0) -> CoupledPencil:
        """The pencil with damping C = alpha M + beta K_s and what relaxes but no fluid; the last one is kept, so a
        sweep over the fluid reuses it.
        """
        key = (alpha, beta, loss_factor)
        if key not in self._damped:
            self._damped.clear()
            damping, relaxation = alpha * self.mass + beta * self.structure, self.relaxation(loss_factor)
            wall = (self.mass, damping, self.stiffness, *self.coupling)
            self._damped[key] = CoupledPencil(*wall, relaxation=relaxation)
        return self._damped[key]

    def check_pump(self) -> None:
        """Refuse a state whose flow the pump's table does not hold.

        Raises
        ------
        SolveError
        """
        pump = self.model.pump
        if pump is None:
            return
        flow = self.model.mass_flow(self.area, self.inlet) / self.model.case.fluid.density
        if not pump.holds(flow):
            raise SolveError(
                f"At {self.inlet:.6g} Pa the valve takes {1e3 * flow:.4g} L/s, and the pump's table goes from "
                f"{1e3 * pump.flow[0]:.4g} to {1e3 * pump.flow[-1]:.4g} L/s."
            )

    def pencil(self, mu: Mu, fluid: bool = True) -> CoupledPencil:
        """Pencil of small motions.

        Parameters
        ----------
        mu : Mu
            Fluid, damping and pipes; where the flow model (storage) or a pipe is not held, the law's own is taken.
        fluid : bool
            False leaves the flow out: motions of the stressed structure, the steady pressures kept as follower loads,
            in vacuo or in the fluid outside.
        """
        damped = self.damped(mu.alpha, mu.beta, mu.loss_factor)
        flowing = fluid and self.model.flow.has_fluid
        if not flowing and self.added is None:
            return CoupledPencil(damped.M, damped.C, damped.K, relaxation=damped.relaxation)
        parts = self.flow_parts(mu.density, mu.get("storage"), mu.pipes) if flowing else {}
        if self.added is not None:
            density = self.model.case.outside.density(mu.density)
            parts = self.added.parts(parts or self.no_flow(), density)
        return damped.replace(**parts)

    def flow_parts(self, density: float, storage: float | None = None, line: dict | None = None) -> dict:
        """A0 to S1 of the flow alone at a density; of a steady flow A0 is all."""
        moving = self.model.flow.unsteady
        return self.no_flow() | (self.fluid_parts(density, storage, line or {}) if moving else self.steady_parts())

    def no_flow(self) -> dict:
        """A0 to S1 of a flow that does nothing."""
        m = self.forces.shape[1]
        shapes = {"A": (m, m), "B": (m, 0), "R": (0, m), "S": (0, 0)}
        return {name: np.zeros(shapes[name[0]]) for name in FLUID_PARTS}


def fluid_parts(
    flow: FlowLaw,
    area: np.ndarray,
    inlet: float,
    density: float,
    storage: float | None = None,
    line: Mapping[str, float] = {},
) -> dict[str, np.ndarray]:
    """Fluid part of a pencil: A0 to S1 of `eigen.CoupledPencil`, at steady flow; `line` as `Mu.pipes`."""
    given = {"inlet": inlet, "density": density, **line}
    return flow.linearise_still(area, given if storage is None else given | {"storage": storage}).parts()


def linearise(model: ValveModel, q: np.ndarray, inlet: float) -> LinearisedState:
    """Linearise a steady state at an inlet pressure, Pa."""
    tangent = model.tangent(q, inlet)
    stiffness, forces, slope = model.matrices(tangent)
    matrix = model.shell.dofs.matrix
    structure = matrix(tangent.structure)
    added = None if model.outside is None else model.outside.added_mass(q, structure)
    return LinearisedState(
        model, q, inlet, matrix(model.mass(q)), structure, stiffness, forces, slope, tangent.area, added
    )
