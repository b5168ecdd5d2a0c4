"""Bratu's problem, laplacian u + lambda exp(u) = 0, u = 0 on the edge of the unit interval or square."""

import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from continuation.jax_system import JaxSystem


def bratu_1d(points: int) -> JaxSystem:
    """Fourth-order compact (Numerov) differences, so that few points suffice."""
    h = 1.0 / (points + 1)

    def residual(u, mu):
        full = jnp.concatenate([jnp.zeros(1), u, jnp.zeros(1)])
        source = mu["lambda"] * jnp.exp(full)
        second = (full[2:] - 2 * full[1:-1] + full[:-2]) / h**2
        return second + (source[2:] + 10 * source[1:-1] + source[:-2]) / 12

    pattern = sp.diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(points, points))
    return JaxSystem(residual, points, sparsity=pattern)


def bratu_chebyshev(order: int) -> JaxSystem:
    """On the square by Chebyshev collocation, (order - 1)^2 interior points, dense."""
    i = np.arange(order + 1)
    x = np.cos(np.pi * i / order)
    c = np.where((i == 0) | (i == order), 2.0, 1.0) * (-1.0) ** i
    gap = x[:, None] - x[None, :] + np.eye(order + 1)
    d = np.outer(c, 1 / c) / gap
    d -= np.diag(d.sum(axis=1))
    # On [0, 1] derivatives are twice those on [-1, 1].
    second = 4.0 * (d @ d)[1:-1, 1:-1]
    second = jnp.asarray(second)

    def residual(u, mu):
        v = u.reshape(order - 1, order - 1)
        return (second @ v + v @ second.T).ravel() + mu["lambda"] * jnp.exp(u)

    return JaxSystem(residual, (order - 1) ** 2)
