"""Largest eigenpairs by blocks against dense ones."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import eigen.basis
from eigen import NotConvergedError, NotPositiveError, largest_pairs


def problem(n: int, values, seed: int = 0):
    """A = K X diag(values) X' K with X' K X = 1, for a full K."""
    rng = np.random.default_rng(seed)
    k = rng.standard_normal((n, n))
    k = k @ k.T + n * np.eye(n)
    x = rng.standard_normal((n, n))
    x = la.solve_triangular(la.cholesky(x.T @ k @ x, lower=True), x.T, lower=True).T
    values = np.concatenate([values, np.zeros(n - len(values))])
    a = k @ (x * values) @ x.T @ k
    return 0.5 * (a + a.T), k


def found(a, k, count, block, tolerance=1e-8, **start):
    first = a @ np.random.default_rng(start.get("seed", 1)).standard_normal((len(a), block))
    return largest_pairs(lambda x: a @ x, k, lambda x: np.linalg.solve(k, x), first, count, tolerance)


@pytest.mark.parametrize("block", [1, 3, 8])
def test_pairs_are_those_of_a_dense_solver(block):
    a, k = problem(60, 1.0 / np.arange(1, 61) ** 2)
    pairs = found(a, k, 7, block)
    np.testing.assert_allclose(pairs.values, la.eigh(a, k, eigvals_only=True)[::-1][:7], rtol=1e-12)
    np.testing.assert_allclose(pairs.vectors.T @ k @ pairs.vectors, np.eye(7), atol=1e-10)
    np.testing.assert_allclose(pairs.images, a @ pairs.vectors, atol=1e-10 * np.abs(a).max())
    missed = pairs.images - k @ pairs.vectors * pairs.values
    length = np.sqrt(np.einsum("ij,ij->j", missed, np.linalg.solve(k, missed)))
    assert np.all(length <= 2e-8 * pairs.values)


def test_the_tolerance_is_what_residuals_have():
    a, k = problem(80, 1.0 / np.arange(1, 81))
    for tolerance in (1e-2, 1e-4, 1e-6):
        pairs = found(a, k, 5, 4, tolerance)
        missed = pairs.images - k @ pairs.vectors * pairs.values
        length = np.sqrt(np.einsum("ij,ij->j", missed, np.linalg.solve(k, missed))) / pairs.values
        assert length.max() <= tolerance * (1 + 1e-6) and length.max() > 1e-4 * tolerance


def test_an_eigenvalue_as_often_as_the_block_is_wide():
    a, k = problem(40, [5.0, 5.0, 5.0, 2.0, 1.0, 0.5, 0.25])
    np.testing.assert_allclose(found(a, k, 5, 3).values, [5.0, 5.0, 5.0, 2.0, 1.0], rtol=1e-10)


def test_a_range_that_holds_fewer_ends_the_search():
    a, k = problem(30, [4.0, 3.0, 2.0, 1.0])
    np.testing.assert_allclose(found(a, k, 9, 3).values, [4.0, 3.0, 2.0, 1.0], rtol=1e-10)


def test_what_is_not_positive_or_does_not_converge_is_told(monkeypatch):
    a, k = problem(30, 1.0 / np.arange(1, 31))
    values, vectors = la.eigh(k)
    values[-2:] *= -1.0
    with pytest.raises(NotPositiveError):
        found(a, (vectors * values) @ vectors.T, 4, 4)
    monkeypatch.setattr(eigen.basis, "MOST_BLOCKS", 2)
    with pytest.raises(NotConvergedError, match="Fewer than 6 eigenpairs converged in a Krylov space of 6 vectors"):
        found(a, k, 6, 3)
