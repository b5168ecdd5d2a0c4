"""The unsteady flow of a time step when it may turn round, as a whole or in a part of the valve.

Evaluators of `dbvfiv.flow.heads.reversible_head`, beside those of the ordinary flow.
"""

from __future__ import annotations

import numpy as np

from .stepping import MovingFluid


class ReversibleFluid(MovingFluid):
    """Flow that may run backwards.

    Outwards it is that of the ordinary fluid. Drawn in through the lips, it starts from rest outside, where the
    pressure vanishes, gains speed at the cost of pressure as far as sections get narrower, and wherever they widen it
    goes on as a jet whose velocity head is lost. The ordinary law would give that head back at the inlet, so that a
    reversed flow gained pressure where it should lose it, and ran away.
    """

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
        outward with it, else the one next to the old one, in the direction in which that misses it.
        """
        outward = super().velocity(mid, new, inlet, old, theta, psi_weight, psi_known)
        if self.channel.terms:
            return outward
        still, unit = self._affine(*mid)
        start = (1.0 - theta) * old
        if np.min(still + (start + theta * outward) * unit) >= 0.0:
            return outward
        return self._searched(mid, new, inlet, old, theta, psi_weight, psi_known)


def _upstream(values: np.ndarray) -> np.ndarray:
    """Sums of values (m, ...) from each station to the inlet."""
    return np.cumsum(values[::-1], axis=0)[::-1]
