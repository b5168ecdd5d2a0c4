"""Columns: one family of pencils under many conditions, against dense eigenvalues."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from eigen import Certificate, ColumnSolver, PencilFamily, SearchOptions, certified_spectrum
from eigen.columns import DIRECT, REDUCED, _corrected, cell_beside
from eigen.operator import FLUID_PARTS
from eigen.reduction import FamilyReduction

SIZE = 60


class Point(NamedTuple):
    """Density factor of the coupling, damping, which coupling, and factor of the relaxation."""

    inertia: float
    alpha: float
    beta: float
    law: float
    loss: float = 0.0


class PointFamily(PencilFamily):
    """A family over such points, of couplings `_parts` by their law."""

    def rayleigh(self, mu):
        return mu.alpha, mu.beta

    def coupling(self, mu):
        return {name: value * mu.inertia ** (int(name[1]) / 2) for name, value in self._parts[mu.law].items()}


class Chain(PointFamily):
    """Masses on springs, with a coupling that feeds motion where it is dense enough, and one inner unknown."""

    def __init__(self, max_frequency=None):
        self.max_frequency = max_frequency
        main = np.linspace(2.0, 3.0, SIZE)
        self.mass = sp.identity(SIZE, format="csr")
        self.stiffness = (1e4 * sp.diags([main, -np.ones(SIZE - 1), -np.ones(SIZE - 1)], [0, 1, -1])).tocsr()
        self.damping = self.stiffness
        patterns = np.array([np.sin((k + 1) * np.pi * np.arange(1, SIZE + 1) / (SIZE + 1)) for k in range(3)])
        self.slope = sp.csr_matrix(patterns)
        self.forces = sp.csr_matrix(patterns.T)
        zero = {"A": (3, 3), "B": (3, 1), "R": (1, 3), "S": (1, 1)}
        parts = {name: np.zeros(zero[name[0]]) for name in FLUID_PARTS}
        parts |= {"A1": 0.1 * np.diag([1.0, 0.5, 0.2]), "B0": np.full((3, 1), 0.3), "S0": np.ones((1, 1))}
        parts |= {"R0": np.array([[0.1, 0.0, 0.2]]), "S1": 0.01 * np.ones((1, 1))}
        self._parts = {0.0: parts, 1.0: parts | {"A2": -0.02 * np.eye(3)}}

    def search(self, condition):
        band = self.max_frequency if self.max_frequency or condition.beta else 40.0
        return SearchOptions(max_frequency=band, limit_point=-1 / condition.beta if condition.beta else None)


def dense(family, condition):
    values = la.eigvals(*family.at(condition).first_order())
    return values[np.isfinite(values)]


def conditions(alpha, beta, law):
    return [Point(inertia, alpha, beta, law) for inertia in np.geomspace(0.01, 100, 7)]


@pytest.mark.parametrize(
    "alpha, beta, law", [(0.0, 2e-4, 0.0), (0.0, 2e-4, 1.0), (1.0, 1e-5, 0.0), (0.5, 0.0, 1.0), (0.0, 0.0, 0.0)]
)
def test_cells_agree_with_dense_eigenvalues(alpha, beta, law):
    family = Chain()
    column = ColumnSolver().solve(family, conditions(alpha, beta, law))
    assert column.certified.all()
    for i, condition in enumerate(conditions(alpha, beta, law)):
        values = dense(family, condition)
        certificate = column.cells[i].certificate
        inside = values[np.abs(values.imag) <= 2 * np.pi * certificate.band]
        assert certificate.unstable == certificate.counted == np.sum(inside.real > certificate.line)
        leading = family.reach(condition).leading(values)[0]
        assert column.leading[i].real == pytest.approx(leading.real, abs=1e-6 * abs(leading))
    assert set(column.unstable > 0) == {True, False} or beta == 0


def test_errors_are_relative_however_slow_a_family_is():
    """The chain with time in units of 1e-6."""
    slow, unit = Chain(), 1e6
    slow.mass = slow.mass * unit**2
    points = conditions(0.0, 2e-4, 0.0)
    columns = [
        ColumnSolver().solve(Chain(), points),
        ColumnSolver().solve(slow, [Point(p.inertia * unit**2, 0.0, p.beta * unit, p.law) for p in points]),
    ]
    assert columns[1].model.error == pytest.approx(columns[0].model.error, rel=0.1)
    assert columns[1].leading * unit == pytest.approx(columns[0].leading, rel=1e-5)


def test_a_band_that_is_asked_for_ends_list_and_count():
    condition = Point(100.0, 0.0, 2e-4, 0.0)
    whole, part = (ColumnSolver().solve(Chain(band), [condition] * 3) for band in (None, 20.0))
    bands = [column.cells[0].certificate.band for column in (whole, part)]
    assert np.isinf(bands[0]) and bands[1] == pytest.approx(20.0, rel=2e-3)
    assert part.leading[0].imag <= 40 * np.pi and part.certified.all()


@pytest.mark.parametrize(
    ("density", "law", "band", "unstable", "left_open"),
    [(30.0, 1.0, 1.3, 0, True), (30.0, 1.0, 2.0, 2, False), (30.0, 1.0, None, 6, False), (0.01, 0.0, 6.0, 0, False)],
)
def test_a_cell_beside_is_left_open_where_modes_grow_above_its_band(density, law, band, unstable, left_open):
    """Three modes grow, at 1.6, 2.5 and 3.2 Hz; of a thin fluid none."""
    condition = Point(density, 1.0 if law == 0.0 else 0.0, 2e-4, law)
    beside = FamilyReduction(Chain(band)).beside(Chain(band), np.eye(SIZE), condition)
    cell = cell_beside(beside, condition, 0.0, 5.0)
    assert cell.certificate.unstable == cell.certificate.counted == unstable and cell.open_above == left_open


def test_a_cell_and_a_mode_list_carry_one_certificate():
    family, condition = Chain(), Point(100.0, 0.0, 2e-4, 0.0)
    cell = ColumnSolver().solve(family, [condition] * 3).cells[1].certificate
    modes = certified_spectrum(family.at(condition), 6, family.search(condition)).certificate
    assert type(cell) is type(modes) is Certificate
    assert (cell.unstable, cell.counted, cell.stable) == (modes.unstable, modes.counted, modes.stable)


def test_without_agreement_there_is_no_verdict():
    assert Certificate(0, 2, True).stable is None and Certificate(0, 0, False).stable is None
    assert Certificate(0, 0, True).stable is True and Certificate(2, 2, True).stable is False


def test_correction_is_that_of_newton_on_the_full_pencil():
    family, condition = Chain(), Point(3.0, 0.0, 2e-4, 1.0)
    reduction = FamilyReduction(family)
    pairs = reduction.coarse.pairs(condition, 2)
    better = pairs.values + reduction.correction(pairs, condition)
    values = dense(family, condition)
    for before, after in zip(pairs.values, better):
        exact = values[np.argmin(np.abs(values - after))]
        assert abs(after - exact) <= max(0.2 * abs(before - exact), 1e-9 * abs(exact))


def test_further_cells_of_a_column_are_certified_too():
    family, condition = Chain(), Point(5.0, 0.0, 2e-4, 0.0)
    more = ColumnSolver().solve(family, conditions(0.0, 2e-4, 0.0)).model.cell(condition)
    assert more.certificate.agrees and more.how in (REDUCED, DIRECT)
    exact = family.reach(condition).leading(dense(family, condition))[0]
    assert more.leading[0] == pytest.approx(exact, rel=1e-6)


def test_counts_need_no_damping_at_all():
    family = Chain()
    reduced = FamilyReduction(family).wide
    counts = [reduced.count(mu) for mu in conditions(0.0, 0.0, 0.0)]
    assert all(count.line > 0 and count.certain for count in counts)


def test_corrected_eigenvalues_are_sorted_by_growth_rate():
    """Corrections of 5e-4 of the size exchange the first two."""
    change = np.array([-0.05, 0.05])
    reduction = SimpleNamespace(slow=0.0)
    model = SimpleNamespace(error=0.0, corrected=lambda point, values: change, reduction=reduction)
    (found,), trusted = _corrected(model, [None], [np.array([-1.0 + 100j, -1.01 + 101j])])
    assert trusted.all() and found == pytest.approx([-0.96 + 101j, -1.05 + 100j])
