"""Excitable cells: FitzHugh-Nagumo."""

import jax.numpy as jnp

from continuation.jax_system import JaxSystem


def fitzhugh_nagumo(rate: float) -> JaxSystem:
    """v' = v - v^3 / 3 - w + I, w' = rate (v + 0.7 - 0.8 w); FitzHugh, Biophys. J. 1 (1961) 445, rate 0.08."""

    def residual(u, mu):
        v, w = u
        return jnp.stack([v - v**3 / 3 - w + mu["I"], rate * (v + 0.7 - 0.8 * w)])

    return JaxSystem(residual, 2)
