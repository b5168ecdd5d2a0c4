"""Strain energies of a sheet with S33 = 0, each a traceable function with its formula; stress and tangent follow.

An energy per unit reference volume, J/m3, is a function of five Green-Lagrange strains in the law's own axes (1, 2 in
the plane of the layer, 3 through the thickness),

    e = [E11, E22, 2 E12, 2 E13, 2 E23],

the sixth being eliminated by S33 = 0. Its gradient is the second Piola-Kirchhoff stress [S11, S22, S12, S13, S23], its
Hessian the plane-stress tangent. Shear-correction factors and rotation to ply axes belong to the shell.

With C2 the in-plane block of the right Cauchy-Green tensor and c = (2 E13, 2 E23) its transverse shear pair, det C = 1
gives C33 = 1/det C2 + c' C2^-1 c, so S33 = 0 holds in closed form. The constants of a fitted three-parameter rubber are
tens of MPa of opposite sign against a shear modulus of a few MPa; the invariants are therefore built from the strains
and never as differences of numbers near 3. With t = 2 (E11 + E22), D = 4 det E2, J = det C2 = 1 + t + D and
A = adj C2 = I + 2 adj E2,

    I1 - 3  = (t^2 - D + t D          +  c'A c) / J
    I2 - 3  = (t^2 - D + D (2 t + D)  +  |A c|^2) / J
    I2 - I1 = (D (t + D)              +  (A c)' (A - I) c) / J

where t^2 - D = 4 (E11^2 + E11 E22 + E22^2 + E12^2). The second line uses the Cayley-Hamilton theorem for C2. I2 - I1 is
of third order in the strain.

Ogden's energy is symmetric in the eigenvalues l^2 of C, hence analytic in its invariants, also where stretches are
equal and they themselves have no derivatives. Cauchy's integral about the eigenvalues says so: with p(z) = det(z - C)
= z^3 - I1 z^2 + I2 z - 1 and w = ln z,

    W        = 1/(2 pi i) int  sum mu_p/alpha_p e^(alpha_p w/2) [p'/p - 3/(z - 1)] z dw
    dW/dI1   = 1/(2 pi i) int  g z^2/p dw,    dW/dI2 = - 1/(2 pi i) int g z/p dw,     g = sum mu_p/2 e^(alpha_p w/2)

and each further derivative by I1 or I2 brings another factor z^2/p or -z/p. The integrand is analytic in the strip
|Im w| < 2 pi but for the logarithms of the eigenvalues, so the trapezoidal rule on an ellipse about these converges
geometrically: 56 points, half of them by symmetry, leave rounding of a strip of alpha = 12 stretched to five times its
length, and of alpha = 30 to 1.5 times.

Equation (T.6) of docs/theory.md.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

#: Numbers of the energies, and of the constants of a law without Ogden's terms.
LINEAR_ELASTIC, MOONEY_RIVLIN = 0, 1
PARAMETER_COUNT = 8
#: Place of x0 among the parameters of a rubber, and of the first of Ogden's mu_1, alpha_1, mu_2, ...
KNEE, OGDEN_FROM = 6, PARAMETER_COUNT
#: x0 of a rubber without a knee, so that its term and the derivatives are zeros at strains no sheet can have, too.
_NO_KNEE = 1e100
#: Upper half of the points of the rule on the ellipse, and its parameter s where nothing else is near.
OGDEN_ANGLES = (np.arange(28) + 0.5) * np.pi / 28
OGDEN_ELLIPSE = 1.0
#: Least half distance of its foci; over the largest exponent, so that e^(alpha w/2) stays near 1 on the ellipse.
OGDEN_FOCI, OGDEN_SPREAD = 0.5, 6.0


class PlaneStressInvariants(NamedTuple):
    """Invariants of C for an incompressible sheet with S33 = 0."""

    #: i1_minus_3, i2_minus_3 and i2_minus_i1: each computed without cancellation.
    i1_minus_3: object
    i2_minus_3: object
    i2_minus_i1: object
    in_plane_determinant: object  #: det C2, the squared ratio of deformed to reference area; must be positive.


def plane_stress_invariants(e) -> PlaneStressInvariants:
    """Invariants from five Green-Lagrange strains.

    Plain arithmetic: works with floats, fractions, numpy arrays, complex steps and traced values. An
    array of shape (5, ...) gives fields of shape (...).

    Parameters
    ----------
    e : sequence of 5
        ``[E11, E22, 2 E12, 2 E13, 2 E23]``.
    """
    e11, e22, g12, c1, c2 = (e[i] for i in range(5))
    trace = 2 * (e11 + e22)
    det = 4 * e11 * e22 - g12 * g12
    area = 1 + trace + det
    quadratic = 4 * (e11 * e11 + e11 * e22 + e22 * e22) + g12 * g12

    # (A - I) c and A c
    b1 = 2 * e22 * c1 - g12 * c2
    b2 = 2 * e11 * c2 - g12 * c1
    a1 = c1 + b1
    a2 = c2 + b2

    i1 = (quadratic + trace * det + c1 * a1 + c2 * a2) / area
    i2 = (quadratic + det * (2 * trace + det) + a1 * a1 + a2 * a2) / area
    gap = (det * (trace + det) + a1 * b1 + a2 * b2) / area
    return PlaneStressInvariants(i1, i2, gap, area)


def linear_elastic_energy(parameters, e):
    """St Venant-Kirchhoff energy of an orthotropic sheet in plane stress.

        W = (Q11 e1^2 + 2 Q12 e1 e2 + Q22 e2^2 + Q66 e3^2 + Q55 e4^2 + Q44 e5^2) / 2

    Parameters
    ----------
    parameters : array_like, shape (>= 6,)
        ``[Q11, Q22, Q12, Q66, Q55, Q44, ...]``, Pa, with Q55 for the 13 and Q44 for the 23 shear.
    e : array_like, shape (5,)
    """
    q11, q22, q12, q66, q55, q44 = (parameters[i] for i in range(6))
    in_plane = q11 * e[0] ** 2 + 2.0 * q12 * e[0] * e[1] + q22 * e[1] ** 2 + q66 * e[2] ** 2
    return 0.5 * (in_plane + q55 * e[3] ** 2 + q44 * e[4] ** 2)


def mooney_rivlin_energy(parameters, e):
    """Three-parameter Mooney-Rivlin energy of an incompressible sheet.

        W = C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3)(I2 - 3)
          = (C10 + C01)(I1 - 3) + C01 (I2 - I1) + C11 (I1 - 3)(I2 - 3)

    The second line is what is evaluated: its first term carries the small-strain stiffness.

    Parameters
    ----------
    parameters : array_like, shape (>= 3,)
        ``[c10, c01, c11, ...]``, Pa.
    e : array_like, shape (5,)
        Not meaningful where det C2 <= 0, which is no deformation of a sheet.
    """
    c10, c01, c11 = parameters[0], parameters[1], parameters[2]
    inv = plane_stress_invariants(e)
    return (c10 + c01) * inv.i1_minus_3 + c01 * inv.i2_minus_i1 + c11 * inv.i1_minus_3 * inv.i2_minus_3


def ogden_energy(moduli, exponents, e):
    """Ogden's energy of an incompressible sheet (1972, Proc. R. Soc. A 326, 565), by Cauchy's integral; see the module.

        W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3)

    Parameters
    ----------
    moduli, exponents : array_like, shape (n,)
        mu_p, Pa, and alpha_p; a term of mu_p = 0 may have any exponent.
    e : array_like, shape (5, ...)
        Complex ones, near real ones, give the analytic continuation.
    """
    inv = plane_stress_invariants(e)
    i1, gap = jnp.asarray(inv.i1_minus_3)[..., None], jnp.asarray(inv.i2_minus_i1)[..., None]
    moduli, exponents = jnp.asarray(moduli), jnp.asarray(exponents)
    exponents = exponents + (exponents == 0.0)
    # the integral does not depend on its way
    first, gap_there, largest = (jax.lax.stop_gradient(x).real for x in (i1, gap, jnp.abs(exponents).max()))
    third, third_of_inverse = 1.0 + first / 3.0, 1.0 + (first + gap_there) / 3.0
    upper = jnp.log(third + 2.0 * jnp.sqrt(jnp.maximum(third**2 - third_of_inverse, 0.0)))
    lower = -jnp.log(third_of_inverse + 2.0 * jnp.sqrt(jnp.maximum(third_of_inverse**2 - third, 0.0)))
    half = jnp.maximum(0.5 * (upper - lower), jnp.minimum(OGDEN_FOCI, OGDEN_SPREAD / largest))
    # of real invariants the real part stands for the lower half; an analytic continuation has both
    continued = jnp.iscomplexobj(i1)
    angles = np.concatenate([OGDEN_ANGLES, -OGDEN_ANGLES]) if continued else OGDEN_ANGLES
    s = jnp.minimum(OGDEN_ELLIPSE, 0.5 * jnp.arcsinh(2.0 * np.pi / half)) + 1j * angles
    w = 0.5 * (upper + lower) + half * jnp.cosh(s)
    y = jnp.expm1(w)
    characteristic = y**3 + (1.0 + y) * (gap - i1 * y)
    slope = ((i1 * y + 2.0 * (i1 - gap)) * y - 3.0 * gap) / (characteristic * y)  # p'/p - 3/(z - 1)
    powers = jnp.sum(moduli / exponents * jnp.exp(0.5 * exponents * w[..., None]), axis=-1)
    integrand = powers * slope * (1.0 + y) * half * jnp.sinh(s)
    return jnp.sum(integrand if continued else integrand.real, axis=-1) / len(angles)


def rubber_energy(parameters, e):
    """Energy of an incompressible sheet: Mooney-Rivlin, powers of x = I1 - 3, a knee, and Ogden's terms.

        W = Mooney-Rivlin + C20 x^2 + C30 x^3 + m0 x0 (sqrt(1 + x/x0) - 1) + Ogden

    The knee is evaluated as m0 x/(1 + sqrt(1 + x/x0)), which loses no digits near x = 0, and is 0 for m0 = 0, whatever
    x0 is. Ogden's terms are there where the parameters are more than eight.

    Parameters
    ----------
    parameters : array_like, shape (7,) or (8 + 2 n,)
        ``[c10, c01, c11, c20, c30, m0, x0, 0, mu_1, alpha_1, ...]``, Pa but for x0 and the exponents.
    e : array_like, shape (5,)
    """
    i1 = plane_stress_invariants(e).i1_minus_3
    m0, x0 = parameters[5], parameters[6] + (parameters[6] == 0) * _NO_KNEE
    knee = m0 * i1 / (1 + (1 + i1 / x0) ** 0.5)
    energy = mooney_rivlin_energy(parameters, e) + (parameters[3] + parameters[4] * i1) * i1 * i1 + knee
    if len(parameters) > OGDEN_FROM:
        energy = energy + ogden_energy(parameters[OGDEN_FROM::2], parameters[OGDEN_FROM + 1 :: 2], e)
    return energy


#: Energies by their numbers.
ENERGIES = {LINEAR_ELASTIC: linear_elastic_energy, MOONEY_RIVLIN: rubber_energy}
