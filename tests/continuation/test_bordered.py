"""Bordered solves stay accurate where plain block elimination does not."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from continuation import linear
from continuation.linear import Bordered, DenseSolver, bordered, factorise
from continuation.options import SingularSystem


def singular(rng, n, smallest=0.0, complex_numbers=False):
    """A matrix with one singular value ``smallest``, with its last singular vectors."""

    def square():
        a = rng.standard_normal((n, n))
        return a + 1j * rng.standard_normal((n, n)) if complex_numbers else a

    u, _ = np.linalg.qr(square())
    v, _ = np.linalg.qr(square())
    values = np.append(np.linspace(1.0, 3.0, n - 1), smallest)
    return (u * values) @ v.conj().T


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 1e-17, 1e-14, 1e-9, 1e-3]), st.booleans())
def test_solution_is_accurate_however_singular_the_block(seed, smallest, complex_numbers):
    rng = np.random.default_rng(seed)
    n = 12
    a = singular(rng, n, smallest, complex_numbers)
    b, c = rng.standard_normal(n), rng.standard_normal(n)
    full = np.block([[a, b[:, None]], [c[None, :], np.array([[0.3]])]])
    # Random borders can come out nearly dependent; such draws test nothing.
    condition = np.linalg.cond(full)
    x = rng.standard_normal(n + 1)
    border = Bordered(factorise(a), b, c, 0.3)
    # A solve is as good as a backward stable one of the full matrix, give or take 100.
    bound = 1e2 * condition * np.finfo(float).eps
    assert np.linalg.norm(border.solve(full @ x) - x) <= bound * np.linalg.norm(x)
    assert np.linalg.norm(border.solve_transpose(full.T @ x) - x) <= bound * np.linalg.norm(x)


def test_plain_block_elimination_would_fail_here(monkeypatch):
    """The case for the mixed scheme: one pass loses most digits, this keeps them."""
    rng = np.random.default_rng(3)
    n = 12
    a = singular(rng, n, 1e-15)
    b, c = rng.standard_normal(n), rng.standard_normal(n)
    full = np.block([[a, b[:, None]], [c[None, :], np.zeros((1, 1))]])
    x = rng.standard_normal(n + 1)
    f = full @ x
    inner = DenseSolver(a)
    v, z = inner.solve(b), inner.solve(f[:-1])
    y = (f[-1] - c @ z) / (0.0 - c @ v)
    plain = np.append(z - v * y, y)
    monkeypatch.setattr(linear, "REFINEMENTS", 0)
    mixed = Bordered(inner, b, c, 0.0).solve(f)
    assert np.linalg.norm(plain - x) > 1e-4
    assert np.linalg.norm(mixed - x) < 1e-11


@pytest.mark.parametrize("sparse", [False, True])
def test_exactly_singular_matrix_with_zero_row(sparse):
    a = np.diag([1.0, 2.0, 0.0])
    matrix = sp.csc_matrix(a) if sparse else a
    e = np.array([0.0, 0.0, 1.0])
    border = Bordered(factorise(matrix), e, e)
    assert factorise(matrix).repaired
    assert np.allclose(border.solve(np.array([1.0, 2.0, 3.0, 4.0])), [1.0, 1.0, 4.0, 3.0], rtol=0, atol=1e-13)


def test_zero_matrix_of_order_one():
    border = Bordered(factorise(np.zeros((1, 1))), np.ones(1), np.ones(1))
    assert np.allclose(border.solve(np.array([2.0, 5.0])), [5.0, 2.0], rtol=0, atol=1e-13)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_nested_borders_equal_the_dense_matrix(k):
    rng = np.random.default_rng(k)
    n = 9
    a = singular(rng, n, 0.0)
    columns = [rng.standard_normal(n) for _ in range(k)]
    rows = rng.standard_normal((k, n + k))
    full = np.vstack([np.hstack([a, np.stack(columns, axis=1)]), rows])
    solver = bordered(factorise(a), columns, rows)
    x = rng.standard_normal(n + k)
    assert np.allclose(solver.matvec(x), full @ x, rtol=0, atol=1e-13)
    assert np.allclose(solver.rmatvec(x), full.T @ x, rtol=0, atol=1e-13)
    bound = 1e3 * np.linalg.cond(full) * np.finfo(float).eps
    assert np.linalg.norm(solver.solve(full @ x) - x) < bound
    assert np.linalg.norm(solver.solve_transpose(full.T @ x) - x) < bound


def test_regular_block_with_singular_border_is_refused():
    with pytest.raises(SingularSystem, match="border does not lift"):
        Bordered(factorise(np.eye(2)), np.zeros(2), np.zeros(2), 0.0)
