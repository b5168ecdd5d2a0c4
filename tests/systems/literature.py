"""Systems of the literature whose bifurcations are known in closed form or with published digits."""

import jax.numpy as jnp
import numpy as np

from continuation.jax_system import JaxSystem


def fitzhugh_nagumo(rate: float) -> JaxSystem:
    """v' = v - v^3 / 3 - w + I, w' = rate (v + 0.7 - 0.8 w); FitzHugh, Biophys. J. 1 (1961) 445, rate 0.08."""

    def residual(u, mu):
        v, w = u
        return jnp.stack([v - v**3 / 3 - w + mu["I"], rate * (v + 0.7 - 0.8 * w)])

    return JaxSystem(residual, 2)


def hodgkin_huxley() -> JaxSystem:
    """Squid axon at 6.3 degrees, mV from rest, ms, uA/cm^2; Hodgkin & Huxley, J. Physiol. 117 (1952) 500, table 3."""

    def residual(u, mu):
        v, m, h, n = u
        rates = (
            (0.1 * (25 - v) / jnp.expm1((25 - v) / 10), 4 * jnp.exp(-v / 18), m),
            (0.07 * jnp.exp(-v / 20), 1 / (jnp.exp((30 - v) / 10) + 1), h),
            (0.01 * (10 - v) / jnp.expm1((10 - v) / 10), 0.125 * jnp.exp(-v / 80), n),
        )
        ions = 120 * m**3 * h * (v - 115) + 36 * n**4 * (v + 12) + 0.3 * (v - 10.613)
        return jnp.stack([mu["I"] - ions, *(a * (1 - x) - b * x for a, b, x in rates)])

    return JaxSystem(residual, 4)


def predator_prey() -> JaxSystem:
    """u' = 3 u (1 - u) - u v - p (1 - exp(-5 u)), v' = -v + 3 u v: the demonstration pp2 of AUTO-07p."""

    def residual(x, mu):
        u, v = x
        return jnp.stack([3 * u * (1 - u) - u * v - mu["p"] * (1 - jnp.exp(-5 * u)), -v + 3 * u * v])

    return JaxSystem(residual, 2)


def lorenz_84() -> JaxSystem:
    """Atmosphere of Lorenz, Tellus 36A (1984) 98, with a = 1/4 and b = 4."""

    def residual(u, mu):
        x, y, z = u
        return jnp.stack([-(y**2) - z**2 - x / 4 + mu["F"] / 4, x * y - 4 * x * z - y + mu["G"], 4 * x * y + x * z - z])

    return JaxSystem(residual, 3)


def roessler() -> JaxSystem:
    """x' = -y - z, y' = x + a y, z' = b + z (x - c); Roessler, Phys. Lett. A 57 (1976) 397."""

    def residual(u, mu):
        x, y, z = u
        return jnp.stack([-y - z, x + mu["a"] * y, mu["b"] + z * (x - mu["c"])])

    return JaxSystem(residual, 3)


def gelfand(dimension: int, order: int) -> JaxSystem:
    """Laplacian u + lambda exp(u) = 0 in the unit ball, u = 0 on it; radial, Chebyshev collocation in s = r^2.

    The Laplacian is 4 s u_ss + 2 d u_s, regular at the centre; unknowns are u at the points within, from s near 1 to 0.
    """
    i = np.arange(order + 1)
    s = 0.5 * (1 + np.cos(np.pi * i / order))
    c = np.where((i == 0) | (i == order), 2.0, 1.0) * (-1.0) ** i
    slope = np.outer(c, 1 / c) / (s[:, None] - s[None, :] + np.eye(order + 1))
    slope -= np.diag(slope.sum(axis=1))
    laplacian = jnp.asarray((4 * s[:, None] * (slope @ slope) + 2 * dimension * slope)[1:, 1:])
    return JaxSystem(lambda u, mu: laplacian @ u + mu["lambda"] * jnp.exp(u), order)
