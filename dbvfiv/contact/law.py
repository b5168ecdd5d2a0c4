"""From gap to contact pressure: penalty with augmented-Lagrangian multipliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class ContactLaw:
    """t = penalty * ramp(multiplier / penalty - gap): the augmented Lagrangian of g >= 0, t >= 0, t g = 0 (Alart &
    Curnier 1991).

    Attributes
    ----------
    penalty : float, Pa/m
        The contact pressure follows the penetration with this slope; updates of the multipliers remove what penetration
        is left.
    rounding : float, m
        Half width over which the kink of the ramp is rounded by a parabola, so that the tangent is continuous; 0 keeps
        the kink.
    """

    penalty: float
    rounding: float = 0.0

    def __post_init__(self):
        if not self.penalty > 0:
            raise ValueError(f"The contact penalty must be positive, not {self.penalty:g} Pa/m.")
        if not self.rounding >= 0:
            raise ValueError(f"The rounding of the contact law cannot be negative, as {self.rounding:g} m is.")

    def respond(self, gap: np.ndarray, multiplier: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Potential (J/m2), contact pressure (Pa) and stiffness (Pa/m), each (k,), at gaps (k,) and multipliers (k,).

        Pressure and stiffness are the first and second derivatives of the potential with respect to the penetration.
        """
        x = multiplier / self.penalty - gap
        w = self.rounding
        if w == 0.0:
            positive = x > 0
            ramp, slope = np.where(positive, x, 0.0), positive.astype(float)
            area = 0.5 * ramp**2
        else:
            inside, beyond = np.abs(x) < w, x >= w
            ramp = np.where(beyond, x, np.where(inside, (x + w) ** 2 / (4 * w), 0.0))
            slope = np.where(beyond, 1.0, np.where(inside, (x + w) / (2 * w), 0.0))
            area = np.where(beyond, 0.5 * x**2 + w**2 / 6, np.where(inside, (x + w) ** 3 / (12 * w), 0.0))
        return self.penalty * area, self.penalty * ramp, self.penalty * slope
