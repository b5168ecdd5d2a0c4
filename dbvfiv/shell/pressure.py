"""Loads of a shell: follower pressure on the mid-surface, its weight, and the outer face that a fluid pushes.

The pressure is linear in a few station pressures; its stiffness is not symmetric. The weight is a dead load with a
potential, so that its tangent is symmetric:

    V = - g . integral (rho - rho_d) (x + t d) dV = - g . sum_a (w_a x_a + m_a d_a)

rho_d is the density of what the wall displaces. m_a, the first moment over the thickness, is there where layers of
different densities do not balance; it turns with the director and is all that the tangent holds.

A wall between two fluids displaces the mean of both: in an incompressible wall a pressure that is the same on both
faces makes no strain, and what is left of the two that stand on its faces is their difference, which loads the
mid-surface, and the gradient of their mean, which acts on its volume.

Equation (T.12) of docs/theory.md.
"""

from __future__ import annotations

from functools import cached_property

import jax
import jax.numpy as jnp
import numba
import numpy as np
import scipy.sparse as sp

from .reference import SHAPE, SLOPE
from .rotation import director
from .shell import Shell

_SHAPE = np.ascontiguousarray(SHAPE)
_SLOPE = np.ascontiguousarray(SLOPE)


@numba.njit(inline="always")
def _vectors(quad, nodes, q, point, g1, g2):
    for i in range(3):
        g1[i] = 0.0
        g2[i] = 0.0
        for a in range(4):
            x = nodes[quad[a], i] + q[quad[a], i]
            g1[i] += _SLOPE[point, a, 0] * x
            g2[i] += _SLOPE[point, a, 1] * x


@numba.njit(cache=True)
def pressure_force(quads, nodes, q, nodal, loaded, out):
    """Add the force of nodal pressures (nn,) to out (nn, c); positive along the outward normal.

    `loaded` (ne,) is the share of each element that carries pressure.
    """
    g1 = np.empty(3)
    g2 = np.empty(3)
    for el in range(quads.shape[0]):
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            p = 0.0
            for a in range(4):
                p += _SHAPE[point, a] * nodal[quad[a]]
            p *= loaded[el]
            f0 = p * (g1[1] * g2[2] - g1[2] * g2[1])
            f1 = p * (g1[2] * g2[0] - g1[0] * g2[2])
            f2 = p * (g1[0] * g2[1] - g1[1] * g2[0])
            for a in range(4):
                out[quad[a], 0] += _SHAPE[point, a] * f0
                out[quad[a], 1] += _SHAPE[point, a] * f1
                out[quad[a], 2] += _SHAPE[point, a] * f2


@numba.njit(cache=True)
def pressure_stiffness(quads, nodes, q, nodal, loaded, slots, factor, data):
    """Add factor times the derivative of the pressure force with respect to the displacements to the matrix values."""
    g1 = np.empty(3)
    g2 = np.empty(3)
    k = np.empty((4, 4, 3, 3))
    for el in range(quads.shape[0]):
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        k[:] = 0.0
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            p = 0.0
            for a in range(4):
                p += _SHAPE[point, a] * nodal[quad[a]]
            p *= loaded[el] * factor
            for b in range(4):
                # derivative of g1 x g2 along displacement e_j of node b: s1 e_j x g2 + s2 g1 x e_j
                s1 = _SLOPE[point, b, 0]
                s2 = _SLOPE[point, b, 1]
                v0 = p * (s1 * g2[0] - s2 * g1[0])
                v1 = p * (s1 * g2[1] - s2 * g1[1])
                v2 = p * (s1 * g2[2] - s2 * g1[2])
                for a in range(4):
                    n = _SHAPE[point, a]
                    # e_j x v, column j
                    k[a, b, 0, 1] += n * v2
                    k[a, b, 0, 2] -= n * v1
                    k[a, b, 1, 0] -= n * v2
                    k[a, b, 1, 2] += n * v0
                    k[a, b, 2, 0] += n * v1
                    k[a, b, 2, 1] -= n * v0
        for a in range(4):
            for i in range(3):
                for b in range(4):
                    for j in range(3):
                        where = slots[el, 20 * (5 * a + i) + 5 * b + j]
                        if where >= 0:
                            data[where] += k[a, b, i, j]


@numba.njit(cache=True)
def station_forces(quads, nodes, q, station, loaded, out):
    """Fill element force columns out (ne, 4, 3, 4): force on node a, component i, of unit pressure at node b."""
    g1 = np.empty(3)
    g2 = np.empty(3)
    for el in range(quads.shape[0]):
        out[el] = 0.0
        if loaded[el] == 0.0:
            continue
        quad = quads[el]
        for point in range(4):
            _vectors(quad, nodes, q, point, g1, g2)
            f0 = loaded[el] * (g1[1] * g2[2] - g1[2] * g2[1])
            f1 = loaded[el] * (g1[2] * g2[0] - g1[0] * g2[2])
            f2 = loaded[el] * (g1[0] * g2[1] - g1[1] * g2[0])
            for a in range(4):
                for b in range(4):
                    n = _SHAPE[point, a] * _SHAPE[point, b]
                    out[el, a, 0, b] += n * f0
                    out[el, a, 1, b] += n * f1
                    out[el, a, 2, b] += n * f2


class Weight:
    """Weight of a shell.

    Parameters
    ----------
    gravity : (3,) array, m/s2
    displaced : float
        Density of what the wall displaces, kg/m3.

    All methods take the shell whose unknowns (n,) they are asked for, which may number its nodes otherwise.
    """

    def __init__(self, shell: Shell, gravity: np.ndarray, displaced: float = 0.0):
        geometry = shell.geometry
        volume = np.einsum("ep,pa,e->ea", geometry.area, SHAPE, geometry.thickness)
        count = shell.mesh.node_count

        def at_nodes(values):
            return np.bincount(shell.mesh.quads.ravel(), weights=values.ravel(), minlength=count)

        push = at_nodes(shell.inertia_integrals[:, 0].sum(axis=2) - displaced * volume)
        moment = at_nodes(shell.inertia_integrals[:, 1].sum(axis=2))
        self.push, self.moment = push[:, None] * gravity, moment[:, None] * gravity

    def energy(self, shell: Shell, q: np.ndarray) -> float:
        """Potential over that at rest, J."""
        nodal = shell.dofs.expand(q)
        turned = shell.directors(nodal)[0] - shell.mesh.directors
        return -float(np.sum(self.push * nodal[:, :3]) + np.sum(self.moment * turned))

    def force(self, shell: Shell, q: np.ndarray) -> np.ndarray:
        """Derivative (n,) of the potential: what the wall has to carry with the sign of an internal force."""
        nodal = shell.dofs.expand(q)
        out = np.zeros_like(nodal)
        out[:, :3] = -self.push
        out[:, 3:5] = -np.einsum("ni,nri->nr", self.moment, shell.directors(nodal)[1])
        return shell.dofs.restrict(out)

    def add_tangent(self, shell: Shell, q: np.ndarray, data: np.ndarray, share: float = 1.0) -> None:
        """Add a share of its tangent to the values (nnz,) of a matrix on the pattern of the shell's unknowns."""
        bend = -share * np.einsum("ni,nri->nr", self.moment, shell.directors(shell.dofs.expand(q))[2])
        for slots, values in zip(_rotation_slots(shell), (bend[:, 0], bend[:, 1], bend[:, 2], bend[:, 2])):
            data[slots[slots >= 0]] += values[slots >= 0]

    def form(self, shell: Shell, q: np.ndarray, *directions: np.ndarray) -> np.ndarray:
        """Derivative (n,) of `force` along one, two or three directions (n,)."""
        turns = tuple(shell.dofs.expand(x)[:, 3:5] for x in directions)
        out = np.zeros((shell.mesh.node_count, 5))
        out[:, 3:] = _moment_form(
            shell.dofs.expand(q)[:, 3:5], turns, self.moment, shell.mesh.directors, shell.mesh.frames
        )
        return shell.dofs.restrict(out)


def _rotation_slots(shell: Shell) -> np.ndarray:
    """(4, nn) places of the entries 11, 22, 12, 21 of each node's rotations among matrix values; -1 where held."""
    slots = np.full((4, shell.mesh.node_count), -1, np.int64)
    entries = shell.dofs.slots.reshape(-1, 20, 20)
    for a in range(4):
        first, second = 5 * a + 3, 5 * a + 4
        for k, (i, j) in enumerate(((first, first), (second, second), (first, second), (second, first))):
            slots[k, shell.mesh.quads[:, a]] = entries[:, i, j]
    return slots


@jax.jit
def _moment_form(turn, directions, moment, reference, frames):
    """Derivative (nn, 2) of - m . d1 along rotations (nn, 2)."""

    def moments(theta):
        potential = lambda x: -jnp.sum(moment * jax.vmap(director)(x, reference, frames))  # noqa: E731
        return jax.grad(potential)(theta)

    form = moments
    for direction in directions:
        form = (lambda inner, v: lambda x: jax.jvp(inner, (x,), (v,))[1])(form, direction)
    return form(turn)


class OuterFace:
    """Nodes of the mid-surface moved out by half the wall along their directors, joined bilinearly.

    Attributes
    ----------
    half_wall : (nn,) array, m
        Half the thickness at the nodes, the mean of the adjoining elements weighted by area.
    """

    def __init__(self, shell: Shell):
        self.shell = shell
        mesh, area = shell.mesh, shell.geometry.area.sum(axis=1)
        total, weight = np.zeros(mesh.node_count), np.zeros(mesh.node_count)
        np.add.at(total, mesh.quads, (area * mesh.thickness)[:, None])
        np.add.at(weight, mesh.quads, area[:, None])
        self.half_wall = 0.5 * total / weight

    def points(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (nn, 3), m, and directors (nn, 3) of the face's nodes for nodal unknowns (nn, c)."""
        directors = self.shell.directors(nodal)[0]
        return self.shell.mesh.nodes + nodal[:, :3] + self.half_wall[:, None] * directors, directors

    def fluxes(self, nodal: np.ndarray) -> sp.csr_matrix:
        """Volume that each element's face sweeps outwards per change of the unknowns, (ne, n).

        Its transpose holds the forces of unit pressures on the faces.
        """
        directors, turned, _ = self.shell.directors(nodal)
        place = self.shell.mesh.nodes + nodal[:, :3] + self.half_wall[:, None] * directors
        corners = place[self.shell.mesh.quads]
        basis = np.einsum("pac,eai->epci", SLOPE, corners)
        share = np.einsum("pa,epi->eai", SHAPE, np.cross(basis[:, :, 0], basis[:, :, 1]))
        values = np.empty((*share.shape[:2], 5))
        values[..., :3] = share
        lever = (self.half_wall[:, None, None] * turned)[self.shell.mesh.quads]
        values[..., 3:] = np.einsum("eai,eaji->eaj", share, lever)
        taken, columns, pointers = self._pattern
        return sp.csr_matrix((values.ravel()[taken], columns, pointers), (len(corners), self.shell.size))

    @cached_property
    def _pattern(self):
        """Sparsity pattern of `fluxes`: flat indices of the entries in CSR order, their columns, the row pointers."""
        index = self.shell.dofs.element_index
        order = np.argsort(index, axis=1, kind="stable")
        taken = (order + index.shape[1] * np.arange(len(index))[:, None])[np.take_along_axis(index, order, 1) >= 0]
        pointers = np.concatenate([[0], np.cumsum((index >= 0).sum(axis=1))])
        return taken, index.ravel()[taken], pointers
