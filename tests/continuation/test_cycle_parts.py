"""What makes branches of cycles quick: products with matrices at samples, rough projections, predictions, exponents."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from continuation import blocks, hill
from continuation.blocks import BlockRows, SparseBlocks
from continuation.cycle_linearisation import LeftProjection
from continuation.cycle_points import (
    DOUBLING,
    FOLD,
    TORUS,
    change_between,
    exponent_that_crosses,
    parameter_predicts_better,
    predict_by_arclength,
    predict_by_parameter,
)
from continuation.cycles import CycleSolver
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion, PeriodicOperator, Term
from tests.systems import periodic

RNG = np.random.default_rng(5)
SERIES = Harmonics(3)
SIZE = 30
PATTERN = sp.random(SIZE, SIZE, 0.2, "csr", random_state=1)


def rows_of(rank: int = 3) -> np.ndarray:
    """Values at each sample, smooth in the phase, on a pattern a part of which is empty."""
    values = SERIES.basis[:, :rank] @ RNG.standard_normal((rank, PATTERN.nnz))
    values[:, ::4] = 0.0
    return values


def dense_of(values: np.ndarray) -> list[np.ndarray]:
    return [sp.csr_matrix((row, PATTERN.indices, PATTERN.indptr), shape=PATTERN.shape).toarray() for row in values]


def blocks_of(values: np.ndarray) -> SparseBlocks:
    rows = BlockRows(len(values))
    for row in values:
        rows.put(row)
    assert np.allclose(rows.mean, values.mean(axis=0))
    return SparseBlocks(rows, PATTERN.indices, PATTERN.indptr, PATTERN.shape)


def operator_of() -> PeriodicOperator:
    """With a term through few numbers, as a flow has it, and an outer filter."""
    motion = PeriodicMotion(SERIES, np.zeros((SERIES.size, SIZE)), 3.0)
    left, right = RNG.standard_normal((SERIES.samples, SIZE, 2)), RNG.standard_normal((SERIES.samples, 2, SIZE))
    terms = [
        Term([(0, blocks_of(rows_of()))], outer=1),
        Term([(0, blocks_of(rows_of())), (2, blocks_of(rows_of()))]),
        Term([(1, RNG.standard_normal((SERIES.samples, 2, 2)))], list(left), list(right)),
    ]
    return PeriodicOperator(motion, terms)


@pytest.mark.parametrize(("single", "error"), [(float, 1e-12), (np.float32, 2e-6)])
@pytest.mark.parametrize("rank", [1, 3, 6])
def test_products_are_those_of_each_matrix(monkeypatch, single, error, rank):
    """Where an entry is zero at the first samples only, too; sums of one, few and more matrices."""
    monkeypatch.setattr(blocks, "SINGLE", single)
    values = rows_of(rank)
    values[0, 1:9] = 0.0
    values[1, 5:9] = 0.0
    found, dense = blocks_of(values), dense_of(values)
    assert found.values.shape[1] == np.count_nonzero(values.any(axis=0)) < PATTERN.nnz
    for shape in ((SIZE,), (SIZE, 3)):
        x = RNG.standard_normal((SERIES.samples, *shape)) + 1j * RNG.standard_normal((SERIES.samples, *shape))
        for samples in (x.real, x):
            exact = np.stack([a @ one for a, one in zip(dense, samples)])
            assert np.abs(found.times(samples) - exact).max() < error * np.abs(exact).max()


def test_values_at_fewer_phases_serve_all_samples():
    """A motion's linearisation is of few harmonics: at seven phases those of three are whole."""
    few, basis = Harmonics(3, 7), RNG.standard_normal((SIZE, 4))
    coefficients = RNG.standard_normal((few.size, PATTERN.nnz))
    many = Harmonics(3, 15)
    pattern = PATTERN.indices, PATTERN.indptr, PATTERN.shape
    spread = many.basis @ few.basis.T / few.samples
    found = SparseBlocks(few.basis @ coefficients, *pattern, spread=spread)
    exact = SparseBlocks(many.basis @ coefficients, *pattern)
    assert len(found) == len(exact) == 15
    assert np.allclose(found.projected(basis).stack, exact.projected(basis).stack)


def test_several_changes_at_once_are_as_each():
    operator, shifts = operator_of(), [0.4, -0.1 + 2j]
    vectors = [RNG.standard_normal((SERIES.size, SIZE)) + 1j * k for k in range(2)]
    for found, vector, shift in zip(operator.apply_each(vectors, shifts), vectors, shifts):
        assert np.allclose(found, operator.apply(vector, shift))


def test_rough_projections(monkeypatch):
    """In single precision where nothing is left out, and by as much as is left out; those of a basis that grew too."""
    x, basis = RNG.standard_normal((SERIES.size, SIZE)), RNG.standard_normal((SIZE, 5))

    def found_and_exact(operator):
        few = operator.reduced(basis[:, :3], rough=True)
        found = LeftProjection(operator, operator.reduced(basis, few, rough=True)).apply(x)
        return found, operator.apply(x) @ basis

    monkeypatch.setattr(blocks, "ROUGH", 0.0)
    found, exact = found_and_exact(operator_of())
    assert np.allclose(found, exact, rtol=0, atol=1e-5 * np.abs(exact).max())
    monkeypatch.setattr(blocks, "ROUGH", 1.0)  # one combination each
    found, exact = found_and_exact(operator_of())
    assert np.abs(found - exact).max() > 0.05 * np.abs(exact).max()


def point_of(value: float, coefficients: np.ndarray, omega: float, arclength: float):
    motion = PeriodicMotion(SERIES, coefficients, omega)
    return SimpleNamespace(value=value, motion=motion, arclength=arclength)


def beside_onset(value: float):
    """A supercritical branch from 1 downwards: odd harmonics with a root, all else without."""
    x = 1.0 - value
    c = np.zeros((SERIES.size, 2))
    c[0], c[3] = [1.0 + x, 2.0 - x**2], [0.3 * x, -0.1 * x]
    c[1], c[5] = np.sqrt(x) * np.array([1.0, 0.5]), np.sqrt(x) * np.array([0.1, 0.05])
    return point_of(value, c, 3.0 - 0.2 * x, np.sqrt(x))


def test_predictions_beside_an_onset_are_exact():
    points, there = [beside_onset(v) for v in (0.99, 0.95, 0.8)], beside_onset(0.5)
    found = predict_by_parameter(points, 0.5, SERIES, np.ones(2))
    assert np.allclose(found.coefficients, there.motion.coefficients, atol=1e-12)
    assert np.isclose(found.omega, there.motion.omega)
    assert parameter_predicts_better(points, np.ones(2))
    assert predict_by_parameter(points, 0.9, SERIES, np.ones(2)) is None  # behind the last


def test_predictions_beside_a_fold_go_by_arclength():
    """The parameter is a parabola of the way."""

    def folding(way):
        return point_of(1.0 - way**2, np.outer(np.arange(SERIES.size), [1.0, way]), 2.0 + way, way)

    points = [folding(way) for way in (-0.9, -0.6, -0.35, -0.15, -0.05)]
    assert not parameter_predicts_better(points, np.ones(2))
    found = predict_by_arclength(points[-3:], 0.1, SERIES)
    assert np.allclose(found.coefficients, folding(0.1).motion.coefficients)


def exponents_of(*values: complex):
    """At the frequency 2 rad/s."""
    return hill.Exponents(np.array(values, complex), [], np.zeros(len(values)), 1e-9, 2.0)


@pytest.mark.parametrize(
    ("before", "after", "kind", "crossing"),
    [
        ((-0.1, -3 + 1j), (2 + 1j, -0.1), DOUBLING, (-0.1, 2 + 1j)),
        ((-0.1 + 0.6j, -3 + 1j), (2 + 1j, -0.1 + 0.6j), DOUBLING, (-0.1 + 0.6j, 2 + 1j)),
        ((-0.1, -3 + 0.6j), (2 + 0.6j, -0.1), TORUS, (-0.1, 2 + 0.6j)),
        ((3, -1 + 0.8j), (-1 + 0.8j, -4), FOLD, (3, -1 + 0.8j)),
        ((0.4, -0.2 + 0.6j), (2 + 0.6j, 0.5), TORUS, (-0.2 + 0.6j, 2 + 0.6j)),
        ((0.02 + 0.6j, -0.01 + 1j, -0.2), (0.03 + 0.6j, 0.01 + 1j, -0.19), DOUBLING, (-0.01 + 1j, 0.01 + 1j)),
        ((0.03 + 0.4j, -0.1 + 0.6j), (0.02 + 0.4j, 0.01 + 0.6j), TORUS, (-0.1 + 0.6j, 0.01 + 0.6j)),
        ((0.5 + 0.6j, -0.2), (0.3, -0.1), FOLD, (0.5 + 0.6j, -0.1)),  # a pair became real, and one of both went back
    ],
)
def test_the_exponent_that_crosses_is_not_a_slow_one_beside_it(before, after, kind, crossing):
    before, after = exponents_of(*before), exponents_of(*after)
    points = [SimpleNamespace(exponents=e) for e in (before, after)]
    for ends in ((before, after), (after, before)):
        exponent = exponent_that_crosses(*ends)
        assert change_between(*ends) == kind and [exponent(p) for p in points] == list(crossing)


def test_eigenvalues_in_the_circle_are_all_found():
    """Against all those of the companion matrix, and with the few steps after which not all of them are there."""
    size = 120
    parts = [RNG.standard_normal((size, size)) / 10 for _ in range(2)] + [np.eye(size)]
    whole = la.eigvals(np.block([[np.zeros((size, size)), np.eye(size)], [-parts[0], -parts[1]]]))
    radii = []
    for pairs, radius, _ in hill._nearest(parts, 0.3):
        found = np.array([sigma for sigma, _ in pairs])
        inside = whole[np.abs(whole - 0.3) < 0.999 * radius]
        assert len(inside) and all(np.abs(found - sigma).min() < 1e-6 for sigma in inside)
        radii.append(radius)
    assert len(radii) > 1 and radii[-1] > radii[0]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_corrections_leave_less_than_their_tolerance(tolerance):
    system = periodic.van_der_pol()
    guess = PeriodicMotion.of_samples(1.9 * np.cos(2 * np.pi * np.arange(64) / 64)[:, None], 9, 1.0)
    found, exact = (CycleSolver(system, system.basis, t).solve(guess, {"mu": 0.5}) for t in (tolerance, 1e-12))
    change = np.abs(found.motion.coefficients - exact.motion.coefficients).max()
    assert change <= tolerance * np.abs(exact.motion.coefficients[1:]).max()
    assert found.iterations < exact.iterations
