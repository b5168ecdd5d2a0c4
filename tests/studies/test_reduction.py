"""Small models of a state against the full pencil."""

import numpy as np
import pytest

from dbvfiv.studies.column import ColumnSolver, newton_correction
from dbvfiv.studies.parameters import Place
from dbvfiv.studies.phase_count import phase_counts
from dbvfiv.studies.reduction import POWERS, StateFamily, StaticSolver, UnitFluid

DENSITIES = np.geomspace(1.0, 1000.0, 13)


@pytest.fixture(scope="module", params=[0.0, 1.0], ids=["quasi-steady", "storage"])
def storage(request):
    return request.param


@pytest.fixture(scope="module")
def linear(walk, coarse_case):
    return walk.linear(Place.of(coarse_case))


def test_fluid_parts_go_with_powers_of_the_root_of_density(linear):
    from dbvfiv.model.dynamics import fluid_parts

    unit = UnitFluid(linear).parts(0.3)
    parts = fluid_parts(linear.model.flow, linear.area, linear.inlet, 7.0, 0.3)
    for name, power in POWERS.items():
        power += name[0] in "BS"  # the velocity there is not scaled
        assert parts[name] == pytest.approx(
            unit[name] * 7.0 ** (power / 2), rel=1e-9, abs=1e-9 * np.abs(unit[name]).max()
        )


def test_block_solves_with_the_transpose(linear):
    solver = StaticSolver()
    solver.factor(linear)
    right = np.random.default_rng(0).standard_normal((linear.stiffness.shape[0], 3))
    x = solver.solve_transposed(right)
    assert np.abs(linear.stiffness.T @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(linear.stiffness).max()
    x = solver.solve(right)  # the transpose must not stick
    assert np.abs(linear.stiffness @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(linear.stiffness).max()


def test_cells_agree_with_the_full_pencil(linear, storage):
    solver = ColumnSolver()
    column = solver.solve(linear, [(rho, 0.0, 0.003, storage) for rho in DENSITIES])
    assert column.certified.all() and (column.how == 0).all()
    for i in range(0, len(DENSITIES), 2):
        full = solver.direct(linear, (DENSITIES[i], 0.0, 0.003, storage))
        found = complex(column.growth_rate[i], 2 * np.pi * column.frequency[i])
        assert abs(found - full.eigenvalues[0]) < 1e-6 * abs(full.eigenvalues[0])
        assert column.unstable[i] == full.unstable_count


def test_the_count_needs_no_hints_and_sees_both_verdicts(linear, storage):
    family = StateFamily(linear)
    conditions = [(rho, 0.0, 0.003, storage) for rho in DENSITIES]
    counts = phase_counts(family.coarse, conditions)
    full = family.coarse.eigenvalues(conditions)
    assert counts.certain.all()
    assert counts.number.tolist() == (full.real > 0).sum(axis=1).tolist()
    assert set(counts.number) == {0, 2}


def test_the_error_estimate_sees_a_poor_space(linear):
    family = StateFamily(linear)
    condition = (10.0, 0.0, 0.003, 0.0)
    good = newton_correction(family, family.fine([condition], -300.0).pairs(condition, -300.0, 1), condition)
    poor = newton_correction(family, family.coarse.pairs(condition, -300.0, 1), condition)
    assert good[0] < 1e-8 and good[0] < 0.05 * poor[0]


def test_damping_may_change_within_a_column(linear):
    solver = ColumnSolver()
    conditions = [(10.0, alpha, beta, 0.0) for alpha in (0.0, 5.0) for beta in (0.001, 0.003)]
    column = solver.solve(linear, conditions)
    assert column.certified.all()
    for i, condition in enumerate(conditions):
        assert column.growth_rate[i] == pytest.approx(solver.direct(linear, condition).growth_rate[0], rel=1e-6)
