"""The unsteady flow as a time step sees it: station speeds, their integral from the inlet, and derivatives.

    p_k = P_in - rho [ (U_k^2 - U^2)/2 + d psi_k/dt ],      psi_k = integral_in^k U ds

psi rather than U is differentiated in time. Its value at the outlet is a momentum: it changes by bounded forces only, whereas U falls by orders of
magnitude within a step when lips slam, and a scheme for U then throws it to negative values, at which the ideal jet runs away.
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

    def velocity(self, area: np.ndarray, rate: np.ndarray, inlet: float, psi_weight: float, psi_known: float) -> float:
        """Inlet velocity at which the outlet pressure vanishes if d psi/dt = psi_weight psi + psi_known at the outlet.

        Quadratic in the velocity; the root is taken at which more velocity means less pressure. The other one is a reversed jet, which would run away.
        Not a number if there is none.
        """
        still, moving = self.state(area, rate, 0.0), self.state(area, rate, 1.0)
        s0, s1 = still.speed[0], moving.speed[0] - still.speed[0]
        a = 0.5 * (s1 * s1 - 1.0)
        b = s0 * s1 + psi_weight * (moving.psi[0] - still.psi[0])
        c = 0.5 * s0 * s0 + psi_weight * still.psi[0] + psi_known - inlet / self.density
        square = b * b - 4.0 * a * c
        if square < 0.0:
            return np.nan
        root = np.sqrt(square)
        return -2.0 * c / (b + root) if b >= 0.0 else (root - b) / (2.0 * a)

    def pressure(self, flow: FlowState, psi_rate: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa; the first, at the outlet, is to vanish."""
        speed = flow.speed
        return inlet - self.density * (0.5 * (speed * speed - speed[-1] ** 2) + psi_rate)

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

    def pressure_slopes(self, area, rate, velocity: float, weight: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of the pressures where the rate of psi depends on psi by `weight`, 1/s."""
        speed = self.state(area, rate, velocity).speed
        found = []
        for slope, own in zip(self.slopes(area, rate, velocity), (0.0, 0.0, 1.0)):
            column = slope.reshape(len(speed), -1)
            change = speed[:, None] * column - speed[-1] * column[-1] + weight * self.integrate(column)
            found.append(-self.density * change.reshape(slope.shape))
        return tuple(found)
