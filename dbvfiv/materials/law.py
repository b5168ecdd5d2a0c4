"""Base class of material laws, their constants checked, and one traceable strain energy that serves them all.

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

A law is a strain energy per unit reference volume in five Green-Lagrange strains

    e = [E11, E22, 2 E12, 2 E13, 2 E23]

in the law's own axes (1, 2 in the plane of the layer, 3 through the thickness), with the sixth
strain already eliminated by S33 = 0. Its gradient is the second Piola-Kirchhoff stress
[S11, S22, S12, S13, S23] and its Hessian the plane-stress tangent. Shear-correction factors
and rotation to ply axes belong to the shell, not here.
"""

from __future__ import annotations

import math
from numbers import Real
from typing import NamedTuple, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np

from dbvfiv.errors import CaseError


class MaterialError(CaseError):
    """A material constant, table or test file that cannot be used; the message says why."""


def require_finite(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is a finite real number."""
    for name, value in constants.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
            raise MaterialError(f"{law}: {name} must be a finite number, but {value!r} was given.")


def require_positive(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is finite and greater than zero."""
    require_finite(law, **constants)
    for name, value in constants.items():
        if value <= 0.0:
            raise MaterialError(f"{law}: {name} must be greater than zero, but {value:g} was given.")


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


LINEAR_ELASTIC = 0
MOONEY_RIVLIN = 1
PARAMETER_COUNT = 8
#: Constants of a rubber among the parameters, and the one of them that is no modulus: x0.
RUBBER_CONSTANTS, KNEE = 7, 6


@runtime_checkable
class Law(Protocol):
    """A plane-stress material law.

    Attributes
    ----------
    kind : int
        ``LINEAR_ELASTIC`` (0) or ``MOONEY_RIVLIN`` (1, with Yeoh's terms and a knee); a class constant.
    density : float
        Reference density, kg/m3.
    parameters : numpy.ndarray, shape (8,), float64
        Kind 0: ``[Q11, Q22, Q12, Q66, Q55, Q44, 0, 0]`` with Q55 for the 13 and Q44 for the 23
        shear. Kind 1: ``[c10, c01, c11, c20, c30, m0, x0, 0]``, see `rubber_energy`. All in Pa but x0.
    small_strain_shear_modulus : float
        In-plane shear modulus (12) in the reference state, Pa.
    """

    kind: int
    density: float

    @property
    def parameters(self) -> np.ndarray: ...

    @property
    def small_strain_shear_modulus(self) -> float: ...

    def energy(self, e): ...


def padded(*constants: float) -> np.ndarray:
    """Constants followed by zeros, as the float64 array of eight that every law exposes."""
    parameters = np.zeros(PARAMETER_COUNT)
    parameters[: len(constants)] = constants
    return parameters


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
