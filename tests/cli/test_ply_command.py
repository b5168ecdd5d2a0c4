"""``dbvfiv ply``: what it prints, draws and refuses."""

import json
import tomllib

import numpy as np
import pytest

from dbvfiv.fit.cards import law_from_card
from dbvfiv.fit.ply import StripTest
from dbvfiv.materials.laws import fibre_ply, ply_from_constituents
from dbvfiv.studies.case import load_case


@pytest.fixture
def strips(tmp_path):
    ply, names = fibre_ply(), []
    for direction, modulus in (("warp", ply.e1), ("weft", ply.e2)):
        strain = np.linspace(0.005, 0.05, 10)
        rows = zip(strain.tolist(), (modulus * StripTest.unit_stress(strain)).tolist())
        path = tmp_path / f"{direction}.csv"
        path.write_text("engineering_strain [-],nominal_stress [Pa]\n" + "".join(f"{e!r},{p!r}\n" for e, p in rows))
        names.append(str(path))
    return names


def test_the_reference_ply(command_line, strips, tmp_path):
    outcome = command_line("ply", *strips, "--at", "30 %,0.6", "--plots", str(tmp_path / "f"))
    assert outcome.status == 0 and outcome.err == ""
    other = ply_from_constituents(0.3).e1 / 1e6
    assert "fibre 3460 MPa, matrix 4.37 MPa" in outcome.out and f"With 0.3 of fibre: e1 {other:.5g} MPa" in outcome.out
    assert (tmp_path / "f" / "ply.png").stat().st_size > 10_000


def test_both_tables_are_the_ply(command_line, strips, tmp_path):
    document = json.loads(command_line("ply", *strips, "--name", "mine", "--json").out)
    first, second = document["toml"].split("\n# or, to vary the fraction of the fibre:\n")
    for number, text in enumerate((first, second.replace("# ", ""))):
        assert tomllib.loads(text)["materials"]["mine"]
        case = tmp_path / f"{number}.toml"
        case.write_text(text)
        law = law_from_card(load_case(case).materials.named["mine"])
        np.testing.assert_allclose(law.parameters, fibre_ply().parameters, rtol=1e-7)


@pytest.mark.parametrize(
    "options, words",
    [
        (["--fraction", "0"], "--fraction is given as '0'"),
        (["--fraction", "120 %"], "less than 1"),
        (["--at", "30 %,x"], "--at is given as 'x'"),
        (["--xi", "-1"], "--xi is given as -1"),
        (["--xi", "1"], "e1 must be at least e2"),
        (["--bias", "none.csv"], "none.csv cannot be read"),
    ],
)
def test_bad_requests_get_a_sentence(command_line, strips, options, words):
    outcome = command_line("ply", *strips, *options)
    assert outcome.status == 2 and words in " ".join(outcome.err.split()) and "Traceback" not in outcome.err
