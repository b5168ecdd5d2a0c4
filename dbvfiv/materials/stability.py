"""Where a rubber's constants stop describing a stable material.

Criterion: Hill's inequality (Drucker's postulate for an elastic solid), d tau : D > 0 for every
isochoric stretching D, with tau the Kirchhoff stress and its co-rotational rate. It does not
depend on the pressure, hence not on plane stress, and is satisfied at all strains by a Mooney
material with non-negative constants, whereas convexity in Green-Lagrange strain is not: the sound
W = C01 (I2 - 3) loses that in tension at the stretch 4^(1/3). In principal axes, with
a_i = l_i^2, b_i = l_i^-2, W1 = C10 + C11 (I2 - 3) and W2 = C01 + C11 (I1 - 3), it asks that

    H_ij = 4 delta_ij (a_i W1 + b_i W2) - 4 C11 (a_i b_j + b_i a_j)   is positive on traceless vectors,
    2 (W1 + l_k^2 W2) (a_i - a_j)/(ln l_i - ln l_j) > 0               for the three shears ij,

each of which equals 2 mu at rest. The margin is the least of the five over 2 mu. The second line
is the Baker-Ericksen inequality (the greater stress along the greater stretch), scaled by
logarithmic strains; the shear modulus of the Jaumann rate has the same sign. The Green-Lagrange
tangent that the solver's material stiffness is built from is available as a second measure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import brentq

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.hill import RUBBER_POWERS, hill_moduli, least_modulus
from dbvfiv.materials.incompressible import plane_stress_invariants
from dbvfiv.materials.law import MOONEY_RIVLIN, Law, energy_of

MEASURES = ("hill", "tangent")
LARGEST_LOG_STRAIN = float(np.log(10.0))
_EDGE_SAMPLES = 801


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
    values = np.linalg.eigvalsh(np.where(possible[..., None, None], c, np.eye(3)))
    ln = 0.5 * np.log(np.maximum(values, np.finfo(float).tiny))
    ln -= ln.mean(axis=-1, keepdims=True)
    return np.where(possible[..., None], ln, np.nan)


def hill_margin(law: Law, log_stretches) -> np.ndarray:
    """Least Hill modulus over 2 mu at given principal logarithmic strains (..., 3) -> (...)."""
    ln = np.asarray(log_stretches, dtype=float)
    valid = np.all(np.isfinite(ln), axis=-1)
    by_constant = hill_moduli(np.where(valid[..., None], ln, 0.0), RUBBER_POWERS)
    moduli = np.tensordot(by_constant, law.parameters[: len(RUBBER_POWERS)], axes=([-3], [0]))
    return np.where(valid, least_modulus(moduli) / (2.0 * law.small_strain_shear_modulus), -np.inf)


def stability_margin(law: Law, strains, measure: str = "hill") -> np.ndarray:
    """How much of its initial stiffness the material keeps, in its weakest direction.

    Parameters
    ----------
    law : Law
    strains : array_like, shape (..., 5)
        Green-Lagrange strains ``[E11, E22, 2 E12, 2 E13, 2 E23]`` as they occur in a solution.
    measure : {"hill", "tangent"}
        "hill": least Hill modulus over 2 mu (see the module). "tangent": least eigenvalue of
        d2W/de2 relative to d2W/de2 at rest (generalised eigenvalue). The linear laws have a
        constant tangent, so both are 1 for them; the softening of St Venant-Kirchhoff materials
        in strong compression is not looked at.

    Returns
    -------
    numpy.ndarray, shape (...)
        1 at rest, 0 at the limit of stability, negative beyond; ``-inf`` where the strain is
        impossible for a sheet (det C2 <= 0) or not finite.

    Raises
    ------
    MaterialError
        For an unknown measure or strains whose last axis is not of length five.
    """
    e = np.asarray(strains, dtype=float)
    if e.ndim == 0 or e.shape[-1] != 5:
        raise MaterialError(f"Strains must have five components on the last axis, but their shape is {e.shape}.")
    if measure not in MEASURES:
        raise MaterialError(f"The measure must be one of {', '.join(MEASURES)}, but {measure!r} was given.")
    finite = np.all(np.isfinite(e), axis=-1)
    e = np.where(finite[..., None], e, 0.0)
    if law.kind != MOONEY_RIVLIN:
        return np.where(finite, 1.0, -np.inf)
    logs = principal_log_strains(e)
    if measure == "hill":
        return np.where(finite, hill_margin(law, logs), -np.inf)
    possible = finite & np.isfinite(logs[..., 0])
    return np.where(possible, _tangent_margin(law, np.where(possible[..., None], e, 0.0)), -np.inf)


@jax.jit
def _tangents(kind, parameters, e):
    return jax.vmap(jax.hessian(energy_of, argnums=2), in_axes=(None, None, 0))(kind, parameters, e)


def _tangent_margin(law: Law, e: np.ndarray) -> np.ndarray:
    flat = np.concatenate([np.zeros((1, 5)), e.reshape(-1, 5)])
    tangents = np.asarray(_tangents(law.kind, law.parameters, flat))
    factor = solve_triangular(np.linalg.cholesky(tangents[0]), np.eye(5), lower=True)
    return np.linalg.eigvalsh(factor @ tangents[1:] @ factor.T)[..., 0].reshape(e.shape[:-1])


@dataclass(frozen=True)
class StableRange:
    """Stretches between which a rubber is stable, along paths from rest.

    Attributes
    ----------
    uniaxial, equibiaxial, pure_shear : tuple of float
        Lowest and highest stretch; 0 and ``inf`` where no limit was found within a logarithmic
        strain of ln 10.
    equivalent_strain : float
        Radius of the largest ball of stable states, sqrt(2/3) |ln U| (the logarithmic strain of
        uniaxial tension); ``inf`` if no limit was found.
    weakest_stretches : tuple of float
        Principal stretches at that distance, ascending; NaN if no limit was found.
    """

    uniaxial: tuple[float, float]
    equibiaxial: tuple[float, float]
    pure_shear: tuple[float, float]
    equivalent_strain: float
    weakest_stretches: tuple[float, float, float]


# Principal logarithmic strains per unit logarithm of the named stretch.
_PATHS = {
    "uniaxial": np.array([1.0, -0.5, -0.5]),
    "equibiaxial": np.array([1.0, 1.0, -2.0]),
    "pure_shear": np.array([1.0, 0.0, -1.0]),
}


def stable_range(law: Law, directions: int = 31) -> StableRange:
    """Range of stretches, in each standard test and in any, within which Hill's inequality holds.

    Parameters
    ----------
    law : Law
        The linear laws are reported without limits.
    directions : int
        Number of strain directions searched for the nearest limit, over the sixth of the
        deviatoric plane that isotropy leaves.
    """
    if law.kind != MOONEY_RIVLIN:
        free = (0.0, float("inf"))
        return StableRange(free, free, free, float("inf"), (float("nan"),) * 3)
    return stable_range_of(lambda ln: hill_margin(law, ln), directions)


def stable_range_of(margin: Callable, directions: int = 31) -> StableRange:
    """`stable_range` of any isotropic rubber from its Hill margin.

    Parameters
    ----------
    margin : callable
        From principal logarithmic strains (..., 3) with zero sum to margins (...).
    directions : int
    """
    limits = {
        name: (
            float(np.exp(-_distance_to_limit(margin, -path))),
            float(np.exp(_distance_to_limit(margin, path))),
        )
        for name, path in _PATHS.items()
    }
    angles = np.linspace(0.0, np.pi / 3.0, directions)
    rays = np.stack([np.cos(angles - k * 2.0 * np.pi / 3.0) for k in range(3)], axis=-1)
    reach = np.array([_distance_to_limit(margin, ray) for ray in rays])
    nearest = int(np.argmin(reach))
    stretches = np.exp(np.sort(rays[nearest] * reach[nearest])) if np.isfinite(reach[nearest]) else (np.nan,) * 3
    return StableRange(
        **limits,
        equivalent_strain=float(reach[nearest]),
        weakest_stretches=tuple(float(s) for s in stretches),
    )


def _distance_to_limit(margin: Callable, ray: np.ndarray) -> float:
    """Logarithmic distance along a traceless ray to the first loss of stability, or inf."""
    largest = LARGEST_LOG_STRAIN / np.sqrt(2.0 / 3.0 * np.sum(ray**2))
    # quadratic spacing: limits of the fitted sets lie at a few per cent
    distance = largest * np.linspace(0.0, 1.0, _EDGE_SAMPLES) ** 2
    lost = np.flatnonzero(margin(distance[:, None] * ray) <= 0.0)
    if lost.size == 0:
        return float("inf")
    low, high = distance[lost[0] - 1], distance[lost[0]]
    return float(brentq(lambda s: float(margin(s * ray)), low, high, xtol=1e-13))


def stability_warning(name: str, law: Law, strains) -> str | None:
    """One sentence if any of the strains that occur is beyond the material's stable range.

    Parameters
    ----------
    name : str
        What to call the material.
    law : Law
    strains : array_like, shape (..., 5)

    Returns
    -------
    str or None
    """
    margin = np.ravel(stability_margin(law, strains))
    lost = np.count_nonzero(margin <= 0.0)
    if lost == 0:
        return None
    logs = principal_log_strains(np.reshape(strains, (-1, 5))[int(np.argmin(margin))])
    where = (
        "principal stretches " + ", ".join(f"{s:.3f}" for s in np.exp(logs))
        if np.all(np.isfinite(logs))
        else "a strain that no sheet can reach"
    )
    return (
        f"The constants of {name} describe an unstable material at {lost} of {margin.size} strains that "
        f"occur; the lowest stiffness there is {margin.min():.2g} of the initial one, at {where}."
    )
