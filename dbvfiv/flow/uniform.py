"""One pressure on all stations, without flow."""

from __future__ import annotations

import jax.numpy as jnp

from .law import FlowLaw, FlowParameter


class UniformLoad(FlowLaw):
    """A uniform pressure without flow: no inner unknowns, p = sign * P at every station.

    Parameters
    ----------
    count : int
        Number of stations.
    sign : +1 (inside) or -1 (outside)
    """

    DATA = ("sign",)
    STATIC = ("_count",)
    has_fluid = False
    unsteady = False

    def __init__(self, count: int, sign: float):
        self._count = int(count)
        self.sign = float(sign)

    @property
    def count(self) -> int:
        return self._count

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter("inlet", "Pa", "pressure on the wall"),)

    def equations(self, motion, parameters):
        return jnp.full(self._count, self.sign * parameters["inlet"]), jnp.zeros(0)
