"""The coupled equations of motion as a time step sees them.

    M(q) a + h(q, v) + alpha M v + beta w + F + f_c - G(q) p = 0,     p_outlet = 0

F is the internal force of shell and stops and w its rate. F and the flow's psi (see `dbvfiv.flow.stepping`) are kept in
the state as quantities of first order, so that stiffness damping beta K_s(q) v = beta dF/dt is consistent with the
tangent without an evaluation of it. f_c is the contact of inner faces, see `dbvfiv.model.supports`.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

import numpy as np

from ..case.parameters import Mu
from ..flow.gas_stepping import GasFluid, GasInstant, GasState
from ..flow.line_stepping import LineInstant, LineState, LineWaves
from ..flow.stepping import FrozenFluid, Load, SteadyFluid, Step, StepFluid
from ..model import ValveModel
from ..model.linear import CoupledFactor, DirectFactor
from ..model.supports import FaceStep
from ..shell import Memory, StepWall, WallMemory
from .kernels import row_motion, strain_energy
from .outside import MovingOutside, OutsideCorrection
from .trial import Weights


class ValveMotion:
    """The equations of a `ValveModel`.

    Parameters
    ----------
    model : ValveModel
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
    waves : LineWaves or None
        Of an elastic line.
    contact : FaceContact or None
        Of the inner faces; None where the valve has stops.
    """

    def __init__(self, model: ValveModel, mu: Mu | None = None, staggered: bool = False):
        self.model, self.contact = model, model.contact
        self.mu = Mu.of(model.case) if mu is None else mu
        branches = model.relaxation.branches(self.mu.loss_factor)
        self.wall = WallMemory(model.shell, branches.strengths, branches.times) if branches else None
        density = self.mu.density
        fluid = model.flow.stepping(density) if model.flow.unsteady else SteadyFluid(model.flow, density)
        self.fluid = FrozenFluid(fluid) if staggered else fluid
        self.moving_fluid = self.fluid.moves
        # the flange is clamped
        self.waves: LineWaves | None = self.fluid.waves(float(model.rows.areas(model.nodal(model.rest()))[-1]))
        self.size = model.size
        self.resolution = float(np.finfo(float).eps * np.abs(model.shell.mesh.nodes).max())
        self.stations = model.stations
        shell = model.shell
        self._factor: CoupledFactor | None = None
        self._correction: OutsideCorrection | None = None
        self._masses: MassSolver | None = None
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
    # ----

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

    def load(self, q, v, q_new, v_new, step: Step, speed: float | None = None, fluid: StepFluid | None = None) -> Load:
        """Fluid of a step and its force.

        Parameters
        ----------
        q, v : (n,) arrays
            Positions and velocities where the equations are met.
        q_new, v_new : (n,) arrays
            Those at the end of the step.
        step : Step
        speed : float, optional
            Inlet velocity at the end, m/s; by default the one at which the outlet pressure vanishes.
        fluid : StepFluid, optional
            Another one than the motion's.
        """
        nodal = self.model.nodal(q)
        new = self._passage(nodal if q_new is q else self.model.nodal(q_new), v_new)
        mid = new if q_new is q else self._passage(nodal, v)
        load = (fluid or self.fluid).load(mid, new, step, speed)
        load.force = self.model.pressure_force(nodal, load.pressure)
        return load

    def _passage(self, nodal: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Areas (m,) and their rates (m,)."""
        rows = self.model.rows
        area, rate = np.empty(self.stations), np.empty(self.stations)
        row_motion(rows.rows, self.model.shell.mesh.nodes, nodal, self.model.nodal(v), area, rate)
        return area + rows.offset, rate

    def speeds(self, state) -> np.ndarray:
        """Speeds (m,) of the fluid in a state, m/s; zeros where it is none of the unknowns."""
        return self.fluid.speeds(*self._passage(self.model.nodal(state.q), state.v), state)

    def momenta(self, psi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Momentum per density and area of the fluid between stations (m - 1,), m2/s."""
        return self.fluid.momenta(psi, speed)

    def _position(self, nodal):
        out = nodal.copy()
        out[:, :3] += self.model.shell.mesh.nodes
        return out

    def length(self, dq: np.ndarray) -> float:
        """Largest displacement in a change (n,) of the unknowns, m; rotations count by the path of the wall's face."""
        return float(np.max(np.abs(dq * self._scale)))

    def turn(self, dq: np.ndarray) -> float:
        """Largest rotation in a change (n,) of the unknowns, rad."""
        return float(np.max(np.abs(dq[self._rotations])))

    # -- linear algebra
    # ----

    def linearise(
        self,
        q_new,
        v_new,
        q,
        v,
        load: Load,
        weights: Weights,
        q_load=None,
        v_load=None,
        step: StepWall | None = None,
        contact: tuple[FaceStep, float] | None = None,
    ) -> None:
        """Factor the iteration matrix.

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
        contact : (FaceStep, float), optional
            Contact of faces in the step, and its weight.

        Raises
        ------
        SingularMatrix
        """
        model = self.model
        q_load, v_load = (q, v) if q_load is None else (q_load, v_load)
        nodal = model.nodal(q_load)
        _, structure = model.structure(q_new, step)
        values = weights.force * structure
        values += weights.inertia * model.mass(q)
        if contact is not None:
            contact[0].add_tangent(q_new, values, contact[1])
        values = model.follower_stiffness(nodal, weights.load * weights.theta * load.pressure, values)
        forces = weights.load * model.station_forces(nodal).data
        slope = model.rows.jacobian(nodal).data
        mid = self._passage(nodal, v_load)
        new = self._passage(model.nodal(q_new), v_new)
        by_area, by_speed = self.fluid.load_slopes(mid, new, load, weights.theta, weights.velocity, weights.psi)
        self._refactor(values, forces, slope, by_area, by_speed)
        self._add_outside(weights.outside)

    def _add_outside(self, weight: float) -> None:
        """Take a multiple of the added mass, if there is one, into the solves with the factors just made."""
        if self.outside is not None:
            none = np.zeros(self._factor.inner)
            solve = self._factor.solve_with_inner
            self._correction = self.outside.correction(lambda f, r: solve(f, none if r is None else r), weight)

    def _refactor(self, values, forces, slope, by_area, by_speed):
        """Factor with the pressures' derivatives by areas (m, m) and, if it is an unknown, the inlet velocity (m,)."""
        if by_speed is None:
            self._solver(0).refactor(values, forces, slope, by_area)
            return
        row, corner = by_area[0].copy(), by_speed[0]
        by_area[0], by_speed[0] = 0.0, 0.0
        self._solver(1).refactor(values, forces, slope, by_area, by_speed, row, corner)

    def solve(self, force: np.ndarray, outlet: float) -> tuple[np.ndarray, float]:
        """Changes of q (n,) and U that the last factored matrix gives for a force (n,) and an outlet pressure."""
        solve = self._factor.solve_with_inner if self._correction is None else self._correction.solve
        dq, du = solve(force, np.full(self._factor.inner, outlet))
        return dq, float(du[0]) if len(du) else 0.0

    def contact_step(self, q: np.ndarray, h: float) -> FaceStep:
        """Contact of the faces in a step of length h, s, from positions (n,)."""
        return FaceStep(self.contact, q, h, self.model.case.supports.rebound)

    def accelerated(self, q: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Accelerations (n,) by a force (n,) against the inertia of the wall and of the fluid outside."""
        self._masses = self._masses or MassSolver(self.model)
        return self._masses.solve(q, force, self.outside)

    def begin_step(self, state, h: float, inlet: float) -> None:
        """Begin a step from a state: the added mass is renewed where it no longer holds, a staggered fluid advanced."""
        if self.outside is not None:
            self.outside.begin_step(state.q, state.v)
        self.fluid.begin_step(self._passage(self.model.nodal(state.q), state.v), state, h, inlet)

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

    def accelerations(
        self,
        q,
        v,
        speed: float,
        inlet: float,
        memory: Memory | None = None,
        line: LineState | None = None,
        gas: GasState | None = None,
    ) -> tuple[np.ndarray, Load]:
        """Accelerations (n,) that the equations ask for at positions, velocities and inlet velocity, and the fluid with
        them; `memory` of a wall that has not relaxed, `line` of an elastic one that does not flow steadily, `gas` of a
        fluid that is compressed and does not.

        The equations are linear in the accelerations and the rate of the inlet velocity: one solve.
        """
        model, alpha, beta = self.model, self.mu.alpha, self.mu.beta
        nodal = model.nodal(q)
        wall = None if memory is None else self.wall.held(memory)
        if self.outside is not None:
            self.outside.begin_step(q, v)
        forces = self.internal_force(q, wall) + beta * self.force_rate(q, v) + self.inertia(q, v, alpha * v)
        forces += model.contact_force(q)
        rows, fluid = model.rows, self.fluid.at_an_instant()
        coupled = model.mass(q), model.station_forces(nodal).data, rows.jacobian(nodal).data
        none = np.zeros(self.stations)
        if fluid.eliminated:
            gas = self.gas_at(q, v, speed, inlet) if gas is None else gas
            load = self.load(q, v, q, v, self._instant(speed, none, inlet, gas=gas), fluid=fluid)
            self._refactor(*coupled, np.zeros((self.stations, self.stations)), None)
            self._add_outside(1.0)
            return self.solve(load.force - forces, 0.0)[0], load
        area, rate = self._passage(nodal, v)
        by_area, by_rate, by_speed = fluid.psi_slopes(area, rate, speed)
        bend = rows.second(model.nodal(v), model.nodal(v))
        known = by_area @ rate + by_rate @ bend
        line = self.line_at(speed, inlet) if line is None else line
        instant = self._instant(speed, known, inlet, self._line_moving(line, inlet, 0.0))
        load = self.load(q, v, q, v, instant, speed, fluid)
        density = self.mu.density
        if line is not None:
            by_speed = by_speed + self.waves.inertance
        self._refactor(*coupled, -density * by_rate, -density * by_speed)
        self._add_outside(1.0)
        a, speed_rate = self.solve(load.force - forces, -load.outlet)
        if line is not None:
            by_speed = by_speed - self.waves.inertance
        psi_rate = known + by_rate @ rows.second(self._position(nodal), model.nodal(a)) + by_speed * speed_rate
        line = self._line_moving(line, inlet, speed_rate)
        return a, self.load(q, v, q, v, self._instant(speed, psi_rate, inlet, line), speed, fluid)

    def gas_at(self, q, v, speed: float, inlet: float, moved=None, flow: np.ndarray | float = 0.0) -> GasState | None:
        """A compressed fluid, steady at positions q or at rest where there is no speed; on a mode that moves its
        unknowns by `flow` (l,) and the wall to positions `moved`; None where it is not compressed.
        """
        if not isinstance(self.fluid, GasFluid):
            return None
        model = self.model
        steady = self.fluid.steady_inner(model.rows.areas(model.nodal(q)), inlet) if speed else 0.0
        passage = self._passage(model.nodal(q if moved is None else moved), v)
        return self.fluid.moving(*passage, np.zeros(model.flow.inner) + steady + flow, inlet)

    def line_at(self, speed: float, inlet: float) -> LineState | None:
        """An elastic line with a steady flow, or at rest without pressure where nothing flows; None without one."""
        if self.waves is None:
            return None
        return self.waves.steady(speed, inlet) if speed else self.waves.at_rest()

    def _line_moving(self, line: LineState | None, inlet: float, speed_rate: float) -> LineState | None:
        return None if line is None else self.waves.moving(line, inlet, speed_rate)

    def instant(self, state, inlet: float) -> Step:
        """A step of no length at a state."""
        return self._instant(state.speed, state.psi_rate, inlet, state.line, state.gas)

    def _instant(
        self,
        speed: float,
        psi_rate: np.ndarray,
        inlet: float,
        line: LineState | None = None,
        gas: GasState | None = None,
    ) -> Step:
        """A step of no length, with a given rate of psi, waves in an elastic line with their rates, and compression."""
        waves = None if line is None else LineInstant(self.waves, line)
        return Step(1.0, speed, 0.0, psi_rate, inlet, waves, gas and GasInstant(self.fluid, gas, inlet))

    # -- energies
    # ----

    def energies(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
        """Kinetic energy, strain energy and that of stops or contact, J of the part; the fluid outside is
        `outside_energy`.
        """
        return *wall_energies(self.model, q, v), self.model.support_energy(q)

    def outside_energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy of the fluid outside, J of the part; zero where there is none."""
        return 0.0 if self.outside is None else self.outside.energy(q, v)


def wall_energies(model: ValveModel, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Kinetic energy and strain energy at positions and velocities (n,), J of the part."""
    shell = model.shell
    nodal = model.nodal(q)
    d = shell.directors(nodal)[0]
    if shell.metric == "first-order":
        parts = zip(shell.parts, shell.wall)
        strain = sum(strain_energy(p.quads, shell.mesh.nodes, nodal, d, p.reference, wall) for p, wall in parts)
    else:
        strain = shell.energy(q)
    return shell.kinetic_energy(q, v), float(strain)


class MassSolver:
    """Accelerations that a force gives the wall, with the added mass of fluid outside.

    Parameters
    ----------
    model : ValveModel
    """

    def __init__(self, model: ValveModel):
        self._model = model
        self._factor = DirectFactor(*model.shell.dofs.pattern)

    def solve(self, q: np.ndarray, force: np.ndarray, outside: MovingOutside | None = None) -> np.ndarray:
        """Accelerations (n,) at positions (n,) by a force (n,)."""
        factor = self._factor
        factor.values[:] = self._model.mass(q)
        factor.refactor()
        if outside is None:
            return factor.solve(force)
        none = np.zeros(0)
        return outside.correction(lambda f, _: (factor.solve(f), none), 1.0).solve(force, none)[0]
