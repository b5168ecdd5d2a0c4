"""Incompressible rubber that softens at small strain and stiffens at large ones, stable in every state.

    W = 1/2 [mu_inf x + 2 mu_0 x_0 (sqrt(1 + x/x_0) - 1) + c x^2/2 + c_3 x^3/3],     x = I1 - 3

in plane stress: a neo-Hookean term, a power law with the exponent 1/2 (Knowles 1977, Int. J. Fracture 13, 611), the
largest softening with which the shear stress still rises everywhere, and Yeoh's second and third terms. The knee at
small strain is that of filled rubber (Payne, Mullins). Hill's condition (see `stability`) holds at all strains for
constants that are not negative with mu_inf >= mu_0/200, whatever x_0 is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dbvfiv.materials.energy import rubber_energy
from dbvfiv.materials.law import MOONEY_RIVLIN, MaterialError, padded, require_finite, require_positive

#: Least mu_inf over mu_0 with which the law is stable at all strains for any x_0 (0.0048 serves). Without it the power
#: law loses Hill's condition in equibiaxial tension, by 0.3 % of its stiffness at rest, where x_0 < 0.02.
LEAST_SHARE = 0.005


@dataclass(frozen=True)
class SofteningRubber:
    """Rubber with a knee at small strain and an upturn, by the first invariant alone.

    Parameters
    ----------
    mu_inf : float
        Shear modulus that is left beyond the knee, Pa; not negative.
    mu_0 : float
        What the shear modulus at rest exceeds it by, Pa; not negative. One of both must be positive.
    x_0 : float
        I1 - 3 at the knee; positive.
    c : float
        Stiffening, Pa; not negative.
    density : float
        Reference density, kg/m3.
    c_3 : float
        Stiffening that grows with the square of x, Pa; not negative.

    Raises
    ------
    MaterialError
        For a constant out of range.

    Examples
    --------
    >>> SofteningRubber(mu_inf=0.3e6, mu_0=1e6, x_0=0.01, c=2e6, density=1300.0).small_strain_shear_modulus
    1300000.0
    """

    kind: ClassVar[int] = MOONEY_RIVLIN

    mu_inf: float
    mu_0: float
    x_0: float
    c: float
    density: float
    c_3: float = 0.0

    def __post_init__(self) -> None:
        name, moduli = "Softening rubber", {"mu_inf": self.mu_inf, "mu_0": self.mu_0, "c": self.c, "c_3": self.c_3}
        require_finite(name, **moduli)
        require_positive(name, x_0=self.x_0, density=self.density)
        for key, value in moduli.items():
            if value < 0.0:
                raise MaterialError(f"{name}: {key} must not be negative, but {value:g} Pa was given.")
        if self.small_strain_shear_modulus <= 0.0:
            raise MaterialError(f"{name}: mu_inf + mu_0 must be greater than zero, but both are 0 Pa.")

    @property
    def parameters(self) -> np.ndarray:
        """``[mu_inf/2, 0, 0, c/4, c_3/6, mu_0, x_0, 0]``, Pa but for x_0."""
        return padded(0.5 * self.mu_inf, 0.0, 0.0, 0.25 * self.c, self.c_3 / 6.0, self.mu_0, self.x_0)

    @property
    def small_strain_shear_modulus(self) -> float:
        """mu = mu_inf + mu_0, Pa."""
        return self.mu_inf + self.mu_0

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return rubber_energy(self.parameters, e)
