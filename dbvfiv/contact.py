"""Frictionless contact of points on a shell's face with a plane: law, forces, tangents and higher derivatives.

The point that touches lies at a depth below the mid-surface along the current director, x - depth * d, so a contact
force acts on the displacement across the plane and on both rotations of the node. A depth of zero makes the mid-surface
itself touch.

The plane stands for a mirror image of the wall. In a motion that is antisymmetric about it, opposite points keep their
distance across it to first order, slide along it by twice their own motion, and tilt together. With u the displacement
of a node along the plane, d the change of its director along the plane, which for a thin wall is minus the slope of
both faces, and b its distance from the face, the gap normal to the common face opens by

    -b d.d + 2 d.u      (second order, of both sides)

of which -F is the energy of a pair that is pressed by a force F; half of it belongs to each side. It leaves a rigid
rotation of the pressed pair free of forces. The faces are taken as flat and in the plane where they touch, and slide
without friction.

Over a step in time the pressure neither feeds nor rings: between two gaps it is the discrete gradient of the potential
V per area (Simo & Tarnow 1992, Gonzalez 1996),

    p = r(g') [V(g1) - V(g0)]/(g0 - g1),     r = 1 while faces close,     R + (1 - R)/(1 + (g'/v)^2) while they part

so that the work done on closing faces is stored to the last digit, whatever the step, and parting faces get back the
share R of it, the rebound resilience of their material. At rest r is 1 with no slope: equilibria and small motions
about them know nothing of R. Equation (T.27) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from .shell.reference import SHAPE, reference_geometry
from .shell.rotation import director
from .shell.shell import Shell


def tributary_area(shell: Shell) -> np.ndarray:
    """Integrals (nn,) of the shape functions over the mid-surface at rest, m2; they sum to its area. A preset wall
    rests in the shape of its mesh.
    """
    mesh = shell.mesh
    geometry = shell.geometry if shell.stress_free is None else reference_geometry(mesh)
    out = np.zeros(mesh.node_count)
    np.add.at(out, mesh.quads, geometry.area @ SHAPE)
    return out


@dataclass(frozen=True)
class ContactLaw:
    """t = penalty * ramp(-gap): the penalty form of g >= 0, t >= 0, t g = 0."""

    penalty: float  #: Pa/m; the contact pressure follows the penetration with this slope.
    #: m; half width over which the kink of the ramp is rounded by a parabola, so that the tangent is continuous; 0
    #: keeps the kink.
    rounding: float = 0.0

    def __post_init__(self):
        if not self.penalty > 0:
            raise ValueError(f"The contact penalty must be positive, not {self.penalty:g} Pa/m.")
        if not self.rounding >= 0:
            raise ValueError(f"The rounding of the contact law cannot be negative, as {self.rounding:g} m is.")

    def respond(self, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Potential (J/m2), contact pressure (Pa) and stiffness (Pa/m), each (k,), at gaps (k,).

        Pressure and stiffness are the first and second derivatives of the potential with respect to the penetration.
        """
        x, w = -gap, self.rounding
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

    def gap_at(self, pressure: float) -> float:
        """Gap, m, at which faces press on each other with a pressure, Pa, above zero."""
        depth, w = pressure / self.penalty, self.rounding
        return w - 2.0 * np.sqrt(w * depth) if depth < w else -depth


@dataclass(frozen=True)
class ContactState:
    """Contact of one state, an entry for each contact node."""

    gap: np.ndarray  #: (k,), m; negative where the face penetrates the plane.
    pressure: np.ndarray  #: (k,), Pa; per area of the mid-surface at rest.
    force: np.ndarray  #: (k,), N.

    @property
    def touching(self) -> np.ndarray:
        """(k,) true where a pressure acts."""
        return self.pressure > 0

    @property
    def penetration(self) -> float:
        """Deepest penetration, m."""
        return float(max(0.0, -self.gap.min(initial=0.0)))

    @property
    def total(self) -> float:
        """Sum of the contact forces, N."""
        return float(self.force.sum())


class PlaneContact:
    """Contact nodes of a shell before the plane where one coordinate vanishes; the shell stands on its positive side.

    Parameters
    ----------
    nodes : (k,) int array
        Nodes without a free displacement across the plane take no part and are dropped.
    depth : (k,) array, m
        Distance of the touching point from the mid-surface, against the director.
    area : (k,) array, m2
        Share of the surface that each node stands for.
    axis : int
        Normal of the plane: 0, 1 or 2.
    least_gap : float or (k,) array, m
        Points that start closer to the plane than this, or beyond it, are measured from where they start plus this gap,
        so that only further closing meets resistance. See `lifted`.
    """

    def __init__(self, shell: Shell, nodes, depth, area, law: ContactLaw, axis: int = 1, least_gap=0.0):
        nodes = np.asarray(nodes, int)
        index = shell.dofs.index
        keep = index[nodes, axis] >= 0
        self.shell, self.law, self.axis = shell, law, axis
        self.nodes = nodes[keep]
        self.depth = np.broadcast_to(np.asarray(depth, float), nodes.shape)[keep].copy()
        self.area = np.broadcast_to(np.asarray(area, float), nodes.shape)[keep].copy()
        start = shell.mesh.nodes[self.nodes, axis] - self.depth * shell.mesh.directors[self.nodes, axis]
        self.start = start
        self.lift = np.maximum(np.broadcast_to(least_gap, nodes.shape)[keep] - start, 0.0)
        # Numbers and matrix slots of the displacement across the plane and the two rotations.
        self._unknowns = index[self.nodes][:, [axis, 3, 4]]

    @property
    def count(self) -> int:
        """Number of contact nodes k."""
        return len(self.nodes)

    @property
    def lifted(self) -> np.ndarray:
        """(k,) true for nodes whose gap is measured from their start because they begin too close to the plane or
        beyond it.
        """
        return self.lift > 0

    def gap(self, nodal: np.ndarray, directors: np.ndarray) -> np.ndarray:
        """Gaps (k,), m, of nodal unknowns (nn, c) with directors (nn, 3)."""
        n, a = self.nodes, self.axis
        return self.shell.mesh.nodes[n, a] + nodal[n, a] - self.depth * directors[n, a] + self.lift

    def points(self, nodal: np.ndarray, directors: np.ndarray) -> np.ndarray:
        """Touching points (k, 3), m, in the deformed state, without the lift."""
        n = self.nodes
        return self.shell.mesh.nodes[n] + nodal[n, :3] - self.depth[:, None] * directors[n]

    def nodal(self, q: np.ndarray) -> np.ndarray:
        """Nodal displacements and rotations (nn, c) of unknowns (n,)."""
        return self.shell.dofs.expand(q)

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """Gaps (k,), m, of unknowns (n,)."""
        nodal = self.nodal(q)
        return self.gap(nodal, self.shell.directors(nodal)[0])

    def state(self, q: np.ndarray) -> ContactState:
        """Gaps, pressures and forces of unknowns (n,)."""
        gap = self.gaps(q)
        _, pressure, _ = self.law.respond(gap)
        return ContactState(gap, pressure, self.area * pressure)

    def touching(self, q: np.ndarray) -> int:
        """Number of nodes that are pressed."""
        return int(np.count_nonzero(self.state(q).touching))

    def energy(self, q: np.ndarray) -> float:
        """Energy stored in the contact, J."""
        return float(self.area @ self.law.respond(self.gaps(q))[0])

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,), the derivative of the energy."""
        force, nodal = np.zeros(self.shell.size), self.nodal(q)
        directors, first, _ = self.shell.directors(nodal)
        _, pressure, _ = self.law.respond(self.gap(nodal, directors))
        self.add_pressure_force(force, pressure, first)
        return force

    def add_tangent(self, q: np.ndarray, data: np.ndarray) -> None:
        """Add the symmetric tangent to values (nnz,) on the shell's pattern."""
        nodal = self.nodal(q)
        self.add_blocks(data, self._tangent_blocks(nodal, *self.shell.directors(nodal)))

    def form(self, q: np.ndarray, *directions: np.ndarray) -> np.ndarray:
        """Derivative (n,) of the force at unknowns (n,) along any number of directions (n,).

        The law is made of pieces; at their joints the derivatives are those of one side.
        """
        n, axis, mesh = self.nodes, self.axis, self.shell.mesh
        columns, nodal = [axis, 3, 4], self.nodal(q)
        data = mesh.nodes[n, axis] + self.lift, self.depth, self.area, mesh.directors[n], mesh.frames[n]
        law = (self.law.penalty, self.law.rounding)
        along = tuple(self.nodal(direction)[n][:, columns] for direction in directions)
        out = np.zeros_like(nodal)
        out[n[:, None], columns] = np.asarray(_form(axis, law, nodal[n][:, columns], along, data))
        return self.shell.dofs.restrict(out)

    def stiffness_of_class(self, q: np.ndarray, shell: Shell, apart: bool) -> sp.csr_matrix:
        """Tangent (k, k) at unknowns (n,) in a class of motion with its shell, of k unknowns; `apart` where the two
        walls move against each other, so that contact resists; where they move together it only turns.
        """
        nodal = self.nodal(q)
        directors, first, second = self.shell.directors(nodal)
        if apart:
            block, columns = self._tangent_blocks(nodal, directors, first, second), [self.axis, 3, 4]
        else:
            block, columns = self._blocks_together(q, first)
        unknowns, width = shell.dofs.index[self.nodes][:, columns], len(columns)
        rows = np.repeat(unknowns[:, :, None], width, axis=2)
        across = np.repeat(unknowns[:, None, :], width, axis=1)
        keep = (rows >= 0) & (across >= 0) & (block != 0)
        return sp.csr_matrix((block[keep], (rows[keep], across[keep])), shape=(shell.size, shell.size))

    def _blocks_together(self, q: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Tangent (k, 4, 4) of each contact node and the columns (4) of its nodal unknowns that it belongs to."""
        along = [axis for axis in range(3) if axis != self.axis]
        force = self.state(q).force
        turn = first[self.nodes][:, :, along].transpose(0, 2, 1)  # director along the plane by the rotations
        block = np.zeros((self.count, 4, 4))
        block[:, 2:, 2:] = (force * self.depth)[:, None, None] * (turn.transpose(0, 2, 1) @ turn)
        block[:, :2, 2:] = -force[:, None, None] * turn
        block[:, 2:, :2] = block[:, :2, 2:].transpose(0, 2, 1)
        return block, [*along, 3, 4]

    def add_pressure_force(self, force, pressure, first) -> None:
        """Add the internal force of contact pressures (k,), Pa, to force (n,)."""
        keep, values = self._unknowns >= 0, -(self.area * pressure)[:, None] * self.slope(first)
        force[self._unknowns[keep]] += values[keep]  # every unknown belongs to one contact node only

    def add_blocks(self, data, block) -> None:
        """Add blocks (k, 3, 3) of each contact node in its displacement across the plane and its rotations to matrix
        values on the shell's pattern.
        """
        slots = self._slots
        keep = slots >= 0
        data[slots[keep]] += block[keep]

    def _tangent_blocks(self, nodal, directors, first, second) -> np.ndarray:
        """Tangent (k, 3, 3) of each contact node in its displacement across the plane and its rotations."""
        _, pressure, stiffness = self.law.respond(self.gap(nodal, directors))
        slope = self.slope(first)
        block = (self.area * stiffness)[:, None, None] * slope[:, :, None] * slope[:, None, :]
        return block + self.bending_blocks(pressure, second)

    def bending_blocks(self, pressure, second) -> np.ndarray:
        """Tangent (k, 3, 3) of pressures (k,) that stay: gaps bend with the rotations."""
        # -pressure * d2 gap, d2 gap = -depth * d2 director
        block = np.zeros((self.count, 3, 3))
        bend = (self.area * pressure * self.depth)[:, None] * second[self.nodes][:, :, self.axis]
        block[:, 1, 1] += bend[:, 0]
        block[:, 2, 2] += bend[:, 1]
        block[:, 1, 2] += bend[:, 2]
        block[:, 2, 1] += bend[:, 2]
        return block

    def slope(self, first: np.ndarray) -> np.ndarray:
        """(k, 3) derivative of the gaps with respect to displacement and rotations."""
        slope = np.empty((self.count, 3))
        slope[:, 0] = 1.0
        slope[:, 1:] = -self.depth[:, None] * first[self.nodes][:, :, self.axis]
        return slope

    @cached_property
    def _slots(self) -> np.ndarray:
        """(k, 3, 3) positions of the nodal blocks among the matrix values, -1 where constrained."""
        rows = np.repeat(self._unknowns[:, :, None], 3, axis=2)
        return self.shell.dofs.slots_of(rows, rows.transpose(0, 2, 1))


def _potential(axis, law, v, data):
    """Potential of one node from its displacement across the plane and its rotations (3,)."""
    place, depth, area, reference, frame = data
    penalty, width = law
    x = depth * director(v[1:], reference, frame)[axis] - place - v[0]
    if width == 0.0:
        return area * penalty * 0.5 * jnp.where(x > 0, x, 0.0) ** 2
    rounded = (x + width) ** 3 / (12 * width)
    return area * penalty * jnp.where(x >= width, 0.5 * x**2 + width**2 / 6, jnp.where(x > -width, rounded, 0.0))


def _form(axis, law, v, along, data):
    def one(v, along, data):
        found = jax.grad(lambda w: _potential(axis, law, w, data))
        for direction in along:
            found = _derivative(found, direction)
        return found(v)

    return jax.vmap(one)(v, along, data)


def _derivative(function, direction):
    return lambda w: jax.jvp(function, (w,), (direction,))[1]


_form = jax.jit(_form, static_argnums=(0, 1))


#: Speed of parting, m/s, above which faces lose energy: that of walls that creep apart is below it.
CREEP = 1e-3
#: Change of the gap over gap and rounding below which the mean is taken in the middle.
_SMALL = 1e-5


@dataclass(frozen=True)
class Rebound:
    """Energy that the contact gives back to parting faces."""

    share: float = 1.0  #: Share of the stored energy that is given back, 0 to 1.
    speed: float = CREEP  #: m/s; parting speed from which on the rest is lost.

    def factor(self, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Factor on the pressure (k,) at rates of the gaps (k,), m/s, and its derivative, s/m."""
        parting = np.maximum(rate, 0.0) / self.speed
        below = 1.0 / (1.0 + parting * parting)
        lost = 1.0 - self.share
        return self.share + lost * below, -2.0 * lost * parting * below * below / self.speed


def mean_pressure(law: ContactLaw, old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Discrete gradient of the potential between gaps (k,), Pa, and its derivative by the new gaps, Pa/m."""
    change = new - old
    small = np.abs(change) <= _SMALL * (np.abs(old) + law.rounding)
    over = np.where(small, 1.0, change)
    stored_old, _, _ = law.respond(old)
    stored, pressure, _ = law.respond(new)
    _, middle, stiffness = law.respond(0.5 * (old + new))
    mean = np.where(small, middle, (stored_old - stored) / over)
    return mean, np.where(small, -0.5 * stiffness, (pressure - mean) / over)


class ContactStep:
    """Contact of one step that starts from given unknowns.

    Parameters
    ----------
    q : (n,) array
        Where the step starts.
    h : float, s
    """

    def __init__(self, contact: PlaneContact, q: np.ndarray, h: float, rebound: Rebound = Rebound()):
        self.contact, self.h, self.rebound = contact, float(h), rebound
        self._nodal, self._gap, self._energy = contact.nodal(q), contact.gaps(q), contact.energy(q)

    def _pressure(self, gap: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        mean, slope = mean_pressure(self.contact.law, self._gap, gap)
        factor, bend = self.rebound.factor((gap - self._gap) / self.h)
        return factor * mean, factor * slope + bend * mean / self.h

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,) over a step that ends at unknowns (n,).

        Gaps bend with the rotations; their slope is that in the middle, so that the work of the force misses pressure
        times the change of the gap by the third power of a director's turn.
        """
        contact = self.contact
        pressure, _ = self._pressure(contact.gaps(q))
        force = np.zeros(contact.shell.size)
        if pressure.any():
            middle = 0.5 * (self._nodal + contact.nodal(q))
            contact.add_pressure_force(force, pressure, contact.shell.directors(middle)[1])
        return force

    def add_tangent(self, q: np.ndarray, data: np.ndarray, weight: float) -> None:
        """Add a multiple of the derivative of `force` by the new unknowns to values (nnz,) on the shell's pattern."""
        contact, nodal = self.contact, self.contact.nodal(q)
        directors = contact.shell.directors
        d, first, _ = directors(nodal)
        pressure, slope = self._pressure(contact.gap(nodal, d))
        if not (pressure.any() or slope.any()):
            return
        _, first_mid, second_mid = directors(0.5 * (self._nodal + nodal))
        block = -(contact.area * slope)[:, None, None] * contact.slope(first_mid)[:, :, None]
        block = block * contact.slope(first)[:, None] + 0.5 * contact.bending_blocks(pressure, second_mid)
        contact.add_blocks(data, weight * block)

    def stored(self, q: np.ndarray) -> float:
        """Energy gained by the contact up to unknowns (n,), J."""
        return self.contact.energy(q) - self._energy
