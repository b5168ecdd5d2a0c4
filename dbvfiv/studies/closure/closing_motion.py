"""The valve with contact of its inner faces in motion."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ...contact import ContactLaw, PlaneContact, nodal_thickness, tributary_area
from ...model import ValveModel
from ...motion.equations import ValveMotion
from ..case import Case
from .model import ROUNDING


class ContactValve(ValveModel):
    """The coupled valve with its inner faces against the closing plane in place of lip stops.

    The contact is a penalty without multipliers: in motion the penetration is seen and reported, not removed.
    """

    def __init__(self, case: Case):
        pump = {"upstream.pump": None} if case.has_pump else {}  # what reverses the pressure takes its place
        alone = {"supports.contact": "stops", "supports.lip_stop": False, "gravity.direction": "none"}
        super().__init__(case.replace(alone | pump))
        closure, nodes = case.closure, np.arange(len(self.mesh.nodes))
        law = ContactLaw(
            max(*closure.pressures, closure.open_pressure) / closure.contact_depth, ROUNDING * closure.contact_depth
        )
        self.face = PlaneContact(
            self.shell,
            nodes,
            0.5 * nodal_thickness(self.shell),
            tributary_area(self.shell),
            law,
            least_gap=case.valve.initial_gap,
        )

    @cached_property
    def _free(self) -> np.ndarray:
        return np.zeros(self.face.count)

    def face_force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,) of the contact alone."""
        force, nodal = np.zeros(self.size), self.nodal(q)
        d, d1, _ = self.shell.directors(nodal)
        self.face.add_force(force, nodal, d, d1, self._free)
        return force

    def contact_state(self, q: np.ndarray):
        nodal = self.nodal(q)
        return self.face.state(nodal, self.shell.directors(nodal)[0], self._free)

    def contact_energy(self, q: np.ndarray) -> float:
        nodal = self.nodal(q)
        return self.face.energy(nodal, self.shell.directors(nodal)[0], self._free)

    def internal_force(self, q, step=None, share=1.0):
        return super().internal_force(q, step, share) + self.face_force(q)

    def structure(self, q, step=None, share=1.0):
        force, data = super().structure(q, step, share)
        nodal = self.nodal(q)
        self.face.add_force_and_tangent(force, data, nodal, *self.shell.directors(nodal), self._free)
        return force, data


class ClosingMotion(ValveMotion):
    """Equations of motion of a `ContactValve`."""

    def energies(self, q, v):
        kinetic, strain, _ = super().energies(q, v)
        return kinetic, strain, self.model.contact_energy(q)
