"""Answers at a parameter point: predicted within the bound, confirmed as `modes` has them."""

from __future__ import annotations

from time import process_time
from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError
from dbvfiv.explore import Explorer
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.studies.case import Case, thesis_case
from dbvfiv.studies.stability.samples import Sample
from eigen.columns import DIRECT
from tests.app.server import COARSE as COARSE_SIX

COARSE = {"mesh.around": 6, "mesh.along": 8}


@pytest.fixture(scope="module")
def explorer():
    return dbvfiv.load(None, COARSE | {"damping.model": "rayleigh", "damping.beta": 0.003}).explore()


@pytest.mark.parametrize("asked", [{}, {"density": 640.0, "beta": 0.001}, {"pressure": 9806.65, "beta": 0.0008}])
def test_predictions_are_what_is_confirmed(explorer, asked):
    predicted, exact = explorer.bounded(**asked), explorer.confirm(**asked)
    assert exact.confirmed and not predicted.confirmed and not predicted.verdict.certain
    assert predicted.verdict.outcome == exact.verdict.outcome
    error = abs(predicted.eigenvalues[0] - exact.eigenvalues[0]) / abs(exact.eigenvalues[0])
    assert error <= max(10 * predicted.bound, 1e-7) and predicted.bound <= 1e-6


def test_texts_and_limits_of_what_is_asked(explorer):
    assert explorer.place({"pressure": "1 m"}) == explorer.place({"pressure": 9806.65})
    for asked, words in (({"pressure": 0.0}, "above 0"), ({"density": "1 s"}, "density is given as '1 s'")):
        with pytest.raises(CaseError, match=words):
            explorer.place(asked)


def test_a_confirmed_answer_on_the_fit_of_a_rubber_says_so():
    keys = COARSE | {"materials.constants": "published", "drive.pressure": 36e3}
    (said,) = dbvfiv.load(thesis_case(keys)).explore().confirm().summary()["warnings"]
    assert said.startswith("The rubber's constants are unstable here: at 36000 Pa")


THIN = {"valve.thickness_factor": 0.586, "materials.strain_level": 0.1, "drive.head": "0.1506 m"}
WET = THIN | {"fluid.density": 813.1, "outside.fluid": "same", "outside.lips": "open", "mesh.element": "MITC4"}


@pytest.mark.parametrize("keys", [THIN, WET])
def test_bounds_hold_where_corrections_do_not_converge(keys):
    """Walls that relax, on a coarse mesh: the leading mode of the last one had the wrong sign, and was called exact."""
    explorer = dbvfiv.load(None, COARSE | keys).explore()
    predicted, exact = explorer.bounded(), explorer.confirm()
    errors = [min(abs(exact.eigenvalues - value)) / abs(value) for value in predicted.eigenvalues[:2]]
    assert max(errors) <= max(predicted.bound, 1e-8) and max(errors) < 1e-5
    assert predicted.verdict.outcome == exact.verdict.outcome == "stable"


def offered(keys) -> dict:
    """Ranges that are offered of a case, without its state."""
    found = object.__new__(Explorer)
    found.case = Case().replace(keys)
    flow, relaxation = SimpleNamespace(back=0.0), SimpleNamespace(highest=lambda own, highest: highest)
    found.base, found.model = Mu.of(found.case), SimpleNamespace(flow=flow, relaxation=relaxation)
    found._session = SimpleNamespace(require_borne=lambda *_, **__: None)
    return dict(found._offered())


@pytest.mark.parametrize(("alpha", "beta", "name"), [(2.0, 0.0, "alpha"), (2.0, 0.003, "beta")])
def test_the_damping_that_a_wall_has_is_offered(alpha, beta, name):
    ranges = offered({"damping.model": "rayleigh", "damping.alpha": alpha, "damping.beta": beta})
    assert {"alpha", "beta", "loss_factor"} & set(ranges) == {name}


def test_the_density_behind_a_pump_is_not_offered():
    """Its head is another pressure in another fluid."""
    line = {"drive.pressure": 6e3, "upstream.length": 3.0, "upstream.diameter": 0.3}
    for more, there in (({}, True), ({"upstream.pump": [[0, 3.0], [0.1, 0.3]]}, False)):
        ranges = offered(line | more)
        assert ("density" in ranges) is there and {"pressure", "pipe_length"} <= set(ranges)


def test_heads_begin_at_none_where_weight_opens_the_valve():
    explorer = dbvfiv.load(None, COARSE | {"gravity.direction": "-z", "materials.strain_level": 0.1}).explore()
    assert explorer.model.flow.back < 0.0 < explorer.ranges["pressure"][0]


@pytest.mark.slow
def test_confirmed_answers_are_those_of_the_command(explorer):
    valve = dbvfiv.load(None, COARSE | {"damping.model": "rayleigh", "damping.beta": 0.003})
    modes = valve.modes("12 kPa", density=800.0, beta=0.001)
    answer = explorer.with_margin(explorer.confirm(pressure=12e3, density=800.0, beta=0.001))
    leading = complex(modes.modes[0].growth_rate, modes.modes[0].angular_frequency)
    assert abs(answer.eigenvalues[0] - leading) < 1e-7 * abs(leading)
    assert answer.state.mass_flow == pytest.approx(modes.state.mass_flow, rel=1e-9)
    ours, theirs = answer.verdict.summary(), modes.verdict.summary()
    assert ours["outcome"] == theirs["outcome"] and ours["certain"]
    for name in ("growth_rate", "frequency", "damping_ratio"):
        assert ours[name] == pytest.approx(theirs[name], rel=1e-6), name
    # searched to 1e-4 of itself, so that it depends on what was asked before by a part of that
    assert ours["critical_damping_factor"] == pytest.approx(theirs["critical_damping_factor"], rel=1e-4)


class Swaying:
    """Walk of a valve that flutters in SA alone."""

    def __init__(self, motion=SYMMETRIES["SS"]):
        self.symmetry, self.refusal = motion, lambda place: ""
        grows = motion.name == "SA"
        values = np.array([(2.0 if grows else -1.0) + (50j if grows else 80j)])
        self.spectrum = lambda place, count: SimpleNamespace(eigenvalues=values)
        self.cell = lambda place, spectrum: spectrum
        self.sample = lambda place, cell: Sample(np.nan, values, 2 * grows, 2 * grows, True, how=DIRECT)

    def in_class(self, motion):
        return Swaying(motion)

    def about_rubbers(self, place):
        return ["CR strains."]


@pytest.mark.parametrize(("asked", "outcome"), [("SS", "stable"), ("all", "flutters"), ("SA", "flutters")])
def test_classes_that_the_case_asks_for_are_confirmed_too(monkeypatch, asked, outcome):
    found = object.__new__(Explorer)
    found.case, found.walk = Case().replace({"modes.symmetry": asked}), Swaying()
    monkeypatch.setattr(Explorer, "state", lambda self, place: None)
    monkeypatch.setattr(Explorer, "place", lambda self, values: Mu.of(self.case))
    ends = {"SS": 0.4, "SA": 1.7}

    def factor(walk, place, verdict):
        return ends.get(walk.symmetry.name, 0.2), np.nan

    monkeypatch.setattr("dbvfiv.explore.critical_damping_factor", factor)
    answer = found.with_margin(found.confirm())
    classes = {"SS": ["SS"], "all": [*SYMMETRIES], "SA": ["SS", "SA"]}[asked]
    assert answer.verdict.outcome == outcome
    assert [*answer.classes] == classes and len(answer.eigenvalues) == len(classes)
    assert answer.eigenvalues[0] == (-1 + 80j if asked == "SS" else 2 + 50j)
    assert answer.verdict.critical_damping_factor == (0.4 if asked == "SS" else 1.7)
    assert answer.warnings == ("CR strains.",)


@pytest.mark.slow
def test_an_unstable_mode_far_above_the_list_is_told():
    """At 489 Hz, where the list of leading modes ends at 113 Hz. A band up to 100 Hz is left open, as `modes` says it:
    stable there, and the count finds the flutter.
    """
    valve = dbvfiv.load(thesis_case(), COARSE | {"drive.pressure": 450.0, "damping.beta": 4.64e-4})
    answer, modes = valve.explore().confirm(), valve.modes()
    assert answer.verdict.outcome == modes.verdict.outcome == "flutters"
    assert answer.verdict.frequency == pytest.approx(modes.verdict.frequency, rel=1e-6)
    assert answer.verdict.frequency > 400
    valve = valve.replace({"modes.max_frequency": 100.0})
    answer, modes = valve.explore().confirm().verdict, valve.modes().verdict
    assert answer.outcome == modes.outcome == "undecided" and not answer.certain
    assert answer.reason.endswith("modes.max_frequency moves the end.")


def test_every_answer_says_where_the_rubber_is_not_valid():
    keys = {"materials.constants": "published", "materials.strain_level": 0.1, "drive.pressure": 36e3}
    explorer = dbvfiv.load(None, COARSE | keys).explore()
    for answer in (explorer.predict(), explorer.bounded(), explorer.confirm()):
        assert answer.verdict.outcome == "not valid" and "constants are unstable" in answer.verdict.reason


def test_corners_are_prepared():
    explorer = dbvfiv.load(None, COARSE | {"damping.model": "rayleigh", "damping.beta": 0.003}).explore()
    explorer.predict()
    steps = 0
    while explorer.prepare():
        steps += 1
    assert steps == 9  # four of density and damping, six heads, the last told
    free = {name: explorer.ranges[name] for name in ("density", "beta")}
    for share in np.random.default_rng(3).uniform(size=(3, 2)):
        asked = {name: low + s * (high - low) for s, (name, (low, high)) in zip(share, free.items())}
        predicted, exact = explorer.predict(**asked), explorer.confirm(**asked)
        assert predicted.eigenvalues[0] == pytest.approx(exact.eigenvalues[0], rel=1e-3)


def test_what_cannot_be_asked_is_said(explorer):
    with pytest.raises(CaseError, match="cannot be moved here"):
        explorer.predict(thickness=1.0)
    with pytest.raises(CaseError, match="pressure is given as -5"):
        explorer.predict(pressure=-5.0)


@pytest.mark.slow
def test_a_move_takes_so_much_of_a_processor(tmp_path):
    """What a quiet processor answers in, whatever else it does: the 6-inch valve on its own mesh of 28 x 48."""
    text = COARSE_SIX.replace("around = 6", "around = 28").replace("along = 8", "along = 48")
    (tmp_path / "six.toml").write_text(text.replace('model = "rayleigh"\nbeta = 0.003', 'model = "loss factor"'))
    explorer = dbvfiv.load(tmp_path / "six.toml").explore()
    explorer.predict()
    while explorer.prepare():
        pass
    chance, asked = np.random.default_rng(8), dict(explorer.base)
    asked = {name: asked[name] for name in explorer.ranges}
    taken = {True: [], False: []}
    for number in range(60):
        name = "pressure" if number % 3 == 2 else ("density", "loss_factor")[number % 2]
        asked[name] = chance.uniform(*explorer.ranges[name])
        begun = process_time()
        explorer.predict(**asked)
        taken[explorer.moves(name)].append(process_time() - begun)
        explorer.bounded(**asked)
    for moves, seconds in taken.items():
        middle, most = np.percentile(seconds, (50, 95))
        print(f"state {'moves' if moves else 'stays'}: median {middle:.3f} s, 95 % {most:.3f} s of a processor")
    assert np.median(taken[False]) <= 0.2 and np.median(taken[True]) <= 2.0


def test_heads_that_no_wall_bears_are_not_offered():
    keys = COARSE | {"materials.strain_level": "10 %", "drive.pressure": "20 m"}
    explorer = dbvfiv.load("cases/dbv4-wide.toml", keys).explore()
    explorer.place({"pressure": explorer.ranges["pressure"][1]})
    with pytest.raises(CaseError, match="strains the round wall"):
        explorer.place({"pressure": "46 m"})
