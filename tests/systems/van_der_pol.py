"""The van der Pol oscillator x'' - mu (1 - x^2) x' + x = 0."""

import jax.numpy as jnp

from continuation.jax_system import JaxSystem


def van_der_pol() -> JaxSystem:
    return JaxSystem(lambda u, mu: jnp.stack([u[1], mu["mu"] * (1 - u[0] ** 2) * u[1] - u[0]]), 2)
