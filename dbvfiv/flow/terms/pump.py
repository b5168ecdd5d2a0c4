"""A pump at the far end of the line: what its head falls by as the flow rises, in place of a fixed pressure.

    P = P_0 + rho g [ H(Q) - H_0 ]

P_0 is the pressure of the case or of a parameter, which at the operating point is rho g H(Q) already. Runs in time have
H_0 = P_0 / (rho g), the pump by itself, and so move to the operating point from another pressure. Spectra and cycles
are those of the steady state at P_0, whose flow Q_0 gives H_0 = H(Q_0): the difference is a static lift that comes on
top, see `with_static_lift`. H is the monotone cubic of Fritsch and Carlson
(1980) through the rows of the pump's table, and goes on along its tangent beyond their ends, where no result is taken
from.

Equation (T.14) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import PchipInterpolator

from ...case.part import QUARTER
from ...case.quantity import GRAVITY
from ..law import FlowLaw, Traceable
from ..term import FlowTerm


class Pump(FlowTerm):
    """A pump's curve.

    Parameters
    ----------
    flow : sequence of float, m3/s
        Increasing.
    head : sequence of float, m
    density : float
        Of the fluid it pumps, kg/m3.
    pressure : float
        P_0, Pa.
    copies : int
        How many of the part that is computed the whole valve is.
    """

    DATA = ("flow", "heads", "series", "density", "reference", "copies")
    drives = True

    def __init__(
        self,
        flow: Sequence[float],
        head: Sequence[float],
        density: float,
        pressure: float,
        copies: int = QUARTER.copies,
    ):
        self.flow, self.heads, self.density = np.asarray(flow, float), np.asarray(head, float), float(density)
        self.reference, self.copies = pressure / (density * GRAVITY), float(copies)
        inside = PchipInterpolator(self.flow, self.heads)
        ends = [(float(inside(q)), float(inside(q, 1))) for q in self.flow[[0, -1]]]
        before, after = ([0.0, 0.0, slope, value] for value, slope in ends)
        self.series = np.column_stack([before, inside.c, after])

    @jax.jit
    def curve(self, flow):
        """Head, m, of a flow, m3/s; traceable."""
        place = jnp.searchsorted(self.flow, flow, side="right")
        from_row = flow - jnp.asarray(self.flow)[jnp.maximum(place - 1, 0)]
        a, b, c, d = jnp.asarray(self.series)[:, place]
        return ((a * from_row + b) * from_row + c) * from_row + d

    def slope(self, flow: float) -> float:
        """Rise of the head with the flow, s/m2."""
        return float(jax.grad(self.curve)(flow))

    def holds(self, flow: float) -> bool:
        """True where a flow rate, m3/s, is within the pump's table."""
        return bool(self.flow[0] <= flow <= self.flow[-1])

    def pressure(self, drive: float, flow: float) -> float:
        """P, Pa, at a flow rate, m3/s, with P_0 of a drive, Pa."""
        return drive + self.density * GRAVITY * (float(self.curve(flow)) - self.reference)

    def gain(self, velocity, inlet_area, parameters):
        """P - P_0 over the density, m2/s2, from the velocity at the far end referred to the inlet's section.

        Flow and head of a fluid of another density are those of the same pressures.
        """
        size = self.density / parameters["density"]
        return size * GRAVITY * (self._head_at(velocity, inlet_area, parameters) - self.reference)

    def _head_at(self, velocity, inlet_area, parameters):
        flow = self.copies * inlet_area * velocity / jnp.sqrt(self.density / parameters["density"])
        return self.curve(flow)

    def lifted(self, velocity: float, inlet_area: float, parameters) -> Pump:
        """The pump with a static lift by which it has P_0 at a velocity at the far end, which is referred to the
        inlet's section.
        """
        return self.changed(reference=float(self._head_at(velocity, inlet_area, parameters)))

    def head(self, stream, parameters):
        return -self.gain(stream.velocity, stream.area[-1], parameters)


def with_static_lift(law: FlowLaw, area: np.ndarray, inner: np.ndarray, parameters: Mapping[str, float]) -> FlowLaw:
    """A flow law whose pumps have P_0 in a steady flow of given unknowns: a static lift makes up the difference."""
    velocity = law.far_velocity(inner, parameters)

    def lifted(part):
        if isinstance(part, Pump):
            return part.lifted(velocity, float(area[-1]), parameters)
        if isinstance(part, tuple):
            return tuple(map(lifted, part))
        if isinstance(part, Traceable):
            return part.changed(**{name: lifted(getattr(part, name)) for name in part.DATA})
        return part

    return lifted(law)


def from_case(case) -> Pump | None:
    """The pump of a case, or None where it has none."""
    if not case.has_pump:
        return None
    flow, head = zip(*case.upstream.pump, strict=True)
    return Pump(flow, head, case.fluid.density, case.drive.pressure, case.part.copies)
