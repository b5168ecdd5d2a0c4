"""One streamline of an incompressible, inviscid fluid without gravity (Th. 4.1-4.10).

    p_k = P_in - rho [ (U_k^2 - U^2)/2 + d/dt integral_in^k U ds ],      p_outlet = 0

Stations run from the outlet (first) to the inlet (last) and keep their places along the axis, as in the thesis's
program (App. A). U is the inlet velocity. Continuity is blended between two laws by `storage` in 0..1: A_k U_k = A_in U
- storage * integral_in^k dA/dt ds, so 0 is the quasi-steady law of the thesis and 1 the conservation of volume under
moving walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np


@dataclass(frozen=True)
class FluidOperators:
    """Linearised flow about a steady state: with a the area and u the inlet-velocity disturbances,

    p = (area0 + lambda area1 + lambda^2 area2) a + (velocity0 + lambda velocity1) u,   p_outlet = 0.

    Attributes
    ----------
    area0, area1, area2 : (m, m) arrays, Pa/m2, Pa s/m2, Pa s2/m2
    velocity0, velocity1 : (m,) arrays, Pa s/m, Pa s2/m
    """

    area0: np.ndarray
    area1: np.ndarray
    area2: np.ndarray
    velocity0: np.ndarray
    velocity1: np.ndarray


class Channel:
    """Flow through m stations.

    Parameters
    ----------
    z : (m,) array
        Axial positions from the outlet to the inlet, m, increasing.
    floor : float
        Smallest area, m2: the passage narrows towards it smoothly as the wall's area falls to zero and below, so a
        closed valve stays finite.
    storage : float
        Blend of the continuity laws, 0 quasi-steady, 1 storage.
    unsteady : bool
        Keep the term d/dt integral U ds.
    """

    def __init__(self, z: np.ndarray, floor: float, storage: float = 0.0, unsteady: bool = True):
        self.step = np.diff(np.asarray(z, float))
        if np.any(self.step <= 0):
            raise ValueError("The stations of a channel must have increasing positions from the outlet to the inlet.")
        self.z = np.asarray(z, float)
        self.floor = float(floor)
        self.storage = float(storage)
        self.unsteady = bool(unsteady)

    @property
    def count(self) -> int:
        return len(self.z)

    # -- steady flow
    # ----

    def steady_pressure(self, area: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa, of steady flow driven by the inlet pressure, Pa; independent of the fluid's density."""
        return np.asarray(_steady(area, inlet, self.floor))

    def steady_operator(self, area: np.ndarray, inlet: float) -> tuple[np.ndarray, np.ndarray]:
        """Steady pressures (m,) and their derivative (m, m) with respect to the areas."""
        pressure, slope = _steady_both(area, inlet, self.floor)
        return np.asarray(pressure), np.asarray(slope)

    def steady_second(self, area, inlet, a, b) -> np.ndarray:
        """Second directional derivative (m,) of the steady pressures along a and b (m,)."""
        return np.asarray(_steady_second(area, inlet, a, b, self.floor))

    def steady_third(self, area, inlet, a, b, c) -> np.ndarray:
        """Third directional derivative (m,) of the steady pressures."""
        return np.asarray(_steady_third(area, inlet, a, b, c, self.floor))

    def inlet_velocity(self, area: np.ndarray, inlet: float, density: float) -> float:
        """Steady inlet velocity, m/s."""
        open_ = np.asarray(_open(jnp.asarray(area), self.floor))
        ratio = (open_[-1] / open_[0]) ** 2 - 1.0
        return float(np.sqrt(2.0 * inlet / (density * ratio))) if ratio > 0 else np.inf

    def velocities(self, area: np.ndarray, velocity: float) -> np.ndarray:
        """Steady velocities (m,) at all stations from the inlet velocity."""
        open_ = np.asarray(_open(jnp.asarray(area), self.floor))
        return velocity * open_[-1] / open_

    # -- unsteady flow
    # ----

    def pressure(self, area, rate, acceleration, velocity, velocity_rate, inlet, density) -> np.ndarray:
        """Pressures (m,), Pa, for areas (m,), their first and second time derivatives, the inlet velocity and its rate.

        The first entry is the outlet pressure, which the flow equation sets to zero.
        """
        return np.asarray(
            _pressure(
                self.step,
                self.floor,
                self.storage,
                self.unsteady,
                area,
                rate,
                acceleration,
                velocity,
                velocity_rate,
                inlet,
                density,
            )
        )

    def operators(
        self, area, inlet: float, density: float, rate=None, acceleration=None, velocity=None, velocity_rate=0.0
    ) -> FluidOperators:
        """Linearisation at a state; at the steady state of these areas unless rates are given."""
        zero = np.zeros(self.count)
        rate = zero if rate is None else rate
        acceleration = zero if acceleration is None else acceleration
        velocity = self.inlet_velocity(area, inlet, density) if velocity is None else velocity
        parts = _operators(
            self.step,
            self.floor,
            self.storage,
            self.unsteady,
            area,
            rate,
            acceleration,
            velocity,
            velocity_rate,
            inlet,
            density,
        )
        return FluidOperators(*(np.asarray(part) for part in parts))


class UniformLoad:
    """A uniform pressure without flow, in place of a `Channel`.

    Parameters
    ----------
    count : int
        Number of stations.
    sign : +1 (inside) or -1 (outside)
    """

    def __init__(self, count: int, sign: float):
        self.count = count
        self.sign = float(sign)

    def steady_pressure(self, area, inlet):
        return np.full(self.count, self.sign * inlet)

    def steady_operator(self, area, inlet):
        return self.steady_pressure(area, inlet), np.zeros((self.count, self.count))

    def steady_second(self, area, inlet, a, b):
        return np.zeros(self.count)

    def steady_third(self, area, inlet, a, b, c):
        return np.zeros(self.count)

    def inlet_velocity(self, area, inlet, density):
        return 0.0

    def velocities(self, area, velocity):
        return np.zeros(self.count)


def _open(area, floor):
    """Area that stays above the floor: floor + softplus(area - floor), within 1e-8 of the area from twenty floors
    upwards.
    """
    return floor * (1.0 + jax.nn.softplus(area / floor - 1.0))


@jax.jit
def _steady(area, inlet, floor):
    inverse = _open(area, floor) ** -2.0
    return inlet * (inverse[0] - inverse) / (inverse[0] - inverse[-1])


@jax.jit
def _steady_both(area, inlet, floor):
    return _steady(area, inlet, floor), jax.jacfwd(_steady)(area, inlet, floor)


def _along(function, *directions):
    for direction in directions:
        function = partial(lambda inner, v, u: jax.jvp(inner, (u,), (v,))[1], function, direction)
    return function


@jax.jit
def _steady_second(area, inlet, a, b, floor):
    return _along(lambda x: _steady(x, inlet, floor), a, b)(area)


@jax.jit
def _steady_third(area, inlet, a, b, c, floor):
    return _along(lambda x: _steady(x, inlet, floor), a, b, c)(area)


def _upstream(step, values):
    """Trapezoidal integral of values (m,) from the inlet (last) to each station."""
    pieces = 0.5 * step * (values[1:] + values[:-1])
    return jnp.concatenate([jnp.cumsum(pieces[::-1])[::-1], jnp.zeros(1)])


def _flow(step, floor, storage, area, rate, velocity):
    """Velocities at the stations and their integral from the inlet."""
    open_, opening = jax.jvp(lambda a: _open(a, floor), (area,), (rate,))
    discharge = open_[-1] * velocity - storage * _upstream(step, opening)
    speed = discharge / open_
    return speed, _upstream(step, speed)


@partial(jax.jit, static_argnums=(3,))
def _pressure(step, floor, storage, unsteady, area, rate, acceleration, velocity, velocity_rate, inlet, density):
    flow = partial(_flow, step, floor, storage if unsteady else 0.0)
    (speed, _), (_, inertia) = jax.jvp(flow, (area, rate, velocity), (rate, acceleration, velocity_rate))
    if not unsteady:
        inertia = 0.0
    return inlet - density * (0.5 * (speed**2 - velocity**2) + inertia)


@partial(jax.jit, static_argnums=(3,))
def _operators(step, floor, storage, unsteady, area, rate, acceleration, velocity, velocity_rate, inlet, density):
    def pressure(*state):
        return _pressure(step, floor, storage, unsteady, *state, inlet, density)

    state = (area, rate, acceleration, jnp.asarray(velocity, float), jnp.asarray(velocity_rate, float))
    return jax.jacfwd(pressure, argnums=(0, 1, 2, 3, 4))(*state)
