"""Small models of a state against the full pencil."""

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.studies.stability.walk import ValveFamily
from eigen import ColumnSolver, FamilyReduction

DENSITIES = np.geomspace(1.0, 1000.0, 13)


def points(storage: float) -> list[Mu]:
    return [Mu(density=rho, beta=0.003, storage=storage) for rho in DENSITIES]


@pytest.fixture(scope="module", params=[0.0, 1.0], ids=["quasi-steady", "storage"])
def storage(request):
    return request.param


@pytest.fixture(scope="module")
def family(walk, coarse_case) -> ValveFamily:
    return walk.family(Mu.of(coarse_case))


def test_the_coupling_is_that_of_the_full_operator_with_a_scaled_velocity(family):
    mu = Mu(density=7.0, storage=0.3)
    full, unit = family.linear.pencil(mu), family.coupling(mu)
    for name, value in unit.items():
        power = name[0] in "BS"  # the velocity there is not scaled
        assert getattr(full, name) == pytest.approx(
            value * 7.0 ** (power / 2), rel=1e-9, abs=1e-9 * np.abs(value).max()
        )


def test_block_solves_with_the_transpose(family):
    solver = FamilyReduction(family).solver
    right = np.random.default_rng(0).standard_normal((family.stiffness.shape[0], 3))
    x = solver.solve_transposed(right)
    assert np.abs(family.stiffness.T @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(family.stiffness).max()
    x = solver.solve(right)  # the transpose must not stick
    assert np.abs(family.stiffness @ x - right).max() < 1e-9 * np.abs(right).max() * np.abs(family.stiffness).max()


def test_cells_agree_with_the_full_pencil(family, storage):
    solver = ColumnSolver()
    column = solver.solve(family, points(storage))
    assert column.certified.all() and (column.how == 0).all()
    for i in range(0, len(DENSITIES), 2):
        full = solver.direct(family, points(storage)[i])
        found = column.leading[i]
        assert abs(found - full.eigenvalues[0]) < 1e-6 * abs(full.eigenvalues[0])
        assert column.unstable[i] == full.unstable_count


def test_the_count_needs_no_hints_and_sees_both_verdicts(family, storage):
    coarse = FamilyReduction(family).coarse
    conditions = points(storage)
    counts = [coarse.count(mu) for mu in conditions]
    values = [coarse.eigenvalues(mu) for mu in conditions]
    assert all(count.certain for count in counts)
    assert [count.number for count in counts] == [2 * int((v.real > 0).sum()) for v in values]
    assert {count.number for count in counts} == {0, 2}


def test_the_error_estimate_sees_a_poor_space(family):
    reduction, condition = FamilyReduction(family), Mu(density=10.0, beta=0.003, storage=0.0)
    good, poor = (
        np.abs(reduction.correction(pairs, condition) / pairs.values)
        for pairs in (
            reduction.fine(reduction.coarse, [condition], 4).pairs(condition, 1),
            reduction.coarse.pairs(condition, 1),
        )
    )
    assert good[0] < 1e-8 and good[0] < 0.05 * poor[0]


def test_damping_may_change_within_a_column(family):
    solver = ColumnSolver()
    conditions = [
        Mu(density=10.0, alpha=alpha, beta=beta, storage=0.0) for alpha in (0.0, 5.0) for beta in (0.001, 0.003)
    ]
    column = solver.solve(family, conditions)
    assert column.certified.all()
    for i, condition in enumerate(conditions):
        assert column.leading[i].real == pytest.approx(solver.direct(family, condition).growth_rate[0], rel=1e-6)
