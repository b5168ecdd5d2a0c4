"""Hill moduli of incompressible rubbers per unit of each constant, in principal axes.

With tau_i = dW/d(ln l_i) the moduli are d tau_i/d(ln l_j) on traceless vectors and (tau_i - tau_j)/(ln l_i - ln l_j)
for the three shears. Both are linear in W, hence in constants that W is linear in: the C_ij of

    W = sum C_ij (I1 - 3)^i (I2 - 3)^j

and, at fixed exponents, the mu_p of Ogden's W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3).
"""

from __future__ import annotations

import numpy as np

#: Powers (i, j) of I1 - 3 and I2 - 3 that the constants C10, C01 and C11 multiply.
MOONEY_RIVLIN_POWERS = ((1, 0), (0, 1), (1, 1))
#: Those of all constants a wall takes: C20 and C30 too.
RUBBER_POWERS = (*MOONEY_RIVLIN_POWERS, (2, 0), (3, 0))
_TRACELESS = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def hill_moduli(log_stretches, powers=MOONEY_RIVLIN_POWERS) -> np.ndarray:
    """The Hill moduli per unit of each constant of a polynomial in the invariants.

    Parameters
    ----------
    log_stretches : array_like, shape (..., 3)
        Principal logarithmic strains with zero sum.
    powers : sequence of (int, int)
        Powers of I1 - 3 and I2 - 3 that each constant multiplies.

    Returns
    -------
    numpy.ndarray, shape (..., n, 5, 5)
        For each constant a symmetric matrix: the 2x2 block on traceless vectors, followed by
        the three shears (23, 31, 12) on the diagonal.
    """
    ln = np.asarray(log_stretches, dtype=float)
    a, b = np.exp(2.0 * ln), np.exp(-2.0 * ln)
    # expm1 keeps I - 3 accurate near the reference state; the linear terms sum to zero.
    i1 = np.sum(np.expm1(2.0 * ln), axis=-1)[..., None]
    i2 = np.sum(np.expm1(-2.0 * ln), axis=-1)[..., None]
    eye = np.eye(3)
    aa, bb = a[..., :, None] * a[..., None, :], b[..., :, None] * b[..., None, :]
    cross = a[..., :, None] * b[..., None, :]
    cross = cross + np.swapaxes(cross, -1, -2)
    # (a_i - a_j)/(ln l_i - ln l_j) = 2 exp(ln l_i + ln l_j) sinh(d)/d
    slope = 4.0 * np.exp(-ln) * _sinhc(_differences(ln))
    normal, shear = [], []
    for i, j in powers:
        w1, w2 = _power(i1, i, 1) * i2**j, i1**i * _power(i2, j, 1)
        w11, w12, w22 = _power(i1, i, 2) * i2**j, _power(i1, i, 1) * _power(i2, j, 1), i1**i * _power(i2, j, 2)
        second = w11[..., None] * aa - w12[..., None] * cross + w22[..., None] * bb
        normal.append(4.0 * (a * w1 + b * w2)[..., None] * eye + 4.0 * second)
        shear.append(slope * (w1 + a * w2))
    return _assembled(normal, shear)


def ogden_moduli(log_stretches, exponents) -> np.ndarray:
    """The Hill moduli per unit of each mu_p of Ogden's law; see `hill_moduli`.

    Parameters
    ----------
    log_stretches : array_like, shape (..., 3)
    exponents : sequence of float
        The alpha_p.
    """
    ln = np.asarray(log_stretches, dtype=float)
    normal, shear = [], []
    for alpha in exponents:
        normal.append(alpha * np.exp(alpha * ln)[..., None] * np.eye(3))
        # (l_i^alpha - l_j^alpha)/(ln l_i - ln l_j), with ln l_i + ln l_j = -ln l_k
        shear.append(alpha * np.exp(-0.5 * alpha * ln) * _sinhc(0.5 * alpha * _differences(ln)))
    return _assembled(normal, shear)


def least_modulus(moduli) -> np.ndarray:
    """Least eigenvalue of Hill moduli (..., 5, 5) -> (...)."""
    mean = 0.5 * (moduli[..., 0, 0] + moduli[..., 1, 1])
    lower = mean - np.hypot(0.5 * (moduli[..., 0, 0] - moduli[..., 1, 1]), moduli[..., 0, 1])
    return np.minimum(lower, moduli[..., [2, 3, 4], [2, 3, 4]].min(axis=-1))


def _differences(ln: np.ndarray) -> np.ndarray:
    """Differences of the two logarithmic strains across each axis."""
    return np.roll(ln, -1, axis=-1) - np.roll(ln, -2, axis=-1)


def _power(x: np.ndarray, n: int, times: int) -> np.ndarray:
    """x^n differentiated once or twice."""
    factor = n if times == 1 else n * (n - 1)
    return factor * x ** (n - times) if factor else np.zeros_like(x)


def _assembled(normal, shear) -> np.ndarray:
    normal, shear = np.stack(normal, axis=-3), np.stack(shear, axis=-2)
    out = np.zeros(shear.shape[:-1] + (5, 5))
    out[..., :2, :2] = _TRACELESS @ normal @ _TRACELESS.T
    for k in range(3):
        out[..., 2 + k, 2 + k] = shear[..., k]
    return out


def _sinhc(x: np.ndarray) -> np.ndarray:
    safe = np.where(np.abs(x) < 1e-4, 1.0, x)
    return np.where(np.abs(x) < 1e-4, 1.0 + x * x / 6.0, np.sinh(safe) / safe)
