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
    """Flow that may run backwards.

    Outwards it is that of the ordinary fluid. Drawn in through the lips, it starts from rest outside, where the pressure vanishes, gains speed at the cost
    of pressure as far as sections get narrower, and wherever they widen it goes on as a jet whose velocity head is lost. The ordinary law would give that
    head back at the inlet, so that a reversed flow gained pressure where it should lose it, and ran away.
    """

    def open_area(self, area: np.ndarray) -> np.ndarray:
        """Areas (m,) that the fluid sees: they stay above the channel's floor."""
        return self._open(area)[0]

    def head(self, speed):
        out, back = np.maximum(speed, 0.0), np.minimum(speed, 0.0)
        head = 0.5 * (out * out - out[-1] ** 2)
        head[:-1] -= 0.5 * _upstream(np.maximum(np.diff(back * back), 0.0))
        head[0] -= 0.5 * back[0] ** 2  # what stands for the outlet is the still water outside
        return head

    def head_slope(self, speed, change):
        out, back = np.maximum(speed, 0.0), np.minimum(speed, 0.0)
        slope = (out * change.T).T
        slope -= slope[-1]
        gains = ((np.diff(back * back) > 0.0) * np.diff(back * change.T)).T
        slope[:-1] -= _upstream(gains)
        slope[0] -= back[0] * change[0]
        return slope

    def velocity(self, mid, new, inlet, old, theta, psi_weight, psi_known) -> float:
        """New inlet velocity at which the pressure outside vanishes: the one next to the old one, in the direction in which that misses it."""
        still, unit = self._affine(*mid)
        p0, p1 = (float(part) for part in self.integrate(np.stack(self._affine(*new), axis=1))[0])
        start = (1.0 - theta) * old  # the velocity where the equations are met is start + theta times the new one
        rise = psi_weight * p1 / theta
        known = psi_weight * (p0 - p1 * start / theta) + psi_known - inlet / self.density

        def missing(u: float) -> tuple[float, float]:
            speed = still + u * unit
            return float(self.head(speed)[0]) + rise * u + known, float(self.head_slope(speed, unit)[0]) + rise

        return (_zero(missing, old) - start) / theta


def _upstream(values: np.ndarray) -> np.ndarray:
    """Sums of values (m, ...) from each station to the inlet."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _zero(function, start: float) -> float:
    """Zero of a function that grows from minus to plus infinity, next to a start; `function` returns value and slope. Not a number if there is none.

    Newton's method within a bracket, bisection where it leaves it or slackens.
    """
    value, _ = function(start)
    if value == 0.0 or not np.isfinite(value):
        return start if value == 0.0 else np.nan
    far, reach = start, -np.sign(value) * max(1e-3, 0.1 * abs(start))
    while function(far)[0] * value > 0.0:
        far, reach = far + reach, 2.0 * reach
        if not np.isfinite(far):
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
