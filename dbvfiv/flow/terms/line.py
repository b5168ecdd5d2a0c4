"""A pipe in front of the valve, or several in series: a rigid column that loses head by friction and fittings.

    P_flange = P_0 - rho [ L' dU/dt + (U^2 - c u^2)/2 + (f L/D + K) u|u|/2 ],   u = U A_in/A_line,   L' = L A_in/A_line

U is the velocity at the flange, u that in the line. c is 0 where P_0 is the pressure of a reservoir at the far end,
whose fluid is at rest, and 1 where it is the static pressure in the line there. Flow that runs back into a reservoir
loses the head of its jet, so that c is 1 then. Of pieces in series inertances and losses add, each with its own
section; u is that of the first, at the far end, and where sections change no head is lost but what `loss` says.
"""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp

from ...case.part import QUARTER
from ..law import FlowParameter
from ..term import FlowTerm


class _Pipes(FlowTerm):
    """Head and inertance of pipes in series, whose `parts`, `section`, `length` and `reservoir` a subclass has."""

    def far_speed(self, velocity, inlet_area):
        """Speed, m/s, at the far end whose kinetic energy adds to the head that drives; none out of a reservoir."""
        speed = self.section(inlet_area)[1] * velocity
        return jnp.minimum(speed, 0.0) if self.reservoir else speed

    def head(self, stream, parameters):
        inlet, velocity = stream.area[-1], stream.velocity
        gained = self.far_speed(velocity, inlet)
        stretch, lost = parameters["pipe_length"] / self.length, 0.0
        for part in self.parts:
            diameter, ratio = part.section(inlet)
            lost = lost + part.lost(diameter, stretch * part.length) * ratio**2
        return 0.5 * (stream.inner[0] ** 2 - gained**2 + lost * velocity * jnp.abs(velocity))

    def momentum(self, stream, parameters):
        inertance = sum(part.length * part.section(stream.area[-1])[1] for part in self.parts)
        return parameters["pipe_length"] / self.length * inertance * stream.velocity


class Line(_Pipes):
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
    copies : int
        How many of the part that is computed the whole valve is.
    """

    DATA = ("length", "friction", "roughness", "loss", "diameter", "copies")
    STATIC = ("reservoir",)

    def __init__(
        self,
        length: float,
        diameter: float | None = None,
        friction: float = 0.0,
        roughness: float = 0.0,
        loss: float = 0.0,
        reservoir: bool = True,
        copies: int = QUARTER.copies,
    ):
        self.length, self.friction, self.roughness, self.loss = map(float, (length, friction, roughness, loss))
        self.diameter = None if diameter is None else float(diameter)
        self.reservoir, self.copies = bool(reservoir), float(copies)

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("pipe_length", "m", "length of the pipe in front", self.length),)

    @property
    def parts(self) -> tuple[Line, ...]:
        """Pieces from the far end to the flange."""
        return (self,)

    def section(self, inlet):
        """Diameter, m, and area of the inlet over that of the line, from the part's area of the inlet."""
        own = jnp.sqrt(4.0 * self.copies * inlet / jnp.pi)
        return (own, 1.0) if self.diameter is None else (self.diameter, (own / self.diameter) ** 2)

    def lost(self, diameter, length):
        """Loss of the line in velocity heads: f L/D + K."""
        rough = self.roughness / (3.7 * diameter)
        factor = jnp.where(rough > 0, (2.0 * jnp.log10(jnp.where(rough > 0, rough, 0.5))) ** -2, 0.0)
        return (self.friction + factor) * length / diameter + self.loss

    def lost_head(self, inlet: float, velocity: float) -> float:
        """Head lost in the line, m2/s2, from the part's area of the inlet, m2, and its velocity, m/s."""
        diameter, ratio = self.section(inlet)
        return float(0.5 * self.lost(diameter, self.length) * (ratio * velocity) ** 2)


class PiecedLine(_Pipes):
    """Pipes in series in front of the valve.

    Its parameter is the length of all; another one than its own stretches all pieces alike.

    Parameters
    ----------
    parts : sequence of Line
        From the far end to the flange; whether there is a reservoir is what the first one says.
    """

    DATA = ("parts", "length")

    def __init__(self, parts: Sequence[Line]):
        self.parts = tuple(parts)
        self.length = sum(part.length for part in self.parts)

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("pipe_length", "m", "length of the pipes in front", self.length),)

    @property
    def reservoir(self) -> bool:
        """True where the driving pressure is that of a reservoir, False where it is static in the first pipe."""
        return self.parts[0].reservoir

    def section(self, inlet):
        """Diameter, m, of the first pipe, and area of the inlet over its own; see `Line.section`."""
        return self.parts[0].section(inlet)

    def lost_head(self, inlet: float, velocity: float) -> float:
        """Head lost in all pipes, m2/s2; see `Line.lost_head`."""
        return sum(part.lost_head(inlet, velocity) for part in self.parts)


def from_case(case) -> Line | PiecedLine | None:
    """The line of a case, or None where it has none."""
    if not case.has_line:
        return None
    reservoir = case.drive.at == "reservoir"
    parts = [
        Line(pipe.length, pipe.diameter, pipe.friction, pipe.roughness, pipe.loss, reservoir, case.part.copies)
        for pipe in case.upstream.pipes
    ]
    return PiecedLine(parts) if case.upstream.pieces else parts[0]
