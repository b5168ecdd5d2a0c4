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

#: Absolute pressure, Pa, below which a fluid is a gas: by no more can its pressure fall.
GAS = 1e6


class GasMotion(ValveMotion):
    """The equations of a `ValveModel` whose flow law is `dbvfiv.flow.gas.GasChannel`."""

    @property
    def quiet_inward(self) -> bool:
        """True where steps with inward flow need no numerical damping.

        A gas is soft. The water hammer of a liquid hits stiff walls as an incompressible fluid does.
        """
        law = self.model.flow
        return self.mu.density * law.sound_speed**2 / law.ratio < GAS

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

    def momenta(self, psi, speed):
        return -np.diff(psi)

    @property
    def eliminated(self) -> bool:
        return True

    def _pressure_slope(self, area, load, weights):
        by_area, by_rate = load.gas.slopes()
        return by_area + weights.velocity * by_rate

    def _first_instant(self, q, v, speed, inlet, gas):
        """First instant of the fluid: a given state, or steady flow, which is at rest where there is no speed."""
        gas = self._gas(q, v, self._steady(q, speed, inlet), inlet) if gas is None else gas
        return self._of_gas(gas, np.zeros(self.stations), inlet)

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
