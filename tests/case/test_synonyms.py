"""Words of the trade that lead to the keys of the case file."""

import pytest

from dbvfiv.case.describe import SYNONYMS, explain, walk
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import Case, load_case


@pytest.mark.parametrize("word", SYNONYMS)
def test_word_of_the_trade_leads_to_a_key_that_exists(word):
    key = SYNONYMS[word]
    assert key in {info.key for info in walk(Case)}
    with pytest.raises(CaseError, match="is not a key") as raised:
        explain(Case, f"valve.{word}")
    assert key in str(raised.value)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ("pipe_length=30 m", "upstream.length"),
        ("valve.hardness=60", "materials.NAME(neo-hookean).shear_modulus"),
        ("closure.back_pressure=5 m", "closure.rated_pressure"),
        ("head=2 m", "drive.head"),
        ("steady.heads=[1]", "steady.pressures"),
    ],
)
def test_unknown_key_names_the_one_that_holds_it(given, key):
    with pytest.raises(CaseError) as raised:
        load_case(None, [given])
    assert f"the nearest valid key is {key}" in str(raised.value)
