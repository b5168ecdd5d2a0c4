"""Rubber by its hardness: Gent's relation."""

import pytest

from dbvfiv.case.materials import shear_modulus_of
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import load_case

RUBBER = "materials.NR"


def _case(hardness):
    text = f'{{kind="neo-hookean", shear_modulus="{hardness}", density=1100}}'
    return load_case(None, (f"{RUBBER}={text}",))


def test_modulus_is_that_of_gent():
    # E = 0.0981 x 515.6 / (0.137505 x 101.6) = 3.6205 MPa at 60 Shore A
    assert shear_modulus_of(60.0) == pytest.approx(3.6205e6 / 3, rel=1e-4)
    assert 0.18 < shear_modulus_of(65.0) / shear_modulus_of(60.0) - 1 < 0.24  # five points, a fifth


@pytest.mark.parametrize("words", ("60 Shore A", "60 ShA", "60 shore a", "60.0 Shore-A"))
def test_hardness_stands_where_the_modulus_does(words):
    assert _case(words).materials.card("NR").shear_modulus == pytest.approx(shear_modulus_of(60.0), rel=1e-12)


@pytest.mark.parametrize("words", ("120 Shore A", "10 Shore A", "60 Shore D"))
def test_other_hardness_is_refused_with_a_sentence(words):
    with pytest.raises(CaseError, match="shear_modulus"):
        _case(words)
