"""Contact over a step in time: a pressure that neither feeds nor rings.

The mean pressure of a step between two gaps is the discrete gradient of the potential V per area (Simo & Tarnow 1992,
Gonzalez 1996),

    p = r(g') [V(g1) - V(g0)]/(g0 - g1),     r = 1 while faces close,     R + (1 - R)/(1 + (g'/v)^2) while they part

so that the work done on closing faces is stored to the last digit, whatever the step, and parting faces get back the
share R of it, the rebound resilience of their material. At rest r is 1 with no slope: equilibria and small motions
about them know nothing of R. Equation (T.27) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .plane import ContactLaw, PlaneContact

#: Speed of parting, m/s, above which faces lose energy: that of walls that creep apart is below it.
CREEP = 1e-3
#: Change of the gap over gap and rounding below which the mean is taken in the middle.
_SMALL = 1e-5


@dataclass(frozen=True)
class Rebound:
    """Energy that the contact gives back to parting faces.

    Attributes
    ----------
    share : float
        Share of the stored energy that is given back, 0 to 1.
    speed : float, m/s
        Parting speed from which on the rest is lost.
    """

    share: float = 1.0
    speed: float = CREEP

    def factor(self, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factor on the pressure (k,) at rates of the gaps (k,), m/s, and its derivative, s/m."""
        parting = np.maximum(rate, 0.0) / self.speed
        below = 1.0 / (1.0 + parting * parting)
        lost = 1.0 - self.share
        return self.share + lost * below, -2.0 * lost * parting * below * below / self.speed


def mean_pressure(law: ContactLaw, old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Discrete gradient of the potential between gaps (k,), Pa, and its derivative by the new gaps, Pa/m."""
    none = np.zeros_like(old)
    change = new - old
    small = np.abs(change) <= _SMALL * (np.abs(old) + law.rounding)
    over = np.where(small, 1.0, change)
    stored_old, _, _ = law.respond(old, none)
    stored, pressure, _ = law.respond(new, none)
    _, middle, stiffness = law.respond(0.5 * (old + new), none)
    mean = np.where(small, middle, (stored_old - stored) / over)
    return mean, np.where(small, -0.5 * stiffness, (pressure - mean) / over)


class ContactStep:
    """Contact of one step that starts from given nodal unknowns.

    Parameters
    ----------
    plane : PlaneContact
    nodal : (nn, c) array
        Where the step starts.
    h : float, s
    rebound : Rebound
    """

    def __init__(self, plane: PlaneContact, nodal: np.ndarray, h: float, rebound: Rebound = Rebound()):
        self.plane, self.h, self.rebound = plane, float(h), rebound
        self._nodal = nodal
        self._gap = plane.gap(nodal, plane.shell.directors(nodal)[0])
        self._energy = self._stored(self._gap)

    def _stored(self, gap: np.ndarray) -> float:
        return float(self.plane.area @ self.plane.law.respond(gap, np.zeros_like(gap))[0])

    def _pressure(self, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mean, slope = mean_pressure(self.plane.law, self._gap, gap)
        factor, bend = self.rebound.factor((gap - self._gap) / self.h)
        return factor * mean, factor * slope + bend * mean / self.h

    def force(self, nodal: np.ndarray) -> np.ndarray:
        """Internal force (n,) over a step that ends at nodal unknowns (nn, c).

        Gaps bend with the rotations; their slope is that in the middle, so that the work of the force misses pressure
        times the change of the gap by the third power of a director's turn.
        """
        plane = self.plane
        directors = plane.shell.directors
        pressure, _ = self._pressure(plane.gap(nodal, directors(nodal)[0]))
        force = np.zeros(plane.shell.size)
        if pressure.any():
            plane.add_pressure_force(force, pressure, directors(0.5 * (self._nodal + nodal))[1])
        return force

    def add_tangent(self, nodal: np.ndarray, data: np.ndarray, weight: float) -> None:
        """Add a multiple of the derivative of `force` by the new unknowns to values (nnz,) on the shell's pattern."""
        plane = self.plane
        directors = plane.shell.directors
        d, first, _ = directors(nodal)
        pressure, slope = self._pressure(plane.gap(nodal, d))
        if not (pressure.any() or slope.any()):
            return
        _, first_mid, second_mid = directors(0.5 * (self._nodal + nodal))
        block = -(plane.area * slope)[:, None, None] * plane.slope(first_mid)[:, :, None] * plane.slope(first)[:, None]
        block += 0.5 * plane.bending_blocks(pressure, second_mid)
        plane.add_blocks(data, weight * block)

    def stored(self, nodal: np.ndarray) -> float:
        """Energy gained by the contact up to nodal unknowns (nn, c), J."""
        return self._stored(self.plane.gap(nodal, self.plane.shell.directors(nodal)[0])) - self._energy
