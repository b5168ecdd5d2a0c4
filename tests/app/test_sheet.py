"""The case of a page: read, written, checked; nothing outside its folder is read."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given as drawn
from hypothesis import strategies as st

from dbvfiv.app.see import arguments_of
from dbvfiv.app.sheet import change, check, given, read_sheet, usual_value, write_sheet
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import Case, load_case
from tests.app.server import COARSE

NUMBERS = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False) | st.booleans()
TEXTS = st.text(st.characters(blacklist_categories=("Cs",)), max_size=20)
VALUES = st.recursive(NUMBERS | TEXTS, lambda v: st.lists(v, max_size=3) | st.dictionaries(TEXTS, v, max_size=3))


@drawn(st.dictionaries(TEXTS, VALUES, max_size=5))
def test_what_is_written_reads_back(data):
    assert read_sheet(write_sheet(data)) == data


def test_keys_are_set_and_taken_away(tmp_path):
    data = read_sheet(COARSE)
    change(data, "drive.pressure", "1 m")
    change(data, "layers.0.thickness", "3 mm")
    assert given(data, "drive.pressure") == "1 m"
    case = check(data, tmp_path).case
    assert case.drive.pressure == pytest.approx(9806.65) and case.layers[0].thickness == 0.003
    change(data, "drive.pressure", " ")
    assert "pressure" not in data["drive"]


def test_a_page_takes_so_many_elements(tmp_path):
    found = check({"mesh": {"around": 100, "along": 41}}, tmp_path)
    assert found.case is None and found.problems[0].endswith("make 4100 elements; a page takes 4000.")
    assert check({"mesh": {"around": 100, "along": 40}}, tmp_path).case.mesh.along == 40


def test_a_sheet_is_the_case_of_its_file(tmp_path):
    (tmp_path / "dbv6.toml").write_text(COARSE)
    assert check(read_sheet(COARSE), tmp_path).case == load_case(tmp_path / "dbv6.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[valve]\nduckbill_length = "-1 mm"', 'The case, line 2: valve.duckbill_length is given as "-1 mm"'),
        ("[valve]\nlenght = 1", "valve.lenght is not a key of the case file"),
        ("[mesh]\naround = 400\nalong = 400", "160000 elements"),
        ('[map]\nworkers = "tcp://10.0.0.1:8786"', "map.workers"),
        ('[valve]\nkey_points = "/etc/passwd"', "without their folder"),
        ('[valve]\nkey_points = "../../etc/passwd"', "without their folder"),
        ('[materials.CR]\nloss_data = "~/secret.csv"', "without their folder"),
        ('[uncertainty.inputs]\ndensity = "samples(/etc/passwd)"', "without their folder"),
        ('[steady]\nmeasured = ["..\\\\x.csv"]', "without their folder"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path, text, said):
    found = check(read_sheet(text), tmp_path, text)
    assert found.case is None and said in found.problems[0]


@pytest.mark.parametrize("text", ["a = [", "[" * 5000, "x = " + "[" * 5000, "\0", "a = 1\n" * 60_000])
def test_what_is_no_sheet_is_a_sentence(text):
    with pytest.raises(CaseError):
        read_sheet(text)


@drawn(st.dictionaries(st.sampled_from(["valve", "layers", "mesh", "fluid", "drive"]), VALUES, max_size=3))
def test_no_data_raise(data):
    check(data, Path("."))


@drawn(st.dictionaries(st.sampled_from(["valve", "layers"]), VALUES, max_size=2), st.sampled_from(["", "1 mm"]))
def test_changes_of_any_data_are_made_or_refused(data, typed):
    for key in ("layers.0.thickness", "layers.7.angle", "valve.wall_map.1.to", "valve.scale"):
        with suppress(CaseError):
            change(data, key, typed)


def test_usual_values_have_units():
    assert usual_value(Case().drive, "pressure") == "18 kPa" and usual_value(Case().layers[2], "angle") == "54 deg"


def test_pictures_begin_above_the_pressure_downstream():
    case = load_case(None, ["drive.pressure=10 kPa", "downstream.pressure=5 kPa"])
    assert arguments_of(case, "Head-loss curve") == ["-p", "5.75 kPa:12.5 kPa:10"]
    assert arguments_of(case, "Root locus over head") == ["--over", "pressure=5750:12500:10"]
    case = load_case(None, ["drive.pressure=10 kPa"])
    assert arguments_of(case, "Root locus over head") == ["--over", "pressure=1500:15000:10"]
