"""Onsets, maps, sweeps and back pressure in all classes of motion."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.onset.line import FoundOnsets, joined_stretches
from dbvfiv.studies.onset.study import OnsetResult, common_stretches, merge_points
from dbvfiv.studies.stability.dimensions import Variant, leading_class
from dbvfiv.studies.stability.samples import Sample
from eigen.columns import DIRECT

OTHERS = ["SA", "AS", "AA"]
SMALL = {"mesh.around": 8, "mesh.along": 14, "drive.pressure": "6 kPa", "damping.alpha": 0}


def make(**changes):
    return dbvfiv.load(thesis_case(SMALL | {k.replace("__", "."): v for k, v in changes.items()}))


@pytest.fixture(scope="module")
def onset():
    plain = {"onset__coarse_mesh": 0, "onset__normal_form": False}
    return make(onset__symmetry="all", onset__over="density=1:1000:5:log", **plain).onset()


@pytest.mark.slow
def test_onset_names_the_most_unstable_class(onset):
    said = json.loads(json.dumps(onset.summary()))
    assert [part["symmetry"] for part in said["classes"]] == OTHERS
    assert {point["symmetry"] for point in said["points"]} == {"SS"}
    leading = said["leading"]
    assert leading["values"] == list(onset.case.onset.axis.values) and all(leading["certified"])
    assert leading["symmetry"][0] == "SS" and leading["symmetry"][-1] == "SA"
    for value, growth, name in zip(leading["values"], leading["growth_rate"], leading["symmetry"]):
        found = make().modes("6 kPa", density=value, count=3, symmetry=name)
        assert found.modes[0].growth_rate == pytest.approx(growth, rel=1e-6)
    (edge,) = [point["value"] for point in onset.points if point["edge"]]
    outcomes = ["flutters" if value < edge else "stable" for value in leading["values"]]
    assert [v["outcome"] for v in leading["verdict"]] == outcomes
    assert leading["verdict"][-1]["reason"].startswith("In SS: ") and all(v["certain"] for v in leading["verdict"])
    rates = [[part["scan"]["growth_rate"][0], *[leading["growth_rate"][0]]] for part in said["classes"]]
    assert all(own < most for own, most in rates)
    assert "class" in onset.lines()[1] and onset.lines()[2].endswith("SS") and "alone" not in onset.lines()[0]


def test_stretches_are_those_of_all_classes(onset):
    (edge,) = [point["value"] for point in onset.points if point["edge"]]
    low, high = onset.values[[0, -1]]
    assert onset.unstable_intervals == [(low, edge)]
    assert onset.stable_intervals == [(edge, high)]


def test_without_an_onset_the_valve_is_stable_up_to_the_band_of_all_classes(onset):
    parts = [replace(part, samples=part.samples[-1:], points=()) for part in (onset.own, *onset._classes)]
    narrow = replace(parts[2], samples=(replace(parts[2].samples[0], band=30.0),))
    said = onset._without_onset([*parts[:2], narrow, parts[3]])
    assert said.startswith("No onset: the valve is stable from ")
    assert said.endswith(" for modes up to 30 Hz in classes SS, SA, AS, AA.")
    assert onset._without_onset(parts[:1]).endswith(" in class SS.")
    assert onset._line(onset.own.points[0].summary()).endswith("  SS")  # as of another flow model


def test_onsets_come_back_from_a_file(onset, tmp_path):
    stored = dbvfiv.load_result(onset.save(tmp_path / "onset.h5"))
    assert stored.summary() == onset.summary() and stored.lines() == onset.lines()
    assert "onset" in stored.drawers()


def test_a_crossing_inside_what_another_class_has_unstable_is_no_edge():
    own = [{"value": 3.0, "edge": True}, {"value": 8.0, "edge": True}]
    unstable = {"SS": [(0.0, 3.0), (8.0, 9.0)], "SA": [(5.0, 9.0)]}
    points = merge_points({"SS": own, "SA": [{"value": 5.0, "edge": True}]}, unstable)
    assert [(p["value"], p["symmetry"], p["edge"]) for p in points] == [
        (3.0, "SS", True),
        (5.0, "SA", True),
        (8.0, "SS", False),
    ]
    assert joined_stretches([[(0.0, 3.0), (8.0, 9.0)], [(5.0, 9.0)]]) == [(0.0, 3.0), (5.0, 9.0)]
    assert common_stretches([[(3.0, 8.0)], [(0.0, 5.0)]]) == [(3.0, 5.0)]
    assert common_stretches([[(3.0, 8.0)], []]) == []


def test_leading_takes_the_largest_growth_rate():
    rates, frequencies = [[[-1.0, np.nan]], [[0.0, 1.0]]], [[[9.0, np.nan]], [[2.0, 3.0]]]
    cells = leading_class(["SS", "AA"], np.array(rates), np.array(frequencies))
    assert cells["symmetry"] == [["AA", None]] and cells["growth_rate"][0][0] == 0.0 and cells["frequency"][0][0] == 2.0


def test_a_valve_that_is_unstable_in_a_certain_class_is_so_whatever_another_one_leaves_open():
    values = (1.0, 2.0, 3.0)
    grows = tuple(Sample(v, np.array([5 + 60j]), 2, 2, True, how=DIRECT) for v in values)
    calm = tuple(Sample(v, np.array([-1 + 50j]), 0, 0, v != 2.0, how=DIRECT) for v in values)
    found = OnsetResult.__new__(OnsetResult)
    parts = {Variant("storage", name): samples for name, samples in (("SS", grows), ("SA", calm))}
    found.__dict__["variants"] = {variant: FoundOnsets(variant, samples, ()) for variant, samples in parts.items()}
    assert found.leading["certified"] == [True] * 3
    assert found.unstable_intervals == [(1.0, 3.0)] and found.uncertain_intervals == []
    found.variants[Variant("storage", "SS")] = FoundOnsets(Variant("storage", "SS"), grows[:2], (), missed=(3.0,))
    assert found.unstable_intervals == [(1.0, 2.0)] and found.uncertain_intervals == [(2.0, 3.0)]


def test_maps_hold_every_class():
    ranges = {"map__x": "pressure=3e3:9e3:3", "map__y": "density=1:1000:4:log", "map__curve": False, "map__refine": 0}
    found = make(map__symmetry="all", map__checks=0, **ranges).map()
    said = json.loads(json.dumps(found.summary()))
    assert [part["symmetry"] for part in said["classes"]] == OTHERS
    assert all(np.all(part["certified"]) for part in said["classes"])
    rates = np.stack([said["growth_rate"], *(part["growth_rate"] for part in said["classes"])])
    assert np.allclose(said["leading"]["growth_rate"], rates.max(axis=0))
    names = np.array(list(SYMMETRIES))[rates.argmax(axis=0)]
    assert np.array_equal(names, said["leading"]["symmetry"]) and {"SS", "SA"} <= set(names.ravel())
    alone = make().modes("6 kPa", density=1000, symmetry="AS", count=2).modes[0]
    assert said["classes"][1]["growth_rate"][3][1] == pytest.approx(alone.growth_rate, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SA", "AA"])
@pytest.mark.parametrize("over", ["density=10:1000:3:log", "pressure=6e3:10e3:2"])
def test_sweeps_follow_one_class(name, over):
    found = make().sweep(over, count=2, symmetry=name)
    assert found.certified and found.summary()["symmetry"] == name
    density = 10.0 if "density" in over else None
    modes = make().modes("6 kPa", symmetry=name, count=2, **({"density": density} if density else {}))
    assert found.branches[0].growth_rate[0] == pytest.approx(modes.modes[0].growth_rate, rel=1e-6)


@pytest.fixture(scope="module")
def closures():
    case = {"closure__pressures": ["2 kPa", "4 kPa"]}
    return {name: make(**case, closure__symmetry=name).closure() for name in ("SS", "all")}


def test_back_pressure_is_watched_in_every_class(closures):
    """The path is the same to the last digit; each class has its own lowest eigenvalue along it."""
    plain, watched = (closures[name].summary() for name in ("SS", "all"))
    assert watched["points"] == plain["points"] and watched["path"] == plain["path"]
    assert plain["classes"] == [] and [part["symmetry"] for part in watched["classes"]] == OTHERS
    for part in watched["classes"]:
        assert set(watched["path"]["pressure"]) <= set(part["path"]["pressure"])
        assert part["critical_pressure"] is None and min(part["path"]["lowest_eigenvalue"]) > 0
    assert watched["first_buckling"] is None
    lines = "\n".join(closures["all"].lines())
    assert all(f"class {name}" in lines for name in OTHERS)


def test_held_lips_are_not_watched():
    found = make(closure__pressures=["1 kPa"], closure__symmetry="all", closure__supports="held-lips").closure()
    assert found.summary()["classes"] == [] and any("cannot move together" in sentence for sentence in found.warnings)


def test_the_lowest_stiffness_at_rest_is_that_of_the_modes(closures):
    """Without pressure the stiffness eigenvalues are the squares of the angular frequencies at rest."""
    part = closures["all"].summary()["classes"][0]
    rest = make().modes(0, in_vacuo=True, symmetry="SA", count=1, beta=0).modes[0]
    low, mid = part["path"]["lowest_eigenvalue"][:2]
    p = part["path"]["pressure"][:2]
    at_rest = low - (mid - low) / (p[1] - p[0]) * p[0]
    assert at_rest == pytest.approx(rest.angular_frequency**2, rel=0.05)
