"""The coupled equations of motion with a fluid that is compressed.

The fluid's equations are met at the end of each step, their rates by backward differences of second order (of first
order where momentum is lost within a step): see `dbvfiv.flow.gas_stepping`. Its force on the wall is the weighted mean
of that there and at the start. The fluid's unknowns are eliminated in each evaluation, so that the wall alone is
iterated.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

import numpy as np

from ..flow.gas_stepping import GasInstant, GasState, GasStep
from .equations import ValveMotion
from .terms import Load, Step


class GasMotion(ValveMotion):
    """The equations of a `ValveModel` whose flow law is `dbvfiv.flow.gas.GasChannel`."""

    def fluid_step(self, old: GasState, h: float, rate: float, inlet: float) -> GasStep:
        """The fluid in a step of length h, s; see `GasStep`."""
        return GasStep(self.fluid, old, h, rate, inlet)

    def load(self, q, v, q_new, v_new, step: Step, speed=None) -> Load:
        """Fluid of a step and its force; arguments as those of the base class, the positions those of the end."""
        model = self.model
        nodal = model.nodal(q_new)
        area, rate = self._passage(nodal, v_new)
        flow = step.gas.at(area, rate)
        psi_rate = step.psi_weight * flow.psi + step.psi_known
        force = model.pressure_force(nodal, flow.pressure)
        moved = area, flow.speed, flow.psi, psi_rate, step.inlet, float(flow.speed[-1])
        return Load(force, 0.0, flow.pressure, *moved, gas=flow)

    def speeds(self, state) -> np.ndarray:
        return self.model.flow.own_velocities(state.gas.inner)

    def linearise(self, q_new, v_new, q, v, load, weights, q_load=None, v_load=None, step=None) -> None:
        model = self.model
        nodal = model.nodal(q_new)
        _, structure = model.structure(q_new, step)
        values = weights.force * structure + weights.inertia * model.mass(q)
        values = model.follower_stiffness(nodal, weights.load * load.pressure, values)
        by_area, by_rate = load.gas.slopes()
        forces = weights.load * model.station_forces(nodal).data
        slope = by_area + weights.velocity * by_rate
        self._solver(0).refactor(values, forces, model.rows.jacobian(nodal).data, slope)
        self._add_outside(weights.outside)

    def solve(self, force, outlet):
        solve = self._factor.solve_with_inner if self._correction is None else self._correction.solve
        return solve(force, np.zeros(0))[0], 0.0

    def accelerations(self, q, v, speed, inlet, memory=None, line=None, gas: GasState | None = None):
        """As the base class; `gas` is the fluid's state, a steady flow by default, or rest where there is none."""
        model, alpha, beta = self.model, self.conditions.alpha, self.conditions.beta
        nodal = model.nodal(q)
        wall = None if memory is None else self.wall.held(memory)
        if self.outside is not None:
            self.outside.begin_step(q, v)
        gas = self._gas(q, v, self._steady(q, speed, inlet), inlet) if gas is None else gas
        load = self.load(q, v, q, v, self._of_gas(gas, np.zeros(self.stations), inlet))
        forces = self.internal_force(q, wall) + beta * self.force_rate(q, v) + self.inertia(q, v, alpha * v)
        none = np.zeros((self.stations, self.stations))
        mass, jacobian = model.mass(q), model.rows.jacobian(nodal).data
        self._solver(0).refactor(mass, model.station_forces(nodal).data, jacobian, none)
        self._add_outside(1.0)
        return self.solve(load.force - forces, 0.0)[0], load

    def gas_on_mode(self, q, moved, v, speed, inlet, flow):
        return self._gas(moved, v, self._steady(q, speed, inlet) + flow, inlet)

    def _steady(self, q, speed: float, inlet: float) -> np.ndarray:
        """Unknowns (l,) of a steady flow at positions q; at rest where there is no speed."""
        if not speed:
            return np.zeros(self.model.flow.inner)
        return self.fluid.steady_inner(self.model.rows.areas(self.model.nodal(q)), inlet)

    def _gas(self, q, v, inner: np.ndarray, inlet: float) -> GasState:
        """State of the fluid with unknowns (l,) in the passage of positions and velocities."""
        return self.fluid.moving(*self._passage(self.model.nodal(q), v), inner, inlet)

    def instant(self, state, inlet: float) -> Step:
        return self._of_gas(state.gas, state.psi_rate, inlet)

    def _of_gas(self, gas: GasState, psi_rate: np.ndarray, inlet: float) -> Step:
        return Step(1.0, float(gas.inner[0]), 0.0, psi_rate, inlet, gas=GasInstant(self.fluid, gas, inlet))
