"""Incompressible Mooney-Rivlin rubber with two or three constants.

    W = C10 (I1 - 3) + C01 (I2 - 3) + C11 (I1 - 3)(I2 - 3)          (Th. 3.1, 3.2)

in plane stress. The third constant multiplies the product of both invariants; it is not the
C20 (I1 - 3)^2 of other three-parameter forms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from dbvfiv.materials.energy import mooney_rivlin_energy
from dbvfiv.materials.law import (
    MOONEY_RIVLIN,
    MaterialError,
    padded,
    require_finite,
    require_positive,
)


@dataclass(frozen=True)
class MooneyRivlin:
    """Mooney-Rivlin rubber.

    Parameters
    ----------
    c10, c01, c11 : float
        Constants, Pa. Single constants may be negative, as in the fits of Th. Table 3-3, but the
        small-strain shear modulus 2 (c10 + c01) must be positive.
    density : float
        Reference density, kg/m3.

    Raises
    ------
    MaterialError
        For a constant that is not finite, a density that is not positive, or c10 + c01 <= 0.
    """

    kind: ClassVar[int] = MOONEY_RIVLIN

    c10: float
    c01: float
    c11: float
    density: float

    def __post_init__(self) -> None:
        require_finite("Mooney-Rivlin rubber", c10=self.c10, c01=self.c01, c11=self.c11)
        require_positive("Mooney-Rivlin rubber", density=self.density)
        if self.c10 + self.c01 <= 0.0:
            raise MaterialError(
                "Mooney-Rivlin rubber: the small-strain shear modulus 2 (c10 + c01) must be "
                f"greater than zero, but c10 = {self.c10:g} Pa and c01 = {self.c01:g} Pa give "
                f"{2.0 * (self.c10 + self.c01):g} Pa."
            )

    @classmethod
    def neo_hookean(cls, shear_modulus: float, density: float) -> MooneyRivlin:
        """Neo-Hookean rubber W = mu/2 (I1 - 3), that is C10 = mu/2 and nothing else."""
        require_positive("Neo-Hookean rubber", shear_modulus=shear_modulus)
        return cls(c10=0.5 * shear_modulus, c01=0.0, c11=0.0, density=density)

    @property
    def parameters(self) -> np.ndarray:
        """``[c10, c01, c11, 0, 0, 0, 0, 0]``, Pa."""
        return padded(self.c10, self.c01, self.c11)

    @property
    def small_strain_shear_modulus(self) -> float:
        """mu = 2 (C10 + C01), Pa; Young's modulus at small strain is three times this."""
        return 2.0 * (self.c10 + self.c01)

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return mooney_rivlin_energy((self.c10, self.c01, self.c11), e)
