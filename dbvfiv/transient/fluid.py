"""The unsteady flow as a time step sees it: station speeds, their integral from the inlet, and derivatives.

    p_k = P_in - rho [ (U_k^2 - U^2)/2 + d psi_k/dt ],      psi_k = integral_in^k U ds

psi rather than U is differentiated in time. Its value at the outlet is a momentum: it changes by bounded forces only,
whereas U falls by orders of magnitude within a step when lips slam, and a scheme for U then throws it to negative
values, at which the ideal jet runs away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flow import Channel


@dataclass(frozen=True)
class FlowState:
    """Velocities at the stations (m,), m/s, from outlet to inlet, and psi (m,), m2/s."""

    speed: np.ndarray
    psi: np.ndarray


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

    def _open(self, area: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Open area with first and second derivative; see `dbvfiv.flow.channel`."""
        floor = self.channel.floor
        x = area / floor - 1.0
        rise = np.exp(-np.abs(x))
        softplus = np.maximum(x, 0.0) + np.log1p(rise)
        slope = np.where(x >= 0, 1.0, rise) / (1.0 + rise)
        return floor * (1.0 + softplus), slope, slope * (1.0 - slope) / floor

    def state(self, area: np.ndarray, rate: np.ndarray, velocity: float) -> FlowState:
        """Flow for areas and their rates (m,) and the inlet velocity."""
        open_, slope, _ = self._open(area)
        discharge = open_[-1] * velocity
        if self.channel.storage:
            discharge = discharge - self.channel.storage * (self._upstream @ (slope * rate))
        speed = discharge / open_
        return FlowState(speed, self._upstream @ speed)

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
        s0, s1 = self._affine(*mid)
        p0, p1 = (self._upstream[0] @ part for part in self._affine(*new))
        start = (1.0 - theta) * old
        a = 0.5 * (s1[0] * s1[0] - 1.0)
        b = s0[0] * s1[0] + psi_weight * p1 / theta
        c = 0.5 * s0[0] * s0[0] + psi_weight * (p0 - p1 * start / theta) + psi_known - inlet / self.density
        square = b * b - 4.0 * a * c
        if not square >= 0.0:
            return np.nan
        root = np.sqrt(square)
        mean = -2.0 * c / (b + root) if b >= 0.0 else (root - b) / (2.0 * a)
        return float((mean - start) / theta)

    def _affine(self, area: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds at rest and per unit of inlet velocity (m,)."""
        open_, slope, _ = self._open(area)
        still = np.zeros_like(area)
        if self.channel.storage:
            still = -self.channel.storage * (self._upstream @ (slope * rate)) / open_
        return still, open_[-1] / open_

    def pressure(self, flow: FlowState, psi_rate: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa; the first, at the outlet, is to vanish."""
        return inlet - self.density * (self.head(flow.speed) + psi_rate)

    def head(self, speed: np.ndarray) -> np.ndarray:
        """What speeds (m,) cost on the way from the inlet to each station: pressure over density (m,), m2/s2."""
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

    def integrate(self, values: np.ndarray) -> np.ndarray:
        """Integral from the inlet to each station of values (m,) or of each column (m, l)."""
        return self._upstream @ values

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
        area, rate, own = self.slopes(*new, new_speed)
        by_area += psi_weight * self.integrate(area + velocity * rate)
        by_speed += psi_weight * self.integrate(own)
        return -self.density * by_area, -self.density * by_speed
