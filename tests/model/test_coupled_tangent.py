"""The coupled tangent against differences of the residual, and its sparse factorisation against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model.newton import EquilibriumSolver
from eigen import SingularShiftError
from eigen.factor import DirectFactor
from tests.differences import difference

STATES = {  # lift of the lip, m, and noise: wide open, ajar, lips crossed and held by the stops
    "open": (0.02, 2e-4),
    "nearly closed": (2e-5, 2e-6),
    "stops touching": (-3e-4, 1e-5),
}


def direction_of(model, seed):
    """A smooth-ish direction: displacements of some millimetres with rotations to match."""
    generator = np.random.default_rng(seed)
    nodal = generator.standard_normal((len(model.mesh.nodes), 5)) * np.array([1, 1, 1, 30, 30]) * 1e-3
    return model.shell.dofs.restrict(nodal)


@pytest.mark.parametrize("name", sorted(STATES))
def test_tangent_against_differences(model, make_state, name):
    lift, noise = STATES[name]
    q = make_state(model, lift, 1, noise)
    if name == "stops touching":
        assert model.stops.touching(q) > 10
    tangent = model.tangent(q, 18e3)
    assert np.allclose(tangent.residual, model.residual(q, 18e3), rtol=0, atol=1e-12 * np.abs(tangent.residual).max())
    # no stop may change sides within the difference: step well below the smallest distance from contact
    distance = np.abs(q[model.stops.unknowns]).min()
    for seed in (2, 3):
        direction = direction_of(model, seed)
        step = min(1e-3, 0.2 * distance / np.abs(direction[model.stops.unknowns]).max())
        slope = difference(lambda x: model.residual(x, 18e3), q, direction, step)
        assert np.linalg.norm(model.apply(tangent, direction) - slope) < 1e-7 * np.linalg.norm(slope)


@pytest.mark.parametrize("kind, side", [("uniform", "inside"), ("uniform", "outside")])
def test_tangent_without_flow(make_model, make_state, kind, side):
    model = make_model(drive__kind=kind, drive__side=side)
    q = make_state(model, 0.01)
    direction = direction_of(model, 4)
    slope = difference(lambda x: model.residual(x, 18e3), q, direction, 1e-4)
    assert np.linalg.norm(model.apply(model.tangent(q, 18e3), direction) - slope) < 1e-7 * np.linalg.norm(slope)
    force = model.pressure_force(model.nodal(q), model.flow.steady_pressure(None, 1.0))
    lifted = model.shell.dofs.expand(force)[:, 1].sum()
    assert lifted > 0 if side == "inside" else lifted < 0


def test_flow_carries_a_part_of_the_tangent(model, make_state):
    """G D J is no small correction: leaving it out would show."""
    q = make_state(model, 0.02)
    tangent = model.tangent(q, 18e3)
    direction = direction_of(model, 5)
    k, g, j = model.matrices(tangent)
    fluid = g @ (tangent.pressure_slope @ (j @ direction))
    assert np.linalg.norm(fluid) > 1e-4 * np.linalg.norm(k @ direction)


def test_structure_is_symmetric_and_follower_stiffness_is_not(model, make_state):
    q = make_state(model, 0.02)
    tangent = model.tangent(q, 18e3)
    structure = model.shell.dofs.matrix(tangent.structure)
    assert abs(structure - structure.T).max() < 1e-13 * abs(structure).max()
    whole = model.shell.dofs.matrix(tangent.stiffness)
    assert abs(whole - whole.T).max() > 1e-9 * abs(whole).max()


@pytest.mark.parametrize("name", sorted(STATES))
def test_bordered_solve_is_the_solve_with_the_full_matrix(model, make_state, name):
    lift, noise = STATES[name]
    q = make_state(model, lift, 1, noise)
    tangent = model.tangent(q, 18e3)
    k, g, j = (part.toarray() for part in model.matrices(tangent))
    full = k - g @ tangent.pressure_slope @ j
    factor = model.factor()
    model.refactor(factor, tangent)
    rhs = np.random.default_rng(6).standard_normal(model.size)
    for solve, matrix in ((factor.solve, full), (factor.solve_transposed, full.T)):
        x = solve(rhs)
        exact = np.linalg.solve(matrix, rhs)
        assert np.linalg.norm(x - exact) < 1e-8 * np.linalg.norm(exact)


def test_factor_is_reused_for_new_values(model, make_state):
    factor = model.factor()
    rhs = np.ones(model.size)
    for lift in (0.01, 0.03):
        tangent = model.tangent(make_state(model, lift), 18e3)
        model.refactor(factor, tangent)
        x = factor.solve(rhs)
        assert np.linalg.norm(model.apply(tangent, x) - rhs) < 1e-6 * np.linalg.norm(rhs)
    assert factor.factorisations == 2


def test_pressure_derivative(model, make_state):
    q = make_state(model, 0.01)
    slope = (model.residual(q, 20e3) - model.residual(q, 16e3)) / 4e3
    assert np.allclose(model.pressure_derivative(q, 18e3), slope, rtol=1e-7, atol=1e-9 * np.abs(slope).max())


def test_singular_matrix_is_reported():
    indptr, indices = np.arange(4, dtype=np.int32), np.arange(3, dtype=np.int32)
    factor = DirectFactor(indptr, indices)
    factor.values[:] = 1.0, np.nan, 1.0
    with pytest.raises(SingularShiftError, match="not finite"):
        factor.refactor()
    factor.values[:] = 2.0, 4.0, 8.0
    factor.refactor()
    assert factor.solve(np.ones(3)) == pytest.approx([0.5, 0.25, 0.125])


def test_equilibria_do_not_depend_on_density(make_model):
    states = []
    for density in (1.0, 1000.0):
        model = make_model(fluid__density=density)
        result = EquilibriumSolver(model).solve(model.rest(), 2e3)
        assert result.converged
        states.append(result.q)
    assert np.array_equal(*states)


def test_newton_converges_quadratically(model):
    """Steps at a slightly raised pressure: each is at most a constant times the square of the one before."""
    solver = EquilibriumSolver(model)
    start = solver.solve(model.rest(), 500.0)
    assert start.converged
    q, steps = start.q, []
    factor = model.factor()
    for _ in range(6):
        tangent = model.tangent(q, 560.0)
        model.refactor(factor, tangent)
        step = factor.solve(tangent.residual)
        steps.append(np.linalg.norm(step))
        q = q - step
    steps = [n for n in steps if n > 1e-10]  # below that is rounding
    assert len(steps) >= 3
    assert steps[-2] < 20 * steps[-3] ** 2 and steps[-1] < 20 * steps[-2] ** 2
