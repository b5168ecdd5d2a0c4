"""How far a valve under back pressure is from its first limit."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.model.closed import ClosedValve
from dbvfiv.record.mesh import MeshData
from dbvfiv.report.answers import _collapse, _margin, closes, trade
from dbvfiv.report.gather import Gathered
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.closure.safety import ClassBuckling, _buckling, find_safety, rated_sentence, rated_verdict
from dbvfiv.studies.closure.study import ClosureResult, PressedState
from dbvfiv.studies.closure.walk import Pressed, film_leak
from dbvfiv.studies.session import load_result
from tests.small_valves import FORMER, SMALL


def result(
    pressures, sealed, overlap=None, buckling=(), supports="contact", failure=None, classes=(), lost=(), **changes
):
    overlap = np.zeros(len(pressures)) if overlap is None else overlap
    walk = [
        SimpleNamespace(pressure=p, sealed_length=s, overlap=o, arclength=False)
        for p, s, o in zip(pressures, sealed, overlap)
    ]
    case = thesis_case({"closure.pressures": [*pressures, *lost]} | {f"closure.{k}": v for k, v in changes.items()})
    buckled = [SimpleNamespace(pressure=p, kind="limit point") for p in buckling]
    found = SimpleNamespace(walk=walk, case=case, buckling=buckled, supports=supports, walk_failure=failure)
    found.classes, found.states = classes, [SimpleNamespace(pressure=p, beyond_limit=False) for p in pressures]
    for state in found.states:
        vars(state).update(closed=True, leak=0.0)
    found.safety = find_safety(found)
    return found


def sway(lowest, *at):
    """Buckling of the class of swaying lips, with its lowest stiffness at 1 and 2 kPa."""
    return ClassBuckling("SA", (1e3, 2e3), lowest, tuple({"kind": "bifurcation", "pressure": p} for p in at))


def test_without_a_limit_the_factor_is_a_lower_bound_and_says_so():
    found = find_safety(result([1e3, 7e3, 28e3], [0.0, 0.1, 0.1], rated_pressure=7e3))
    assert found.at_least and found.factor == pytest.approx(4.0) and found.limit is None
    assert "at least 4" in found.sentence and "rated 7 kPa" in found.sentence
    unrated = find_safety(result([28e3], [0.1]))
    assert unrated.factor == 1.0 and "none is rated" in unrated.sentence and "the rated" not in unrated.sentence


def test_the_first_of_several_limits_counts():
    found = find_safety(result([1e3, 7e3, 14e3, 28e3], [0.1, 0.1, 0.1, 0.0], buckling=[20e3], rated_pressure=10e3))
    assert (found.limit, found.limit_pressure) == ("loss of seal", 14e3) and found.factor == pytest.approx(1.4)
    found = find_safety(result([1e3, 7e3, 28e3], [0.1, 0.1, 0.1], buckling=[20e3, 9e3], rated_pressure=10e3))
    assert (found.limit, found.limit_pressure) == ("buckling", 20e3)  # as met: the path turns back beyond it
    assert not found.at_least and "buckling at 20 kPa" in found.sentence


def test_buckling_in_another_class_is_a_limit():
    asked = {"pressures": [1e3, 2e3], "sealed": [0.1, 0.1], "rated_pressure": 2e3}
    for lowest, at, limit in (((1.0, -1.0), (1.2e3,), 1.2e3), ((10.0, -2.0), (), 2e3)):
        found = result(classes=(sway(lowest, *at),), **asked)
        assert (found.safety.limit, found.safety.limit_pressure) == ("buckling", limit)
        assert rated_verdict(found)["buckles_at"] == limit
        assert f"buckles at {limit / 1e3:g} kPa" in rated_sentence(found)
        assert _collapse(found, 3e3).startswith("the wall buckles at") and _margin(found).startswith("the wall buckles")
    every, own = result(classes=(sway((3.0, 2.0)),), **asked), result(**asked)
    assert "in any symmetry class" in every.safety.summary()["meaning"] and not _collapse(every, 3e3)
    assert _margin(every).startswith("no limit up to")
    assert _margin(own).startswith("no limit within the symmetry of the model up to")
    assert "no buckling within the symmetry of the model up to 2 kPa" in rated_sentence(own) and own.safety.at_least
    assert "sealed, leak 0 L/h; no" in rated_sentence(own)
    own.states[-1].leak = 1e-6
    assert "shut, leak 3.6 L/h at most, as fluid.viscosity is none; no" in rated_sentence(own)
    sizes = SimpleNamespace(bill_width=0.2, bill_height=0.1)
    rows = trade(Gathered(own.case, "valve", (2e3,), sizes, {"closure": own}))
    assert ("leak rate there", "3.6 L/h at most, as fluid.viscosity is none") in rows


def test_a_collapse_below_the_largest_back_pressure_that_was_asked_for_is_told():
    """Page one told of a wall that collapses at 16 kPa only that it is shut at 14, of 28 that were asked for."""
    found = result([7e3, 14e3], [0.1, 0.1], buckling=[16e3], lost=[28e3], failure="The wall has a limit point.")
    told = closes(Gathered(found.case, "valve", (2e3,), None, {"closure": found}))
    assert told.text.endswith("and 14 kPa; the wall collapses at 16 kPa.")


def test_a_rated_state_beyond_a_limit_point_is_not_said_to_be_unasked():
    found = result([3e4, 2e4], [0.1, 0.1], buckling=[27.6e3], rated_pressure=2e4)
    found.states[1].beyond_limit = True
    assert rated_sentence(found).endswith(
        "not examined; its state lies beyond a limit point; ask for it before higher ones."
    )


def test_a_class_that_is_unstable_without_buckling_is_not_said_to_hold():
    assert sway((10.0, -2.0)).sentence.startswith("Unstable in class SA (the lips sway together in y) at 2 kPa")
    assert sway((10.0, 2.0)).sentence.startswith("No buckling in class SA")
    assert looked_at((1e3, -1.0), (2e3, -2.5)).startswith("Unstable within the symmetry of the model at 2 kPa")
    # beyond arclength nothing is said, as of the safety factor
    assert "up to 2 kPa; the stiffness is least at 2 kPa" in looked_at(
        (1e3, 9.0), (2e3, 8.0), (2.5e3, np.nan), (3e3, 2.0)
    )


def looked_at(*points):
    """Sentence on buckling of a path with pressures and lowest eigenvalues, NaN where arclength was followed."""
    walk = [SimpleNamespace(pressure=p, lowest_eigenvalue=v, arclength=np.isnan(v)) for p, v in points]
    softest = ClosureResult.softest.fget(SimpleNamespace(walk=walk))
    (said,) = _buckling(SimpleNamespace(buckling=(), walk=walk, softest=softest))
    return said


def test_a_seal_that_never_was_is_no_seal_that_was_lost():
    assert find_safety(result([1e3, 2e3], [0.0, 0.1])).at_least  # it shuts on the way
    found = find_safety(result([1e3, 2e3], [0.0, 0.0]))
    assert found.factor == 0.0 and "no section was shut" in found.sentence
    assert find_safety(result([1e3, 7e3, 2e3], [0.1, 0.1, 0.0])).at_least  # opens as the pressure falls again


def test_faces_cross_only_where_supports_do_not_look_at_them():
    overlap = [0.0, 1e-4, 1e-3]
    found = find_safety(result([7e3, 14e3, 28e3], [0.2] * 3, overlap, supports="held-lips"))
    assert (found.limit, found.limit_pressure) == ("faces crossing", 7e3)
    assert find_safety(result([7e3, 14e3, 28e3], [0.2] * 3, overlap)).at_least


def test_a_seal_that_supports_give_is_not_found_but_assumed():
    held = find_safety(result([7e3, 14e3], [0.2, 0.2], supports="held-lips"))
    assert held.at_least and held.seal_assumed and "assumption" in held.sentence
    free = find_safety(result([7e3, 14e3], [0.2, 0.2]))
    assert not free.seal_assumed and "does not lose its seal" in free.sentence


def test_where_equilibria_end_is_a_limit():
    asked = {"failure": "No equilibrium was found.", "rated_pressure": 3e3}
    found = find_safety(result([1e3, 1.8e3], [0.1, 0.1], lost=[3e3], **asked))
    assert (found.limit, found.factor) == ("end of the path", pytest.approx(0.6))
    assert find_safety(result([1e3, 1.8e3], [0.1, 0.1], lost=[5e2, 3e3], **asked)).at_least  # as the pressure falls
    assert find_safety(SimpleNamespace(walk=[])) is None


@pytest.mark.parametrize(
    ("points", "closing"),
    [
        ([(1e3, 0.0), (2e3, 0.1), (1.5e3, 0.1)], 2e3),  # opens less readily than it shuts
        ([(1e3, 0.0), (3e3, 0.0), (2e3, 0.1), (1e3, 0.1), (4e3, 0.1)], 3e3),  # snaps at 3 kPa
        ([(1e3, 0.0)], None),
    ],
)
def test_the_closing_pressure_is_one_that_rises_up_to_it(points, closing):
    """A bill that is moulded shut needs none, and supports that hold the lips tell nothing of it."""
    walk = [SimpleNamespace(pressure=pressure, sealed_length=sealed) for pressure, sealed in points]

    def found(preset: bool = False, supports: str = "contact"):
        case = SimpleNamespace(valve=SimpleNamespace(is_preset=preset))
        return ClosureResult.closing_pressure.fget(SimpleNamespace(walk=walk, case=case, supports=supports))

    assert found() == closing
    assert found(preset=True) == 0.0 and found(supports="held-lips") is None


def test_leak_is_that_of_a_laminar_film_and_of_a_jet_at_its_ends():
    z, x = np.linspace(0.0, 0.1, 5), np.tile(np.linspace(0.0, 0.2, 9), (5, 1))
    gap, pressure, viscosity = np.full((5, 9), 5e-5), 3e4, 1.0016e-3
    film = pressure * (2 * 5e-5) ** 3 * (2 * 0.2) / (12 * viscosity * 0.1)
    assert film_leak(pressure, z, x, gap, 4, 1e-6, viscosity) == pytest.approx(film, rel=1e-6)
    jet = 4 * 5e-5 * 0.2 * np.sqrt(2 * pressure / 1000.0)
    assert film_leak(pressure, z, x, gap, 4, 1000.0, 0.0) == pytest.approx(jet, rel=1e-12)
    assert film_leak(pressure, z, x, gap, 4, 1000.0, viscosity) < min(film, jet)
    gap[2] = -1e-6
    assert film_leak(pressure, z, x, gap, 4, 1000.0, viscosity) == 0.0


def test_the_leak_of_a_state_goes_through_its_least_opening():
    """The inner face has less width than the middle of the wall round the side edge of the lip."""
    case = thesis_case(dict(SMALL))
    model = ClosedValve(case)
    pressed = Pressed(model, 2e-5 * np.random.default_rng(0).standard_normal(model.size), 2e3)
    own = {name: getattr(pressed, name) for name in ("pressure", "nodal", "opening")}
    results = SimpleNamespace(case=case, mesh=MeshData.of(model))
    state = PressedState(results=results, gap=model.gaps(pressed.nodal), **own)
    jet = pressed.least_opening * np.sqrt(2 * 2e3 / case.fluid.density)
    assert state.leak == pytest.approx(jet, rel=1e-9)


@pytest.mark.slow
def test_a_rated_valve_is_answered_up_to_one_and_a_half_times_its_rating():
    found = dbvfiv.load(thesis_case(), THIN | {"closure.rated_pressure": "2 kPa"}).closure()
    assert found.case.closure.pressures == (2e3, 3e3)
    told = found.summary()["rated"]
    assert told["examined"] and told["pressure"] == 2e3 and told["examined_to"] == 3e3
    assert told["shut"] and not told["sealed"] and told["leak"] == found.states[0].leak > 0
    (sentence,) = (line for line in found.lines() if line.startswith("Rated back pressure 2 kPa"))
    assert "L/h" in sentence and "margin at least 50%" in sentence
    assert "no buckling within the symmetry of the model up to 3 kPa" in sentence


THIN = {
    "mesh.around": 8,
    "mesh.along": 14,
    "valve.thickness_factor": 0.4,
    "closure.max_step": "0.5 kPa",
    "closure.rated_pressure": "2.5 kPa",
} | dict(FORMER)  # on graded rows this coarse the wall goes to 8 kPa without a limit


@pytest.mark.slow
def test_a_wall_that_snaps_shows_its_last_state_before_and_the_factor(tmp_path):
    path = tmp_path / "thin.h5"
    found = dbvfiv.load(thesis_case(), THIN).closure(["3 kPa", "8 kPa"], output=path)
    assert [state.pressure for state in found.states] == [3e3, 8e3]
    limit, last = found.buckling[0], found.before_limit
    assert limit.kind == "limit point" and 3e3 < last.pressure < limit.pressure
    assert limit.pressure - last.pressure < 0.001 * limit.pressure
    assert last.stable and not last.beyond_limit
    assert found.states[1].beyond_limit
    # its softest stiffness has all but gone
    assert last.lowest_stiffness_eigenvalue < 0.2 * found.states[0].lowest_stiffness_eigenvalue
    assert found.safety.factor == pytest.approx(limit.pressure / 2.5e3) and found.safety.limit == "buckling"
    rows = [line.split()[0] for line in found.lines()[2:5]]
    assert rows == ["3", f"{last.pressure / 1e3:.6g}", "8"]
    again = load_result(path)
    assert again.summary()["before_limit"]["pressure"] == last.pressure
    assert again.summary()["safety"] == found.summary()["safety"]
