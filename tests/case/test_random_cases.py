"""Random junk: a case is accepted or refused in one sentence, and nothing else ever happens."""

import string

from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.case import CaseError, make_case
from dbvfiv.case.describe import walk
from dbvfiv.case.load import parse_toml
from dbvfiv.case.write import case_toml
from dbvfiv.studies.case import Case, load_case

KEYS = [info.key.replace("[]", ".0").replace("materials.NAME(", "materials.A(") for info in walk(Case)]
KEYS = sorted({key.split("(")[0] + key.split(")")[-1] if "(" in key else key for key in KEYS})

NUMBER_TEXT = st.builds(
    "{} {}".format,
    st.one_of(st.floats(), st.integers(), st.text(max_size=5)),
    st.sampled_from(["kPa", "mm", "deg", "%", "kg/m^3", "1/s", "N/m", "degC", "m**9999999", "()", "/", "ms", "", "dB"]),
)
SCALAR = st.one_of(
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=20),
    NUMBER_TEXT,
    st.dates(),
    st.just(10**400),
    st.sampled_from(["flow", "neo-hookean", "halpin-tsai", "density=1:10:3", "pressure=::", "CR"]),
)
JUNK = st.recursive(
    SCALAR,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
TOML_TEXT = st.text(alphabet=string.printable + "é\x00\u2028", max_size=80)
LIKELY_LINES = st.lists(
    st.one_of(
        st.sampled_from(
            ["[valve]", "[drive]", "[[layers]]", "[materials.A]", "[materials]", "[[valve.wall_map]]", '"""']
        ),
        st.builds(
            "{} = {}".format,
            st.sampled_from(sorted({k.split(".")[-1] for k in KEYS})),
            st.one_of(
                st.integers(), st.floats(), NUMBER_TEXT.map(repr), st.sampled_from(["true", "[]", "{}", "[{}]", "'CR'"])
            ),
        ),
    ),
    max_size=12,
).map("\n".join)


def refused_well(action, one_sentence) -> None:
    try:
        case = action()
    except CaseError as error:
        assert one_sentence(str(error)), str(error)
    else:
        assert isinstance(case, Case)
        assert make_case(Case, parse_toml(case_toml(case)), check_files=False) == case


@given(key=st.sampled_from(KEYS), value=JUNK)
def test_junk_for_any_key(key, value, one_sentence):
    refused_well(lambda: Case().replace({key: value}), one_sentence)


@given(key=st.one_of(st.sampled_from(KEYS), st.text(max_size=12)), value=st.one_of(NUMBER_TEXT, st.text(max_size=20)))
def test_junk_overrides(key, value, one_sentence):
    refused_well(lambda: load_case(None, [f"{key}={value}"]), one_sentence)


@given(data=st.dictionaries(st.sampled_from(sorted(Case.model_fields)) | st.text(max_size=6), JUNK, max_size=4))
def test_junk_sections(data, one_sentence):
    refused_well(lambda: make_case(Case, data), one_sentence)


@given(text=TOML_TEXT | LIKELY_LINES)
def test_random_text(text, tmp_path, one_sentence):
    file = tmp_path / "case.toml"
    file.write_text(text, encoding="utf-8")
    refused_well(lambda: load_case(file), one_sentence)
