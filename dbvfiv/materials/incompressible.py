"""Invariants of an incompressible sheet in plane stress, in a form free of cancellation.

With C2 the in-plane block of the right Cauchy-Green tensor and c = (2 E13, 2 E23) its transverse
shear pair, det C = 1 gives C33 = 1/det C2 + c' C2^-1 c, so that S33 = 0 holds in closed form
once C33 is put into the energy. The constants of a fitted three-parameter rubber are tens of MPa
of opposite sign against a shear modulus of a few MPa; I1 - 3, I2 - 3 and I2 - I1 are therefore
built from the strains directly and never as differences of numbers near 3.

With t = 2 (E11 + E22), D = 4 det E2, J = det C2 = 1 + t + D and A = adj C2 = I + 2 adj E2,

    I1 - 3  = (t^2 - D + t D          +  c'A c) / J
    I2 - 3  = (t^2 - D + D (2 t + D)  +  |A c|^2) / J
    I2 - I1 = (D (t + D)              +  (A c)' (A - I) c) / J

where t^2 - D = 4 (E11^2 + E11 E22 + E22^2 + E12^2). The second line uses the Cayley-Hamilton
theorem for C2. I2 - I1 is of third order in the strain.

Equation (T.6) of docs/theory.md.
"""

from __future__ import annotations

from typing import NamedTuple


class PlaneStressInvariants(NamedTuple):
    """Invariants of C for an incompressible sheet with S33 = 0.

    Attributes
    ----------
    i1_minus_3, i2_minus_3, i2_minus_i1 : scalars
        Each computed without cancellation.
    in_plane_determinant : scalar
        det C2, the squared ratio of deformed to reference area; must be positive.
    """

    i1_minus_3: object
    i2_minus_3: object
    i2_minus_i1: object
    in_plane_determinant: object


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


#: x0 of a rubber without a knee, so that its term and the derivatives are zeros at strains no sheet can have, too.
_NO_KNEE = 1e100


def rubber_energy(parameters, e):
    """Energy of an incompressible sheet with S33 = 0: Mooney-Rivlin, powers of x = I1 - 3, and a knee.

        W = Mooney-Rivlin + C20 x^2 + C30 x^3 + m0 x0 (sqrt(1 + x/x0) - 1)

    The last term is evaluated as m0 x/(1 + sqrt(1 + x/x0)), which loses no digits near x = 0, and is 0 for m0 = 0,
    whatever x0 is.

    Parameters
    ----------
    parameters : array_like, shape (>= 7,)
        ``[c10, c01, c11, c20, c30, m0, x0, ...]``, Pa but for x0.
    e : array_like, shape (5,)

    Returns
    -------
    scalar, J/m3. Not meaningful where det C2 <= 0, which is no deformation of a sheet.
    """
    i1 = plane_stress_invariants(e).i1_minus_3
    m0, x0 = parameters[5], parameters[6] + (parameters[6] == 0) * _NO_KNEE
    knee = m0 * i1 / (1 + (1 + i1 / x0) ** 0.5)
    return mooney_rivlin_energy(parameters, e) + (parameters[3] + parameters[4] * i1) * i1 * i1 + knee


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
