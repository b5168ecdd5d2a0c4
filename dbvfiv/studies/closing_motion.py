"""The valve with contact of its inner faces in motion, and a flow that may turn round."""
from __future__ import annotations

from functools import cached_property

import numpy as np

from ..case.model import Case
from ..contact import ContactLaw, PlaneContact, nodal_thickness, tributary_area
from ..model import ValveModel
from ..model.dynamics import Conditions
from ..transient.equations import ValveMotion
from ..transient.fluid import MovingFluid
from .closure_model import ROUNDING


class ContactValve(ValveModel):
    """The coupled valve with its inner faces against the closing plane in place of lip stops.

    The contact is a penalty without multipliers: in motion the penetration is seen and reported, not removed.
    """

    def __init__(self, case: Case):
        super().__init__(case.replace({"supports.lip_stop": False}))
        closure, nodes = case.closure, np.arange(len(self.mesh.nodes))
        law = ContactLaw(max(*closure.pressures, closure.open_pressure) / closure.contact_depth, ROUNDING * closure.contact_depth)
        self.contact = PlaneContact(
            self.shell, nodes, 0.5 * nodal_thickness(self.shell), tributary_area(self.shell), law, least_gap=case.valve.initial_gap
        )

    @cached_property
    def _free(self) -> np.ndarray:
        return np.zeros(self.contact.count)

    def contact_force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,) of the contact alone."""
        force, nodal = np.zeros(self.size), self.nodal(q)
        d, d1, _ = self.shell.directors(nodal)
        self.contact.add_force(force, nodal, d, d1, self._free)
        return force

    def contact_state(self, q: np.ndarray):
        nodal = self.nodal(q)
        return self.contact.state(nodal, self.shell.directors(nodal)[0], self._free)

    def contact_energy(self, q: np.ndarray) -> float:
        nodal = self.nodal(q)
        return self.contact.energy(nodal, self.shell.directors(nodal)[0], self._free)

    def residual(self, q, pressure):
        return super().residual(q, pressure) + self.contact_force(q)

    def structure(self, q):
        force, data = super().structure(q)
        nodal = self.nodal(q)
        self.contact.add_force_and_tangent(force, data, nodal, *self.shell.directors(nodal), self._free)
        return force, data


class ReversibleFluid(MovingFluid):
    """Flow that resists in both directions: U |U| in place of U^2.

    A jet leaves the lips with its velocity head and that is lost; flow drawn in through the lips loses it behind them as well. With U^2 a reversed flow
    would gain pressure where it should lose it, and run away.
    """

    def open_area(self, area: np.ndarray) -> np.ndarray:
        """Areas (m,) that the fluid sees: they stay above the channel's floor."""
        return self._open(area)[0]

    def velocity(self, mid, new, inlet, old, theta, psi_weight, psi_known) -> float:
        """New inlet velocity at which the outlet pressure vanishes; more velocity always means less pressure, so there is one."""
        s0, s1 = (float(part[0]) for part in self._affine(*mid))
        p0, p1 = (float(part) for part in self.integrate(np.stack(self._affine(*new), axis=1))[0])
        start = (1.0 - theta) * old  # the velocity where the equations are met is start + theta times the new one
        b = psi_weight * p1 / theta
        c = psi_weight * (p0 - p1 * start / theta) + psi_known - inlet / self.density
        # between the zeros of the two speeds the equation is a quadratic; the signs on the piece that holds its root are found first
        for low, high in _pieces(-s0 / s1):
            inside = high - 1.0 if low == -np.inf else low + 1.0 if high == np.inf else 0.5 * (low + high)
            outer, inner = np.sign(s0 + s1 * inside), np.sign(inside)
            roots = _roots(0.5 * (outer * s1 * s1 - inner), outer * s0 * s1 + b, 0.5 * outer * s0 * s0 + c)
            for root in roots:
                if low - 1e-12 <= root <= high + 1e-12:
                    return float((root - start) / theta)
        return np.nan

    @staticmethod
    def head(speed):
        return 0.5 * speed * np.abs(speed)

    @staticmethod
    def head_slope(speed):
        return np.abs(speed)


def _pieces(zero: float) -> list[tuple[float, float]]:
    low, high = min(zero, 0.0), max(zero, 0.0)
    return [(-np.inf, low), (low, high), (high, np.inf)] if high > low else [(-np.inf, low), (low, np.inf)]


def _roots(a: float, b: float, c: float) -> list[float]:
    """Real zeros of a x^2 + b x + c without cancellation."""
    if a == 0.0:
        return [-c / b] if b else []
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    half = -0.5 * (b + np.copysign(np.sqrt(square), b if b else 1.0))
    return [half / a, c / half] if half else [0.0]


class ClosingMotion(ValveMotion):
    """Equations of motion of a `ContactValve`."""

    def __init__(self, model: ContactValve, conditions: Conditions | None = None):
        super().__init__(model, conditions)
        if self.moving_fluid:
            self.fluid = ReversibleFluid(model.flow, self.conditions.density)

    def internal_force(self, q):
        return self.model.shell.force(q) + self.model.contact_force(q)

    def energies(self, q, v):
        kinetic, strain, _ = super().energies(q, v)
        return kinetic, strain, self.model.contact_energy(q)
