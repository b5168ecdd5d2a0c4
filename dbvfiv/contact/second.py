"""Second derivative of the contact force, by automatic differentiation of the contact's potential."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ..shell.rotation import director
from .plane import PlaneContact


def contact_second(
    contact: PlaneContact, nodal: np.ndarray, multiplier: np.ndarray, a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """Second directional derivative (nn, 5) of the contact force at nodal unknowns (nn, 5) along a and b (nn, 5)."""
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
    values = _second(axis, law, nodal[n][:, columns], a[n][:, columns], b[n][:, columns], data)
    out = np.zeros_like(nodal)
    out[n[:, None], columns] = np.asarray(values)
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


def _second(axis, law, v, a, b, data):
    def one(v, a, b, data):
        force = jax.grad(lambda w: _potential(axis, law, w, data))
        first = lambda w: jax.jvp(force, (w,), (a,))[1]  # noqa: E731
        return jax.jvp(first, (v,), (b,))[1]

    return jax.vmap(one)(v, a, b, data)


_second = jax.jit(_second, static_argnums=(0, 1))
