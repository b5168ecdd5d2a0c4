"""Clamped flange, symmetry planes and lip stops."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model.symmetry import SYMMETRIES


def test_what_is_held(model):
    free = SYMMETRIES["SS"].free_unknowns(model.mesh)
    rows = model.mesh.rows
    assert not free[rows[-1]].any()
    inner = rows[:-1, 1:-1]
    assert free[inner].all()
    assert np.array_equal(free[rows[0, 0]], [False, True, True, True, False])
    assert np.array_equal(free[rows[0, -1]], [True, False, True, True, False])


def test_symmetry_planes_stay_planes(model, make_state):
    """Whatever the free unknowns, the directors of a symmetry plane stay in it."""
    q = make_state(model, 0.02, noise=1e-3)
    directors, _, _ = model.shell.directors(model.nodal(q))
    assert np.abs(directors[model.mesh.rows[:, 0], 0]).max() < 1e-15
    assert np.abs(directors[model.mesh.rows[:, -1], 1]).max() < 1e-15


@pytest.mark.parametrize("columns, count", [("inner-half", 3), ("all", 6)])
def test_stops_of_the_duckbill(make_model, columns, count):
    """Rows up to the joint; columns of the inner half, or all but the side edge, which has no y displacement."""
    model = make_model(supports__lip_stop_columns=columns, mesh__columns="uniform")
    rows = np.count_nonzero(model.mesh.z <= 0.21 + 1e-9)
    assert len(model.stops.unknowns) == rows * count


def test_no_stops(make_model):
    model = make_model(supports__lip_stop=False)
    assert len(model.stops.unknowns) == 0
    assert model.residual(model.rest(), 0.0) == pytest.approx(0.0, abs=1e-9)


def test_stop_is_one_sided(model):
    stops = model.stops
    q = np.zeros(model.size)
    q[stops.unknowns] = np.where(np.arange(len(stops.unknowns)) % 2, 1e-4, -1e-4)
    force = stops.force(q)
    assert np.all(force[1::2] == 0.0) and np.all(force[::2] == -1e4)
    assert stops.touching(q) == len(force[::2])
    assert stops.energy(q) == pytest.approx(0.5 * 1e8 * 1e-8 * len(force[::2]))
    assert np.all(stops.tangent(q) == np.where(q[stops.unknowns] < 0, 1e8, 0.0))
