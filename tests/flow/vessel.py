"""A flow law with three unknowns: a vessel upstream, fed through an orifice, before the valve's streamline."""

from __future__ import annotations

import jax.numpy as jnp

from dbvfiv.flow import Channel, FlowLaw, FlowParameter


class Vessel(FlowLaw):
    """Unknowns: inlet velocity U, pressure p_v in the vessel, velocity W through the orifice, of the inlet's section.

    capacity * dp_v/dt = A_in (W - U),   P - p_v = rho resistance W|W|/2,   the streamline is driven by p_v.
    """

    DATA = ("law", "floor")
    inner_names = ("inlet velocity", "vessel pressure", "orifice velocity")

    def __init__(self, law: Channel, capacity: float, resistance: float):
        self.law, self.floor = law, law.floor
        self.capacity, self.resistance = capacity, resistance

    @property
    def count(self):
        return self.law.count

    @property
    def parameters(self):
        return (
            *self.law.parameters,
            FlowParameter("capacity", "m3/Pa", "of the vessel", self.capacity),
            FlowParameter("resistance", "1", "loss coefficient of the orifice", self.resistance),
        )

    def equations(self, motion, parameters):
        inside, through = motion.inner[1], motion.inner[2]
        own = motion._replace(inner=motion.inner[:1], inner_rate=motion.inner_rate[:1])
        pressure, outlet = self.law.equations(own, parameters | {"inlet": inside})
        stored = parameters["capacity"] * motion.inner_rate[1] - motion.area[-1] * (through - motion.inner[0])
        lost = 0.5 * parameters["density"] * parameters["resistance"] * through * jnp.abs(through)
        return pressure, jnp.concatenate([outlet, jnp.stack([stored, parameters["inlet"] - inside - lost])])

    def steady_start(self, area, parameters):
        velocity = self.law.steady_start(area, parameters)[0]
        return jnp.stack([velocity, 0.5 * parameters["inlet"], velocity])
