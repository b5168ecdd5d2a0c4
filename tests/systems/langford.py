"""Langford's system with a circular orbit and a torus bifurcation.

x' = (m - 3) x - y/4 + x (z + 0.2 (1 - z^2)), y' = x/4 + (m - 3) y + y (z + 0.2 (1 - z^2)),
z' = m z - (x^2 + y^2 + z^2).
"""

import jax.numpy as jnp

from continuation.jax_system import JaxSystem


def langford() -> JaxSystem:
    def residual(u, mu):
        x, y, z = u
        m = mu["mu"]
        gain = m - 3 + z + 0.2 * (1 - z**2)
        return jnp.stack([gain * x - 0.25 * y, 0.25 * x + gain * y, m * z - (x**2 + y**2 + z**2)])

    return JaxSystem(residual, 3)
