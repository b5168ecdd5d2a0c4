"""The unsteady flow as a time step sees it: station speeds, their integral from the inlet, and derivatives.

    p_k = P_in - rho [ head_k + d psi_k/dt ],      psi_k = integral_in^k U ds

psi rather than U is differentiated in time. Its value at the outlet is a momentum: it changes by bounded forces only,
whereas U falls by orders of magnitude within a step when lips slam, and a scheme for U then throws it to negative
values, at which the ideal jet runs away. Numpy forms of the definition in `dbvfiv.flow.channel`, for speed: a step asks
for them several times. Terms of a channel are evaluated by their definition.

The unknown of a step is one number, the inlet velocity: it is eliminated by a scalar root, which is what lets a step
choose between an outward flow and one drawn in. Laws with more unknowns have no evaluators here.

Equation (T.9) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import jax
import numpy as np

from .term import wall_share

if TYPE_CHECKING:
    from .channel import Channel


@dataclass(frozen=True)
class FlowState:
    """Flow at one instant.

    Attributes
    ----------
    speed : (m,) array
        Velocities at the stations, m/s, from outlet to inlet.
    psi : (m,) array
        m2/s.
    lost : (m,) array or 0
        Heads that terms of the law take, m2/s2.
    """

    speed: np.ndarray
    psi: np.ndarray
    lost: np.ndarray | float = 0.0


class MovingFluid:
    """Flow through a channel whose areas move.

    Parameters
    ----------
    channel : Channel
    density : float, kg/m3
    """

    def __init__(self, channel: Channel, density: float):
        self.channel, self.density = channel, float(density)
        count = channel.count
        self._upstream = np.zeros((count, count))
        for k in range(count):
            self._upstream[k, k:-1] += 0.5 * channel.step[k:]
            self._upstream[k, k + 1 :] += 0.5 * channel.step[k:]
        self._bow = np.zeros((count, count))
        if channel.bowed:
            self._bow = np.asarray(jax.vmap(lambda speed: wall_share(channel.step, speed), 1, 1)(np.eye(count)))
        self._momentum = self._upstream + self._bow
        self._parameters = channel.values({"inlet": 0.0, "density": self.density})

    def _open(self, area: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Open area with first and second derivative; see `dbvfiv.flow.law.above_floor`."""
        floor = self.channel.floor
        x = area / floor - 1.0
        rise = np.exp(-np.abs(x))
        softplus = np.maximum(x, 0.0) + np.log1p(rise)
        slope = np.where(x >= 0, 1.0, rise) / (1.0 + rise)
        return floor * (1.0 + softplus), slope, slope * (1.0 - slope) / floor

    def open_area(self, area: np.ndarray) -> np.ndarray:
        """Areas (m,) that the fluid sees: they stay above the channel's floor."""
        return self._open(area)[0]

    def _terms(self, area, rate, velocity: float) -> tuple[np.ndarray, np.ndarray]:
        """Heads and momenta (m,) that the terms add."""
        head, momentum = _term_values(self.channel, self._parameters, area, rate, float(velocity))
        return np.asarray(head), np.asarray(momentum)

    def _term_slopes(self, area, rate, velocity: float):
        """Their derivatives by areas (m, m), rates (m, m) and inlet velocity (m,): three of each."""
        parts = _term_slopes(self.channel, self._parameters, area, rate, float(velocity))
        return tuple(tuple(np.asarray(part) for part in one) for one in parts)

    def state(self, area: np.ndarray, rate: np.ndarray, velocity: float) -> FlowState:
        """Flow for areas and their rates (m,) and the inlet velocity."""
        open_, slope, _ = self._open(area)
        discharge = open_[-1] * velocity
        if self.channel.storage:
            discharge = discharge - self.channel.storage * (self._upstream @ (slope * rate))
        speed = discharge / open_
        psi = self.integrate(speed)
        if not self.channel.terms:
            return FlowState(speed, psi)
        lost, momentum = self._terms(area, rate, velocity)
        return FlowState(speed, psi + momentum, lost)

    def velocity(
        self, mid: tuple, new: tuple, inlet: float, old: float, theta: float, psi_weight: float, psi_known: float
    ) -> float:
        """New inlet velocity at which the outlet pressure vanishes.

        Quadratic in the velocity; the root is taken at which more velocity means less pressure. The other one is a
        reversed jet, which would run away. Not a number if there is none.

        Parameters
        ----------
        mid, new : pairs of (m,) arrays
            Areas and their rates where the equations are met and at the end of the step.
        old : float
            Inlet velocity at the start of the step.
        theta : float
            Where in the step the equations are met.
        psi_weight, psi_known : float
            There, d psi/dt = psi_weight psi + psi_known at the outlet, psi at the end of the step.
        """
        if self.channel.terms:
            return self._searched(mid, new, inlet, old, theta, psi_weight, psi_known)
        s0, s1 = self._affine(*mid)
        p0, p1 = (self._upstream[0] @ part for part in self._affine(*new))
        start = (1.0 - theta) * old
        a = 0.5 * (s1[0] * s1[0] - 1.0)
        b = s0[0] * s1[0] + psi_weight * p1 / theta
        c = 0.5 * s0[0] * s0[0] + psi_weight * (p0 - p1 * start / theta) + psi_known - self._driving(inlet)
        square = b * b - 4.0 * a * c
        if not square >= 0.0:
            return np.nan
        root = np.sqrt(square)
        mean = -2.0 * c / (b + root) if b >= 0.0 else (root - b) / (2.0 * a)
        return float((mean - start) / theta)

    def _searched(self, mid, new, inlet, old, theta, psi_weight, psi_known, supply=None) -> float:
        """New inlet velocity at which the outlet pressure vanishes, next to the old one in the direction in which that
        misses it; arguments as `velocity` has them.

        With a `supply`, which is anything with the method `at` of `dbvfiv.flow.line_stepping.LineStep`, the pressure at
        the flange follows from the velocity there, and `inlet` comes on top.
        """
        still, unit = self._affine(*mid)
        start = (1.0 - theta) * old  # the velocity where the equations are met is start + theta times the new one
        p0, p1 = (float(part) for part in self.integrate(np.stack(self._affine(*new), axis=1))[0])
        rise = psi_weight * p1 / theta
        known = psi_weight * (p0 - p1 * start / theta) + psi_known - self._driving(inlet)

        def missing(u: float) -> tuple[float, float]:
            speed = still + u * unit
            value = float(self.head(speed)[0]) + rise * u + known
            slope = float(self.head_slope(speed, unit)[0]) + rise
            if self.channel.terms:
                end = (u - start) / theta
                value += self._terms(*mid, u)[0][0] + psi_weight * self._terms(*new, end)[1][0]
                slope += self._term_slopes(*mid, u)[0][2][0]
                slope += psi_weight * self._term_slopes(*new, end)[1][2][0] / theta
            if supply is not None:
                head, rise_of_head = supply.at(u)
                value += 0.5 * u * u - head
                slope += u - rise_of_head
            return value, slope

        return (_zero(missing, old) - start) / theta

    def _affine(self, area: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds at rest and per unit of inlet velocity (m,)."""
        open_, slope, _ = self._open(area)
        still = np.zeros_like(area)
        if self.channel.storage:
            still = -self.channel.storage * (self._upstream @ (slope * rate)) / open_
        return still, open_[-1] / open_

    def pressure(self, flow: FlowState, psi_rate: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa; the first, at the outlet, is to vanish."""
        channel = self.channel
        return inlet - channel.back - self.density * (self._whole_head(flow) + psi_rate) + channel.static

    def _driving(self, inlet: float) -> float:
        """Driving pressure over density, m2/s2."""
        return (inlet - self.channel.back) / self.density

    def _whole_head(self, flow: FlowState) -> np.ndarray:
        head = self.head(flow.speed)
        return head + flow.lost if self.channel.terms else head

    def head(self, speed: np.ndarray) -> np.ndarray:
        """Velocity head between the inlet and each station (m,), m2/s2, of speeds (m,): pressure over density."""
        return 0.5 * (speed * speed - speed[-1] ** 2)

    def head_slope(self, speed: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Its derivative along changes (m,) or (m, l) of the speeds."""
        products = (speed * change.T).T
        return products - products[-1]

    def slopes(self, area: np.ndarray, rate: np.ndarray, velocity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of the speeds with respect to areas (m, m), area rates (m, m) and inlet velocity (m,)."""
        open_, slope, bend = self._open(area)
        speed = self.state(area, rate, velocity).speed
        by_area = -np.diag(speed * slope / open_)
        by_area[:, -1] += slope[-1] * velocity / open_
        by_rate = np.zeros_like(by_area)
        if self.channel.storage:
            share = self.channel.storage * self._upstream / open_[:, None]
            by_area -= share * (bend * rate)
            by_rate -= share * slope
        return by_area, by_rate, open_[-1] / open_

    def psi_slopes(self, area, rate, velocity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of psi with respect to areas (m, m), area rates (m, m) and inlet velocity (m,)."""
        found = tuple(self.integrate(slope) for slope in self.slopes(area, rate, velocity))
        if not self.channel.terms:
            return found
        return tuple(own + more for own, more in zip(found, self._term_slopes(area, rate, velocity)[1]))

    def integrate(self, values: np.ndarray) -> np.ndarray:
        """Integral from the inlet to each station of speeds (m,) or of each column (m, l), as the wall feels it."""
        return self._momentum @ values

    def momenta(self, psi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Momentum per density and area of the fluid between stations (m - 1,), m2/s, by psi and the speeds; without
        what a bow of psi, which the wall feels, takes from one section and gives to the next.
        """
        return -np.diff(psi - self._bow @ speed)

    def pressure_slopes(
        self, mid: tuple, new: tuple, speed: float, new_speed: float, theta: float, velocity: float, psi_weight: float
    ):
        """Derivatives of the pressures with respect to the new areas (m, m) and the new inlet velocity (m,).

        Parameters
        ----------
        mid, new, theta, psi_weight
            As `velocity` has them.
        speed, new_speed : float
            Inlet velocities where the equations are met and at the end of the step.
        velocity : float
            Derivative of the area rates with respect to the areas at the end of the step, 1/s.
        """
        here = self.state(*mid, speed).speed
        area, rate, own = self.slopes(*mid, speed)
        by_area = theta * self.head_slope(here, area + velocity * rate)
        by_speed = theta * self.head_slope(here, own)
        if self.channel.terms:
            area, rate, own = self._term_slopes(*mid, speed)[0]
            by_area, by_speed = by_area + theta * (area + velocity * rate), by_speed + theta * own
        area, rate, own = self.slopes(*new, new_speed)
        by_area += psi_weight * self.integrate(area + velocity * rate)
        by_speed += psi_weight * self.integrate(own)
        if self.channel.terms:
            area, rate, own = self._term_slopes(*new, new_speed)[1]
            by_area, by_speed = by_area + psi_weight * (area + velocity * rate), by_speed + psi_weight * own
        return -self.density * by_area, -self.density * by_speed


def _term_parts(channel, parameters, area, rate, velocity):
    speed = channel.speeds(area, rate, velocity, parameters["storage"])
    stream = channel.stream(area, rate, speed, velocity[None])
    return channel.term_heads(stream, parameters), channel.term_momenta(stream, parameters)


@jax.jit
def _term_values(channel, parameters, area, rate, velocity):
    return _term_parts(channel, parameters, area, rate, jax.numpy.asarray(velocity))


@jax.jit
def _term_slopes(channel, parameters, area, rate, velocity):
    return jax.jacfwd(_term_parts, argnums=(2, 3, 4))(channel, parameters, area, rate, jax.numpy.asarray(velocity))


#: Inlet velocity, m/s, beyond which no zero is looked for.
_RUNAWAY = 1e12


def _zero(function, start: float) -> float:
    """Zero of a function that grows from minus to plus infinity, next to a start; `function` returns value and slope.
    Not a number if there is none.

    Newton's method within a bracket, bisection where it leaves it or slackens.
    """
    value, _ = function(start)
    if value == 0.0 or not np.isfinite(value):
        return start if value == 0.0 else np.nan
    far, reach = start, -np.sign(value) * max(1e-3, 0.1 * abs(start))
    while function(far)[0] * value > 0.0:
        far, reach = far + reach, 2.0 * reach
        if not abs(far) < _RUNAWAY:
            return np.nan
    low, high = (far, start) if value > 0.0 else (start, far)
    u, last = start, high - low
    for _ in range(200):
        value, slope = function(u)
        if value == 0.0:
            return u
        low, high = (low, u) if value > 0.0 else (u, high)
        step = -value / slope if slope else np.inf
        if not (low <= u + step <= high and abs(step) <= 0.5 * abs(last)):
            step = 0.5 * (low + high) - u
        if u + step == u:
            break
        u, last = u + step, step
    return u
