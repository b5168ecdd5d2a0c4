"""Small systems whose bifurcations are known in closed form."""

import jax.numpy as jnp
import numpy as np

from continuation.jax_system import JaxSystem


def pitchfork() -> JaxSystem:
    """x' = mu x - x^3 + e, with a decoupled stable y."""
    return JaxSystem(lambda u, mu: jnp.stack([mu["mu"] * u[0] - u[0] ** 3 + mu["e"], -u[1] + u[0] ** 2]), 2)


def transcritical() -> JaxSystem:
    """x' = mu x - x^2, with a decoupled stable y."""
    return JaxSystem(lambda u, mu: jnp.stack([mu["mu"] * u[0] - u[0] ** 2, -u[1]]), 2)


def cusp() -> JaxSystem:
    """x' = a + b x - x^3: folds at 27 a^2 = 4 b^3."""
    return JaxSystem(lambda u, mu: mu["a"] + mu["b"] * u - u**3, 1)


def bogdanov_takens() -> JaxSystem:
    """x' = y, y' = b1 + b2 x + x^2 + s x y, s = mu["s"].

    Fold: b2^2 = 4 b1; Hopf (s = -1): b1 = 0, b2 < 0, omega^2 = -b2; both meet at the origin.
    """
    return JaxSystem(lambda u, mu: jnp.stack([u[1], mu["b1"] + mu["b2"] * u[0] + u[0] ** 2 + mu["s"] * u[0] * u[1]]), 2)


def bautin() -> JaxSystem:
    """z' = (mu + i) z + nu z |z|^2 - z |z|^4: generalised Hopf at mu = nu = 0."""

    def residual(u, mu):
        r2 = u[0] ** 2 + u[1] ** 2
        a = mu["mu"] + mu["nu"] * r2 - r2**2
        return jnp.stack([a * u[0] - u[1], u[0] + a * u[1]])

    return JaxSystem(residual, 2)


def stuart_landau(mass=None) -> JaxSystem:
    """z' = (mu + i w) z - (1 + i c) z |z|^2: cycle |z|^2 = mu, frequency w - c mu."""

    def residual(u, mu):
        x, y = u
        r2 = x**2 + y**2
        return jnp.stack(
            [mu["mu"] * x - mu["w"] * y - r2 * (x - mu["c"] * y), mu["mu"] * y + mu["w"] * x - r2 * (y + mu["c"] * x)]
        )

    return JaxSystem(residual, 2, mass=mass)


def warped_stuart_landau(sparsity=None) -> JaxSystem:
    """Stuart-Landau multiplied by a mass that depends on the state and on ``mu``.

    ``B(u) u' = B(u) f(u)`` has the orbits of ``u' = f(u)``, so its normal form is known,
    while every derivative of the mass takes part in computing it.
    """
    plain = stuart_landau()

    def apply(u, mu, v):
        x, y = u
        matrix = jnp.array([[2 + x + y**2, 0.3 * x * y - y], [x**2 + mu["mu"] * y, 1 + x * y - x]])
        return matrix @ v

    return JaxSystem(lambda u, mu: apply(u, mu, plain._residual(u, mu)), 2, apply, sparsity)


def subcritical_double(values=np.array([1.0, 2.5])) -> JaxSystem:
    """Two uncoupled oscillators; one gains stability at mu = 0 while the other loses it.

    The number of unstable eigenvalues does not change across mu = 0.
    """
    w1, w2 = values

    def residual(u, mu):
        a, b = u[:2], u[2:]
        m = mu["mu"]
        return jnp.stack(
            [
                m * a[0] - w1 * a[1] - a[0] ** 3,
                w1 * a[0] + m * a[1],
                -m * b[0] - w2 * b[1] - b[0] ** 3,
                w2 * b[0] - m * b[1],
            ]
        )

    return JaxSystem(residual, 4)
