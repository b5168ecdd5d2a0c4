"""Figures and tables of the thesis made again: numbers beside the published ones, one page, runs kept."""

from __future__ import annotations

import json
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.thesis import ENTRIES, Number
from dbvfiv.thesis.materials import deflections
from dbvfiv.thesis.openings import layup
from dbvfiv.verdict import judge_record
from tests.verification.test_recovery import OURS


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
    page = (tmp_path / "thesis-quick.html").read_text()
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


def test_a_list_and_a_name_that_is_none(command_line, misused, tmp_path):
    outcome = command_line("reproduce", "--list")
    assert outcome.status == 0 and len(outcome.out.splitlines()) == len(ENTRIES)
    misused("7-99", "reproduce", "7-99", "-o", tmp_path)


def told(name, workshop, count):
    """First findings of an entry, before its pictures."""
    return list(islice(next(entry for entry in ENTRIES if entry.name == name).tell(workshop), count))


def test_losses_of_the_tunnel_differ_by_what_the_table_says():
    """Areas of the lips on 28 x 48; ours lie below the thesis's."""
    areas = {p: 0.25 * np.pi * 0.3048**2 * (1 - np.sqrt(k)) for p, k in OURS.items()}
    result = SimpleNamespace(nearest=lambda p: SimpleNamespace(outlet_area=areas[p]))
    *numbers, sentence = told("7-9", SimpleNamespace(steady=lambda pressures: result), 4)
    assert [number.row[-1] for number in numbers] == ["-4.7 %", "-6.5 %", "-4.2 %"]
    assert "it differs by -6.5 to -4.2 % from the thesis's factors" in sentence


def test_the_flow_of_a_cycle_has_its_amplitude_and_only_that_of_a_cycle():
    """Half the way between the extremes, so 2 of 3 + 2 sin."""
    time = np.linspace(0.0, 2.0, 4001)
    kinds = {"2 ms": 3 + 2 * np.sin(80 * np.pi * time), "1 ms": 3 + 1e-3 * np.exp(2 * time) * np.sin(80 * np.pi * time)}

    def run(_kind, _changes, name):
        found = judge_record(time, kinds.get(name, kinds["1 ms"]))
        return SimpleNamespace(verdict={"verdict": found.name, "mass_flow": found.summary()})

    workshop = SimpleNamespace(quick=False, duration=lambda full, quick: full, run=run)
    number, other = told("7-14", workshop, 2)
    assert number.what == "amplitude of the flow, 2 ms" and number.ours == pytest.approx(2.0, rel=1e-3)
    assert other == "1 ms: growing, so no amplitude."


@pytest.mark.slow
@pytest.mark.long
def test_the_whole_quick_set(command_line, tmp_path):
    outcome = command_line("reproduce", "--quick", "-o", tmp_path, "--json")
    document = json.loads(outcome.out)
    assert outcome.status == 0 and not document["failures"]
    assert [entry["name"] for entry in document["entries"]] == [entry.name for entry in ENTRIES]
