"""The section [damping] and the keys by which a material relaxes."""

from __future__ import annotations

import pytest

from dbvfiv.case import CaseError, make_case
from dbvfiv.case.load import parse_toml
from dbvfiv.case.write import case_toml
from dbvfiv.studies.case import Case, load_case

LOSS, RAYLEIGH = {"damping.model": "loss factor"}, {"damping.model": "rayleigh"}


def test_numbers_that_are_not_given_follow_from_the_model():
    damping = Case().damping
    assert (damping.model, damping.alpha, damping.beta, damping.loss_factor) == ("loss factor", 0.0, 0.0, 1.0)
    assert (damping.band, damping.branches) == ((1.0, 200.0), 4)
    damping = Case().replace(RAYLEIGH).damping
    assert (damping.alpha, damping.beta, damping.loss_factor) == (5.0, 0.003, 0.0)
    assert Case().replace(RAYLEIGH).replace(LOSS) == Case()
    assert Case().replace({"damping.band": ["0.1 Hz", "1 kHz"]}).damping.branches == 6


def test_what_is_given_stays():
    damping = Case().replace(LOSS | {"damping.alpha": 3, "damping.loss_factor": "1/2", "damping.branches": 6}).damping
    assert (damping.alpha, damping.loss_factor, damping.branches) == (3.0, 0.5, 6)
    assert Case().replace(LOSS | {"damping.beta": 0, "damping.loss_factor": 0}).damping.loss_factor == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        {},
        LOSS,
        LOSS | {"damping.loss_factor": 0.5, "damping.band": [2, "300 Hz"]},
        LOSS | {"materials.CR.loss_factor": "NBR", "materials.fibre.prony": [[0.1, "3 ms"], [0.2, 1]]},
        RAYLEIGH,
        RAYLEIGH | {"damping.beta": 0.001},
    ],
)
def test_every_case_can_be_written_and_read(changes):
    case = Case().replace(changes)
    for comments in (True, False):
        assert make_case(Case, parse_toml(case_toml(case, comments))) == case
    assert Case.from_dict(case.to_dict()) == case


def test_cases_of_earlier_versions_are_read():
    data = Case().to_dict() | {"damping": {"alpha": 5.0, "beta": 0.003}}
    assert Case.from_dict(data).damping.model == "rayleigh"


A = "[materials.A]\nkind='neo-hookean'\nshear_modulus=1e6\ndensity=1000\n"
ON = "[damping]\nmodel='loss factor'\n"
BAD = {
    "no such model": ("[damping]\nmodel='structural'", '"rayleigh" or "loss factor"'),
    "beta with loss factors": (
        ON + "beta='1 ms'",
        "line 3: damping.beta is 0.001 s with damping.model = 'loss factor'",
    ),
    "loss factor with Rayleigh": (
        "[damping]\nmodel='rayleigh'\nloss_factor=1",
        "damping.loss_factor is 1 with.*'rayleigh'.*leave it out",
    ),
    "negative factor": (ON + "loss_factor=-1", "damping.loss_factor.*at least 0"),
    "band of one": (ON + "band=['1 Hz']", "which has 1 entries"),
    "band backwards": (ON + "band=['200 Hz', '1 Hz']", "first frequency is not below its second"),
    "band of a point": (ON + "band=[5, 5]", "not below its second"),
    "band in seconds": (ON + "band=['1 s', '2 Hz']", "'1 s' is one which is not a frequency"),
    "band from zero": (ON + "band=[0, 200]", "0 Hz is out of range"),
    "band in a text": (ON + "band='1 to 200 Hz'", "no list of two frequencies"),
    "no branches": (ON + "branches=0", "damping.branches.*at least 1"),
    "branches that are no integer": (ON + "branches=3.5", "damping.branches.*integer"),
    "negative loss factor": (A + "loss_factor=-0.1", "materials.A.loss_factor is given as -0.1.*from 0 to 2"),
    "loss factor above 2": (A + "loss_factor=2.1", "materials.A.loss_factor is given as 2.1.*from 0 to 2"),
    "loss factor of an unknown material": (A + "loss_factor='teflon'", "NR, SBR, CR, EPDM, NBR, IIR, fibre"),
    "two ways at once": (A + "loss_factor=0.1\nprony=[[0.1, 1]]", "materials.A.prony is given beside loss_factor"),
    "negative strength": (A + "prony=[[0.1, 1], [-0.2, 2]]", "pair 2 has the strength -0.2.*give energy away"),
    "time zero": (A + "prony=[[0.1, 0]]", "pair 1 has the time 0 s, which is not positive"),
    "time in Hz": (A + "prony=[[0.1, '3 Hz']]", "pair 1 holds a value which is not a time"),
    "series of numbers": (A + "prony=[0.1, 1]", "entry 1 is no pair"),
    "empty series": (A + "prony=[]", "which has 0 pairs"),
    "table that does not exist": (A + "loss_data='gone.csv'", "materials.A.loss_data.*does not exist"),
    "relaxation table that does not exist": (A + "relaxation_data='gone.csv'", "relaxation_data.*does not exist"),
    "temperature alone": (A + "loss_temperature='20 degC'", "20 degC without a table"),
    "temperature without a unit": (A + "loss_temperature=20", "which is 20 K; it must be a temperature from 100"),
    "temperature in metres": (A + "loss_temperature='20 m'", "no temperature with its unit"),
    "nothing said": (
        ON + A + "[[layers]]\nmaterial='A'\nthickness=0.01",
        "materials.A.loss_factor is missing.*loss_data",
    ),
    "built-in by another name": (
        "[materials.A]\nkind='built-in'",
        "materials.A.kind is 'built-in'.*CR, SBR, EPDM, fibre",
    ),
    "constant of a built-in": ("[materials.CR]\nc10=3", "materials.CR.c10 is not a key"),
}


@pytest.mark.parametrize("text, words", BAD.values(), ids=BAD.keys())
def test_what_cannot_be_is_refused_in_a_sentence(tmp_path, monkeypatch, one_sentence, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text(text)
    with pytest.raises(CaseError, match=words) as refused:
        load_case("bad.toml")
    assert one_sentence(str(refused.value)), refused.value


def test_materials_that_no_layer_uses_need_say_nothing(tmp_path):
    (tmp_path / "good.toml").write_text(ON + A)
    assert load_case(tmp_path / "good.toml").damping.relaxes


def test_parameters_that_the_model_lacks():
    rayleigh = Case().replace(RAYLEIGH)
    assert rayleigh.damping.lacks("beta") is None and Case().damping.lacks("loss_factor") is None
    assert "damping.model = 'rayleigh'" in rayleigh.damping.lacks("loss_factor")
    assert "damping.model = 'loss factor'" in Case().damping.lacks("beta")
