"""The valve as a System whose two parameters are the coordinates of a stability map, 0..1 along each axis, logarithmic
where the axis is.

Time is counted in units of 1/`RATE`, so that angular frequencies are of the size of the coordinates and arclength
weighs them alike.
"""

from __future__ import annotations

import gc
import math

import numpy as np

from continuation import SystemBase

from ..case.parameters import DESIGN, PARAMETERS
from ..model.system import ValveSystem
from .map_column import MapPlan

#: Angular frequency that counts as 1, rad/s.
RATE = 2 * math.pi * 100.0


class _Slowed:
    """A linearisation with its mass times `RATE`: eigenvalues are divided by it."""

    def __init__(self, inner):
        self._inner = inner
        self.size = inner.size
        for name in ("matvec", "rmatvec", "solve", "solve_transpose"):
            setattr(self, name, getattr(inner, name))

    def mass_matvec(self, x):
        return RATE * self._inner.mass_matvec(x)

    def mass_rmatvec(self, x):
        return RATE * self._inner.mass_rmatvec(x)

    def shifted(self, shift: complex):
        return self._inner.shifted(RATE * shift)


class PlaneSystem(SystemBase):
    """Chain rule around a `ValveSystem`.

    Parameters
    ----------
    valve : ValveSystem
    plan : MapPlan
    law : float
        Blend of the continuity laws where that is no axis.
    """

    constant_mass = False
    parameter_step = 1e-6

    def __init__(self, valve: ValveSystem, plan: MapPlan, law: float):
        self.valve, self.plan, self.law = valve, plan, law
        self.size = valve.size
        self.state_weights = valve.state_weights
        self._axes = {"x": plan.x, "y": plan.y}

    def residual_norm(self, residual) -> float:
        return self.valve.residual_norm(residual)

    def mu(self, plane) -> dict[str, float]:
        """Parameters of the valve at coordinates {"x", "y"}."""
        plan = self.plan
        named = {axis.parameter: plan.value(axis, plane[key]) for key, axis in self._axes.items()}
        return plan.base.at(**({"storage": self.law} | named)).mu()

    def _rate(self, plane, key: str) -> tuple[str, float]:
        """Name of the valve's parameter and its derivative along a coordinate."""
        axis = self._axes[key]
        a, b = axis.values[0], axis.values[-1]
        rate = self.plan.value(axis, plane[key]) * math.log(b / a) if axis.log else b - a
        return PARAMETERS[axis.parameter].system_name or axis.parameter, rate

    def state(self, q: np.ndarray, plane) -> np.ndarray:
        return self.valve.state(q, self.mu(plane))

    def residual(self, u, mu):
        return self.valve.residual(u, self.mu(mu))

    def linear(self, u, mu):
        # factorisations hold each other in cycles and are large: free those of earlier points before the next
        gc.collect()
        return _Slowed(self.valve.linear(u, self.mu(mu)))

    def d_parameter(self, u, mu, name):
        inner, rate = self._rate(mu, name)
        return (
            super().d_parameter(u, mu, name)
            if inner in DESIGN
            else rate * self.valve.d_parameter(u, self.mu(mu), inner)
        )

    def d2(self, u, mu, a, b):
        return self.valve.d2(u, self.mu(mu), a, b)

    def d3(self, u, mu, a, b, c):
        return self.valve.d3(u, self.mu(mu), a, b, c)

    def d2_parameter(self, u, mu, name, a):
        inner, rate = self._rate(mu, name)
        return (
            super().d2_parameter(u, mu, name, a)
            if inner in DESIGN
            else rate * self.valve.d2_parameter(u, self.mu(mu), inner, a)
        )

    def mass_d(self, u, mu, c, a):
        return RATE * self.valve.mass_d(u, self.mu(mu), c, a)

    def mass_d2(self, u, mu, c, a, b):
        return RATE * self.valve.mass_d2(u, self.mu(mu), c, a, b)

    def mass_parameter(self, u, mu, name, c):
        inner, rate = self._rate(mu, name)
        if inner not in DESIGN:
            return RATE * rate * self.valve.mass_parameter(u, self.mu(mu), inner, c)
        up, down, width = self._sides(mu, name)
        return (self.linear(u, up).mass_matvec(c) - self.linear(u, down).mass_matvec(c)) / width
