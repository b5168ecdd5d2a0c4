"""Small models of a state against the full pencil."""

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.studies.stability.walk import ValveFamily
from eigen import ColumnSolver, Condition, FamilyReduction
from eigen.reduced_counts import phase_counts
from eigen.reduction import POWERS, StaticSolver

DENSITIES = np.geomspace(1.0, 1000.0, 13)


@pytest.fixture(scope="module", params=[0.0, 1.0], ids=["quasi-steady", "storage"])
def storage(request):
    return request.param


@pytest.fixture(scope="module")
def family(walk, coarse_case) -> ValveFamily:
    return walk.family(Mu.of(coarse_case))


def test_fluid_parts_go_with_powers_of_the_root_of_density(family):
    linear, unit = family.linear, family.parts(Mu(storage=0.3))
    parts = linear.fluid_parts(7.0, 0.3)
    for name, power in POWERS.items():
        power += name[0] in "BS"  # the velocity there is not scaled
        assert parts[name] == pytest.approx(
            unit[name] * 7.0 ** (power / 2), rel=1e-9, abs=1e-9 * np.abs(unit[name]).max()
        )


def test_block_solves_with_the_transpose(family):
    solver = StaticSolver()
    solver.factor(family)
    right = np.random.default_rng(0).standard_normal((family.stiffness.shape[0], 3))
    x = solver.solve_transposed(right)
    assert np.abs(family.stiffness.T @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(family.stiffness).max()
    x = solver.solve(right)  # the transpose must not stick
    assert np.abs(family.stiffness @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(family.stiffness).max()


def test_cells_agree_with_the_full_pencil(family, storage):
    solver = ColumnSolver()
    column = solver.solve(family, [(rho, 0.0, 0.003, Mu(storage=storage)) for rho in DENSITIES])
    assert column.certified.all() and (column.how == 0).all()
    for i in range(0, len(DENSITIES), 2):
        full = solver.direct(family, (DENSITIES[i], 0.0, 0.003, Mu(storage=storage)))
        found = complex(column.growth_rate[i], 2 * np.pi * column.frequency[i])
        assert abs(found - full.eigenvalues[0]) < 1e-6 * abs(full.eigenvalues[0])
        assert column.unstable[i] == full.unstable_count


def test_the_count_needs_no_hints_and_sees_both_verdicts(family, storage):
    coarse = FamilyReduction(family).coarse
    conditions = [Condition(rho, 0.0, 0.003, Mu(storage=storage)) for rho in DENSITIES]
    counts = phase_counts(coarse, conditions)
    full = coarse.eigenvalues(conditions)
    assert counts.certain.all()
    assert counts.number.tolist() == (full.real > 0).sum(axis=1).tolist()
    assert set(counts.number) == {0, 2}


def test_the_error_estimate_sees_a_poor_space(family):
    reduction, condition = FamilyReduction(family), Condition(10.0, 0.0, 0.003, Mu(storage=0.0))
    good, poor = (
        np.abs(reduction.correction(pairs, condition) / pairs.values)
        for pairs in (
            reduction.fine(reduction.coarse, [condition]).pairs(condition, 1),
            reduction.coarse.pairs(condition, 1),
        )
    )
    assert good[0] < 1e-8 and good[0] < 0.05 * poor[0]


def test_damping_may_change_within_a_column(family):
    solver = ColumnSolver()
    conditions = [(10.0, alpha, beta, Mu(storage=0.0)) for alpha in (0.0, 5.0) for beta in (0.001, 0.003)]
    column = solver.solve(family, conditions)
    assert column.certified.all()
    for i, condition in enumerate(conditions):
        assert column.growth_rate[i] == pytest.approx(solver.direct(family, condition).growth_rate[0], rel=1e-6)
