"""Sweeps: branches are those of full solves, keep their identity, and survive interrupts and failures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbvfiv.case.axis import parse_axis, parse_stability_axis
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.modes.search import ModesOptions, run_modes
from dbvfiv.studies.sweep.branches import SweepOptions, run_sweep
from tests.observers import Stop

LIGHT = Mu(density=10.0, alpha=0.0, beta=0.003)
OPTIONS = SweepOptions(count=4)
DENSITY = parse_axis("density=1:1000:13:log")


@pytest.fixture(scope="module")
def model(coarse_model):
    return coarse_model


@pytest.fixture(scope="module")
def state(opened):
    return opened


@pytest.fixture(scope="module")
def over_density(model, state):
    return run_sweep(model, DENSITY, LIGHT, OPTIONS, state=state)


def nearest(branches, column, eigenvalue):
    found = branches.eigenvalues[:, column]
    return np.nanmin(np.abs(found - eigenvalue)) / abs(eigenvalue)


def test_every_value_agrees_with_a_full_solve(model, state, over_density):
    """Also at densities that no check was made at."""
    checked = [check.value for check in over_density.checks]
    unchecked = [i for i, v in enumerate(over_density.values) if not np.isclose(v, checked, rtol=1e-9).any()]
    for column in (unchecked[1], unchecked[-2]):
        full = run_modes(model, state, LIGHT.at(density=over_density.values[column]), ModesOptions(3))
        assert max(nearest(over_density.branches, column, value) for value in full.eigenvalues) < 1e-5


def test_certificate(over_density):
    assert over_density.certified and len(over_density.checks) >= 3
    for check in over_density.checks:
        assert check.error < 1e-6 and check.agrees and check.unstable_count == check.unstable_count_independent
    assert {1.0, 1000.0} <= {round(check.value, 6) for check in over_density.checks}


def test_a_tolerance_beyond_the_reduced_order_model_takes_full_solves(model, state):
    axis = parse_axis("alpha=0:10:3")
    full = run_sweep(model, axis, LIGHT, replace(OPTIONS, tolerance=1e-17), state=state)
    reduced = run_sweep(model, axis, LIGHT, OPTIONS, state=state)
    assert full.certified and max(check.error for check in full.checks) > 1e-17  # residuals, not corrections
    assert full.branches.eigenvalues[0] == pytest.approx(reduced.branches.eigenvalues[0], rel=1e-6)


def test_branches_keep_their_identity(over_density):
    """One branch goes from flutter to heavy damping, its frequency rising all the way; confidences exist where branches
    do.
    """
    branches = over_density.branches
    assert list(branches.ids) == list(1 + np.arange(len(branches.ids)))
    first = branches.eigenvalues[0]
    assert first[0].real > 0 and np.nanmin(first.real) < -20  # from flutter to heavy damping
    assert np.all(np.diff(first.imag[np.isfinite(first.real)]) > 0)
    there = np.isfinite(branches.eigenvalues.real)
    assert (np.isfinite(branches.confidence) == there).all()
    assert branches.confidence[there].min() >= 0 and branches.confidence[there].max() <= 1


def test_wider_steps_give_the_same_branches(model, state, over_density):
    coarse = run_sweep(model, parse_axis("density=1:1000:4:log"), LIGHT, OPTIONS, state=state)
    ends = over_density.branches.eigenvalues[0][[0, -1]], coarse.branches.eigenvalues[0][[0, -1]]
    assert np.allclose(*(np.nan_to_num(end, nan=-1.0) for end in ends), rtol=1e-6)


def test_unstable_counts_follow_the_branches(over_density):
    growth, imag = over_density.branches.eigenvalues.real, over_density.branches.eigenvalues.imag
    twice = np.where(np.abs(imag) > 0, 2, 1)
    assert (np.nansum((growth > 0) * twice, axis=0) == over_density.unstable_count).all()
    assert over_density.unstable_count[0] == 2 and over_density.unstable_count[-1] == 0


def test_no_branch_beyond_the_limit_point(model, state):
    """Right of -1/beta only: what lies at the limit is not followed."""
    axis = parse_axis("beta=0.001:0.05:6:log")
    found = run_sweep(model, axis, LIGHT, OPTIONS, state=state)
    limit = -1.0 / np.array(axis.values)
    growth = found.branches.eigenvalues.real
    assert np.nanmax(limit - growth) < 0 and np.isnan(growth).any()
    assert found.unstable_count[0] == 2 and found.unstable_count[-1] == 0


def test_pressure(model):
    axis = parse_axis("pressure=2 kPa:14 kPa:4")
    found = run_sweep(model, axis, LIGHT, OPTIONS)
    assert [state.pressure for state in found.states] == list(axis.values) and found.certified
    path = LoadPath(model)
    for column in (0, 3):
        full = run_modes(model, path.go_to(axis.values[column]), LIGHT, ModesOptions(3))
        assert max(nearest(found.branches, column, value) for value in full.eigenvalues[:3]) < 1e-6
    first = found.branches.eigenvalues[0]
    assert first[0].real > 0 > first[-1].real and found.branches.confidence[0].min() > 0.6


@pytest.mark.parametrize("range_", ["density=1:1000:13:log", "pressure=2 kPa:14 kPa:7"])
def test_an_interrupt_keeps_what_is_done(model, state, over_density, range_):
    axis = parse_axis(range_)
    found = run_sweep(model, axis, LIGHT, OPTIONS, Stop(3), state)
    assert found.interrupted and not found.certified and not found.failures
    assert list(found.values) == list(axis.values[:3]) and len(found.unstable_count) == 3
    assert found.branches.eigenvalues.shape[1] == 3 and np.isfinite(found.branches.eigenvalues[0]).all()
    if axis.parameter == "density":
        assert np.allclose(found.branches.eigenvalues[0], over_density.branches.eigenvalues[0][:3], rtol=1e-6)


def test_a_pressure_that_is_not_reached_ends_the_sweep(model, monkeypatch, one_sentence):
    way = LoadPath.go_to

    def fails(self, target):
        if target > 5e3:
            raise SolveError(f"No equilibrium was found at {target:.6g} Pa.")
        return way(self, target)

    monkeypatch.setattr(LoadPath, "go_to", fails)
    found = run_sweep(model, parse_axis("pressure=1 kPa:9 kPa:5"), LIGHT, OPTIONS)
    assert list(found.values) == [1e3, 3e3, 5e3] and len(found.failures) == 1 and not found.interrupted
    assert "7000 Pa" in found.failures[0] and found.branches.eigenvalues.shape[1] == 3
    with pytest.raises(SolveError):
        run_sweep(model, parse_axis("pressure=6 kPa:9 kPa:5"), LIGHT, OPTIONS)


def test_refusals(model, state, one_sentence):
    shut = ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16, "drive.kind": "uniform"}))
    with pytest.raises(CaseError) as caught:
        run_sweep(shut, DENSITY, LIGHT, OPTIONS, state=state)
    assert one_sentence(str(caught.value))
    with pytest.raises(SolveError):
        run_sweep(model, DENSITY, LIGHT, OPTIONS, state=replace(state, converged=False))


def test_what_is_done_is_kept_on_the_way(model, state, over_density, monkeypatch):
    """A sweep that is killed leaves the values up to the last time it was kept, with the branches of the whole."""
    from dbvfiv.studies.sweep import branches as sweep

    monkeypatch.setattr(sweep, "_KEEP_AFTER", 0.0)
    monkeypatch.setattr(sweep, "_KEEPING", 1e9)
    kept = []
    whole = run_sweep(model, DENSITY, LIGHT, OPTIONS, state=state, keep=kept.append)
    assert [len(part.values) for part in kept] == list(range(1, len(DENSITY.values) + 1))
    assert all(part.interrupted for part in kept) and not whole.interrupted
    part = kept[6]
    assert part.branches.eigenvalues[0] == pytest.approx(whole.branches.eigenvalues[0, :7], rel=1e-10)
    assert np.array_equal(whole.branches.eigenvalues, over_density.branches.eigenvalues, equal_nan=True)


@pytest.mark.parametrize("over", ["density=5:50:4:log", "loss_factor=0.5:2:4:log"])
def test_a_wall_that_relaxes_agrees_with_full_solves(over):
    changes = {"mesh.around": 8, "mesh.along": 14, "drive.pressure": 6000}
    changes |= {"damping.model": "loss factor", "materials.constants": "stable"}
    model = ValveModel(thesis_case(changes))
    state, axis = LoadPath(model).go_to(6e3), parse_stability_axis(over)
    conditions = Mu(density=10.0, alpha=0.0, beta=0.0, loss_factor=1.0)
    found = run_sweep(model, axis, conditions, SweepOptions(count=3, checks=2), state=state)
    assert found.certified
    for column in (1, 2):
        here = conditions.at(**{axis.parameter: found.values[column]})
        full = run_modes(model, state, here, ModesOptions(3))
        assert max(nearest(found.branches, column, value) for value in full.eigenvalues) < 1e-5
