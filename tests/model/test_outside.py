"""Fluid outside the valve: added mass, what is kept of it, and the pencils it is part of."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import scipy.linalg as la

from dbvfiv.case.parameters import Mu
from dbvfiv.errors import SolveError
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.model.outside import leading_added_mass
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, leading_modes

MESH = {"mesh.around": 8, "mesh.along": 14}


@cache
def valve(fluid="same", pressure=10e3, **outside) -> tuple[ValveModel, np.ndarray]:
    keys = {f"outside.{name}": value for name, value in outside.items()} | {"outside.fluid": fluid}
    model = ValveModel(thesis_case(MESH | keys))
    return model, find_equilibrium(ValveModel(thesis_case(MESH)), pressure).q


@cache
def parts(**outside):
    model, q = valve(**outside)
    fluxes = model.outside.face.fluxes(model.shell.dofs.expand(q))
    return linearise(model, q, 10e3), fluxes, model.outside.impedance(q).matrix()


def frequencies(state, added, count: int) -> np.ndarray:
    """Lowest frequencies without flow for a dense added mass, Hz, with and without follower parts left symmetric."""
    stiffness = 0.5 * (state.stiffness + state.stiffness.T).toarray()
    mass = state.mass.toarray() + added
    return np.sqrt(la.eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, count - 1))) / (2 * np.pi)


@pytest.mark.parametrize("outside", [{}, {"lips": "open"}, {"pipe_diameter": 0.35}], ids=str)
def test_the_added_mass_is_symmetric_and_positive(outside):
    state, fluxes, impedance = parts(**outside)
    assert np.array_equal(impedance, impedance.T)
    assert np.linalg.eigvalsh(impedance)[0] > 0.0
    added = state.added.columns @ state.added.columns.T
    whole = fluxes.T @ impedance @ fluxes
    # what is left out is positive as well, and bounded by the first motion left out
    left = whole - added
    size = np.linalg.norm(whole, 2)
    assert np.linalg.eigvalsh(left)[0] > -1e-9 * size
    bound = state.added.slowness[-1] * state.structure.toarray() - left
    assert np.linalg.eigvalsh(bound)[0] > -1e-6 * np.linalg.norm(bound, 2)


def test_frequencies_see_hardly_anything_of_what_is_left_out():
    state, fluxes, impedance = parts()
    whole = frequencies(state, 1000.0 * (fluxes.T @ impedance @ fluxes), 10)
    kept = frequencies(state, 1000.0 * state.added.columns @ state.added.columns.T, 10)
    assert np.abs(kept / whole - 1.0).max() < 5e-4
    assert np.all(kept >= whole * (1 - 1e-9))  # less mass
    few = leading_added_mass(fluxes, impedance, state.structure, 10)
    few = frequencies(state, 1000.0 * few.columns @ few.columns.T, 10)
    assert np.abs(few / whole - 1.0).max() > 10 * np.abs(kept / whole - 1.0).max()


def test_the_pencil_has_the_added_mass():
    model, q = valve()
    state, fluxes, impedance = parts()
    conditions = Mu(density=1000.0, alpha=0.0, beta=0.001)
    with_it = state.pencil(conditions)
    without = replace(state, added=None, _damped={}).pencil(conditions)
    added = 1000.0 * state.added.columns @ state.added.columns.T
    dense = without.replace(M=without.M + added)
    options = SearchOptions(limit_point=-1000.0)
    a, b = leading_modes(with_it, 6, options), leading_modes(dense, 6, options)
    np.testing.assert_allclose(a.eigenvalues, b.eigenvalues, rtol=1e-8)
    still = state.pencil(conditions, fluid=False)
    assert still.b == 0 and not np.any(still.A0) and np.array_equal(still.A2, with_it.A2 * (still.A2 != 0))


def test_a_fixed_density_outside_does_not_follow_the_one_inside():
    _, q = valve()
    for fluid, factor in (("same", 10.0), (800.0, 800.0)):
        state = linearise(valve(fluid)[0], q, 10e3)
        inertia = np.diag(state.pencil(Mu(density=10.0, alpha=0.0, beta=0.001)).A2)
        np.testing.assert_allclose(inertia[-state.added.rank :], -factor)


def test_the_derivative_along_the_shape_is_that_of_differences_of_two_sizes():
    model, q = valve()
    way = np.random.default_rng(2).standard_normal(model.size) * 1e-3
    fixed = model.outside.panels(q)

    def product(x):
        fluxes = model.outside.face.fluxes(model.nodal(x))
        return fluxes.T @ (model.outside.impedance(x, fixed) @ (fluxes @ way))

    slopes = [(product(q + h * way) - product(q - h * way)) / (2 * h) for h in (0.05, 0.1)]
    assert np.linalg.norm(slopes[1] - slopes[0]) < 2e-4 * np.linalg.norm(slopes[0])


def test_how_long_the_tube_goes_on_upstream_does_not_matter(monkeypatch):
    model, q = valve()
    state, *_ = parts()
    monkeypatch.setattr("dbvfiv.model.outside.TUBE", 1.5)
    shorter = ValveModel(model.case).outside.added_mass(q, state.structure)
    np.testing.assert_allclose(shorter.slowness[:10], state.added.slowness[:10], rtol=1e-3)


def test_modes_at_ten_kilopascals_lie_near_those_of_an_independent_probe():
    """8.5, 12.2, 27.6 Hz by a rougher panel method at 28 x 48; 8.63, 12.20 and 27.43 Hz here at 14 x 24."""
    state, fluxes, impedance = parts()
    found = frequencies(state, 1000.0 * (fluxes.T @ impedance @ fluxes), 3)
    np.testing.assert_allclose(found, [8.5, 12.2, 27.6], rtol=0.1)


def test_steady_states_are_not_changed():
    model, q = valve()
    plain = ValveModel(thesis_case(MESH))
    assert np.array_equal(model.residual(q, 10e3), plain.residual(q, 10e3))


def test_a_pipe_that_the_open_valve_touches_is_refused():
    model, q = valve(pipe_diameter=0.302)
    with pytest.raises(SolveError, match="touches the pipe.*outside.pipe_diameter"):
        model.outside.panels(q + model.shell.dofs.restrict(np.full(model.shell.dofs.free.shape, 0.01)))
