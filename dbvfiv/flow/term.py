"""Terms that a streamline may carry besides Bernoulli's: losses, inertances."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp

from .law import FlowParameter, Traceable

#: Name of the parameter that a viscous term has, Pa s.
VISCOSITY = "viscosity"


class Stream(NamedTuple):
    """The streamline as a term sees it."""

    #: area and area_rate: (m,); m2, m2/s, from the outlet to the inlet.
    area: Any
    area_rate: Any
    speed: Any  #: (m,); of the fluid at the stations, m/s; negative inwards.
    inner: Any  #: (l,); the law's own unknowns; the first is the inlet velocity, m/s.
    #: (m,); areas that the fluid sees, m2: they stay above the floor of the channel, so that `open_area * speed` is the
    #: discharge.
    open_area: Any = None
    #: (m,); arcs of the wall that the fluid wets, m, of the same part of the section as the areas.
    perimeter: Any = None
    step: Any = None  #: (m-1,); distances of the stations, m.
    passing: Any = None  #: `velocity` where it is not that of the inlet.

    @property
    def velocity(self):
        """Velocity at the inlet, m/s, that mass flows with at the density around the jet."""
        return self.inner[0] if self.passing is None else self.passing


class FlowTerm(Traceable):
    """A loss or an inertance on the way from the pressure that drives the flow to the stations.

    The pressures become p_k - rho [head_k + d/dt momentum_k]. Heads go with the square of the speeds and momenta with
    the speeds themselves, so that equilibria do not depend on density; a head that opposes the flow either way goes
    with U|U|. Both methods are traceable by jax and return (m,) arrays, or one number for all stations.
    """

    #: Whether its head is what the driving pressure of a steady state changes by when the flow does, as that of a pump:
    #: it vanishes in steady flow, then, and need not go with the square of the speeds.
    drives: ClassVar[bool] = False
    #: Whether its head depends on the Reynolds number; equilibria depend on the density of the fluid then.
    viscous: ClassVar[bool] = False
    #: Whether its head is lost behind the narrowest section, where nothing flows if that is shut.
    behind_throat: ClassVar[bool] = False

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        """The numbers that the term depends on, each with its value."""
        return ()

    def head(self, stream: Stream, parameters):
        """Head lost before each station, m2/s2."""
        return 0.0

    def momentum(self, stream: Stream, parameters):
        """Momentum per density and area of the fluid before each station, m2/s, that the term adds."""
        return 0.0


def wall_share(step, speed):
    """Correction (m,), m2/s, of the integral of speeds (m,) from the inlet, for the pressure on the wall; traceable.

    The integral is known at the stations. A speed that varies linearly over a section of length h, from U_a to U_b,
    makes a parabola of it. With the same moments, the parabola lies h (U_b - U_a)/12 from a straight line; stations
    take their parts from adjacent sections by the lengths of these. The outlet, whose pressure is given, and the inlet
    keep their own values.
    """
    bow = step**2 * (speed[1:] - speed[:-1]) / 12.0
    inner = (bow[1:] + bow[:-1]) / (step[1:] + step[:-1])
    return jnp.concatenate([jnp.zeros(1), inner, jnp.zeros(1)])


def upstream_integral(step, values):
    """Trapezoidal integral of values (m,) from the inlet (last) to each station, `step` (m-1,) apart; traceable."""
    pieces = 0.5 * step * (values[1:] + values[:-1])
    return jnp.concatenate([jnp.cumsum(pieces[::-1])[::-1], jnp.zeros(1)])
