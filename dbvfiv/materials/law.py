"""Base of material laws: invariants of a sheet, constants checked, and what every law gives.

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


LINEAR_ELASTIC = 0
MOONEY_RIVLIN = 1
PARAMETER_COUNT = 8
#: Place of x0 among the parameters of a rubber, and of the first of Ogden's mu_1, alpha_1, mu_2, ...
KNEE, OGDEN_FROM = 6, PARAMETER_COUNT


@runtime_checkable
class Law(Protocol):
    """A plane-stress material law.

    Attributes
    ----------
    kind : int
        ``LINEAR_ELASTIC`` (0) or ``MOONEY_RIVLIN`` (1, with Yeoh's terms, a knee and Ogden's terms); a class constant.
    density : float
        Reference density, kg/m3.
    parameters : numpy.ndarray, shape (8,), or (8 + 2 n,) of a rubber with n terms of Ogden's; float64
        Kind 0: ``[Q11, Q22, Q12, Q66, Q55, Q44, 0, 0]`` with Q55 for the 13 and Q44 for the 23
        shear. Kind 1: ``[c10, c01, c11, c20, c30, m0, x0, 0, mu_1, alpha_1, ...]``, see `rubber_energy`. All in
        Pa but x0 and the exponents.
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
