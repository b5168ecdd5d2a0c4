"""Weight of a shell: a dead load with a potential, so that its tangent is symmetric.

    V = - g . integral (rho - rho_d) (x + t d) dV = - g . sum_a (w_a x_a + m_a d_a)

rho_d is the density of what the wall displaces. m_a, the first moment over the thickness, is there where layers of
different densities do not balance; it turns with the director and is all that the tangent holds.

A wall between two fluids displaces the mean of both: in an incompressible wall a pressure that is the same on both
faces makes no strain, and what is left of the two that stand on its faces is their difference, which loads the
mid-surface, and the gradient of their mean, which acts on its volume.

Equation (T.12) of docs/theory.md.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .reference import SHAPE
from .rotation import director
from .shell import Shell


class Weight:
    """Weight of a shell.

    Parameters
    ----------
    shell : Shell
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
