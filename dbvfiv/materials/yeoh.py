"""Incompressible Yeoh rubber with two or three constants (Yeoh 1993, Rubber Chem. Technol. 66, 754).

    W = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3

in plane stress.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dbvfiv.materials.energy import rubber_energy
from dbvfiv.materials.law import MOONEY_RIVLIN, padded, require_finite, require_positive


@dataclass(frozen=True)
class Yeoh:
    """Yeoh rubber.

    Parameters
    ----------
    c10, c20, c30 : float
        Constants, Pa; c10 must be positive.
    density : float
        Reference density, kg/m3.

    Raises
    ------
    MaterialError
        For a constant that is not finite, a density or c10 that is not positive.
    """

    kind: ClassVar[int] = MOONEY_RIVLIN

    c10: float
    c20: float
    c30: float
    density: float

    def __post_init__(self) -> None:
        require_positive("Yeoh rubber", c10=self.c10, density=self.density)
        require_finite("Yeoh rubber", c20=self.c20, c30=self.c30)

    @property
    def parameters(self) -> np.ndarray:
        """``[c10, 0, 0, c20, c30, 0, 0, 0]``, Pa."""
        return padded(self.c10, 0.0, 0.0, self.c20, self.c30)

    @property
    def small_strain_shear_modulus(self) -> float:
        """mu = 2 C10, Pa."""
        return 2.0 * self.c10

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return rubber_energy(self.parameters, e)
