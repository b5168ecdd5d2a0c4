"""The Brusselator, well mixed and with diffusion in one dimension."""

import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from continuation.jax_system import JaxSystem


def brusselator() -> JaxSystem:
    """x' = A - (B + 1) x + x^2 y, y' = B x - x^2 y; equilibrium (A, B/A)."""

    def residual(u, mu):
        x, y = u
        return jnp.stack([mu["A"] - (mu["B"] + 1) * x + x**2 * y, mu["B"] * x - x**2 * y])

    return JaxSystem(residual, 2)


def brusselator_1d(points: int) -> JaxSystem:
    """On a line of length ``l`` (time and diffusion scaled to [0, 1]), ends held at (A, B/A).

    Unknowns are interior values, x and y of a node side by side; diffusion by second-order
    differences.  Parameters A, B, l, D1, D2.
    """
    h = 1.0 / (points + 1)

    def residual(u, mu):
        x, y = u[0::2], u[1::2]
        a, b = mu["A"], mu["B"]

        def spread(v, edge):
            full = jnp.concatenate([jnp.array([edge]), v, jnp.array([edge])])
            return (full[2:] - 2 * full[1:-1] + full[:-2]) / h**2

        fx = mu["D1"] / mu["l"] ** 2 * spread(x, a) + a - (b + 1) * x + x**2 * y
        fy = mu["D2"] / mu["l"] ** 2 * spread(y, b / a) + b * x - x**2 * y
        return jnp.stack([fx, fy], axis=1).ravel()

    pattern = sp.kron(sp.diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(points, points)), np.ones((2, 2)))
    return JaxSystem(residual, 2 * points, sparsity=pattern)
