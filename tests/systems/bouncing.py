"""Linear systems whose unknowns hit planes, for the stepper: masses and bars; `beam` has the matrices of beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from dbvfiv.contact import ContactLaw, Rebound, mean_pressure
from tests.verification.moving import Drive, Motion


@dataclass(frozen=True)
class Planes:
    """Planes that some unknowns, counted by `unknowns` (k,), cannot pass: q + start >= 0."""

    unknowns: np.ndarray
    start: np.ndarray
    law: ContactLaw
    rebound: Rebound = Rebound()

    def gap(self, q):
        return q[self.unknowns] + self.start

    def respond(self, q):
        return self.law.respond(self.gap(q))

    def energies(self, q):
        """Energy of each contact (k,)."""
        return self.respond(q)[0]

    def spread(self, q, values):
        out = np.zeros_like(q)
        out[self.unknowns] = values
        return out

    def force(self, q):
        return self.spread(q, -self.respond(q)[1])

    def touching(self, q):
        return int(np.count_nonzero(self.respond(q)[1]))


class PlaneStep:
    """What a step asks of them, as `dbvfiv.contact.ContactStep`."""

    def __init__(self, planes: Planes, q, h):
        self.planes, self.q, self.h = planes, q, h

    def _pressure(self, q):
        old, new = self.planes.gap(self.q), self.planes.gap(q)
        mean, slope = mean_pressure(self.planes.law, old, new)
        factor, bend = self.planes.rebound.factor((new - old) / self.h)
        return factor * mean, factor * slope + bend * mean / self.h

    def force(self, q):
        return self.planes.spread(q, -self._pressure(q)[0])

    def stiffness(self, q):
        """Diagonal of its derivative (n,)."""
        return self.planes.spread(q, -self._pressure(q)[1])

    def stored(self, q):
        return float(np.sum(self.planes.energies(q) - self.planes.energies(self.q)))


class BouncingMotion(Motion):
    """M a + beta K v + K q + contact = load."""

    def __init__(self, mass, stiffness, planes: Planes | None, load=None, beta: float = 0.0):
        self.mass, self.stiffness = sp.csc_matrix(mass), sp.csc_matrix(stiffness)
        super().__init__(self.mass.shape[0], beta=beta)
        self.contact = planes
        self.push = np.zeros(self.size) if load is None else np.asarray(load, float)
        self._mass_factor = splu(self.mass)

    def internal_force(self, q, step=None):
        return self.stiffness @ q

    def pressure_force(self, q, pressure):
        return self.push

    def inertia(self, q, v, a):
        return self.mass @ a

    def contact_step(self, q, h):
        return PlaneStep(self.contact, q, h)

    def accelerated(self, q, force):
        return self._mass_factor.solve(force)

    def linearise(self, q_new, v_new, q, v, load, weights, q_load=None, v_load=None, step=None, contact=None):
        matrix = weights.inertia * self.mass + weights.force * self.stiffness
        if contact is not None:
            matrix = matrix + sp.diags(contact[1] * contact[0].stiffness(q_new))
        self._factor = splu(sp.csc_matrix(matrix))

    def solve(self, force):
        return self._factor.solve(force)

    def accelerations(self, q, v, inlet, inner=None, memory=None):
        force = self.push - self.stiffness @ (q + self.mu.beta * v)
        if self.contact is not None:
            force = force - self.contact.force(q)
        return self._mass_factor.solve(force), self.load(q, v, q, v, Drive())

    def energy(self, q, v) -> float:
        """Kinetic, elastic and contact energy less the work of the load."""
        stored = 0.0 if self.contact is None else self.contact.energies(q).sum()
        return float(0.5 * v @ (self.mass @ v) + 0.5 * q @ (self.stiffness @ q) - self.push @ q + stored)


def bar(elements: int, length: float = 1.0, modulus: float = 1.0, density: float = 1.0):
    """Mass and stiffness (n + 1, n + 1) of a free elastic bar of unit section, lumped mass."""
    size = length / elements
    ends = np.ones(elements + 1)
    ends[[0, -1]] = 0.5
    stiffness = sp.diags([2.0 * ends, -np.ones(elements), -np.ones(elements)], [0, 1, -1]) * (modulus / size)
    return sp.diags(density * size * ends), stiffness
