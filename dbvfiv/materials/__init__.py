"""Material laws of a layered wall: rubbers, isotropic sheets and fibre plies.

Each law is a strain energy in five Green-Lagrange strains with S33 = 0 (see `law`); stresses and
tangents follow by differentiation. Energies are meant for float64: switch on ``jax_enable_x64``.
"""

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.isotropic import IsotropicElastic
from dbvfiv.materials.law import (
    LINEAR_ELASTIC,
    MOONEY_RIVLIN,
    PARAMETER_COUNT,
    Law,
    energy_of,
)
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.orthotropic import OrthotropicPly

__all__ = [
    "IsotropicElastic",
    "LINEAR_ELASTIC",
    "Law",
    "MOONEY_RIVLIN",
    "MaterialError",
    "MooneyRivlin",
    "OrthotropicPly",
    "PARAMETER_COUNT",
    "energy_of",
]
