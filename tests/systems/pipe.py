"""Cantilever pipe conveying fluid, w'''' + u^2 w'' + 2 sqrt(beta) u w_t' + w_tt = 0.

Galerkin with polynomials x^2 P_k(2 x - 1), orthonormal in the mass; the free end's conditions
are natural.  The unsteady flow term keeps the derivative on w, so the follower nature stays.
"""

import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss

from continuation.jax_system import JaxSystem


def pipe_matrices(count: int):
    """Stiffness, flow stiffness and Coriolis matrices for an identity mass, (count, count)."""
    points, weights = leggauss(2 * count + 8)
    points, weights = 0.5 * (points + 1), 0.5 * weights
    clamped = Polynomial([0, 0, 1])
    shifted = [np.polynomial.Legendre.basis(k, domain=[0, 1]).convert(kind=Polynomial) for k in range(count)]
    basis = [clamped * p for p in shifted]
    values = [np.stack([f.deriv(m)(points) if m else f(points) for f in basis]) for m in range(3)]
    mass = (values[0] * weights) @ values[0].T
    lower = np.linalg.inv(np.linalg.cholesky(mass))
    w, d, dd = (lower @ v for v in values)
    return (dd * weights) @ dd.T, (w * weights) @ dd.T, (w * weights) @ d.T


def pipe(count: int = 14) -> JaxSystem:
    """First-order form, 2 * count unknowns; parameters beta (mass ratio) and u (velocity)."""
    bending, flow, coriolis = map(jnp.asarray, pipe_matrices(count))

    def residual(state, mu):
        q, v = state[:count], state[count:]
        u = mu["u"]
        force = bending @ q + u**2 * (flow @ q) + 2 * jnp.sqrt(mu["beta"]) * u * (coriolis @ v)
        return jnp.concatenate([v, -force])

    return JaxSystem(residual, 2 * count)
