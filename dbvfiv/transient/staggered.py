"""The thesis's coupling (App. A), for comparison: the fluid first, in the passage of the last state, then the wall under its pressures."""
from __future__ import annotations

import numpy as np

from .equations import Load, ValveMotion


class StaggeredMotion(ValveMotion):
    """Equations of the wall under pressures that do not follow it within a step.

    The inlet velocity takes a backward difference in the areas of the last state; the pressures act on the wall as it moves, but are not changed by it.
    """

    def __init__(self, model, conditions=None):
        super().__init__(model, conditions)
        self.coupled_fluid, self.moving_fluid = self.moving_fluid, False
        self._frozen: Load | None = None

    def begin_step(self, state, h: float, inlet: float) -> None:
        """Advance the fluid through the passage of a state."""
        if not self.coupled_fluid:
            self._frozen = super().load(state.q, state.v, inlet, 0.0, np.zeros(self.stations))
            return
        self.moving_fluid = True
        self._frozen = super().load(state.q, state.v, inlet, 1.0 / h, -state.psi / h)
        self.moving_fluid = False

    def load(self, q, v, inlet, psi_weight, psi_known, speed=None) -> Load:
        if self._frozen is None:
            return super().load(q, v, inlet, psi_weight, psi_known, speed)
        kept = self._frozen
        force = self.model.pressure_force(self.model.nodal(q), kept.pressure)
        return Load(force, 0.0, kept.pressure, kept.area, kept.speed, kept.psi, kept.psi_rate, inlet)

    def linearise(self, q, q_inertia, v, load, weights) -> None:
        model = self.model
        nodal = model.nodal(q)
        _, structure = model.structure(q)
        values = weights.force * structure + weights.inertia * model.mass(q_inertia)
        values = model.follower_stiffness(nodal, weights.load * load.pressure, values)
        none = np.zeros((self.stations, self.stations))
        self._solver(0).refactor(values, model.station_forces(nodal).data, model.rows.jacobian(nodal).data, none)

    def accelerations(self, q, v, speed, inlet):
        self._frozen, self.moving_fluid = None, self.coupled_fluid
        try:
            return super().accelerations(q, v, speed, inlet)
        finally:
            self.moving_fluid = False
            self.drop_factors()
