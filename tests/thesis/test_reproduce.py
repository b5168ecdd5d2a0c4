"""Figures and tables of the thesis made again: numbers beside the published ones, one page, runs kept."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dbvfiv.thesis import ENTRIES, Number
from dbvfiv.thesis.materials import deflections
from dbvfiv.thesis.openings import layup


def test_entries_stand_in_the_order_of_the_thesis():
    places = [entry.place for entry in ENTRIES]
    assert places == sorted(places) and len(set(places)) == len(places)
    names = [entry.name for entry in ENTRIES]
    assert {"3-6", "T3-3", "T3-5", "3-17", "3-21", "T5-1", "5-3", "5-10", "7-2", "7-4", "7-12", "7-13", "7-17"} <= set(
        names
    )


def test_a_difference_is_relative_and_of_percentages_in_points():
    assert Number("flow", 41.0, 50.0, "kg/s").difference == pytest.approx(-0.18)
    assert Number("gain", 15.0, 12.0, "%").difference == pytest.approx(0.03)
    assert Number("gain", 15.0, 12.0, "%").row[-1] == "+3.0 points"
    assert Number("area", 1.0).difference is None


def test_layups_have_opposite_plies():
    assert [layer["angle"] for layer in layup(36.0) if layer["material"] == "fibre"] == [36.0, -36.0]
    assert all(layer["material"] != "fibre" for layer in layup(None))


def test_constants_and_an_opening(command_line, tmp_path):
    names = ("T3-3", "T3-5", "T5-1", "7-11")
    outcome = command_line("reproduce", *names, "--quick", "-o", tmp_path, "--json")
    assert outcome.status == 0
    found = {entry["name"]: entry for entry in json.loads(outcome.out)["entries"]}
    assert list(found) == list(names)
    assert all(abs(n["ours"] - n["published"]) <= 0.0051 for n in found["T3-3"]["numbers"])  # the table has two digits
    assert found["T5-1"]["numbers"][1]["ours"] == pytest.approx(0.1 / (2 * np.pi * 11))  # 2 xi/(w1 + w2)
    size = found["7-11"]["numbers"][0]
    assert size["published"] == 0.069 and 0.05 < size["ours"] < 0.065
    page = (tmp_path / "thesis.html").read_text()
    assert all(f"entry-{name}" in page for name in names) and "a coarse mesh" in page
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "quick").iterdir()}
    assert len(kept) == 1
    assert command_line("reproduce", "7-11", "--quick", "-o", tmp_path).status == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "quick").iterdir()} == kept


def test_three_point_bending(command_line, tmp_path):
    """Stiffer than rubber alone and nearly linear; small deflections go as the load."""
    outcome = command_line("reproduce", "3-13", "--quick", "-o", tmp_path, "--json")
    (entry,) = json.loads(outcome.out)["entries"]
    small, large = (number["ours"] for number in entry["numbers"])
    assert 0.9 * small < large < small
    a, b = deflections((8, 4), (0.01, 0.02))
    assert b == pytest.approx(2 * a, rel=1e-4)


def test_a_list_and_a_name_that_is_none(command_line, one_sentence, tmp_path):
    outcome = command_line("reproduce", "--list")
    assert outcome.status == 0 and len(outcome.out.splitlines()) == len(ENTRIES)
    outcome = command_line("reproduce", "7-99", "-o", tmp_path)
    assert outcome.status == 2 and one_sentence(outcome.err) and "7-99" in outcome.err


@pytest.mark.slow
def test_the_whole_quick_set(command_line, tmp_path):
    outcome = command_line("reproduce", "--quick", "-o", tmp_path, "--json")
    document = json.loads(outcome.out)
    assert outcome.status == 0 and not document["failures"]
    assert [entry["name"] for entry in document["entries"]] == [entry.name for entry in ENTRIES]
