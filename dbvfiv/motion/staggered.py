"""The thesis's coupling (App. A), for comparison: the fluid first, in the passage of the last state, then the wall
under its pressures.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .equations import ValveMotion
from .terms import Load, Step


class StaggeredMotion(ValveMotion):
    """Equations of the wall under pressures that do not follow it within a step.

    The inlet velocity takes a backward difference in the areas of the last state; the pressures act on the wall as it
    moves, but are not changed by it.
    """

    def __init__(self, model, mu=None):
        super().__init__(model, mu)
        self.coupled_fluid, self.moving_fluid = self.moving_fluid, False
        self._frozen: Load | None = None

    def begin_step(self, state, h: float, inlet: float) -> None:
        """Advance the fluid through the passage of a state by a backward difference."""
        super().begin_step(state, h, inlet)
        self.moving_fluid = self.coupled_fluid
        step = Step(1.0, state.speed, 1.0 / h, -state.psi / h, inlet)
        self._frozen = super().load(state.q, state.v, state.q, state.v, step)
        self.moving_fluid = False

    def load(self, q, v, q_new, v_new, step: Step, speed=None) -> Load:
        if self._frozen is None:
            return super().load(q, v, q_new, v_new, step, speed)
        kept = self._frozen
        return replace(
            kept, force=self.model.pressure_force(self.model.nodal(q), kept.pressure), outlet=0.0, inlet=step.inlet
        )

    def linearise(self, q_new, v_new, q, v, load, weights, q_load=None, v_load=None, step=None, contact=None) -> None:
        model = self.model
        nodal = model.nodal(q if q_load is None else q_load)
        _, structure = model.structure(q_new, step)
        values = weights.force * structure + weights.inertia * model.mass(q)
        if contact is not None:
            contact[0].add_tangent(q_new, values, contact[1])
        values = model.follower_stiffness(nodal, weights.load * weights.theta * load.pressure, values)
        none = np.zeros((self.stations, self.stations))
        self._solver(0).refactor(values, model.station_forces(nodal).data, model.rows.jacobian(nodal).data, none)
        self._add_outside(weights.outside)

    def accelerations(self, q, v, speed, inlet, memory=None, line=None, gas=None):
        self._frozen, self.moving_fluid = None, self.coupled_fluid
        try:
            return super().accelerations(q, v, speed, inlet, memory, line)
        finally:
            self.moving_fluid = False
            self.drop_factors()
