"""Constants of materials from their tests: rubbers, plies and loss factors; laws and damping of a case's materials."""

from dbvfiv.fit.cards import (
    DampingReport,
    MaterialDamping,
    damping_of,
    describe_damping,
    law_from_card,
    law_from_case,
    outside_band,
    relaxation_from_case,
)
from dbvfiv.fit.curves import TensionTest
from dbvfiv.fit.prony import fit_moduli, fit_relaxation, fit_tan_delta
from dbvfiv.fit.rubber import RubberFit, fit_rubber, form_of, uniaxial_stress
from dbvfiv.materials.prony import PronyFit, fit_constant

__all__ = [
    "DampingReport",
    "MaterialDamping",
    "PronyFit",
    "RubberFit",
    "TensionTest",
    "damping_of",
    "describe_damping",
    "fit_constant",
    "fit_moduli",
    "fit_relaxation",
    "fit_rubber",
    "fit_tan_delta",
    "form_of",
    "law_from_card",
    "law_from_case",
    "outside_band",
    "relaxation_from_case",
    "uniaxial_stress",
]
