"""Exact linearisation of the valve's equations of motion (`dbvfiv.model.residual`) about a state at rest.

The unknowns are q and those of the flow law, the inlet velocity U for one. Small motions see K_s and, of layers with
Maxwell branches, sum_g phi_g(lambda) K_g, with K_g the material part of the tangent of layers that relax alike.

Equation (T.16) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from eigen.operator import FLUID_PARTS, CoupledPencil, Relaxation

from ..case.parameters import Mu
from ..errors import SolveError
from ..flow.channel import Channel
from ..flow.law import FlowLaw, FlowMotion
from ..flow.terms.pump import with_static_lift
from .outside import AddedMass
from .valve import ValveModel


@dataclass(frozen=True)
class LinearisedState:
    """Matrices of a steady state that do not depend on fluid density, damping or continuity law."""

    model: ValveModel
    q: np.ndarray  #: (n,).
    inlet: float  #: Inlet pressure, Pa.
    #: mass, structure and stiffness: (n, n) sparse matrices; M, the structure's own tangent K_s, and K = K_s, with
    #: contact of inner faces, less the follower stiffness of the pressures.
    mass: object
    structure: object
    stiffness: object
    forces: object  #: (n, m) sparse matrix G.
    slope: object  #: (m, n) sparse matrix J.
    area: np.ndarray  #: (m,), m2.
    added: AddedMass | None = None  #: Of the fluid outside, at unit density; None where there is none.
    inner: np.ndarray | None = None  #: (l,) or None; unknowns of a flow that is not that of an equilibrium.
    _damped: dict = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def relaxing(self) -> tuple:
        """K_g (n, n): material part of the tangent of each group of layers that relax alike."""
        return self.model.relaxing_stiffness(self.q)

    @cached_property
    def coupling(self) -> tuple:
        """G and J with what couples the fluid outside behind what couples the flow."""
        return (self.forces, self.slope) if self.added is None else self.added.coupling(self.forces, self.slope)

    @property
    def seal(self) -> int | None:
        """Last of the stations, from the outlet on, that the faces of a bill that is moulded shut shut; None where it
        is open.
        """
        return self.model.seal(self.area)

    def resolved(self, mu: Mu) -> float:
        """Frequency up to which waves of the fluid inside are resolved, Hz; infinite where these motions make none."""
        law = self.model.flow
        if law.has_fluid and self.seal is not None:
            law = self._still_law(mu.storage)
        return law.resolved(mu.pipes)

    def _still_law(self, storage: float | None) -> FlowLaw:
        """Law of which the still fluid in front of a seal is: with waves where the wall displaces what makes them."""
        flow = self.model.flow
        rigid = still_channel(flow)
        return flow if (rigid.storage if storage is None else storage) > 0 else rigid

    def shut_parts(self, given: Mapping[str, float]) -> dict[str, np.ndarray]:
        """A0 to S1 of the still fluid in front of a seal, `given` the parameters of the flow law."""
        law = self._still_law(given.get("storage"))
        rest = law.with_velocity(law.steady_inner(self.area, given), 0.0)
        law = with_static_lift(law, self.area, rest, given)
        found = law.shut(self.seal).linearise(FlowMotion.still(self.area, rest), given)
        parts = self.no_flow(self.model.flow.inner)
        parts["S0"] = np.eye(self.model.flow.inner)
        for name, values in found.items():
            rows, columns = values.shape
            parts[name][:rows, :columns] = values
        # a balance of rates alone, as of the discharge past the seal, which stays zero, holds at all times
        rates = ~np.hstack([parts["R0"], parts["S0"]]).any(axis=1)
        for name, rate in (("R0", "R1"), ("R1", "R2"), ("S0", "S1")):
            parts[name][rates], parts[rate][rates] = parts[rate][rates], 0.0
        return parts

    def fluid_parts(self, given: Mapping[str, float]) -> dict[str, np.ndarray]:
        """A0 to S1 of `eigen.CoupledPencil`: response of the unsteady fluid to `slope`."""
        self.check_pump()
        return self.model.flow.linearise_still(self.area, given)

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
        """Refuse a state whose flow the pump's table does not hold. Raises SolveError."""
        pump = self.model.pump
        if pump is None:
            return
        flow = self.model.mass_flow(self.area, self.inlet) / self.model.case.fluid.density
        if not pump.holds(flow):
            raise SolveError(
                f"At {self.inlet:.6g} Pa the valve takes {1e3 * flow:.4g} L/s, and the pump's table goes from "
                f"{1e3 * pump.flow[0]:.4g} to {1e3 * pump.flow[-1]:.4g} L/s."
            )

    def pencil(self, mu: Mapping[str, float], fluid: bool = True) -> CoupledPencil:
        """Pencil of small motions.

        Parameters
        ----------
        mu : mapping
            Fluid, damping and pipes; where the flow model (storage) or a pipe is not held, the law's own is taken.
        fluid : bool
            False leaves the flow out: motions of the stressed structure, the steady pressures kept as follower loads,
            in vacuo or in the fluid outside.
        """
        damped = self.damped(*(mu.get(name, 0.0) for name in ("alpha", "beta", "loss_factor")))
        flowing = fluid and (self.model.flow.has_fluid or self.inner is not None)
        if not flowing and self.added is None:
            return CoupledPencil(damped.M, damped.C, damped.K, relaxation=damped.relaxation)
        parts = self.flow_parts(mu) if flowing else {}
        if self.added is not None:
            density = self.model.case.outside.density(mu["density"])
            parts = self.added.parts(parts or self.no_flow(), density)
        return damped.replace(**parts)

    def flow_parts(self, mu: Mapping[str, float]) -> dict[str, np.ndarray]:
        """A0 to S1 of the flow alone at a parameter point; of a steady flow A0 is all."""
        if self.inner is not None:
            return self.model.flow.linearise(FlowMotion.still(self.area, self.inner), mu)
        given, moving = {**mu, "inlet": self.inlet}, self.model.flow.unsteady
        if self.seal is not None and moving:
            return self.shut_parts(given)
        return self.no_flow() | (self.fluid_parts(given) if moving else self.steady_parts())

    def no_flow(self, inner: int = 0) -> dict:
        """A0 to S1 of a flow that does nothing."""
        m = self.forces.shape[1]
        shapes = {"A": (m, m), "B": (m, inner), "R": (inner, m), "S": (inner, inner)}
        return {name: np.zeros(shapes[name[0]]) for name in FLUID_PARTS}


def still_channel(flow: FlowLaw) -> Channel:
    """The incompressible passage of a flow law, a pipe in front of it as a rigid column."""
    while not isinstance(flow, Channel):
        flow = getattr(flow, "rigid", None) or flow.channel
    return flow


def without_circulation(model: ValveModel, area: np.ndarray, stiffness: sp.csr_matrix) -> sp.csr_matrix:
    """Stiffness (n, n) with the pressures of still fluid where sections (m,), m2, are sealed.

    Still fluid is conservative, so its stiffness is symmetric. Pressures that stay with the nodes are not where they
    change along the wall, as they do over the element at the edge of the seal: they would feed motions past it.
    """
    return stiffness if model.seal(area) is None else (0.5 * (stiffness + stiffness.T)).tocsr()


def linearise(
    model: ValveModel,
    q: np.ndarray,
    inlet: float,
    mu: Mapping[str, float] | None = None,
    inner: np.ndarray | None = None,
    added: AddedMass | None = None,
) -> LinearisedState:
    """Linearise a state at rest.

    Parameters
    ----------
    q : (n,) array
    inlet : float
        Inlet pressure, Pa.
    mu, inner : mapping and (l,) array, optional
        Parameters of the flow law and its unknowns, where the flow is not that of an equilibrium at `inlet`.
    added : AddedMass, optional
        That of the fluid outside, where that of the state is not wanted.
    """
    nodal = model.nodal(q)
    area, matrix = model.rows.areas(nodal), model.shell.dofs.matrix
    if inner is None:
        pressure = model.flow.steady_pressure(area, inlet)
    else:
        inner = np.asarray(inner, float)
        pressure, _ = model.flow.evaluate(FlowMotion.still(area, inner), mu)
    _, values = model.structure(q)
    structure, stiffness = matrix(values), matrix(model.stiffness(q, pressure, values))
    forces, slope = model.station_forces(nodal), model.rows.jacobian(nodal)
    seal = model.seal(area)
    if seal is not None:
        stiffness = without_circulation(model, area, stiffness)
        if model.flow.unsteady:  # pressures do work on the areas
            forces = model.forces_on_areas(nodal, model.flow.shut(seal).work_lengths(area))
    if added is None and model.outside is not None:
        added = model.outside.added_mass(q, structure)
    coupled = forces, slope, area, added, inner
    return LinearisedState(model, q, inlet, matrix(model.mass(q)), structure, stiffness, *coupled)
