"""Material laws of a layered wall: rubbers, isotropic sheets and fibre plies, their stability, and how they relax.

Each law is a strain energy in five Green-Lagrange strains with S33 = 0 (see `energy`);
stresses and tangents follow by differentiation, in float64.
"""

from dbvfiv.materials.energy import LINEAR_ELASTIC, MOONEY_RIVLIN, PARAMETER_COUNT
from dbvfiv.materials.laws import (
    IsotropicElastic,
    Law,
    MaterialError,
    MooneyRivlin,
    Ogden,
    OrthotropicPly,
    SofteningRubber,
    Yeoh,
    fibre_ply,
    halpin_tsai,
    ply_from_constituents,
)
from dbvfiv.materials.prony import Prony
from dbvfiv.materials.shipped import (
    ShippedLoss,
    published_rubber,
    rubber,
    rubber_names,
    shipped_loss,
    shipped_loss_names,
    strain_levels,
)
from dbvfiv.materials.stability import StableRange, stability_margin, stable_range

__all__ = [
    "IsotropicElastic",
    "LINEAR_ELASTIC",
    "Law",
    "MOONEY_RIVLIN",
    "MaterialError",
    "MooneyRivlin",
    "Ogden",
    "OrthotropicPly",
    "PARAMETER_COUNT",
    "Prony",
    "ShippedLoss",
    "SofteningRubber",
    "StableRange",
    "Yeoh",
    "fibre_ply",
    "halpin_tsai",
    "ply_from_constituents",
    "published_rubber",
    "rubber",
    "rubber_names",
    "shipped_loss",
    "shipped_loss_names",
    "stability_margin",
    "stable_range",
    "strain_levels",
]
