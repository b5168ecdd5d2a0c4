"""Base class of material laws, and one traceable strain energy that serves them all.

A law is a strain energy per unit reference volume in five Green-Lagrange strains

    e = [E11, E22, 2 E12, 2 E13, 2 E23]

in the law's own axes (1, 2 in the plane of the layer, 3 through the thickness), with the sixth
strain already eliminated by S33 = 0. Its gradient is the second Piola-Kirchhoff stress
[S11, S22, S12, S13, S23] and its Hessian the plane-stress tangent. Shear-correction factors
and rotation to ply axes belong to the shell, not here.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np

from dbvfiv.materials.incompressible import rubber_energy

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
        shear. Kind 1: ``[c10, c01, c11, c20, c30, m0, x0, 0]``, see `incompressible.rubber_energy`. All in Pa but x0.
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
