"""The coupled equations of motion as a time step sees them.

    M(q) a + h(q, v) + alpha M v + beta w + F + f_c - G(q) p = 0,     p_outlet = 0

F is the internal force of shell and stops and w its rate. F and what the flow's balances hold (`dbvfiv.flow.stepping`)
are kept in the state as quantities of first order, so that stiffness damping beta K_s(q) v = beta dF/dt is consistent
with the tangent without an evaluation of it. f_c is the contact of inner faces, see `dbvfiv.model.supports`.

Between two renewals the added mass M_a of fluid outside is constant, so that steps treat it as they treat constant mass
and the balance of energy holds. A renewal changes the kinetic energy at given velocities; what it adds is kept in the
books. The inertia quadratic in the velocities that a changing added mass brings is what the renewals leave out.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from eigen.factor import DirectFactor

from ..case.parameters import Mu
from ..contact import ContactStep, Rebound
from ..flow.stepping import Flow, FrozenFluid, MovingFluid, SteadyFluid
from ..model.linear import CoupledFactor
from ..model.outside import AddedMass
from ..model.valve import ValveModel
from ..shell.memory import Memory, WallMemory
from ..shell.shell import StepWall
from .stepper import Weights

#: Largest displacement of the wall, over the radius of the flange, up to which an added mass is kept.
KEPT_WITHIN = 0.03
#: Shapes whose added mass is remembered, for motions that come back to them.
REMEMBERED = 24


class MovingOutside:
    """Added mass along a motion.

    Parameters
    ----------
    model : ValveModel
        With a fluid outside.
    density : float
        Of that fluid, kg/m3.
    length : callable
        Largest displacement in a change (n,) of the unknowns, m.

    Attributes
    ----------
    renewed : float
        Energy that renewals have added since the start, J of the part.
    """

    def __init__(self, model: ValveModel, density: float, length: Callable[[np.ndarray], float]):
        self.model, self.density, self._length = model, density, length
        self.within = KEPT_WITHIN * model.case.valve.inlet_radius
        self.renewed = 0.0
        self._place: np.ndarray | None = None
        self._mass: AddedMass | None = None
        self._known: list[tuple[np.ndarray, AddedMass]] = []

    def force(self, q: np.ndarray, a: np.ndarray) -> np.ndarray:
        """M_a a (n,); for accelerations at positions q where no added mass is known yet."""
        w = self._at(q).columns
        return self.density * (w @ (w.T @ a))

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy of the fluid, J of the part."""
        return 0.5 * self.density * float(np.sum((self._at(q).columns.T @ v) ** 2))

    def _at(self, q: np.ndarray) -> AddedMass:
        if self._mass is None:
            self._take(q)
        return self._mass

    def begin_step(self, q: np.ndarray, v: np.ndarray) -> None:
        """Renew the added mass where the wall has moved too far from where it was taken."""
        if self._place is None or self._length(q - self._place) > self.within:
            self._change(q, v)

    def start_afresh(self, q: np.ndarray, v: np.ndarray) -> None:
        """Take the added mass at a state and forget all others, so that what follows depends on the state alone."""
        self._known.clear()
        if self._place is None or not np.array_equal(q, self._place):
            self._change(q, v)

    def _change(self, q, v):
        before = None if self._mass is None else self.energy(q, v)
        self._take(q)
        if before is not None:
            self.renewed += self.energy(q, v) - before

    def _take(self, q: np.ndarray) -> None:
        near = [pair for pair in self._known if self._length(q - pair[0]) <= 0.5 * self.within]
        if near:
            self._place, self._mass = min(near, key=lambda pair: self._length(q - pair[0]))
            return
        model = self.model
        structure = model.shell.dofs.matrix(model.structure(q)[1])
        self._place, self._mass = np.array(q), model.outside.added_mass(q, structure)
        self._known = [*self._known[1 - REMEMBERED :], (self._place, self._mass)]

    def correction(self, solve: Callable, weight: float) -> OutsideCorrection:
        """Correction that turns solves with a matrix into solves with weight M_a added; see `OutsideCorrection`."""
        return OutsideCorrection(solve, self._mass.columns, weight * self.density)


class OutsideCorrection:
    """Solves with A + c W W' from those with A (Woodbury).

    Parameters
    ----------
    solve : callable
        From forces (n,) and the flow's rows (l,), or None, to changes of q (n,) and of its unknowns (l,), by A; of
        columns of forces too.
    columns : (n, r) array W
    weight : float
        c.
    """

    def __init__(self, solve: Callable, columns: np.ndarray, weight: float):
        self._solve, self.columns = solve, columns
        self._q, self._u = solve(columns, None)
        small = np.eye(columns.shape[1]) + weight * (columns.T @ self._q)
        self._small = la.lu_factor(small, check_finite=False)
        self._weight = weight

    def solve(self, force: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q (n,) and of the flow's unknowns (l,)."""
        q, u = self._solve(force, rest)
        share = self._weight * la.lu_solve(self._small, self.columns.T @ q, check_finite=False)
        return q - self._q @ share, u - self._u @ share


class ValveMotion:
    """The equations of a `ValveModel`.

    Parameters
    ----------
    mu : Mu, optional
        Density and damping; those of the model's case by default.
    staggered : bool
        The thesis's coupling, fluid first.

    Attributes
    ----------
    resolution : float
        Smallest displacement that positions resolve, m.
    wall : WallMemory or None
        What the wall remembers; None where it is elastic.
    fluid : MovingFluid
        The flow law in steps.
    contact : PlaneContact or None
        Of the inner faces; None where the valve has stops.
    """

    def __init__(self, model: ValveModel, mu: Mu | None = None, staggered: bool = False):
        self.model, self.contact = model, model.contact
        self.mu = Mu.of(model.case) if mu is None else mu
        branches = model.relaxation.branches(self.mu.loss_factor)
        self.wall = WallMemory(model.shell, branches.strengths, branches.times) if branches else None
        density = self.mu.density
        if not model.flow.unsteady:
            self.fluid = SteadyFluid(model.flow, density, model.seal)
        else:
            self.fluid = (FrozenFluid if staggered else MovingFluid)(model.flow, density, model.seal)
        self.size = model.size
        self.resolution = float(np.finfo(float).eps * np.abs(model.shell.mesh.nodes).max())
        self.stations = model.stations
        shell = model.shell
        self._factor: CoupledFactor | None = None
        self._correction: OutsideCorrection | None = None
        self._masses: DirectFactor | None = None
        free = shell.dofs.free
        scale = np.ones(free.shape)
        scale[:, 3:] = 0.5 * float(np.mean(shell.geometry.thickness))
        self._scale = scale[free]
        self.outside: MovingOutside | None = None
        if model.outside is not None:
            density = model.case.outside.density(self.mu.density)
            self.outside = MovingOutside(model, density, self.length)
        self._rotations = np.flatnonzero(np.broadcast_to(np.arange(free.shape[1]) >= 3, free.shape)[free])

    # -- forces

    def internal_force(self, q: np.ndarray, step: StepWall | None = None) -> np.ndarray:
        """Force (n,) of shell, stops and weight; `step` for a wall that relaxes."""
        return self.model.internal_force(q, step)

    def force_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Rate (n,) of the internal force by the slow law: K_s(q) v."""
        if not np.any(v):
            return np.zeros(self.size)
        return self.model.shell.dofs.matrix(self.model.structure(q)[1]) @ v

    def inertia(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """M(q) a + h(q, v), (n,)."""
        return self.model.shell.inertia(q, v, a)

    def momentum(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """M(q) v, (n,)."""
        return self.inertia(q, np.zeros_like(v), v)

    def load(self, q, v, q_new, v_new, step) -> Flow:
        """Fluid of a step and its force.

        Parameters
        ----------
        q, v : (n,) arrays
            Positions and velocities where the equations are met.
        q_new, v_new : (n,) arrays
            Those at the end of the step.
        step : FluidStep or anything with its method `at`
        """
        nodal = self.model.nodal(q)
        new = self._passage(nodal if q_new is q else self.model.nodal(q_new), v_new)
        mid = new if q_new is q else self._passage(nodal, v)
        load = step.at(mid, new)
        load.force = self._force(nodal, load.pressure, load.still)
        return load

    def _force(self, nodal: np.ndarray, pressure: np.ndarray, still: tuple | None) -> np.ndarray:
        """Force (n,) of pressures (m,) on the wall; what moving fluid adds in front of a seal acts on the areas."""
        if still is None:
            return self.model.pressure_force(nodal, pressure)
        at_rest, lengths = still
        added = self.model.forces_on_areas(nodal, lengths)
        return self.model.pressure_force(nodal, at_rest) + added @ (pressure - at_rest)

    def _forces(self, nodal: np.ndarray, still: tuple | None) -> np.ndarray:
        """Derivatives of that force by the pressures, as values of G."""
        model = self.model
        return (model.station_forces(nodal) if still is None else model.forces_on_areas(nodal, still[1])).data

    def _passage(self, nodal: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Areas (m,) and their rates (m,)."""
        rows = self.model.rows
        return rows.areas(nodal), rows.rates(nodal, self.model.nodal(v))

    def length(self, dq: np.ndarray) -> float:
        """Largest displacement in a change (n,) of the unknowns, m; rotations count by the path of the wall's face."""
        return float(np.max(np.abs(dq * self._scale)))

    def turn(self, dq: np.ndarray) -> float:
        """Largest rotation in a change (n,) of the unknowns, rad."""
        return float(np.max(np.abs(dq[self._rotations])))

    # -- linear algebra

    def linearise(
        self,
        q_new,
        v_new,
        q,
        v,
        load: Flow,
        weights: Weights,
        q_load=None,
        v_load=None,
        step: StepWall | None = None,
        contact: tuple[ContactStep, float] | None = None,
    ) -> None:
        """Factor the iteration matrix. Raises SingularShiftError.

        Parameters
        ----------
        q_new, v_new : (n,) arrays
            New positions and velocities.
        q, v : (n,) arrays
            Those that inertia is taken at.
        q_load, v_load : (n,) arrays, optional
            Those that the fluid's equations are met at, if others.
        step : StepWall, optional
            The wall at the end of the step, if it relaxes.
        contact : (ContactStep, float), optional
            Contact of faces in the step, and its weight.
        """
        model = self.model
        q_load, v_load = (q, v) if q_load is None else (q_load, v_load)
        nodal = model.nodal(q_load)
        _, structure = model.structure(q_new, step)
        values = weights.force * structure
        values += weights.inertia * model.mass(q)
        if contact is not None:
            contact[0].add_tangent(q_new, values, contact[1])
        pressure = load.pressure if load.still is None else load.still[0]
        values = model.follower_stiffness(nodal, weights.load * weights.theta * pressure, values)
        forces = weights.load * self._forces(nodal, load.still)
        slope = model.rows.jacobian(nodal).data
        by_area = load.slopes(weights.velocity)
        self._solver(0).refactor(values, forces, slope, by_area)
        self._add_outside(weights.outside)

    def _add_outside(self, weight: float) -> None:
        """Take a multiple of the added mass, if there is one, into the solves with the factors just made."""
        if self.outside is not None:
            self._correction = self.outside.correction(self._factor.solve_with_inner, weight)

    def solve(self, force: np.ndarray) -> np.ndarray:
        """Change of q (n,) that the last factored matrix gives for a force (n,)."""
        return self._solve(force, np.zeros(self._factor.inner))[0]

    def _solve(self, force: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        solve = self._factor.solve_with_inner if self._correction is None else self._correction.solve
        return solve(force, rest)

    def contact_step(self, q: np.ndarray, h: float) -> ContactStep:
        """Contact of the faces in a step of length h, s, from positions (n,)."""
        return ContactStep(self.contact, q, h, Rebound(self.model.case.supports.rebound))

    def accelerated(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Accelerations (n,) by a force (n,) against the inertia of the wall and of the fluid outside."""
        self._masses = factor = self._masses or DirectFactor(*self.model.shell.dofs.pattern)
        factor.refactor(self.model.mass(q))
        if self.outside is None:
            return factor.solve(force)
        return self.outside.correction(lambda f, _: (factor.solve(f), np.zeros_like(f[:0])), 1.0).solve(force, None)[0]

    def begin_step(self, state, h: float, theta: float, rate: float, inlet: float):
        """Step of the fluid from a state, see `dbvfiv.flow.stepping.MovingFluid.step`; the added mass outside is
        renewed where it no longer holds.
        """
        if self.outside is not None:
            self.outside.begin_step(state.q, state.v)
        passage = self._passage(self.model.nodal(state.q), state.v)
        return self.fluid.step(state.fluid, passage, h, theta, rate, inlet)

    def drop_factors(self) -> None:
        """Forget the factorisation with its analysis, so that later numbers do not depend on matrices seen before."""
        self._factor = self._correction = self._masses = None

    @property
    def factored(self) -> bool:
        """True where a factorisation to solve with exists."""
        return self._factor is not None and self._factor.factorisations > 0

    def _solver(self, inner: int) -> CoupledFactor:
        if self._factor is None or self._factor.inner != inner:
            model = self.model
            rest = model.nodal(model.rest())
            pattern = model.shell.dofs.matrix(np.ones(len(model.shell.dofs.pattern[1])))
            self._factor = CoupledFactor(pattern, model.station_forces(rest), model.rows.jacobian(rest), inner)
        return self._factor

    def still_fluid(self) -> np.ndarray:
        """Unknowns (l,) of the fluid at rest, at the pressure behind the valve; the inlet velocity alone where the law
        has none.
        """
        model = self.model
        return model.flow.still(model.rows.areas(model.nodal(model.rest())), self.fluid.parameters(0.0))

    def accelerations(
        self, q, v, inlet: float, inner: np.ndarray | None = None, memory: Memory | None = None
    ) -> tuple[np.ndarray, Flow]:
        """Accelerations (n,) that the equations ask for at positions, velocities and unknowns of the fluid (l,), by
        default those at rest, and the fluid with them; `memory` of a wall that has not relaxed.

        The equations are linear in the accelerations and the rates of the fluid's unknowns: one solve. Where the law
        lets pressures depend on neither, they are known before.
        """
        model, alpha, beta = self.model, self.mu.alpha, self.mu.beta
        nodal = model.nodal(q)
        wall = None if memory is None else self.wall.held(memory)
        if self.outside is not None:
            self.outside.begin_step(q, v)
        forces = self.internal_force(q, wall) + beta * self.force_rate(q, v) + self.inertia(q, v, alpha * v)
        forces += model.contact_force(q)
        inner = self.still_fluid() if inner is None else np.asarray(inner, float)
        passage, m = self._passage(nodal, v), self.stations
        fluid = self.fluid
        if self.model.flow.unsteady:
            fluid = fluid.facing(passage[0], fluid.speeds(*passage, inner), inlet)
        still = fluid.still(passage[0], inlet)
        coupled = model.mass(q), self._forces(nodal, still), model.rows.jacobian(nodal).data
        if not self.model.flow.unsteady:
            load = self.load(q, v, q, v, fluid.instant(None, inlet))
            self._solver(0).refactor(*coupled, np.zeros((m, m)))
            self._add_outside(1.0)
            return self.solve(load.force - forces), load
        inner = fluid.law.with_displaced(*passage, inner)
        sources, by_area, by_rate, by_inner = fluid.operators(*passage, inner, inlet)
        bend = model.rows.second(model.nodal(v), model.nodal(v))
        known = sources + by_area @ passage[1] + by_rate @ bend
        if self.fluid.compressed:
            self._solver(0).refactor(*coupled, np.zeros((m, m)))
        else:
            self._solver(len(inner)).refactor(*coupled, by_rate[:m], by_inner[:m], by_rate[m:], by_inner[m:])
        self._add_outside(1.0)
        pressure = self._force(nodal, known[:m], still)
        a, _ = self._solve(pressure - forces, -known[m:][: self._factor.inner])
        position = nodal.copy()
        position[:, :3] += model.shell.mesh.nodes
        acceleration = bend + model.rows.second(position, model.nodal(a))
        state = fluid.moving(passage, acceleration, inner, inlet)
        return a, self.load(q, v, q, v, fluid.instant(state, inlet))

    def instant(self, state, inlet: float):
        """A step of no length of the fluid at a state."""
        return self.fluid.instant(state.fluid, inlet)

    # -- energies

    def energies(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
        """Kinetic energy, strain energy and that of stops or contact, J of the part; the fluid outside is
        `outside_energy`.
        """
        shell = self.model.shell
        return shell.kinetic_energy(q, v), shell.energy(q), self.model.support_energy(q)

    def outside_energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy of the fluid outside, J of the part; zero where there is none."""
        return 0.0 if self.outside is None else self.outside.energy(q, v)
