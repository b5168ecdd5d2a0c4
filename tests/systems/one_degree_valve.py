"""One-degree valve with an inlet inertance: (m s^2 + c s + k)(s + r) = B s."""

import jax.numpy as jnp

from continuation.jax_system import JaxSystem


def one_degree_valve() -> JaxSystem:
    """States x, x', f with f' + r f = B x'; the force f acts on the mass."""

    def residual(state, mu):
        x, v, f = state
        return jnp.stack([v, (f - mu["c"] * v - mu["k"] * x) / mu["m"], mu["B"] * v - mu["r"] * f])

    return JaxSystem(residual, 3)
