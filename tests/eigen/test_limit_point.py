"""Leading modes where stiffness-proportional damping makes real eigenvalues accumulate."""

import numpy as np
import pytest
import scipy.sparse as sp

from eigen import CoupledPencil, SearchOptions, leading_modes

BETA = 0.01


def chain(n=400, damping=BETA):
    """A chain of masses with damping proportional to stiffness; eigenvalues in closed form, ascending if all swing."""
    M = sp.identity(n, format="csr")
    K = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1], format="csr") * 4e5
    square = 4e5 * 4 * np.sin(0.5 * np.pi * np.arange(1, n + 1) / (n + 1)) ** 2
    root = np.sqrt((0.5 * damping * square) ** 2 - square + 0j)
    values = np.concatenate([-0.5 * damping * square + root, -0.5 * damping * square - root])
    return CoupledPencil(M, damping * K, K), values[values.imag >= 0]


def test_modes_right_of_the_limit_are_all_found():
    pencil, values = chain()
    found = leading_modes(pencil, 60, SearchOptions(limit_point=-1 / BETA, method="krylov"))
    exact = values[values.real > -0.8 / BETA]
    exact = exact[np.lexsort((exact.imag, -exact.real))]
    assert found.status == "complete"
    assert len(found) == len(exact) < 60
    np.testing.assert_allclose(found.eigenvalues, exact, rtol=1e-9)
    assert any("accumulate" in note for note in found.notes)


def test_the_same_modes_without_the_hint():
    pencil, _ = chain()
    with_hint = leading_modes(pencil, 6, SearchOptions(limit_point=-1 / BETA, method="krylov"))
    without = leading_modes(pencil, 6, SearchOptions(method="krylov"))
    np.testing.assert_allclose(with_hint.eigenvalues, without.eigenvalues, rtol=1e-8)


def test_a_far_limit_point_changes_nothing():
    pencil, _ = chain()
    a = leading_modes(pencil, 5, SearchOptions(limit_point=-1e7, method="krylov"))
    b = leading_modes(pencil, 5, SearchOptions(method="krylov"))
    assert a.shifts == b.shifts
    np.testing.assert_allclose(a.eigenvalues, b.eigenvalues, rtol=1e-12)


@pytest.mark.parametrize("value", [0.0, 10.0, float("nan"), -float("inf")])
def test_a_limit_point_must_be_a_negative_number(value):
    with pytest.raises(ValueError, match="limit_point"):
        SearchOptions(limit_point=value)
