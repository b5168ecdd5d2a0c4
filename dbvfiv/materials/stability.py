"""Loss of material stability of a rubber, under slow and under instantaneous strain.

Criterion: Hill's inequality (Drucker's postulate for an elastic solid), d tau : D > 0 for every
isochoric stretching D, with tau the Kirchhoff stress and its co-rotational rate. It does not
depend on the pressure, hence not on plane stress, and is satisfied at all strains by a Mooney
material with non-negative constants, whereas convexity in Green-Lagrange strain is not: the sound
W = C01 (I2 - 3) loses that in tension at the stretch 4^(1/3). In principal axes, with
a_i = l_i^2, b_i = l_i^-2 and W1, W11, ... the derivatives of W by I1 and I2, it asks that

    H_ij = 4 delta_ij (a_i W1 + b_i W2) + 4 (a_i a_j W11 - (a_i b_j + b_i a_j) W12 + b_i b_j W22)
                                                                     is positive on traceless vectors,
    2 (W1 + l_k^2 W2) (a_i - a_j)/(ln l_i - ln l_j) > 0               for the three shears ij,

each of which equals 2 mu at rest. The margin is the least of the five over 2 mu. The second line
is the Baker-Ericksen inequality (the greater stress along the greater stretch), scaled by logarithmic strains.

With quasi-linear viscoelasticity (Maxwell branches dh_j = g_j dS beside the slow stress S) a fast change meets the
material tangent C of S times r = 1 + sum g_j, but the same stress, so

    d tau : D = r E' : C : E' + 2 tau : (D D),     E' = F^T D F,

must be positive for every D. That is linear in r: if it holds at r = 1, where it is Hill's inequality, and at the
largest r, it holds between. Since E' : C : E' is Hill's form less 2 tau : (D D) and both are diagonal in the principal
axes but for the normal strains, the moduli are r H - (r - 1) 2 tau, the pressure in tau being that of S33 = 0. At a
very large r they are those of the Green-Lagrange tangent alone.

Moduli and stresses are linear in W, hence in constants that W is linear in: the C_ij of W = sum C_ij (I1 - 3)^i
(I2 - 3)^j, the m0 of a knee and, at fixed exponents, Ogden's mu_p, for which tau_i = mu_p l_i^alpha_p. They are stored
as symmetric matrices (..., 5, 5): the 2 x 2 block on traceless vectors, then the three shears (23, 31, 12).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from dbvfiv.materials.energy import KNEE, MOONEY_RIVLIN, OGDEN_FROM, plane_stress_invariants
from dbvfiv.materials.laws import Law, MaterialError

LARGEST_LOG_STRAIN = float(np.log(10.0))
_EDGE_SAMPLES = 801
#: Powers (i, j) of I1 - 3 and I2 - 3 that the first five constants of a wall's rubber multiply.
RUBBER_POWERS = ((1, 0), (0, 1), (1, 1), (2, 0), (3, 0))
_TRACELESS = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])


def _polynomial_slopes(i1, i2, i: int, j: int) -> tuple[np.ndarray, ...]:
    """Derivatives W1, W2, W11, W12, W22 of (I1 - 3)^i (I2 - 3)^j, at I1 - 3 and I2 - 3."""
    (one, a, aa), (other, b, bb) = _powers(i1, i), _powers(i2, j)
    return a * other, one * b, aa * other, a * b, one * bb


def _powers(x: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x^n and its first two derivatives."""
    none = np.zeros_like(x)
    return x**n, n * x ** (n - 1) if n else none, n * (n - 1) * x ** (n - 2) if n > 1 else none


def _knee_slopes(i1, x0) -> tuple[np.ndarray, ...]:
    """Derivatives of x0 (sqrt(1 + (I1 - 3)/x0) - 1), at I1 - 3."""
    first = 0.5 / np.sqrt(1.0 + i1 / x0)
    none = np.zeros_like(first)
    return first, none, -0.5 * first / (x0 + i1), none, none


def _slopes(parameters, i1, i2) -> list[np.ndarray]:
    """Derivatives W1, W2, W11, W12, W22, each (..., 1), of the energy of a rubber but for Ogden's terms."""
    parts = [(c, _polynomial_slopes(i1, i2, *power)) for c, power in zip(parameters, RUBBER_POWERS) if c != 0.0]
    if parameters[5] != 0.0:
        parts.append((parameters[5], _knee_slopes(i1, parameters[KNEE])))
    return [sum((c * slopes[k] for c, slopes in parts), np.zeros_like(i1))[..., None] for k in range(5)]


def principal_stress(parameters, log_stretches) -> np.ndarray:
    """Principal Kirchhoff stresses of a rubber but for a pressure, Pa; 0 at rest, without loss of digits about it.

    Parameters
    ----------
    parameters : array_like
        See `dbvfiv.materials.energy.rubber_energy`; complex ones give complex stresses.
    log_stretches : array_like, shape (..., 3)
        Principal logarithmic strains with zero sum.
    """
    ln = np.asarray(log_stretches, dtype=float)
    grown, shrunk = np.expm1(2.0 * ln), np.expm1(-2.0 * ln)
    w1, w2, *_ = _slopes(parameters, grown.sum(axis=-1), shrunk.sum(axis=-1))
    stress = 2.0 * (grown * w1 - shrunk * w2)
    for mu, alpha in np.reshape(parameters[OGDEN_FROM:], (-1, 2)):
        stress = stress + mu * np.expm1(alpha * ln)
    return stress


def rubber_moduli(parameters, log_stretches) -> np.ndarray:
    """Hill moduli (..., 5, 5) of a rubber, Pa; arguments as `principal_stress` has them."""
    ln = np.asarray(log_stretches, dtype=float)
    invariants = (np.expm1(sign * 2.0 * ln).sum(axis=-1) for sign in (1, -1))
    w1, w2, w11, w12, w22 = _slopes(parameters, *invariants)
    a, b = np.exp(2.0 * ln), np.exp(-2.0 * ln)
    cross = a[..., :, None] * b[..., None, :]
    second = w11[..., None] * a[..., :, None] * a[..., None, :] + w22[..., None] * b[..., :, None] * b[..., None, :]
    second = second - w12[..., None] * (cross + np.swapaxes(cross, -1, -2))
    normal = 4.0 * (a * w1 + b * w2)[..., None] * np.eye(3) + 4.0 * second
    # (a_i - a_j)/(ln l_i - ln l_j) = 2 exp(ln l_i + ln l_j) sinh(d)/d
    apart = _differences(ln)
    shear = 4.0 * np.exp(-ln) * _sinhc(apart) * (w1 + a * w2)
    for mu, alpha in np.reshape(parameters[OGDEN_FROM:], (-1, 2)):
        normal = normal + mu * alpha * np.exp(alpha * ln)[..., None] * np.eye(3)
        shear = shear + mu * alpha * np.exp(-0.5 * alpha * ln) * _sinhc(0.5 * alpha * apart)
    return _assembled(normal, shear)


def least_modulus(moduli) -> np.ndarray:
    """Least eigenvalue of Hill moduli (..., 5, 5) -> (...)."""
    mean = 0.5 * (moduli[..., 0, 0] + moduli[..., 1, 1])
    lower = mean - np.hypot(0.5 * (moduli[..., 0, 0] - moduli[..., 1, 1]), moduli[..., 0, 1])
    return np.minimum(lower, moduli[..., [2, 3, 4], [2, 3, 4]].min(axis=-1))


def _differences(ln: np.ndarray) -> np.ndarray:
    """Differences of the two logarithmic strains across each axis."""
    return np.roll(ln, -1, axis=-1) - np.roll(ln, -2, axis=-1)


def _assembled(normal, shear) -> np.ndarray:
    """Moduli (..., 5, 5) from those of normal strains (..., 3, 3) and of shears (..., 3)."""
    out = np.zeros(shear.shape[:-1] + (5, 5))
    out[..., :2, :2] = _TRACELESS @ normal @ _TRACELESS.T
    out[..., [2, 3, 4], [2, 3, 4]] = shear
    return out


def _sinhc(x: np.ndarray) -> np.ndarray:
    safe = np.where(np.abs(x) < 1e-4, 1.0, x)
    return np.where(np.abs(x) < 1e-4, 1.0 + x * x / 6.0, np.sinh(safe) / safe)


def principal_log_strains(strains) -> np.ndarray:
    """Principal logarithmic strains of an incompressible sheet.

    Parameters
    ----------
    strains : array_like, shape (..., 5)
        ``[E11, E22, 2 E12, 2 E13, 2 E23]``.

    Returns
    -------
    numpy.ndarray, shape (..., 3)
        Ascending, with zero sum; NaN where det C2 <= 0, which no sheet can reach.
    """
    return _principal(strains)[0]


def _principal(strains) -> tuple[np.ndarray, np.ndarray]:
    """`principal_log_strains`, and the squares (..., 3) of the cosines between their axes and the normal."""
    e = np.asarray(strains, dtype=float)
    inv = plane_stress_invariants(np.moveaxis(e, -1, 0))
    possible = inv.in_plane_determinant > 0.0
    safe = np.where(possible[..., None], e, 0.0)
    c = np.zeros(e.shape[:-1] + (3, 3))
    c[..., 0, 0] = 1.0 + 2.0 * safe[..., 0]
    c[..., 1, 1] = 1.0 + 2.0 * safe[..., 1]
    c[..., 0, 1] = c[..., 1, 0] = safe[..., 2]
    c[..., 0, 2] = c[..., 2, 0] = safe[..., 3]
    c[..., 1, 2] = c[..., 2, 1] = safe[..., 4]
    i1 = np.where(possible, inv.i1_minus_3, 0.0)
    c[..., 2, 2] = 3.0 + i1 - c[..., 0, 0] - c[..., 1, 1]
    # both diagonal entries negative also gives a positive determinant
    possible &= (c[..., 0, 0] > 0.0) & (c[..., 1, 1] > 0.0)
    values, axes = np.linalg.eigh(np.where(possible[..., None, None], c, np.eye(3)))
    ln = 0.5 * np.log(np.maximum(values, np.finfo(float).tiny))
    ln -= ln.mean(axis=-1, keepdims=True)
    return np.where(possible[..., None], ln, np.nan), axes[..., 2, :] ** 2


def hill_margin(law: Law, log_stretches) -> np.ndarray:
    """Least Hill modulus over 2 mu at given principal logarithmic strains (..., 3) -> (...)."""
    ln = np.asarray(log_stretches, dtype=float)
    valid = np.all(np.isfinite(ln), axis=-1)
    ln = np.where(valid[..., None], ln, 0.0)
    moduli = rubber_moduli(law.parameters, ln)
    return np.where(valid, least_modulus(moduli) / (2.0 * law.small_strain_shear_modulus), -np.inf)


def stability_margin(law: Law, strains, instantaneous: float = 1.0) -> np.ndarray:
    """Share of its initial stiffness that a material keeps in its weakest direction, slow or instantaneous. Raises
    MaterialError for strains whose last axis is not of length five, or an instantaneous modulus below the slow one.

    Parameters
    ----------
    strains : array_like, shape (..., 5)
        Green-Lagrange strains ``[E11, E22, 2 E12, 2 E13, 2 E23]`` as they occur in a solution.
    instantaneous : float
        r, the instantaneous tangent over the slow one: 1 + the sum of the strengths of a Prony series; 1 for a material
        that does not relax.

    Returns
    -------
    numpy.ndarray, shape (...)
        The lesser of both criteria (see the module): 1 at rest, 0 at the limit of stability, negative beyond; ``-inf``
        where the strain is impossible for a sheet (det C2 <= 0) or not finite. 1 for the linear laws; the softening of
        St Venant-Kirchhoff materials in strong compression is not looked at.
    """
    e = np.asarray(strains, dtype=float)
    if e.ndim == 0 or e.shape[-1] != 5:
        raise MaterialError(f"Strains must have five components on the last axis, but their shape is {e.shape}.")
    if not 1.0 <= instantaneous < np.inf:
        raise MaterialError(
            f"The instantaneous modulus over the slow one must be finite and at least 1, but {instantaneous:g} was "
            "given."
        )
    finite = np.all(np.isfinite(e), axis=-1)
    if law.kind != MOONEY_RIVLIN:
        return np.where(finite, 1.0, -np.inf)
    e = np.where(finite[..., None], e, 0.0)
    logs, normal = _principal(e)
    possible = finite & np.isfinite(logs[..., 0])
    ln = np.where(possible[..., None], logs, 0.0)
    moduli = rubber_moduli(law.parameters, ln)
    least = least_modulus(moduli)
    if instantaneous > 1.0:
        stress = principal_stress(law.parameters, ln)
        stressed = (1.0 - 1.0 / instantaneous) * _stress_moduli(ln, stress, normal)
        least = np.minimum(least, least_modulus(moduli - stressed))
    return np.where(possible, least / (2.0 * law.small_strain_shear_modulus), -np.inf)


def _stress_moduli(ln, stress, normal) -> np.ndarray:
    """2 tau : (D D) as moduli (..., 5, 5) in principal axes, with the pressure that makes S33 = 0.

    Parameters
    ----------
    ln, stress, normal : (..., 3) arrays
        Logarithmic strains, stresses but for a pressure, squared cosines between the axes and the normal.
    """
    share = normal * np.exp(-2.0 * ln)  # S33 is the sum of (tau_i - p) share_i
    tau = stress - np.sum(stress * share, axis=-1, keepdims=True) / share.sum(axis=-1, keepdims=True)
    pairs = tau.sum(axis=-1, keepdims=True) - tau
    # (b_i + b_j)/(b_i - b_j) (ln l_i - ln l_j): from D to rates of the logarithmic strain
    apart = _differences(ln)
    safe = np.where(np.abs(apart) < 1e-4, 1.0, apart)
    rate = np.where(np.abs(apart) < 1e-4, 1.0 + apart * apart / 3.0, safe / np.tanh(safe))
    return _assembled(2.0 * tau[..., None] * np.eye(3), pairs / rate)


@dataclass(frozen=True)
class StableRange:
    """Stretches between which a rubber is stable, along paths from rest."""

    #: uniaxial, equibiaxial and pure_shear: lowest and highest stretch; 0 and ``inf`` where no limit was found within a
    #: logarithmic strain of ln 10.
    uniaxial: tuple[float, float]
    equibiaxial: tuple[float, float]
    pure_shear: tuple[float, float]
    #: Radius of the largest ball of stable states, sqrt(2/3) |ln U| (the logarithmic strain of uniaxial tension);
    #: ``inf`` if no limit was found.
    equivalent_strain: float


# Principal logarithmic strains per unit logarithm of the named stretch.
_PATHS = {
    "uniaxial": np.array([1.0, -0.5, -0.5]),
    "equibiaxial": np.array([1.0, 1.0, -2.0]),
    "pure_shear": np.array([1.0, 0.0, -1.0]),
}


def stable_range(law: Law, directions: int = 31) -> StableRange:
    """Range of stretches, in each standard test and in any, within which Hill's inequality holds.

    The linear laws are reported without limits. `directions` are the strain directions searched for the nearest limit,
    over the sixth of the deviatoric plane that isotropy leaves.
    """
    if law.kind != MOONEY_RIVLIN:
        free = (0.0, float("inf"))
        return StableRange(free, free, free, float("inf"))
    ends = {
        name: tuple(float(np.exp(sign * _distance_to_limit(law, sign * path))) for sign in (-1.0, 1.0))
        for name, path in _PATHS.items()
    }
    return StableRange(**ends, equivalent_strain=min(_distance_to_limit(law, ray) for ray in strain_rays(directions)))


def strain_rays(count: int) -> np.ndarray:
    """Principal logarithmic strains (count, 3) of equivalent strain 1, over the sixth of all that isotropy leaves."""
    angles = np.linspace(0.0, np.pi / 3.0, count)
    return np.stack([np.cos(angles - k * 2.0 * np.pi / 3.0) for k in range(3)], axis=-1)


def _distance_to_limit(law: Law, ray: np.ndarray) -> float:
    """Logarithmic distance along a traceless ray to the first loss of stability, or inf."""
    largest = LARGEST_LOG_STRAIN / np.sqrt(2.0 / 3.0 * np.sum(ray**2))
    # quadratic spacing: limits of the fitted sets lie at a few per cent
    distance = largest * np.linspace(0.0, 1.0, _EDGE_SAMPLES) ** 2
    lost = np.flatnonzero(hill_margin(law, distance[:, None] * ray) <= 0.0)
    if lost.size == 0:
        return float("inf")
    low, high = distance[lost[0] - 1], distance[lost[0]]
    return float(brentq(lambda s: float(hill_margin(law, s * ray)), low, high, xtol=1e-13))
