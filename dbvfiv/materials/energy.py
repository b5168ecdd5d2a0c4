"""Traceable strain energies of an incompressible sheet and of a linear one, and one function that serves every law."""

from __future__ import annotations

import jax.numpy as jnp

from dbvfiv.materials.law import MOONEY_RIVLIN, OGDEN_FROM, plane_stress_invariants
from dbvfiv.materials.ogden import ogden_energy

#: x0 of a rubber without a knee, so that its term and the derivatives are zeros at strains no sheet can have, too.
_NO_KNEE = 1e100


def rubber_energy(parameters, e):
    """Energy of an incompressible sheet with S33 = 0: Mooney-Rivlin, powers of x = I1 - 3, a knee, and Ogden's terms.

        W = Mooney-Rivlin + C20 x^2 + C30 x^3 + m0 x0 (sqrt(1 + x/x0) - 1) + Ogden

    The knee is evaluated as m0 x/(1 + sqrt(1 + x/x0)), which loses no digits near x = 0, and is 0 for m0 = 0, whatever
    x0 is. Ogden's terms (see `ogden`) are there where the parameters are more than eight.

    Parameters
    ----------
    parameters : array_like, shape (7,) or (8 + 2 n,)
        ``[c10, c01, c11, c20, c30, m0, x0, 0, mu_1, alpha_1, ...]``, Pa but for x0 and the exponents.
    e : array_like, shape (5,)

    Returns
    -------
    scalar, J/m3. Not meaningful where det C2 <= 0, which is no deformation of a sheet.
    """
    i1 = plane_stress_invariants(e).i1_minus_3
    m0, x0 = parameters[5], parameters[6] + (parameters[6] == 0) * _NO_KNEE
    knee = m0 * i1 / (1 + (1 + i1 / x0) ** 0.5)
    energy = mooney_rivlin_energy(parameters, e) + (parameters[3] + parameters[4] * i1) * i1 * i1 + knee
    if len(parameters) > OGDEN_FROM:
        energy = energy + ogden_energy(parameters[OGDEN_FROM::2], parameters[OGDEN_FROM + 1 :: 2], e)
    return energy


def mooney_rivlin_energy(parameters, e):
    """Three-parameter Mooney-Rivlin energy of an incompressible sheet with S33 = 0.

        W = C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3)(I2 - 3)
          = (C10 + C01)(I1 - 3) + C01 (I2 - I1) + C11 (I1 - 3)(I2 - 3)

    The second line is what is evaluated: its first term carries the small-strain stiffness.

    Parameters
    ----------
    parameters : array_like, shape (>= 3,)
        ``[c10, c01, c11, ...]``, Pa.
    e : array_like, shape (5,)

    Returns
    -------
    scalar, J/m3. Not meaningful where det C2 <= 0, which is no deformation of a sheet.
    """
    c10, c01, c11 = parameters[0], parameters[1], parameters[2]
    inv = plane_stress_invariants(e)
    return (c10 + c01) * inv.i1_minus_3 + c01 * inv.i2_minus_i1 + c11 * inv.i1_minus_3 * inv.i2_minus_3


def linear_elastic_energy(parameters, e):
    """St Venant-Kirchhoff energy of an orthotropic sheet in plane stress.

        W = (Q11 e1^2 + 2 Q12 e1 e2 + Q22 e2^2 + Q66 e3^2 + Q55 e4^2 + Q44 e5^2) / 2

    Parameters
    ----------
    parameters : array_like, shape (>= 6,)
        ``[Q11, Q22, Q12, Q66, Q55, Q44, ...]``, Pa.
    e : array_like, shape (5,)
        Green-Lagrange strains ``[E11, E22, 2 E12, 2 E13, 2 E23]``.

    Returns
    -------
    scalar, J/m3
    """
    q11, q22, q12, q66, q55, q44 = (parameters[i] for i in range(6))
    in_plane = q11 * e[0] ** 2 + 2.0 * q12 * e[0] * e[1] + q22 * e[1] ** 2 + q66 * e[2] ** 2
    return 0.5 * (in_plane + q55 * e[3] ** 2 + q44 * e[4] ** 2)


def energy_of(kind, parameters, e):
    """Strain energy of any law from its number and constants; traceable in all three arguments.

    One compiled function then serves a wall of mixed materials. The rubber branch is fed a zero
    strain where it is not selected, so neither it nor its derivatives can spoil the other one.

    Parameters
    ----------
    kind : int or traced integer scalar
    parameters : array_like, shape (8,)
    e : array_like, shape (5,)

    Returns
    -------
    scalar, J/m3

    Examples
    --------
    >>> from dbvfiv.materials import MooneyRivlin, energy_of
    >>> law = MooneyRivlin(c10=4e5, c01=1e5, c11=0.0, density=1300.0)
    >>> e = [0.1, 0.0, 0.02, 0.0, 0.01]
    >>> bool(abs(energy_of(law.kind, law.parameters, e) - law.energy(e)) < 1e-9)
    True
    """
    parameters = jnp.asarray(parameters)
    e = jnp.asarray(e)
    is_rubber = jnp.asarray(kind) == MOONEY_RIVLIN
    rubber = rubber_energy(parameters, jnp.where(is_rubber, e, 0.0))
    return jnp.where(is_rubber, rubber, linear_elastic_energy(parameters, e))
