"""Directors from two rotation unknowns: the exponential map in the tangent plane of the reference director.

d(theta) = cos(r) D + sin(r)/r (theta_1 T_1 + theta_2 T_2), r^2 = theta_1^2 + theta_2^2: total, free of history and
regular for r < pi.

Equation (T.1) of docs/theory.md.
"""

from __future__ import annotations

import jax.numpy as jnp
import numba
import numpy as np

SERIES_BELOW = 1e-2  # r^2 under which the series is more accurate than the closed form


def director(theta, reference, frame):
    """Director (3,) from rotations (2,), reference director (3,) and frame (2, 3); traceable by jax."""
    s = theta @ theta
    small = s < SERIES_BELOW
    safe = jnp.where(small, 1.0, s)
    root = jnp.sqrt(safe)
    cos = jnp.where(small, 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90)))), jnp.cos(root))
    sinc = jnp.where(
        small, 1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72 * (1 - s / 110)))), jnp.sin(root) / root
    )
    return cos * reference + sinc * (theta @ frame)


@numba.njit(cache=True)
def director_derivatives(theta, reference, frame, d, d1, d2):
    """Directors and their first and second derivatives for all nodes.

    Fills d (nn, 3), d1 (nn, 2, 3) and d2 (nn, 3, 3); the rows of d2 are the derivatives 11, 22, 12.
    """
    for n in range(theta.shape[0]):
        a = theta[n, 0]
        b = theta[n, 1]
        s = a * a + b * b
        if s < SERIES_BELOW:
            cos = 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56 * (1 - s / 90))))
            sinc = 1 - s / 6 * (1 - s / 20 * (1 - s / 42 * (1 - s / 72 * (1 - s / 110))))
            # derivatives of sinc with respect to s, term by term
            p = -1 / 6 * (1 - s / 10 * (1 - s / 28 * (1 - s / 54 * (1 - s / 88))))
            pp = 1 / 60 * (1 - s / 14 * (1 - s / 36 * (1 - s / 66)))
        else:
            r = np.sqrt(s)
            cos = np.cos(r)
            sinc = np.sin(r) / r
            p = (cos - sinc) / (2 * s)
            pp = -(0.5 * sinc + 3 * p) / (2 * s)
        for i in range(3):
            ref = reference[n, i]
            f1 = frame[n, 0, i]
            f2 = frame[n, 1, i]
            t = a * f1 + b * f2
            d[n, i] = cos * ref + sinc * t
            d1[n, 0, i] = -sinc * a * ref + 2 * p * a * t + sinc * f1
            d1[n, 1, i] = -sinc * b * ref + 2 * p * b * t + sinc * f2
            common = -sinc * ref + 2 * p * t
            d2[n, 0, i] = common + a * a * (-2 * p * ref + 4 * pp * t) + 4 * p * a * f1
            d2[n, 1, i] = common + b * b * (-2 * p * ref + 4 * pp * t) + 4 * p * b * f2
            d2[n, 2, i] = a * b * (-2 * p * ref + 4 * pp * t) + 2 * p * (a * f2 + b * f1)
