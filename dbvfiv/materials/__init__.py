"""Material laws of a layered wall: rubbers, isotropic sheets and fibre plies.

Each law is a strain energy in five Green-Lagrange strains with S33 = 0 (see `law`);
stresses and tangents follow by differentiation, in float64.
"""

from dbvfiv.materials.damping import (
    MaterialDamping,
    ShippedLoss,
    damping_of,
    relaxation_from_case,
    shipped_loss,
    shipped_loss_names,
)
from dbvfiv.materials.damping_report import DampingReport, describe_damping, outside_band
from dbvfiv.materials.energy import energy_of
from dbvfiv.materials.fit import RubberFit, fit_mooney_rivlin, fit_rubber, form_of, uniaxial_stress
from dbvfiv.materials.isotropic import IsotropicElastic
from dbvfiv.materials.law import LINEAR_ELASTIC, MOONEY_RIVLIN, PARAMETER_COUNT, Law, MaterialError
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.ogden import Ogden
from dbvfiv.materials.orthotropic import OrthotropicPly
from dbvfiv.materials.ply_fit import fibre_ply, halpin_tsai, ply_from_constituents
from dbvfiv.materials.prony import Prony, PronyFit, fit_constant, fit_moduli, fit_relaxation, fit_tan_delta
from dbvfiv.materials.rubber_tests import TensionTest, read_tension_test
from dbvfiv.materials.rubbers import law_from_card, law_from_case, published_rubber, rubber, rubber_names, strain_levels
from dbvfiv.materials.softening import SofteningRubber
from dbvfiv.materials.stability import StableRange, stability_margin, stable_range
from dbvfiv.materials.yeoh import Yeoh

__all__ = [
    "DampingReport",
    "IsotropicElastic",
    "LINEAR_ELASTIC",
    "Law",
    "MOONEY_RIVLIN",
    "MaterialDamping",
    "MaterialError",
    "MooneyRivlin",
    "Ogden",
    "OrthotropicPly",
    "PARAMETER_COUNT",
    "Prony",
    "PronyFit",
    "RubberFit",
    "ShippedLoss",
    "SofteningRubber",
    "StableRange",
    "TensionTest",
    "Yeoh",
    "damping_of",
    "describe_damping",
    "energy_of",
    "fibre_ply",
    "fit_constant",
    "fit_moduli",
    "fit_mooney_rivlin",
    "fit_relaxation",
    "fit_rubber",
    "form_of",
    "fit_tan_delta",
    "halpin_tsai",
    "law_from_card",
    "law_from_case",
    "outside_band",
    "ply_from_constituents",
    "published_rubber",
    "read_tension_test",
    "relaxation_from_case",
    "rubber",
    "rubber_names",
    "shipped_loss",
    "shipped_loss_names",
    "stability_margin",
    "stable_range",
    "strain_levels",
    "uniaxial_stress",
]
