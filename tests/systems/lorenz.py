"""The Lorenz equations."""

import jax.numpy as jnp

from continuation.jax_system import JaxSystem


def lorenz() -> JaxSystem:
    """x' = sigma (y - x), y' = r x - y - x z, z' = x y - b z."""

    def residual(u, mu):
        x, y, z = u
        return jnp.stack([mu["sigma"] * (y - x), mu["r"] * x - y - x * z, x * y - mu["b"] * z])

    return JaxSystem(residual, 3)
