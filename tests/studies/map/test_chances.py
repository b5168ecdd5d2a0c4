"""Bands of probability on maps: cells are those of samples found one by one with their full matrices."""

from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies.map import chances
from dbvfiv.studies.map.chances import find_chances
from dbvfiv.studies.map.column import MapPlan
from dbvfiv.studies.map.figures import stability_map
from dbvfiv.studies.stability.verdict import Verdict
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.observers import Stop
from tests.small_valves import load_small

INPUTS = {"thickness": "normal(8 %)", "materials.CR.stiffness_factor": "lognormal(1.4)"}
KEYS = {"damping.alpha": 0.0, "fluid.density": 20.0, "uncertainty.inputs": INPUTS, "map.curve": False, "map.refine": 0}
AXES = {"map.x": "pressure=3 kPa:5 kPa:2", "map.y": "beta=0.004:0.012:4:log", "map.checks": 0}


@pytest.mark.slow
def test_cells_have_the_probability_of_samples_found_one_by_one(tmp_path):
    valve, path = load_small(KEYS, AXES, {"map.samples": 24}), tmp_path / "map.h5"
    assert valve.map(output=path, observer=Stop(0, "probability at 3 kPa")).interrupted
    found = dbvfiv.resume(path, workers=2)
    value, low, high = found.probability
    assert value.shape == (4, 2) and (low <= value).all() and (value <= high).all()
    assert ((value > 0.1) & (value < 0.9)).any()
    for column, pressure in enumerate(found.plan.x.values):
        for row in (1, 2):
            singly = valve.uncertainty(samples=24, pressure=pressure, beta=found.plan.y.values[row]).points[0]
            # undecided samples, which full matrices decide, widen an interval
            assert low[row, column] <= singly["interval"][0] and singly["interval"][1] <= high[row, column]
    assert found.summary()["probability"]["value"] == value.tolist()
    assert any("Probability of flutter from 24 samples" in line for line in found.lines())
    assert stability_map(found).axes[0].collections


def test_a_column_without_a_probability_is_told_again_by_a_run_that_goes_on():
    said, kept = [], [{"value": 3e3, "failure": "No state."}, {"value": 5e3, "flutters": [], "undecided": []}]
    record = SimpleNamespace(notes=lambda _: kept, warn=said.append)
    find_chances(load_small(KEYS, AXES, {"map.samples": 24}).case, record, 1)
    assert said == ["No probability at 3 kPa: No state."]


@pytest.mark.parametrize(
    "verdict, undecided, diverges",
    [
        (Verdict.not_valid("CR is unstable."), 8, 0),
        (Verdict.of(np.array([1.0 + 0.0j]), 1, 1, True, line=0.0, band=np.inf), 0, 8),
    ],
    ids=["no rubber", "diverge"],
)
def test_samples_that_say_nothing_of_flutter(monkeypatch, verdict, undecided, diverges):
    """A cell in which all lost the stability of their rubber has no probability, and not that of valves that never
    flutter; those that diverge are told beside.
    """
    shared = SimpleNamespace(state=lambda row: None)
    unsound = SimpleNamespace(verdicts=lambda walk, places, row: [verdict] * len(places))
    monkeypatch.setattr(chances, "find_neighbours", lambda *_: shared)
    monkeypatch.setattr(chances, "Beside", lambda *_: unsound)
    for name in ("equilibrium", "settle"):
        monkeypatch.setattr(StabilityWalk, name, lambda *_: None)
    case = load_small(KEYS, AXES, {"map.samples": 8}).case
    found = chances.Chances(case).column(3e3)
    assert found == {"flutters": [0] * 4, "undecided": [undecided] * 4, "diverges": [diverges] * 4}
    record = SimpleNamespace(notes=lambda _: [{"value": 3e3, **found}])
    value, low, high, _ = chances.chance_grid(record, MapPlan(case))[:, :, 0]
    assert (low == 0).all() and (high == 1).all() == np.isnan(value).all() == (undecided > 0)
    told = " ".join(chances.sentences(record, MapPlan(case)))
    assert ("100 % of the samples of a cell diverge" in told) == (diverges > 0)


@pytest.mark.parametrize(
    ("changes", "clause"),
    [
        ({"map.y": "thickness=0.9:1.1:3"}, "a steady state of its own"),
        ({"uncertainty.inputs": {"beta": "lognormal(1.3)"}}, "which the map moves"),
    ],
)
def test_what_has_no_bands_is_answered_by_a_sentence(changes, clause):
    with pytest.raises(CaseError, match=clause):
        load_small(KEYS, AXES, {"map.samples": 24}, changes).map()
