"""Structures that run away by themselves: rates against closed forms, and columns that hold them."""

import numpy as np
import pytest
import scipy.sparse as sp

from eigen import ColumnSolver, Condition, CoupledPencil, Relaxation
from eigen.factorization import StructureMatrices
from eigen.inertia import SymmetricStructure
from eigen.runaway import Runaway
from tests.eigen.test_negative_stiffness import STRENGTHS, TIMES, oscillators_that_relax
from tests.eigen.test_relaxing_columns import RelaxingFamily, dense
from tests.systems.relaxing import mode_roots


def structure_of(pencil: CoupledPencil) -> SymmetricStructure:
    return SymmetricStructure(StructureMatrices(pencil))


@pytest.mark.parametrize("n", [100, 300])
def test_rates_and_motions_are_those_of_single_oscillators(n):
    squares, shares = np.linspace(1.0, 60.0, n) ** 2, np.ones(n)
    own = [n // 3, n // 2, n - 2]
    squares[own] = 100.0**2, 300.0**2, 1000.0**2
    shares[own] = -1.5, -1.3, -1.9
    pencil = oscillators_that_relax(squares, shares)
    found = Runaway.of(structure_of(pencil))
    roots = [r.real for i in own for r in mode_roots(squares[i], STRENGTHS, TIMES, share=shares[i])]
    expected = np.sort([r for r in roots if r > 0])[::-1]
    assert expected.size == 6
    np.testing.assert_allclose(found.rates, expected, rtol=1e-10)
    # each is one oscillator of a mixed pair, and both its rates have the same motion
    for rate, motion in zip(found.rates, found.motions.T):
        stiffness = pencil.K + sum(x * part for x, part in zip(pencil.relaxation.factors(rate), pencil.relaxing))
        assert np.linalg.norm(stiffness @ motion + rate**2 * motion) < 1e-6 * rate**2
        assert motion @ motion == pytest.approx(1.0)
    assert found.core.shape == (n, 3)


def test_a_structure_that_holds_has_none():
    squares = np.linspace(1.0, 60.0, 40) ** 2
    assert Runaway.of(structure_of(oscillators_that_relax(squares, np.ones(40)))).rates.size == 0
    # stiffness that turns negative too late for what inertia holds it back
    shares = np.ones(40)
    shares[20] = -1.001
    assert Runaway.of(structure_of(oscillators_that_relax(squares, shares))).rates.size == 0


def test_signs_of_a_factor_are_the_inertia_of_sums():
    rng = np.random.default_rng(2)
    n = 60
    sparse = [sp.random(n, n, 0.1, random_state=rng) + sp.diags(rng.standard_normal(n)) for _ in range(4)]
    M, C, K, part = ((a + a.T).tocsr() for a in sparse)
    upper = sp.random(n, n, 0.02, random_state=rng)
    structure = structure_of(CoupledPencil(M, C, K + upper - upper.T, relaxation=Relaxation([part], [[0.7]], [0.3])))
    for s in (0.0, 0.4, 3.0):
        phi = 0.7 * 0.3 * s / (1 + 0.3 * s)
        exact = (s * s * M + s * C + K + phi * part).toarray()
        weights, right = structure.at(s), rng.standard_normal(n)
        np.testing.assert_allclose(structure.times(weights, right), exact @ right, atol=1e-12)
        with structure.factored(weights) as factor:
            assert factor.negative == np.sum(np.linalg.eigvalsh(exact) < 0)
            np.testing.assert_allclose(exact @ factor.solve(right), right, atol=1e-8)
    step = 1e-6
    difference = (structure.at(0.4 + step) - structure.at(0.4 - step)) / (2 * step)
    np.testing.assert_allclose(structure.slope(0.4), difference, atol=1e-8)


class Runs(RelaxingFamily):
    """Of the random structures one more unknown, light and stiff, whose stiffness is lost as it relaxes."""

    def __init__(self, seed: int, coupling: float = 0.1):
        super().__init__(seed, coupling)

        def with_one(matrix, own):
            return sp.block_diag([matrix, [[own]]]).tocsr()

        self.mass, self.stiffness, self.damping = (
            with_one(matrix, own) for matrix, own in ((self.mass, 1e-4), (self.stiffness, 50.0), (self.damping, 0.0))
        )
        total = self.strengths.sum(axis=1)
        self.relaxing = [with_one(part, -100.0 / total.sum()) for part in self.relaxing]
        touch = 1e-3 * np.random.default_rng(seed).standard_normal((3, 1))
        self.slope = sp.hstack([self.slope, touch]).tocsr()
        self.forces = sp.vstack([self.forces, touch.T]).tocsr()


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_columns_list_and_count_what_runs_away(seed):
    """By itself, whatever the coupling: two real eigenvalues in every cell beside those of the modes."""
    family = Runs(seed)
    conditions = [Condition(inertia, 0.1, 0.0, 0.0, 0.9) for inertia in np.geomspace(0.01, 3.0, 9)]
    column = ColumnSolver().solve(family, conditions)
    assert column.certified.all() and (column.runaway == 2).all()
    for i, condition in enumerate(conditions):
        values = dense(family, condition)
        fastest = values[np.argmax(values.real)]
        assert fastest.imag == 0 and column.growth_rate[i] == pytest.approx(fastest.real, rel=1e-6)
        assert column.frequency[i] == 0.0
        assert column.unstable[i] == column.counted[i] == (values.real > 0).sum()
        # onsets are looked for among the modes
        modes = family.reach(condition).leading(values)[2:]
        assert column.leading[i][0] == pytest.approx(modes[0], abs=1e-6 * abs(modes[0]))
    whole = ColumnSolver().whole(family, conditions[4])
    assert whole.unstable_count == column.unstable[4]
    assert whole.growth_rate[0] == pytest.approx(column.growth_rate[4], rel=1e-6)
