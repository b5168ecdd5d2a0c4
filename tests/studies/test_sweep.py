"""Sweeps: branches are those of full solves, keep their identity, and survive interrupts and failures."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.modes import Keys
from dbvfiv.studies.modes.search import run_modes
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability import walk
from dbvfiv.studies.sweep import study as tracked
from dbvfiv.studies.sweep.study import Branch
from eigen import SearchOptions
from eigen.columns import ReducedColumn
from tests.observers import Stop

LIGHT = Mu(density=10.0, alpha=0.0, beta=0.003)
DENSITY = "density=1:1000:13:log"


def sweep(model, over, state=None, observer=None, **keys):
    """Sweep of a light fluid from a state that is known."""
    light = {"fluid.density": 10.0, "damping.alpha": 0.0, "damping.beta": 0.003, "drive.pressure": 6e3}
    case = model.case.replace(light | {"sweep.over": over, "sweep.count": 4} | keys)
    return Session(case, start=state).perform("sweep", observer=observer)


def eigenvalues(found):
    """(branches, values), NaN where a branch does not exist."""
    return np.array([branch.growth_rate + 1j * branch.angular_frequency for branch in found.branches])


@pytest.fixture(scope="module")
def over_density(model, state):
    return sweep(model, DENSITY, state)


def nearest(found, column, eigenvalue):
    return np.nanmin(np.abs(eigenvalues(found)[:, column] - eigenvalue)) / abs(eigenvalue)


def test_a_band_below_the_flutter_leaves_every_value_open(model, state):
    """Said as by `modes`, with the key that moves the end, and the same when it is read again."""
    found = sweep(model, "density=5:20:4:log", state, **{"modes.max_frequency": 25.0})
    whole = run_modes(model, state, LIGHT, Keys(count=3, max_frequency=25.0))
    assert not found.certified and len(found.samples) == 4
    for sample in found.samples:
        assert sample.verdict.outcome == whole.verdict.outcome == "undecided" and sample.certified is False
        own, said = sample.verdict.reason.split(" Above 24.98 Hz ")
        assert whole.verdict.reason.startswith(own) and said.endswith("modes.max_frequency moves the end.")
        assert any(said in note for note in found.notes)


def test_every_value_agrees_with_a_full_solve(model, state, over_density):
    """Also at densities that no check was made at."""
    checked = [check["value"] for check in over_density.checks]
    unchecked = [i for i, v in enumerate(over_density.values) if not np.isclose(v, checked, rtol=1e-9).any()]
    for column in (unchecked[1], unchecked[-2]):
        full = run_modes(model, state, LIGHT.at(density=over_density.values[column]), Keys(count=3))
        assert max(nearest(over_density, column, value) for value in full.eigenvalues) < 1e-5


def test_certificate(over_density):
    assert over_density.certified and len(over_density.checks) >= 3
    for check in over_density.checks:
        assert check["error"] < 1e-6 and check["unstable_count"] == check["unstable_count_independent"]
    assert {1.0, 1000.0} <= {round(check["value"], 6) for check in over_density.checks}


@pytest.mark.slow
def test_a_tolerance_beyond_the_reduced_order_model_takes_full_solves(model, state):
    full, reduced = (sweep(model, "alpha=0:10:3", state, **{"sweep.tolerance": t}) for t in (1e-13, 1e-6))
    assert full.certified and reduced.certified
    assert eigenvalues(full)[0] == pytest.approx(eigenvalues(reduced)[0], rel=1e-6)


def test_branches_keep_their_identity(over_density):
    """One branch goes from flutter to heavy damping, its frequency rising all the way; confidences exist where branches
    do.
    """
    assert [branch.id for branch in over_density.branches] == list(1 + np.arange(len(over_density.branches)))
    first = eigenvalues(over_density)[0]
    assert first[0].real > 0 and np.nanmin(first.real) < -20  # from flutter to heavy damping
    assert np.all(np.diff(first.imag[np.isfinite(first.real)]) > 0)
    for branch in over_density.branches:
        there = np.isfinite(branch.growth_rate)
        assert (np.isfinite(branch.confidence) == there).all()
        assert branch.confidence[there].min() >= 0 and branch.confidence[there].max() <= 1


def test_wider_steps_give_the_same_branches(model, state, over_density):
    coarse = sweep(model, "density=1:1000:4:log", state)
    ends = eigenvalues(over_density)[0][[0, -1]], eigenvalues(coarse)[0][[0, -1]]
    assert np.allclose(*(np.nan_to_num(end, nan=-1.0) for end in ends), rtol=1e-6)


def test_unstable_counts_follow_the_branches(over_density):
    twice = np.where(np.abs(eigenvalues(over_density).imag) > 0, 2, 1)
    counted = np.nansum((eigenvalues(over_density).real > 0) * twice, axis=0)
    assert (counted == over_density.unstable_count).all()
    assert over_density.unstable_count[0] == 2 and over_density.unstable_count[-1] == 0


def test_no_branch_beyond_the_limit_point(model, state):
    """Right of -1/beta only: what lies at the limit is not followed."""
    found = sweep(model, "beta=0.001:0.05:6:log", state)
    limit, growth = -1.0 / found.values, eigenvalues(found).real
    assert np.nanmax(limit - growth) < 0 and np.isnan(growth).any()
    assert found.unstable_count[0] == 2 and found.unstable_count[-1] == 0


@pytest.mark.slow
def test_pressure(model):
    found = sweep(model, "pressure=2 kPa:14 kPa:4")
    assert [state["pressure"] for state in found.points] == list(found.axis.values) and found.certified
    path = LoadPath(model)
    for column in (0, 3):
        full = run_modes(model, path.go_to(found.values[column]), LIGHT, Keys(count=3))
        assert max(nearest(found, column, value) for value in full.eigenvalues[:3]) < 1e-6
    first = eigenvalues(found)[0]
    assert first[0].real > 0 > first[-1].real and found.branches[0].confidence.min() > 0.6


def test_more_pressures_than_states_are_kept(model, monkeypatch):
    monkeypatch.setattr(walk, "_STATES", 1)
    states, case = walk.StabilityWalk(model.case, model=model), Mu.of(model.case)
    for pressure in (6e3, 6.1e3, 6.2e3, 6e3):
        state = states.state(case.at(pressure=pressure))
        assert state.pressure == pressure and np.array_equal(state.q, states.equilibrium(case.at(pressure=pressure)))


@pytest.mark.parametrize("over", [DENSITY, "pressure=2 kPa:14 kPa:7"])
def test_an_interrupt_keeps_what_is_done(model, state, over_density, over):
    found = sweep(model, over, state, Stop(3))
    assert found.interrupted and not found.certified and not found.failures
    assert list(found.values) == list(found.axis.values[:3]) and len(found.unstable_count) == 3
    assert eigenvalues(found).shape[1] == 3 and np.isfinite(eigenvalues(found)[0]).all()
    if over == DENSITY:
        assert np.allclose(eigenvalues(found)[0], eigenvalues(over_density)[0][:3], rtol=1e-6)


def test_a_pressure_that_is_not_reached_ends_the_sweep(model, monkeypatch):
    way = LoadPath.go_to

    def fails(self, target):
        if target > 5e3:
            raise SolveError(f"No equilibrium was found at {target:.6g} Pa.")
        return way(self, target)

    monkeypatch.setattr(LoadPath, "go_to", fails)
    found = sweep(model, "pressure=1 kPa:9 kPa:5")
    assert list(found.values) == [1e3, 3e3, 5e3] and len(found.failures) == 1
    assert "7000 Pa" in found.failures[0] and eigenvalues(found).shape[1] == 3
    with pytest.raises(SolveError):
        sweep(model, "pressure=6 kPa:9 kPa:5")


def test_refusals(model, state, refused):
    shut = ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16, "drive.kind": "uniform"}))
    with refused(CaseError):
        sweep(shut, DENSITY, state)
    with pytest.raises(SolveError):
        sweep(model, DENSITY, replace(state, converged=False))


def test_modes_on_the_reduced_model_are_searched_as_others_and_name_their_pressure(monkeypatch):
    def lost(*_):
        raise ArithmeticError("no convergence")

    tracking, pencil = object.__new__(tracked.Tracking), object()
    place, search = SimpleNamespace(pressure=30e3), SimpleNamespace(options=SearchOptions(100.0))
    vars(tracking).update(spectra={}, values={pencil: 30e3}, options=SimpleNamespace(count=2), tolerance=1e-9)
    tracking.line, tracking.walk = SimpleNamespace(place=lambda _: place), SimpleNamespace(search=lambda _: search)
    asked = []
    monkeypatch.setattr(tracked, "leading_modes", lambda _pencil, _count, options: asked.append(options))
    monkeypatch.setattr(tracked.Tracking, "is_reduced", True)
    options = SearchOptions(2e3, limit_point=-300.0, lowest=4.6)
    tracking._leading(SimpleNamespace(relaxation=object(), n=40), 2, options)
    assert (asked[0].lowest, asked[0].max_frequency, asked[0].limit_point, asked[0].left) == (4.6, 2e3, None, True)
    tracking._leading = lost
    with pytest.raises(SolveError, match="The modes at 30000 Pa were not found: no convergence"):
        tracking._solve(pencil)


def test_all_modes_that_are_followed_are_checked():
    """The tenth of twelve is wrong by a thousandth."""
    values = -np.arange(1.0, 16.0) + 100j
    fine = SimpleNamespace(leading=lambda _: values, near=lambda _, places: np.array(places))
    reduction = SimpleNamespace(correction=lambda pairs, _: 1e-3 * pairs * (pairs == values[9]))
    line = SimpleNamespace(place=lambda value: value)
    line.column = SimpleNamespace(model=ReducedColumn(None, reduction, None, fine, 0.0))
    tracking = object.__new__(tracked.Tracking)
    for count, error in ((12, 1e-3), (4, 0.0)):
        vars(tracking).update(line=line, options=SimpleNamespace(count=count))
        assert tracking._error(1.0) == pytest.approx(error)


def test_what_is_done_is_kept_on_the_way(model, state, over_density, monkeypatch):
    """A sweep that is killed leaves the values up to the last time it was kept, with the branches of the whole."""
    monkeypatch.setattr(tracked, "_KEEP_AFTER", 0.0)
    monkeypatch.setattr(tracked, "_KEEPING", 1e9)
    whole = sweep(model, DENSITY, state)
    kept = whole.record.notes("kept")
    first = [[row["growth_rate"] for row in part["branches"] if row["id"] == 1] for part in kept]
    assert [len(rates) for rates in first[:-1]] == list(range(1, len(whole.values) + 1))
    assert first[6] == pytest.approx(whole.branches[0].growth_rate[:7], rel=1e-10)
    # two runs of one process differ by the rounding of sums whose order follows the alignment of arrays
    assert np.allclose(eigenvalues(whole), eigenvalues(over_density), rtol=1e-9, atol=0.0, equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "over", [pytest.param("density=5:50:4:log", marks=pytest.mark.slow), "loss_factor=0.5:2:4:log"]
)
def test_a_wall_that_relaxes_agrees_with_full_solves(over):
    changes = {"mesh.around": 8, "mesh.along": 14, "drive.pressure": 6000}
    changes |= {"damping.model": "loss factor", "materials.constants": "stable", "fluid.density": 10.0}
    case = thesis_case(changes | {"damping.alpha": 0.0, "sweep.over": over, "sweep.count": 3, "sweep.checks": 2})
    model = ValveModel(case)
    state = LoadPath(model).go_to(6e3)
    found = Session(case, start=state).perform("sweep")
    assert found.certified
    for column in (1, 2):
        here = Mu.of(case).at(**{found.parameter: found.values[column]})
        full = run_modes(model, state, here, Keys(count=3))
        assert max(nearest(found, column, value) for value in full.eigenvalues) < 1e-5


def test_growth_that_is_rounding_crosses_nothing():
    """An undamped wall changed from stable to unstable seven times beside no unstable mode."""
    branch = Branch(1, np.array([1e-12, -2e-12, np.nan, 3.0]), np.full(4, 120.0), np.ones(4))
    assert np.array_equal(branch.growth_beyond_rounding, [0.0, 0.0, np.nan, 3.0], equal_nan=True)
