"""Hill moduli of incompressible rubbers in principal axes.

With tau_i = dW/d(ln l_i) the moduli are d tau_i/d(ln l_j) on traceless vectors and (tau_i - tau_j)/(ln l_i - ln l_j)
for the three shears. Both are linear in W, hence in constants that W is linear in: the C_ij of

    W = sum C_ij (I1 - 3)^i (I2 - 3)^j,

the m0 of a knee W = m0 x0 (sqrt(1 + (I1 - 3)/x0) - 1) and, at fixed exponents, the mu_p of Ogden's
W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dbvfiv.materials.law import OGDEN_FROM

#: Powers (i, j) of I1 - 3 and I2 - 3 that the first five constants of a wall's rubber multiply.
RUBBER_POWERS = ((1, 0), (0, 1), (1, 1), (2, 0), (3, 0))
_TRACELESS = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


class Slopes(NamedTuple):
    """Derivatives of W by I1 and I2, each an array (...)."""

    w1: np.ndarray
    w2: np.ndarray
    w11: np.ndarray
    w12: np.ndarray
    w22: np.ndarray


def polynomial_slopes(i1, i2, power: tuple[int, int]) -> Slopes:
    """Derivatives of (I1 - 3)^i (I2 - 3)^j by I1 and I2, at I1 - 3 and I2 - 3."""
    i, j = power
    return Slopes(
        _power(i1, i, 1) * i2**j,
        i1**i * _power(i2, j, 1),
        _power(i1, i, 2) * i2**j,
        _power(i1, i, 1) * _power(i2, j, 1),
        i1**i * _power(i2, j, 2),
    )


def knee_slopes(i1, x0: float) -> Slopes:
    """Derivatives of x0 (sqrt(1 + (I1 - 3)/x0) - 1) by I1 and I2, at I1 - 3."""
    first = 0.5 / np.sqrt(1.0 + i1 / x0)
    none = np.zeros_like(first)
    return Slopes(first, none, -0.5 * first / (x0 + i1), none, none)


def rubber_moduli(parameters, log_stretches) -> tuple[np.ndarray, np.ndarray]:
    """Hill moduli of a rubber and its principal Kirchhoff stresses but for a pressure, Pa.

    Parameters
    ----------
    parameters : array_like
        See `law.Law`.
    log_stretches : array_like, shape (..., 3)

    Returns
    -------
    moduli, stress : arrays (..., 5, 5) and (..., 3)
    """
    ln = np.asarray(log_stretches, dtype=float)
    i1, i2 = invariants(ln)
    parts = [(c, polynomial_slopes(i1, i2, power)) for c, power in zip(parameters, RUBBER_POWERS) if c != 0.0]
    if parameters[5] != 0.0:
        parts.append((parameters[5], knee_slopes(i1, parameters[6])))
    slopes = Slopes(*(sum((c * slopes[k] for c, slopes in parts), np.zeros_like(i1)) for k in range(5)))
    moduli = moduli_of(ln, slopes)
    stress = 2.0 * (np.exp(2.0 * ln) * slopes.w1[..., None] - np.exp(-2.0 * ln) * slopes.w2[..., None])
    terms = np.reshape(parameters[OGDEN_FROM:], (-1, 2))
    for mu, alpha in terms[terms[:, 0] != 0.0]:
        moduli = moduli + mu * ogden_moduli(ln, [alpha])[..., 0, :, :]
        stress = stress + mu * np.exp(alpha * ln)
    return moduli, stress


def invariants(log_stretches) -> tuple[np.ndarray, np.ndarray]:
    """I1 - 3 and I2 - 3 (...) of principal logarithmic strains (..., 3) with zero sum, accurate near rest."""
    ln = np.asarray(log_stretches, dtype=float)
    return np.sum(np.expm1(2.0 * ln), axis=-1), np.sum(np.expm1(-2.0 * ln), axis=-1)


def moduli_of(log_stretches, slopes: Slopes) -> np.ndarray:
    """The Hill moduli of an energy of both invariants.

    Parameters
    ----------
    log_stretches : array_like, shape (..., 3)
        Principal logarithmic strains with zero sum.
    slopes : Slopes
        At these states.

    Returns
    -------
    numpy.ndarray, shape (..., 5, 5)
        A symmetric matrix: the 2x2 block on traceless vectors, followed by the three shears (23, 31, 12) on the
        diagonal.
    """
    ln = np.asarray(log_stretches, dtype=float)
    w1, w2, w11, w12, w22 = (w[..., None] for w in slopes)
    a, b = np.exp(2.0 * ln), np.exp(-2.0 * ln)
    aa, bb = a[..., :, None] * a[..., None, :], b[..., :, None] * b[..., None, :]
    cross = a[..., :, None] * b[..., None, :]
    cross = cross + np.swapaxes(cross, -1, -2)
    second = w11[..., None] * aa - w12[..., None] * cross + w22[..., None] * bb
    normal = 4.0 * (a * w1 + b * w2)[..., None] * np.eye(3) + 4.0 * second
    # (a_i - a_j)/(ln l_i - ln l_j) = 2 exp(ln l_i + ln l_j) sinh(d)/d
    return assembled(normal, 4.0 * np.exp(-ln) * _sinhc(differences(ln)) * (w1 + a * w2))


def hill_moduli(log_stretches, powers) -> np.ndarray:
    """The Hill moduli per unit of each constant of a polynomial in the invariants, (..., n, 5, 5); see `moduli_of`.

    Parameters
    ----------
    log_stretches : array_like, shape (..., 3)
    powers : sequence of (int, int)
        Powers of I1 - 3 and I2 - 3 that each constant multiplies.
    """
    i1, i2 = invariants(log_stretches)
    return np.stack([moduli_of(log_stretches, polynomial_slopes(i1, i2, power)) for power in powers], axis=-3)


def ogden_moduli(log_stretches, exponents) -> np.ndarray:
    """The Hill moduli per unit of each mu_p of Ogden's law, (..., n, 5, 5); see `moduli_of`.

    Parameters
    ----------
    log_stretches : array_like, shape (..., 3)
    exponents : sequence of float
        The alpha_p.
    """
    ln = np.asarray(log_stretches, dtype=float)
    found = []
    for alpha in exponents:
        normal = alpha * np.exp(alpha * ln)[..., None] * np.eye(3)
        # (l_i^alpha - l_j^alpha)/(ln l_i - ln l_j), with ln l_i + ln l_j = -ln l_k
        found.append(assembled(normal, alpha * np.exp(-0.5 * alpha * ln) * _sinhc(0.5 * alpha * differences(ln))))
    return np.stack(found, axis=-3)


def least_modulus(moduli) -> np.ndarray:
    """Least eigenvalue of Hill moduli (..., 5, 5) -> (...)."""
    mean = 0.5 * (moduli[..., 0, 0] + moduli[..., 1, 1])
    lower = mean - np.hypot(0.5 * (moduli[..., 0, 0] - moduli[..., 1, 1]), moduli[..., 0, 1])
    return np.minimum(lower, moduli[..., [2, 3, 4], [2, 3, 4]].min(axis=-1))


def differences(ln: np.ndarray) -> np.ndarray:
    """Differences of the two logarithmic strains across each axis."""
    return np.roll(ln, -1, axis=-1) - np.roll(ln, -2, axis=-1)


def assembled(normal, shear) -> np.ndarray:
    """Moduli (..., 5, 5) from those of normal strains (..., 3, 3) and of shears (..., 3)."""
    out = np.zeros(shear.shape[:-1] + (5, 5))
    out[..., :2, :2] = _TRACELESS @ normal @ _TRACELESS.T
    for k in range(3):
        out[..., 2 + k, 2 + k] = shear[..., k]
    return out


def _power(x: np.ndarray, n: int, times: int) -> np.ndarray:
    """x^n differentiated once or twice."""
    factor = n if times == 1 else n * (n - 1)
    return factor * x ** (n - times) if factor else np.zeros_like(x)


def _sinhc(x: np.ndarray) -> np.ndarray:
    safe = np.where(np.abs(x) < 1e-4, 1.0, x)
    return np.where(np.abs(x) < 1e-4, 1.0 + x * x / 6.0, np.sinh(safe) / safe)
