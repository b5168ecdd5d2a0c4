"""The four classes on the quarter against the whole valve, meshed without use of its symmetry."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl
import scipy.sparse as sp

from dbvfiv.case.parameters import Mu
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.motion.start import steady_positions
from tests.model.test_relaxing_wall import relaxing_valve
from tests.small_valves import find_open_state, make_valve
from tests.systems.whole_valve import whole_valve

PRESSURE = 12e3


@pytest.fixture(scope="module")
def model():
    return make_valve()


@pytest.fixture(scope="module")
def state(model):
    """A strongly deformed state; some of its stops are made to touch."""
    q = steady_positions(model, PRESSURE).copy()
    q[model.stops.unknowns[::2]] = -1e-7
    return q


@pytest.fixture(scope="module")
def whole(model, state):
    return whole_valve(model, state, PRESSURE)


@pytest.fixture(scope="module")
def classes(model, state):
    return {name: linearise_class(model, state, PRESSURE, symmetry) for name, symmetry in SYMMETRIES.items()}


def test_the_classes_have_as_many_unknowns_as_the_whole_valve(classes, whole):
    assert sum(linear.mass.shape[0] for linear in classes.values()) == whole.mass.shape[0]


@pytest.mark.parametrize("part", ["mass", "structure", "stiffness"])
def test_the_whole_valve_falls_into_the_four_classes(model, state, whole, classes, part):
    """In the motions of the classes the whole matrix is four blocks, each four times that of the quarter."""
    assert model.stops.touching(state) > 3
    matrix = getattr(whole, part)
    bases = {name: whole.basis(SYMMETRIES[name].free_unknowns(model.mesh), SYMMETRIES[name].signs) for name in classes}
    assert np.linalg.matrix_rank(sp.hstack(list(bases.values())).toarray()) == matrix.shape[0]
    size = abs(matrix).max()
    for name, basis in bases.items():
        for other, beside in bases.items():
            block = (beside.T @ matrix @ basis).toarray()
            expected = 4 * getattr(classes[name], part).toarray() if name == other else 0.0
            assert np.abs(block - expected).max() < 1e-11 * size, (name, other)


def test_what_relaxes_falls_into_the_four_classes():
    model = relaxing_valve(mesh__around=6, mesh__along=8)
    state = find_open_state()
    whole = whole_valve(model, state, PRESSURE)
    assert len(whole.relaxing) == 2
    for symmetry in SYMMETRIES.values():
        basis = whole.basis(symmetry.free_unknowns(model.mesh), symmetry.signs)
        linear = linearise_class(model, state, PRESSURE, symmetry)
        for matrix, ours in zip(whole.relaxing, linear.relaxing, strict=True):
            expected = (basis.T @ matrix @ basis).toarray()
            assert np.abs(4 * ours.toarray() - expected).max() < 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("part", ["structure", "stiffness"])
def test_the_spectrum_of_the_whole_valve_is_the_union_of_four(whole, classes, part):
    """In vacuo without pressures, where the matrix is symmetric, and with the follower stiffness of the steady ones."""

    def inverse_squares(linear):
        matrix, mass = getattr(linear, part).toarray(), linear.mass.toarray()
        values = sl.eigvals(np.linalg.solve(matrix, mass))
        return values[np.argsort(-np.abs(values))]

    union = np.concatenate([inverse_squares(linear) for linear in classes.values()])
    union = union[np.argsort(-np.abs(union))][:60]
    found = inverse_squares(whole)[:60]
    gaps = np.abs(found[:, None] - union[None, :])
    assert np.all(np.sort(np.argmin(gaps, axis=1)) == np.arange(60))
    assert np.all(gaps.min(axis=1) < 1e-8 * np.abs(found))


@pytest.mark.parametrize("name", ["SA", "AS", "AA"])
def test_fluid_outside_slows_every_class(name):
    """Its mass is positive, follows its density, and slows the class's motions without flow."""
    q, symmetry = find_open_state(), SYMMETRIES[name]
    dry, wet = (linearise_class(make_valve(more), q, PRESSURE, symmetry) for more in ({}, {"outside.fluid": 1000.0}))
    assert np.all(wet.added.slowness > 0)
    squares = [
        sl.eigh(linear.structure.toarray(), linear.mass.toarray() + more, eigvals_only=True)[:4]
        for linear, more in ((dry, 0.0), (wet, 1000.0 * wet.added.columns @ wet.added.columns.T))
    ]
    assert np.all(squares[1] < 0.8 * squares[0])
    pencil = wet.pencil(Mu(density=500.0, alpha=0.0, beta=0.003), fluid=False)
    x, s = np.ones(pencil.n), 2.0 + 30.0j
    without = dry.pencil(Mu(density=500.0, alpha=0.0, beta=0.003), fluid=False)
    terms, bare = (sum(p.terms(s, x, np.zeros(p.b))[0]) for p in (pencil, without))
    added = s**2 * 1000.0 * wet.added.columns @ (wet.added.columns.T @ x)
    assert terms == pytest.approx(bare + added, rel=1e-9, abs=1e-9 * np.abs(bare).max())
