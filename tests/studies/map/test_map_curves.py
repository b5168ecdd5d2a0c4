"""Onset curves of stability maps: through the onsets of the columns, neutral, whole, or said to be not."""

import numpy as np
import pytest

from dbvfiv.studies.map.column import MapColumn, MapPlan
from dbvfiv.studies.map.curves import Web, linked
from dbvfiv.studies.stability.samples import Sample
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen.columns import REDUCED
from tests.studies.map.axes import run_map


def test_linked_curves_go_through_all_onsets(whole):
    curves = linked(whole.plan, whole.columns)
    assert sum(len(curve.x) for curve in curves) == sum(len(column.onsets) for column in whole.columns)


def test_linked_tongue_is_one_curve(case):
    plan = MapPlan(case)
    width = {2000.0: 0.1, 3000.0: 0.15, 4000.0: 0.1}
    columns = []
    for value in (1000.0, 2000.0, 3000.0, 4000.0, 5000.0):
        half = width.get(value)
        middle = 0.5
        onsets = (
            []
            if half is None
            else [
                (0, plan.value(plan.y, middle + d), f, way, 0.0) for d, f, way in ((-half, 30.0, 1), (half, 31.0, -1))
            ]
        )
        columns.append(MapColumn(value, 0, {0: [Sample(value, how=REDUCED)]}, np.array(onsets, float).reshape(-1, 5)))
    (curve,) = linked(plan, tuple(columns))
    assert len(curve.x) == 7 and curve.points()[0] == curve.points()[-1], "a tongue is closed"
    assert not curve.exact and "not known between" in curve.reason


@pytest.mark.parametrize("failed", [True, False])
def test_no_curve_runs_across_a_column_in_which_nothing_is_known(case, failed):
    """The curves beside it end there and are not exact, and no more columns are put in, which would find nothing."""
    plan, columns = MapPlan(case), []
    for place, sample in ((0.49, Sample(1.0, how=REDUCED)), (0.5, Sample(1.0, refusal="No.")), (0.51, None)):
        sample = sample or columns[0].samples[0][0]
        onset = [(0, plan.value(plan.y, 0.5), 30.0, 1, 0.0)] if sample.how == REDUCED else []
        cells, failure = ({}, "No state.") if failed and not onset else ({0: [sample]}, "")
        value = plan.value(plan.x, place)
        columns.append(MapColumn(value, 0, cells, np.array(onset, float).reshape(-1, 5), failure=failure))
    curves = linked(plan, tuple(columns))
    assert len(curves) == 2 and not any(curve.exact for curve in curves)
    assert Web.of(plan, columns, 0).wanted() == []


@pytest.mark.parametrize("solved", [True, False])
def test_a_change_at_the_lower_edge_calls_for_columns(case, solved):
    """No curve ends there; beside a column whose cells are not valid nothing is known of it."""
    plan = MapPlan(case)
    columns = []
    for value, number in ((1000.0, 0), (2000.0, 1)):
        unknown = Sample(value, refusal="The constants do not hold.")
        cells = [Sample(value, unstable=number, how=REDUCED) if solved else unknown, Sample(value, how=REDUCED)]
        columns.append(MapColumn(value, 0, {0: cells}, np.zeros((0, 5))))
    assert bool(Web.of(plan, columns, 0).wanted()) == solved


@pytest.fixture(scope="module")
def traced(coarse_case):
    """Both laws, lightly damped, with exact curves."""
    axes = {"map.x": "pressure=1000:12000:8", "map.y": "density=1:1000:10:log", "map.curve": True, "map.checks": 0}
    return run_map(coarse_case.replace(axes | {"map.continuity": "both", "damping.beta": 0.001}))


@pytest.mark.slow
def test_curves_are_neutral_by_the_full_pencil(traced, coarse_case):
    walk = StabilityWalk(traced.plan.case)
    assert len(traced.curves) >= 2 and all(curve.exact and curve.mismatch < 1e-6 for curve in traced.curves)
    for curve in traced.curves:
        for i in (0, len(curve.x) // 3, len(curve.x) - 1):
            place = traced.plan.place(curve.x[i], curve.y[i], traced.plan.laws[curve.law])
            values = walk.spectrum(place).eigenvalues
            nearest = values[np.argmin(np.abs(values - 2j * np.pi * curve.frequency[i]))]
            assert abs(nearest.real) < 1e-6 * abs(nearest)


def test_exact_curves_end_at_the_edges_of_the_map_or_close(traced):
    for curve in traced.curves:
        unit = np.column_stack([np.log(curve.y) / np.log(1000), (curve.x - 1000) / 11000])
        for end in (unit[0], unit[-1]):
            assert abs(np.min([end, 1 - end])) < 0.0101 or np.allclose(unit[0], unit[-1])
        assert np.hypot(*np.diff(unit, axis=0).T).max() < 0.25


def test_columns_put_in_certify_what_onsets_lie_between_and_nothing_else(traced):
    along = np.array(traced.plan.along.values)
    put_in = [column for column in traced.columns if column.level > 0]
    assert put_in
    for column in put_in:
        for law in column.samples:
            certified = np.flatnonzero(column.numbers(law, "certified"))
            onsets = [row[1] for row in column.onsets if int(row[0]) == law]
            beside = {i for value in onsets for i in (np.searchsorted(along, value) - 1, np.searchsorted(along, value))}
            assert set(certified) == beside
            counted = column.numbers(law, "counted")
            assert (counted[certified] == column.numbers(law, "unstable")[certified]).all()
            assert (np.delete(counted, certified) == -1).all()


@pytest.mark.slow
def test_a_column_is_put_in_under_the_law_that_asks_for_it(coarse_case):
    """Under the quasi-steady law no curve needs more than the grid where the other one has a tip."""
    axes = {"map.x": "pressure=6000:30000:4", "map.y": "density=1:1000:8:log", "map.checks": 0}
    result = run_map(coarse_case.replace(axes | {"map.continuity": "both", "damping.beta": 0.001}))
    put_in = [column for column in result.columns if column.level > 0]
    assert any(column.has(0) != column.has(1) for column in put_in)
    for column in put_in:
        assert [part for part in (0, 1) if column.has(part)] == list(column.samples)
        assert all(np.isfinite(column.numbers(part, "growth_rate")).all() for part in column.samples)
    assert result.curves and all(curve.exact for curve in result.curves)


def test_a_curve_that_is_not_followed_says_so(case, monkeypatch):
    monkeypatch.setattr("dbvfiv.studies.map.study.ROUNDS", 0)
    result = run_map(case.replace({"map.curve": True, "map.refine": 0, "map.checks": 0}))
    assert result.curves and not any(curve.exact for curve in result.curves)
    for curve, line in zip(result.curves, result.lines()[2:]):
        at = f"pressure = {curve.x[0] / 1e3:.6g} kPa, density = {curve.y[0]:.6g} kg/m³"
        assert any(f"near {at} is not exact" in sentence for sentence in result.warnings)
        assert f": pressure {min(curve.x) / 1e3:.6g} to {max(curve.x) / 1e3:.6g} kPa, density " in line


def test_contours_are_where_the_leading_mode_has_their_damping(coarse_case):
    asked = {"map.x": "pressure=3000,6000", "map.y": "density=1:1000:6:log", "map.refine": 0, "map.checks": 0}
    result = run_map(coarse_case.replace(asked | {"map.contours": ["-2", "2 %"]}))
    levels = {curve.level: curve for curve in result.curves}
    assert {"-2 1/s", "2 %"} <= set(levels) and all(curve.exact for curve in levels.values())
    walk = StabilityWalk(result.case)
    for words, exceeds in (("-2 1/s", lambda z: z.real + 2.0), ("2 %", lambda z: z.real + 0.02 * abs(z))):
        x, y = levels[words].points()[0]
        found = walk.spectrum(result.plan.place(x, y, 0.0)).eigenvalues
        assert max(map(exceeds, found)) == pytest.approx(0.0, abs=1e-6 * abs(found[0]))
    (document,) = (row for row in result.summary()["contours"] if row["level"] == "2 %")
    assert document["exact"] and len(document["points"]) == len(document["frequencies"])
