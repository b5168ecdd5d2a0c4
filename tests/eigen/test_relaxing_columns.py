"""Families whose stiffness relaxes: small models and counts against dense eigenvalues of the exact linear form."""

import numpy as np
import pytest
import scipy.sparse as sp

from eigen import (
    ColumnSolver,
    CoupledPencil,
    FamilyReduction,
    ReducedFamily,
    Relaxation,
    SearchOptions,
    lowest_frequencies,
)
from eigen.columns import REDUCED
from eigen.operator import FLUID_PARTS
from tests.eigen.test_columns import Point, PointFamily, dense

SIZE, GROUPS, TIMES = 12, 2, 3


class RelaxingFamily(PointFamily):
    """A random structure of which two thirds relax, with a coupling of three forces and one inner unknown."""

    def __init__(self, seed: int, coupling: float = 0.1):
        rng = np.random.default_rng(seed)
        normal = lambda *shape: rng.standard_normal(shape)  # noqa: E731
        root = normal(SIZE, SIZE)
        self.mass = sp.csr_matrix(root @ root.T / SIZE + np.eye(SIZE))
        parts = []
        for _ in range(GROUPS + 1):
            turn = np.linalg.qr(normal(SIZE, SIZE))[0]
            parts.append(rng.uniform(0.2, 1.0) * (turn * 10 ** rng.uniform(-1, 2, SIZE)) @ turn.T)
        self.damping = sp.csr_matrix(sum(parts))
        self.stiffness = sp.csr_matrix(sum(parts) + 0.05 * normal(SIZE, SIZE))
        self.relaxing = [sp.csr_matrix(part) for part in parts[1:]]
        self.strengths, self.times = rng.uniform(0, 0.5, (GROUPS, TIMES)), 10 ** rng.uniform(-2, 1.5, TIMES)
        self.forces, self.slope = sp.csr_matrix(normal(SIZE, 3)), sp.csr_matrix(normal(3, SIZE))
        shapes = {"A": (3, 3), "B": (3, 1), "R": (1, 3), "S": (1, 1)}
        quasi_steady = {name: coupling * normal(*shapes[name[0]]) for name in FLUID_PARTS} | {
            "A2": np.zeros((3, 3)),
            "R2": np.zeros((1, 3)),
            "S0": np.ones((1, 1)),
            "S1": np.full((1, 1), 0.3),
        }
        added = normal(3, 3)
        self._parts = {0.0: quasi_steady, 1.0: quasi_steady | {"A2": -0.1 * added @ added.T}}
        self._known: dict[float, Relaxation] = {}

    def relaxation(self, mu):
        loss = mu.loss
        if loss and loss not in self._known:
            # a time that some factors leave out
            kept = slice(None) if loss < 1.0 else slice(1, None)
            self._known[loss] = Relaxation(self.relaxing, loss * self.strengths[:, kept], self.times[kept])
        return self._known[loss] if loss else None

    def search(self, condition):
        return SearchOptions()


def random_conditions(seed: int, number: int) -> list[Point]:
    rng = np.random.default_rng(seed)
    return [
        Point(
            10 ** rng.uniform(-2, 0.5),
            rng.uniform(0, 0.1) * rng.integers(2),
            10 ** rng.uniform(-3, -1) * rng.integers(2),
            float(rng.integers(2)),
            rng.uniform(0.05, 1.5),
        )
        for _ in range(number)
    ]


@pytest.mark.parametrize("seed", range(5))
def test_growth_and_counts_are_those_of_the_exact_linear_form(seed):
    family, conditions = RelaxingFamily(seed), random_conditions(seed, 20)
    reduced = ReducedFamily(family, np.eye(SIZE))
    unstable = []
    for condition in conditions:
        values = dense(family, condition)
        true, own = family.reach(condition).leading(values), reduced.leading(condition)
        count = reduced.count(condition, own)
        unstable.append(int((values.real > 0).sum()))
        assert count.certain and count.number == unstable[-1]
        assert np.abs(own - true).max() <= 1e-7 * np.abs(true).max()
    assert len(set(unstable)) > 1


def test_a_slow_real_eigenvalue_is_found_beside_cells_that_creep_nearer_to_zero():
    """All damped by mass, one too soft to swing; heavier losses move the edge of creep past it."""
    family = RelaxingFamily(0, coupling=0.0)
    family.times, family.strengths = np.array([0.05, 0.2, 1.0]), np.full((GROUPS, TIMES), 0.4)
    soft = np.linalg.eigh(family.mass.toarray())[1][:, -1]
    weight = float(soft @ family.mass @ soft)
    hold = np.eye(SIZE) - np.outer(family.mass @ soft, soft) / weight  # what is left of forces on the others
    family.relaxing = [sp.csr_matrix(hold @ part @ hold.T) for part in family.relaxing]
    others = sum(family.relaxing) + 200.0 * hold @ family.mass @ hold.T
    family.stiffness = sp.csr_matrix(others + 6.0 * np.outer(family.mass @ soft, family.mass @ soft) / weight)
    conditions = [Point(1.0, 10.0, 0.0, 0.0, loss) for loss in (0.1, 0.8, 2.0)]
    reaches = [family.reach(c) for c in conditions]
    true = -5.0 + np.sqrt(25.0 - 6.0)  # s^2 + 10 s + 6 = 0
    assert reaches[0].creep < true < reaches[1].creep
    reduced = ReducedFamily(family, np.eye(SIZE))
    found = [reduced.leading(condition) for condition in conditions]
    assert abs(found[0][0] - true) < 1e-9
    assert all(np.abs(row - true).min() > 1e-3 for row in found[1:])


class Unstable(RelaxingFamily):
    """With a structure that is unstable by itself: it swings under a circulatory force, or buckles, or runs away by a
    part that relaxes and pushes.
    """

    def __init__(self, seed: int):
        super().__init__(seed)
        rng = np.random.default_rng(100 + seed)
        pair, size = np.linalg.qr(rng.standard_normal((SIZE, 2)))[0], np.abs(self.stiffness.diagonal()).mean()
        kind = seed % 3
        if kind == 0:
            self.stiffness = self.stiffness + sp.csr_matrix(size * (pair @ [[0.0, 1.0], [-1.0, 0.0]] @ pair.T))
        elif kind == 1:
            self.stiffness = self.stiffness - sp.csr_matrix(3.0 * size * np.outer(pair[:, 0], pair[:, 0]))
        else:
            self.relaxing[0] = self.relaxing[0] - sp.csr_matrix(30.0 * size * np.outer(pair[:, 0], pair[:, 0]))


@pytest.mark.parametrize("seed", range(6))
def test_counts_where_the_structure_is_unstable_by_itself(seed):
    family, conditions = Unstable(seed), random_conditions(seed, 12)
    reduced = ReducedFamily(family, np.eye(SIZE))
    values = [dense(family, c) for c in conditions]
    counts = [reduced.count(c, v[(v.imag >= 0) & (v.real > -0.05 * np.abs(v))]) for c, v in zip(conditions, values)]
    assert all(count.certain for count in counts)
    assert [count.number for count in counts] == [int((v.real > 0).sum()) for v in values]
    assert sum(count.number for count in counts) > 0


def test_lowest_frequencies_of_a_small_model():
    family = RelaxingFamily(4)
    assert not family.lowest(3).size  # nobody has made one
    reduction = FamilyReduction(family)
    elastic = CoupledPencil(family.mass, 0.0 * family.mass, family.stiffness)
    assert family.lowest(3) == pytest.approx(lowest_frequencies(elastic, 3), rel=1e-9)
    del reduction
    assert not family.lowest(3).size


def test_columns_carry_certificates_whatever_relaxes():
    """Elastic cells and cells of several factors in one column."""
    family = RelaxingFamily(3)
    conditions = [Point(0.3, 0.02, 0.0, 1.0, loss) for loss in (0.0, 0.2, 0.7, 1.2)]
    column = ColumnSolver().solve(family, conditions)
    assert column.certified.all()
    for i, condition in enumerate(conditions):
        values = dense(family, condition)
        leading = family.reach(condition).leading(values)[0]
        assert column.leading[i].real == pytest.approx(leading.real, abs=1e-6 * abs(leading))
        assert column.unstable[i] == column.cells[i].certificate.counted == (values.real > 0).sum()


def test_an_uncoupled_column_takes_no_relaxation_for_another():
    """Relaxation of a family that keeps none but the last, so that others may come to lie where it was."""

    class Forgetful(RelaxingFamily):
        def relaxation(self, mu):
            self._known = {loss: own for loss, own in self._known.items() if loss == mu.loss}
            return super().relaxation(mu)

    family = Forgetful(6)
    family.forces, family.slope, family._parts = sp.csr_matrix((SIZE, 0)), sp.csr_matrix((0, SIZE)), {0.0: {}}
    conditions = [Point(1.0, 0.1, 0.0, 0.0, loss) for loss in np.linspace(0.1, 0.9, 40)]
    column = ColumnSolver().solve(family, conditions)
    assert column.certified.all()
    assert column.leading == pytest.approx([family.reach(c).leading(dense(family, c))[0] for c in conditions], rel=1e-7)


def test_a_cell_that_is_counted_anew_lists_no_slow_motions():
    """Modes of 2 and 40 Hz in a band of 100 Hz, of which the second grows; the first is too slow to be one."""

    class Two(PointFamily):
        def __init__(self):
            self.mass, self.damping = np.eye(2), np.diag([4.0, -16.0])
            self.stiffness = np.diag((2 * np.pi * np.array([2.0, 40.0])) ** 2)
            self.forces, self.slope = sp.csr_matrix(np.ones((2, 1))), sp.csr_matrix(np.ones((1, 2)))
            shapes = {"A": (1, 1), "B": (1, 0), "R": (0, 1), "S": (0, 0)}
            self._parts = {0.0: {name: np.zeros(shapes[name[0]]) for name in FLUID_PARTS}}
            self._relaxation = Relaxation([self.stiffness], [[0.1]], [1.0])

        def search(self, condition):
            return SearchOptions(max_frequency=100.0)

        def relaxation(self, mu):
            return self._relaxation

    family, condition = Two(), Point(1.0, 0.0, 1.0, 0.0)
    (cell,) = ColumnSolver().solve(family, [condition]).cells
    assert cell.certificate.agrees and cell.certificate.counted == 2
    assert cell.leading == pytest.approx(family.reach(condition).leading(dense(family, condition)), rel=1e-7)


def test_a_cell_whose_growing_mode_lies_above_the_band_is_left_open():
    """Modes of 30 and 40 Hz decay; a third one grows, at 114 to 91 Hz, the slower the denser the fluid; the band is one
    of 100 Hz, and the small model knows that mode from the cells where it lies inside."""

    class Three(PointFamily):
        def __init__(self):
            self.mass, self.damping = np.eye(3), np.diag([4.0, 6.0, -16.0])
            self.stiffness = np.diag((2 * np.pi * np.array([30.0, 40.0, 120.0])) ** 2)
            pattern = np.array([[0.2], [0.2], [1.0]])
            self.forces, self.slope = sp.csr_matrix(pattern), sp.csr_matrix(pattern.T)
            shapes = {"A": (1, 1), "B": (1, 0), "R": (0, 1), "S": (0, 0)}
            self._parts = {0.0: {name: np.zeros(shapes[name[0]]) for name in FLUID_PARTS} | {"A2": -np.eye(1)}}
            self._relaxation = Relaxation([0.01 * self.stiffness], [[0.1]], [1.0])

        def search(self, condition):
            return SearchOptions(max_frequency=100.0)

        def relaxation(self, mu):
            return self._relaxation

    family, conditions = Three(), [Point(inertia, 0.0, 1.0, 0.0) for inertia in (0.1, 0.3, 0.4, 0.5, 0.8)]
    column = ColumnSolver().solve(family, conditions)
    assert (column.how == REDUCED).all() and column.certified.all()
    for cell, condition in zip(column.cells, conditions):
        values = dense(family, condition)
        growing = values[values.real > 0]
        inside = np.abs(growing.imag) <= 2 * np.pi * 100.0
        assert len(growing) == 2 and cell.certificate.unstable == inside.sum() == 2 * (cell.leading[0].real > 0)
        assert cell.open_above == (not inside.any())
    assert [cell.open_above for cell in column.cells] == [True] * 3 + [False] * 2


def test_correction_is_that_of_newton_on_the_full_pencil():
    family, condition = RelaxingFamily(5), Point(0.3, 0.0, 0.0, 0.0, 0.4)
    reduction = FamilyReduction(family)
    some = np.linalg.qr(np.random.default_rng(0).standard_normal((SIZE, SIZE)))[0][:, :-1]
    pairs = ReducedFamily(family, some).pairs(condition, 1)
    better = pairs.values + reduction.correction(pairs, condition)
    values = dense(family, condition)
    exact = values[np.argmin(np.abs(values - better[0]))]
    assert abs(better[0] - exact) <= 0.2 * abs(pairs.values[0] - exact)


def test_slow_divergence_is_found_and_counted():
    """Soft while it creeps, stiff while it moves: one real eigenvalue right of zero, slower than the relaxation."""
    family = RelaxingFamily(1, coupling=0.0)
    parts = dict(family._parts[0.0])
    unit = (family.slope @ np.linalg.solve(family.stiffness.toarray(), family.forces.toarray()))[0, 0]
    parts["A0"] = np.diag([1.05 / unit, 0.0, 0.0])
    family._parts = {0.0: parts}
    condition = Point(1.0, 0.1, 0.0, 0.0, 1.4)
    reduced = ReducedFamily(family, np.eye(SIZE))
    values = dense(family, condition)
    (slow,) = values[values.real > 0]
    found = reduced.eigenvalues(condition)
    (own,) = found[found.real > 0]
    assert slow.imag == 0 and slow.real * family.times.max() < 1
    assert own == pytest.approx(slow, rel=1e-8)
    assert reduced.count(condition).number == 1


@pytest.mark.slow
def test_columns_without_any_mode():
    """In a band below all of them nothing is listed, and what is unstable beyond it is still counted."""

    class Banded(RelaxingFamily):
        def search(self, condition):
            return SearchOptions(max_frequency=1e-5)

    family = Banded(2, coupling=0.0)
    drawn = [c._replace(alpha=0.1) for c in random_conditions(3, 20)]
    conditions = [c for c in drawn if not family.reach(c).leading(dense(family, c)).size]
    assert len(conditions) > 3
    column = ColumnSolver().solve(family, conditions)
    assert np.isnan(column.leading).all() and not column.certified.any()
    assert [(dense(family, c).real > 0).sum() for c in conditions] == list(column.unstable) and max(column.unstable) > 0
