"""A pipe behind the valve, in which the valve stands: its jet widens to the pipe and gives back a part of its head.

    p_out = P_d + rho [ L du/dt + zeta u|u|/2 - g ],     g = r U_0^2 - u^2,     u = U A_in/A_pipe,  r = A_0/A_pipe

P_d is the pressure at the pipe's far end, p_out that around the jet and on the outer side of the wall, U_0 the speed of
the jet, u that in the pipe. g is the momentum balance of Borda and Carnot over the widening jet. The pipe is rigid and
the wall keeps its volume, so what the moving wall displaces inside it makes room for outside: the pipe carries what
enters at the flange, under either law of continuity. The valve sees p - p_out: a head of one size for all stations.
"""

from __future__ import annotations

import jax.numpy as jnp

from ...case.part import QUARTER
from ..law import FlowParameter
from ..term import FlowTerm


class Tail(FlowTerm):
    """A straight pipe behind the valve.

    Parameters
    ----------
    diameter : float, m
        Inner.
    length : float, m
        Of the rigid column behind the valve; 0 for one without inertia.
    loss : float
        Sum of K up to the far end, of the velocity head in the pipe.
    expansion : float, optional
        Loss of the widening jet over its velocity head, the K of Th. 7.2; Borda and Carnot's (1 - r)^2 without it.
    copies : int
        How many of the part that is computed the whole valve is.

    Flow that runs back comes from fluid at rest at the far end and gets no head from a jet.
    """

    DATA = ("diameter", "length", "loss", "expansion", "copies")

    def __init__(
        self,
        diameter: float,
        length: float = 0.0,
        loss: float = 0.0,
        expansion: float | None = None,
        copies: int = QUARTER.copies,
    ):
        self.diameter, self.length, self.loss = map(float, (diameter, length, loss))
        self.copies = float(copies)
        self.expansion = None if expansion is None else float(expansion)

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("tail_length", "m", "length of the pipe behind", self.length),)

    @property
    def section(self):
        """The part's share of the pipe's section, m2."""
        return jnp.pi * self.diameter**2 / (4.0 * self.copies)

    def gained(self, jet_area, jet, speed):
        """Rise of pressure over density from the jet to the pipe, m2/s2.

        Parameters
        ----------
        jet_area : float, m2
            Of the part.
        jet, speed : float, m/s
            Of the jet and in the pipe; what runs back gains nothing.
        """
        jet, speed = jnp.maximum(jet, 0.0), jnp.maximum(speed, 0.0)
        if self.expansion is None:
            return jet_area / self.section * jet**2 - speed**2
        return 0.5 * ((1.0 - self.expansion) * jet**2 - speed**2)

    def speed(self, inlet, velocity):
        """Speed in the pipe, m/s, from the part's area of the inlet, m2, and its velocity."""
        return inlet * velocity / self.section

    def lost_head(self, speed):
        """Head lost in the pipe, m2/s2, at a speed in it, m/s."""
        return 0.5 * self.loss * speed * abs(speed)

    def head(self, stream, parameters):
        speed = self.speed(stream.area[-1], stream.velocity)
        return self.lost_head(speed) - self.gained(stream.open_area[0], stream.speed[0], speed)

    def momentum(self, stream, parameters):
        return parameters["tail_length"] * self.speed(stream.area[-1], stream.velocity)


def from_case(case) -> Tail | None:
    """The pipe behind the valve of a case, or None where it discharges freely."""
    tail = case.downstream
    if not case.has_tail:
        return None
    return Tail(tail.pipe_diameter, tail.length, tail.loss, tail.expansion_loss, case.part.copies)
