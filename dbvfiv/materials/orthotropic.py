"""Orthotropic St Venant-Kirchhoff ply in plane stress, axis 1 along the fibre.

    W = (Q11 e1^2 + 2 Q12 e1 e2 + Q22 e2^2 + G12 e3^2 + G13 e4^2 + G23 e5^2) / 2
    Q11 = E1/k,  Q22 = E2/k,  Q12 = nu12 E2/k,  k = 1 - nu12^2 E2/E1

with e = [E11, E22, 2 E12, 2 E13, 2 E23] Green-Lagrange strains in ply axes and S33 = 0. nu12 is
the contraction across the fibre for tension along it.
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
class OrthotropicPly:
    """Unidirectional ply.

    Parameters
    ----------
    e1, e2 : float
        Young's moduli along and across the fibre, Pa.
    nu12 : float
        Major Poisson ratio; nu12^2 must be less than e1/e2.
    g12, g13, g23 : float
        Shear moduli, Pa.
    density : float
        kg/m3.

    Raises
    ------
    MaterialError
        For a modulus or density that is not positive, or a Poisson ratio that makes the
        plane-stress stiffness indefinite.
    """

    kind: ClassVar[int] = LINEAR_ELASTIC

    e1: float
    e2: float
    nu12: float
    g12: float
    g13: float
    g23: float
    density: float

    def __post_init__(self) -> None:
        require_positive(
            "Orthotropic ply",
            e1=self.e1,
            e2=self.e2,
            g12=self.g12,
            g13=self.g13,
            g23=self.g23,
            density=self.density,
        )
        require_finite("Orthotropic ply", nu12=self.nu12)
        if self.nu12**2 >= self.e1 / self.e2:
            raise MaterialError(
                "Orthotropic ply: the square of nu12 must be less than e1/e2 = "
                f"{self.e1 / self.e2:g} for a positive energy, but nu12 = {self.nu12:g} was given."
            )

    @property
    def parameters(self) -> np.ndarray:
        """``[Q11, Q22, Q12, Q66, Q55 (13), Q44 (23), 0, 0]``, Pa."""
        k = 1.0 - self.nu12**2 * self.e2 / self.e1
        return padded(self.e1 / k, self.e2 / k, self.nu12 * self.e2 / k, self.g12, self.g13, self.g23)

    @property
    def small_strain_shear_modulus(self) -> float:
        """In-plane shear modulus G12, Pa."""
        return self.g12

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return linear_elastic_energy(self.parameters, e)
