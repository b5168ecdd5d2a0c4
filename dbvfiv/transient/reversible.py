"""The unsteady flow when it may turn round, as a whole or in a part of the valve."""

from __future__ import annotations

import numpy as np

from .fluid import MovingFluid


class ReversibleFluid(MovingFluid):
    """Flow that may run backwards.

    Outwards it is that of the ordinary fluid. Drawn in through the lips, it starts from rest outside, where the
    pressure vanishes, gains speed at the cost of pressure as far as sections get narrower, and wherever they widen it
    goes on as a jet whose velocity head is lost. The ordinary law would give that head back at the inlet, so that a
    reversed flow gained pressure where it should lose it, and ran away.
    """

    def open_area(self, area: np.ndarray) -> np.ndarray:
        """Areas (m,) that the fluid sees: they stay above the channel's floor."""
        return self._open(area)[0]

    def head(self, speed):
        if speed.min() >= 0.0:
            return super().head(speed)
        out, back = np.maximum(speed, 0.0), np.minimum(speed, 0.0)
        head = 0.5 * (out * out - out[-1] ** 2)
        head[:-1] -= 0.5 * _upstream(np.maximum(np.diff(back * back), 0.0))
        head[0] -= 0.5 * back[0] ** 2  # what stands for the outlet is the still water outside
        return head

    def head_slope(self, speed, change):
        if speed.min() >= 0.0:
            return super().head_slope(speed, change)
        out, back = np.maximum(speed, 0.0), np.minimum(speed, 0.0)
        slope = (out * change.T).T
        slope -= slope[-1]
        gains = ((np.diff(back * back) > 0.0) * np.diff(back * change.T)).T
        slope[:-1] -= _upstream(gains)
        slope[0] -= back[0] * change[0]
        return slope

    def velocity(self, mid, new, inlet, old, theta, psi_weight, psi_known) -> float:
        """New inlet velocity at which the pressure outside vanishes: that of the ordinary fluid if all speeds are
        outward with it, else the one next to
        the old one, in the direction in which that misses it."""
        outward = super().velocity(mid, new, inlet, old, theta, psi_weight, psi_known)
        still, unit = self._affine(*mid)
        start = (1.0 - theta) * old  # the velocity where the equations are met is start + theta times the new one
        if np.min(still + (start + theta * outward) * unit) >= 0.0:
            return outward
        p0, p1 = (float(part) for part in self.integrate(np.stack(self._affine(*new), axis=1))[0])
        rise = psi_weight * p1 / theta
        known = psi_weight * (p0 - p1 * start / theta) + psi_known - inlet / self.density

        def missing(u: float) -> tuple[float, float]:
            speed = still + u * unit
            return float(self.head(speed)[0]) + rise * u + known, float(self.head_slope(speed, unit)[0]) + rise

        return (_zero(missing, old) - start) / theta


#: Inlet velocity, m/s, beyond which no zero is looked for.
_RUNAWAY = 1e12


def _upstream(values: np.ndarray) -> np.ndarray:
    """Sums of values (m, ...) from each station to the inlet."""
    return np.cumsum(values[::-1], axis=0)[::-1]


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
