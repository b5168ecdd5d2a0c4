"""Higher derivatives of the contact force, by automatic differentiation of the contact's potential."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..shell.rotation import director
from .plane import PlaneContact


def contact_form(
    contact: PlaneContact, nodal: np.ndarray, multiplier: np.ndarray, *directions: np.ndarray
) -> np.ndarray:
    """Derivative (nn, c) of the contact force at nodal unknowns (nn, c) along any number of directions (nn, c).

    The law is made of pieces; at their joints the derivatives are those of one side.
    """
    n, axis, mesh = contact.nodes, contact.axis, contact.shell.mesh
    columns = [axis, 3, 4]
    data = (
        mesh.nodes[n, axis] + contact.lift,
        contact.depth,
        contact.area,
        multiplier,
        mesh.directors[n],
        mesh.frames[n],
    )
    law = (contact.law.penalty, contact.law.rounding)
    along = tuple(field[n][:, columns] for field in directions)
    out = np.zeros_like(nodal)
    out[n[:, None], columns] = np.asarray(_form(axis, law, nodal[n][:, columns], along, data))
    return out


def _potential(axis, law, v, data):
    """Potential of one node from its displacement across the plane and its rotations (3,)."""
    place, depth, area, multiplier, reference, frame = data
    penalty, width = law
    gap = place + v[0] - depth * director(v[1:], reference, frame)[axis]
    x = multiplier / penalty - gap
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
