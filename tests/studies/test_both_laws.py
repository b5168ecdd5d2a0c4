"""Modes and onsets under both continuity laws side by side, and what is said where they disagree."""

from __future__ import annotations

import json

import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies.onset.study import disagreements
from dbvfiv.studies.stability.dimensions import compare_ranges, compare_states
from tests.small_valves import SMALL, load_small, settings

STATE = {"damping.alpha": 0.0, "drive.pressure": "6 kPa", "fluid.density": 60.0}
BOTH = {"modes.continuity": "both", "onset.continuity": "both", "onset.coarse_mesh": 0, "onset.normal_form": False}
OPTIONS = settings(SMALL | STATE)


def test_modes_under_both_laws_are_those_of_each(command_line):
    document = json.loads(command_line("modes", *OPTIONS, "--law", "both", "--count=4", "--json").out)
    alone = {law: load_small(STATE).modes(continuity=law, count=4) for law in ("quasi-steady", "storage")}
    other = document["other_law"]
    assert document["state"]["continuity"] == "quasi-steady" and other["continuity"] == "storage"
    for found, law in ((document, "quasi-steady"), (other, "storage")):
        for listed, mode in zip(found["modes"], alone[law].modes, strict=True):
            expected = mode.summary()
            assert listed.pop("symmetry") == expected.pop("symmetry") == "SS"
            assert listed == pytest.approx(expected, rel=1e-7, abs=1e-8)
        assert found["stable"] == alone[law].stable
        assert found["unstable_count"] == found["unstable_count_independent"]
    # here is a state on which they disagree
    assert document["stable"] is False and other["stable"] is True
    assert "disagree: unstable under quasi-steady, stable under storage" in document["comparison"]
    assert "conserves volume" in document["comparison"] and "water tunnel" in document["comparison"]


def test_they_are_printed_side_by_side_and_kept(command_line, tmp_path):
    out = command_line("modes", *OPTIONS, "--law=both", "--count=3", "-o", tmp_path / "both.h5").out
    assert "Flutters under quasi-steady continuity: " in out and "Stable under storage continuity: " in out
    assert out.count("growth rate") == 0 and "disagree" in out
    assert out.count("Modes are of class SS alone (both lips open and close).") == 1
    read = dbvfiv.load_result(tmp_path / "both.h5")
    law, other = read.other_law
    assert law == "storage" and len(other.modes) == 3
    assert "\n".join(read.lines()) in out


def test_one_law_in_place_of_the_cases(command_line):
    document = json.loads(command_line("modes", *OPTIONS, "--law", "storage", "--count=1", "--json").out)
    assert document["state"]["continuity"] == "storage" and "other_law" not in document


@pytest.mark.slow
def test_onsets_under_both_laws_are_those_of_each():
    found = load_small(STATE, BOTH).onset("density=5:300:6:log")
    alone = load_small(STATE, {"onset.coarse_mesh": 0, "onset.normal_form": False})
    other = alone.onset("density=5:300:6:log", continuity="storage")
    assert found.other_law["points"][0]["value"] == pytest.approx(other.points[0]["value"], rel=1e-8)
    ((low, high, law),) = found.disagreements
    assert law == "storage"
    assert (low, high) == pytest.approx((other.points[0]["value"], found.points[0]["value"]), rel=1e-6)
    assert "(stable under storage alone)" in found.comparison and "conserves volume" in found.comparison
    assert "other_law" in found.summary() and "Under storage continuity;" in "\n".join(found.lines())


@pytest.mark.parametrize(
    "study, keys, words",
    [
        ("modes", {"modes.in_vacuo": True}, "in_vacuo leaves the fluid out"),
        ("modes", {"fluid.unsteady": False}, "fluid.unsteady is false"),
        ("modes", {"drive.kind": "uniform"}, "drive.kind is 'uniform'"),
        ("onset", {"onset.over": "storage"}, "onset.over moves the flow model itself"),
        ("map", {"map.y": "storage"}, "an axis moves the flow model itself"),
        ("onset", {"fluid.unsteady": False}, "fluid.unsteady is false"),
        ("modes", {"fluid.sound_speed": 343, "fluid.continuity": "storage"}, "compressed .* stores mass"),
    ],
)
def test_where_no_law_is_at_work_there_are_not_two(study, keys, words):
    with pytest.raises(CaseError, match=rf"{study}\.continuity is given as 'both', but .*{words}"):
        getattr(load_small(STATE, keys, {f"{study}.continuity": "both"}), study)()


def test_sentences():
    assert compare_states("storage", True, "quasi-steady", True) == "Both flow models find the state stable."
    assert "cannot be compared: undecided under storage" in compare_states("storage", None, "quasi-steady", None)
    assert "say the same" in compare_ranges("density", [], "kg/m³", 1.0)
    other = {"continuity": "storage", "stable": [(1.0, 2.0), (4.0, 9.0)], "unstable": [(2.0, 4.0)]}
    found = disagreements("quasi-steady", [(3.0, 5.0)], [(1.0, 3.0), (5.0, 6.0), (6.0, 7.0)], other)
    assert found == [(1.0, 2.0, "storage"), (3.0, 4.0, "quasi-steady"), (5.0, 7.0, "storage")]
