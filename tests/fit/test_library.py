"""Laws from the material tables of a case."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.load import make_case
from dbvfiv.case.materials import KINDS
from dbvfiv.case.model import Case
from dbvfiv.errors import CaseError
from dbvfiv.fit import law_from_case, uniaxial_stress
from dbvfiv.fit.cards import CARD_KINDS
from dbvfiv.materials.laws import (
    IsotropicElastic,
    MooneyRivlin,
    OrthotropicPly,
    SofteningRubber,
    fibre_ply,
    ply_from_constituents,
)
from dbvfiv.materials.shipped import published_rubber, rubber
from dbvfiv.studies.case import thesis_case


def _case(**materials):
    return make_case(Case, {"materials": materials})


def test_every_kind_of_card_has_a_law():
    assert {*CARD_KINDS, "built-in"} == set(KINDS)


def test_built_in_materials():
    case = thesis_case()
    for name in ("CR", "SBR", "EPDM"):
        assert law_from_case(case, name) == published_rubber(name, 0.10)
    assert law_from_case(case, "fibre") == fibre_ply("program")


def test_published_constants():
    case = _case(constants="published", strain_level="20 %")
    assert law_from_case(case, "SBR") == published_rubber("SBR", 0.20)
    levels = case.replace(case.materials.at_levels({"SBR": 0.3}))
    assert law_from_case(levels, "SBR") == published_rubber("SBR", 0.3)
    table = _case().replace({"materials.CR": {"kind": "shipped", "rubber": "EPDM", "constants": "published"}})
    card = table.replace(table.materials.at_levels({"CR": 0.3})).materials.card("CR")
    assert (card.rubber, card.constants, card.strain_level) == ("EPDM", "published", 0.3)
    with pytest.raises(CaseError, match="materials.constants.*stable.*published"):
        _case(constants="thesis")


def test_strain_level_and_fibre_constants():
    case = _case(strain_level="15 %", fibre_constants="table")
    assert law_from_case(case, "SBR") == rubber("SBR", 0.15)
    assert law_from_case(case, "fibre") == fibre_ply("table")


@pytest.mark.parametrize(
    "card, law",
    [
        (
            {"kind": "mooney-rivlin", "c10": "0.3 MPa", "c01": 1e5, "density": 1100.0},
            MooneyRivlin(3e5, 1e5, 0.0, 1100.0),
        ),
        ({"kind": "neo-hookean", "shear_modulus": "1 MPa", "density": 1100.0}, MooneyRivlin(5e5, 0.0, 0.0, 1100.0)),
        (
            {"kind": "isotropic", "youngs_modulus": "6 MPa", "poisson_ratio": 0.49, "density": 1300.0},
            IsotropicElastic(6e6, 0.49, 1300.0),
        ),
        (
            {
                "kind": "orthotropic",
                "e1": 9e8,
                "e2": 8e6,
                "nu12": 0.3,
                "g12": 3e6,
                "g13": 2e6,
                "g23": 1e6,
                "density": 1270.0,
            },
            OrthotropicPly(9e8, 8e6, 0.3, 3e6, 2e6, 1e6, 1270.0),
        ),
        ({"kind": "halpin-tsai", "fibre_fraction": "30 %"}, ply_from_constituents(fibre_fraction=0.3)),
        (
            {"kind": "shipped", "rubber": "EPDM", "strain_level": "40 %", "density": 1150.0},
            rubber("EPDM", 0.4, density=1150.0),
        ),
        ({"kind": "shipped", "rubber": "CR", "constants": "published"}, published_rubber("CR", 0.1, density=1300.0)),
        (
            {"kind": "softening", "mu_0": "1 MPa", "x_0": 0.01, "c": 2e6, "density": 1150.0},
            SofteningRubber(0.0, 1e6, 0.01, 2e6, 1150.0),
        ),
    ],
)
def test_tables_of_the_case(card, law):
    assert law_from_case(_case(mine=card), "mine") == law


def test_tables_of_the_case_go_before_built_in_ones():
    card = {"kind": "halpin-tsai", "fibre_fraction": 0.3, "loss_factor": "fibre"}
    case = _case(fibre_constants="table", fibre=card)
    assert law_from_case(case, "fibre").e1 == ply_from_constituents(fibre_fraction=0.3).e1


def test_fitted_material(tmp_path):
    path = tmp_path / "tension.csv"
    stretch = np.linspace(1.05, 1.6, 10)
    stress = uniaxial_stress(MooneyRivlin(3e5, 1e5, 0.0, 1.0), stretch)
    rows = "".join(f"{s!r},{p!r}\n" for s, p in zip(stretch.tolist(), stress.tolist()))
    path.write_text("stretch [-],nominal_stress [Pa]\n" + rows)
    card = {"kind": "fit", "path": str(path), "law": "mooney-rivlin", "terms": 2, "density": 1200.0}
    law = law_from_case(_case(mine=card), "mine")
    assert (law.c10, law.c01, law.c11, law.density) == pytest.approx((3e5, 1e5, 0.0, 1200.0), rel=1e-9)

    law = law_from_case(_case(mine={"kind": "fit", "path": str(path), "density": 1200.0}), "mine")
    assert isinstance(law, SofteningRubber) and law.small_strain_shear_modulus == pytest.approx(8e5, rel=0.05)

    path.write_text("stretch [-],nominal_stress [Pa]\n1.1,oops\n")
    with pytest.raises(CaseError, match="materials.mine cannot be used.*line 2.*'oops'") as caught:
        law_from_case(_case(mine=card), "mine")
    assert caught.value.key == "materials.mine"


def test_unknown_name_is_refused():
    with pytest.raises(CaseError, match="'steel' is no material.*CR, SBR, EPDM, fibre"):
        law_from_case(thesis_case(), "steel")
