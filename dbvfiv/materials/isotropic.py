"""Isotropic St Venant-Kirchhoff sheet in plane stress.

    W = E/(2 (1 - nu^2)) (e1^2 + e2^2 + 2 nu e1 e2) + G/2 (e3^2 + e4^2 + e5^2),  G = E/(2 (1 + nu))

with e = [E11, E22, 2 E12, 2 E13, 2 E23] Green-Lagrange strains, so that the stress S = dW/de is
the second Piola-Kirchhoff stress and S33 = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dbvfiv.materials.energy import linear_elastic_energy
from dbvfiv.materials.law import (
    LINEAR_ELASTIC,
    MaterialError,
    padded,
    require_finite,
    require_positive,
)


@dataclass(frozen=True)
class IsotropicElastic:
    """Isotropic linear elastic material.

    Parameters
    ----------
    youngs_modulus : float
        Pa, greater than zero.
    poisson_ratio : float
        Greater than -1, at most 0.5 (plane stress allows the incompressible limit).
    density : float
        kg/m3, greater than zero.

    Raises
    ------
    MaterialError
        For a constant outside these bounds.
    """

    kind: ClassVar[int] = LINEAR_ELASTIC

    youngs_modulus: float
    poisson_ratio: float
    density: float

    def __post_init__(self) -> None:
        require_positive("Isotropic material", youngs_modulus=self.youngs_modulus, density=self.density)
        require_finite("Isotropic material", poisson_ratio=self.poisson_ratio)
        if not -1.0 < self.poisson_ratio <= 0.5:
            raise MaterialError(
                "Isotropic material: poisson_ratio must be greater than -1 and at most 0.5, but "
                f"{self.poisson_ratio:g} was given."
            )

    @property
    def parameters(self) -> np.ndarray:
        """``[Q11, Q22, Q12, Q66, Q55, Q44, 0, 0]``, Pa."""
        q11 = self.youngs_modulus / (1.0 - self.poisson_ratio**2)
        g = self.small_strain_shear_modulus
        return padded(q11, q11, self.poisson_ratio * q11, g, g, g)

    @property
    def small_strain_shear_modulus(self) -> float:
        """G = E/(2 (1 + nu)), Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return linear_elastic_energy(self.parameters, e)
