"""A pipe in front of the valve: a rigid column of fluid that loses head by friction and fittings.

    P_flange = P_0 - rho [ L' dU/dt + (U^2 - c u^2)/2 + (f L/D + K) u|u|/2 ],   u = U A_in/A_line,   L' = L A_in/A_line

U is the velocity at the flange, u that in the line. c is 0 where P_0 is the pressure of a reservoir at the far end,
whose fluid is at rest, and 1 where it is the static pressure in the line there. Flow that runs back into a reservoir
loses the head of its jet, so that c is 1 then.
"""

from __future__ import annotations

import jax.numpy as jnp

from ..law import FlowParameter
from ..term import FlowTerm


class Line(FlowTerm):
    """A straight pipe in front of the valve.

    Parameters
    ----------
    length : float, m
    diameter : float, m, optional
        Inner; that of the section at the flange where it is not given.
    friction : float
        Darcy's factor.
    roughness : float, m
        In place of it; see `rough`.
    loss : float
        Sum of K, of the velocity head in the line.
    reservoir : bool
        Whether the pressure that drives the flow is that of a reservoir; the static one in the line otherwise.
    """

    DATA = ("length", "friction", "roughness", "loss", "diameter")
    STATIC = ("reservoir",)

    def __init__(
        self,
        length: float,
        diameter: float | None = None,
        friction: float = 0.0,
        roughness: float = 0.0,
        loss: float = 0.0,
        reservoir: bool = True,
    ):
        self.length, self.friction, self.roughness, self.loss = map(float, (length, friction, roughness, loss))
        self.diameter = None if diameter is None else float(diameter)
        self.reservoir = bool(reservoir)

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("pipe_length", "m", "length of the pipe in front", self.length),)

    def section(self, inlet):
        """Diameter, m, and area of the inlet over that of the line, from the area of a quarter of the inlet."""
        own = jnp.sqrt(16.0 * inlet / jnp.pi)
        return (own, 1.0) if self.diameter is None else (self.diameter, (own / self.diameter) ** 2)

    def lost(self, diameter, length):
        """Loss of the line in velocity heads: f L/D + K."""
        rough = self.roughness / (3.7 * diameter)
        factor = jnp.where(rough > 0, (2.0 * jnp.log10(jnp.where(rough > 0, rough, 0.5))) ** -2, 0.0)
        return (self.friction + factor) * length / diameter + self.loss

    def lost_head(self, inlet: float, velocity: float) -> float:
        """Head lost in the line, m2/s2, from the area of a quarter of the inlet, m2, and its velocity, m/s."""
        diameter, ratio = self.section(inlet)
        return float(0.5 * self.lost(diameter, self.length) * (ratio * velocity) ** 2)

    def head(self, stream, parameters):
        velocity = stream.inner[0]
        diameter, ratio = self.section(stream.area[-1])
        speed = ratio * velocity
        gained = jnp.minimum(speed, 0.0) if self.reservoir else speed
        lost = self.lost(diameter, parameters["pipe_length"])
        return 0.5 * (velocity**2 - gained**2 + lost * speed * jnp.abs(speed))

    def momentum(self, stream, parameters):
        return parameters["pipe_length"] * self.section(stream.area[-1])[1] * stream.inner[0]


def from_case(case) -> Line | None:
    """The line of a case, or None where it has none."""
    line = case.upstream
    if not case.has_line:
        return None
    reservoir = case.drive.at == "reservoir"
    return Line(line.length, line.diameter, line.friction, line.roughness, line.loss, reservoir)
