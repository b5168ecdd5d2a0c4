"""Incompressible Ogden rubber with any number of terms (Ogden 1972, Proc. R. Soc. A 326, 565).

    W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3)

with the principal stretches l in plane stress. The energy is symmetric in the eigenvalues l^2 of the right Cauchy-Green
tensor C, hence analytic in its invariants, also where stretches are equal and they themselves have no derivatives.
Cauchy's integral about the eigenvalues says so: with p(z) = det(z - C) = z^3 - I1 z^2 + I2 z - 1 and w = ln z,

    W        = 1/(2 pi i) int  sum mu_p/alpha_p e^(alpha_p w/2) [p'/p - 3/(z - 1)] z dw
    dW/dI1   = 1/(2 pi i) int  g z^2/p dw,    dW/dI2 = - 1/(2 pi i) int g z/p dw,     g = sum mu_p/2 e^(alpha_p w/2)

and each further derivative by I1 or I2 brings another factor z^2/p or -z/p. The integrand is analytic in the strip
|Im w| < 2 pi but for the logarithms of the eigenvalues, so the trapezoidal rule on an ellipse about these converges
geometrically: 56 points, half of them by symmetry, leave rounding of a strip of alpha = 12 stretched to five times its
length, and of alpha = 30 to 1.5 times.

Equation (T.6) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from dbvfiv.materials.law import (
    MOONEY_RIVLIN,
    MaterialError,
    padded,
    plane_stress_invariants,
    require_finite,
    require_positive,
)

#: Upper half of the points of the rule on the ellipse, and its parameter s where nothing else is near.
OGDEN_ANGLES = (np.arange(28) + 0.5) * np.pi / 28
OGDEN_ELLIPSE = 1.0
#: Least half distance of its foci; over the largest exponent, so that e^(alpha w/2) stays near 1 on the ellipse.
OGDEN_FOCI, OGDEN_SPREAD = 0.5, 6.0


@dataclass(frozen=True)
class Ogden:
    """Ogden rubber.

    Parameters
    ----------
    mu : sequence of float
        Moduli mu_p, Pa; single ones may be negative.
    alpha : sequence of float
        Exponents alpha_p, as many, none of them 0.
    density : float
        Reference density, kg/m3.

    Raises
    ------
    MaterialError
        For unequal numbers of moduli and exponents, a constant that is not finite, an exponent of 0, or a shear modulus
        at small strain that is not positive.

    Examples
    --------
    >>> Ogden((0.6e6, -0.01e6), (1.3, -2.0), 1300.0).small_strain_shear_modulus
    400000.0
    """

    kind: ClassVar[int] = MOONEY_RIVLIN

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    density: float

    def __post_init__(self) -> None:
        name = "Ogden rubber"
        if not self.mu or len(self.mu) != len(self.alpha):
            raise MaterialError(
                f"{name}: mu and alpha must have as many entries, one or more, but {len(self.mu)} and "
                f"{len(self.alpha)} were given."
            )
        require_finite(name, **{f"mu_{p + 1}": value for p, value in enumerate(self.mu)})
        require_finite(name, **{f"alpha_{p + 1}": value for p, value in enumerate(self.alpha)})
        require_positive(name, density=self.density)
        if 0.0 in self.alpha:
            raise MaterialError(f"{name}: an exponent must not be 0; leave its term out.")
        if self.small_strain_shear_modulus <= 0.0:
            raise MaterialError(
                f"{name}: the small-strain shear modulus, half the sum of mu alpha, must be greater than zero, but it "
                f"is {self.small_strain_shear_modulus:g} Pa."
            )

    @property
    def parameters(self) -> np.ndarray:
        """Eight zeros and ``[mu_1, alpha_1, mu_2, alpha_2, ...]``, Pa and 1."""
        return np.concatenate([padded(), np.stack([self.mu, self.alpha], axis=1).ravel()])

    @property
    def small_strain_shear_modulus(self) -> float:
        """mu = 1/2 sum mu_p alpha_p, Pa."""
        return 0.5 * float(np.dot(self.mu, self.alpha))

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return ogden_energy(self.mu, self.alpha, e)


def ogden_energy(moduli, exponents, e):
    """Ogden's energy of an incompressible sheet with S33 = 0, by Cauchy's integral; see the module.

    Parameters
    ----------
    moduli, exponents : array_like, shape (n,)
        mu_p, Pa, and alpha_p; a term of mu_p = 0 may have any exponent.
    e : array_like, shape (5, ...)

    Returns
    -------
    array (...), J/m3
    """
    inv = plane_stress_invariants(e)
    i1, gap = jnp.asarray(inv.i1_minus_3)[..., None], jnp.asarray(inv.i2_minus_i1)[..., None]
    moduli, exponents = jnp.asarray(moduli), jnp.asarray(exponents)
    exponents = exponents + (exponents == 0.0)
    # the integral does not depend on its way
    first, gap_there, largest = (jax.lax.stop_gradient(x) for x in (i1, gap, jnp.abs(exponents).max()))
    third, third_of_inverse = 1.0 + first / 3.0, 1.0 + (first + gap_there) / 3.0
    upper = jnp.log(third + 2.0 * jnp.sqrt(jnp.maximum(third**2 - third_of_inverse, 0.0)))
    lower = -jnp.log(third_of_inverse + 2.0 * jnp.sqrt(jnp.maximum(third_of_inverse**2 - third, 0.0)))
    half = jnp.maximum(0.5 * (upper - lower), jnp.minimum(OGDEN_FOCI, OGDEN_SPREAD / largest))
    s = jnp.minimum(OGDEN_ELLIPSE, 0.5 * jnp.arcsinh(2.0 * np.pi / half)) + 1j * OGDEN_ANGLES
    w = 0.5 * (upper + lower) + half * jnp.cosh(s)
    y = jnp.expm1(w)
    characteristic = y**3 + (1.0 + y) * (gap - i1 * y)
    slope = ((i1 * y + 2.0 * (i1 - gap)) * y - 3.0 * gap) / (characteristic * y)  # p'/p - 3/(z - 1)
    powers = jnp.sum(moduli / exponents * jnp.exp(0.5 * exponents * w[..., None]), axis=-1)
    return jnp.sum((powers * slope * (1.0 + y) * half * jnp.sinh(s)).real, axis=-1) / len(OGDEN_ANGLES)
