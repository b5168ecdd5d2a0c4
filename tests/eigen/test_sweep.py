"""Sweeps on a structural basis against full solves."""

import numpy as np
import pytest

from eigen import SearchOptions, TransferBasis, leading_modes, sweep
from tests.systems.plate_over_channel import plate_over_channel


@pytest.fixture(scope="module")
def state():
    return plate_over_channel(6, 15, with_parts=True)


def over_density(base, storage=False):
    def pencil(density):
        other = plate_over_channel(6, 15, density=density, storage=storage)
        return other.replace(M=base.M, C=base.C, K=base.K, G=base.G, J=base.J)

    return pencil


@pytest.mark.parametrize("storage", [False, True])
def test_density_sweep(state, storage):
    base, _ = state
    pencil_at = over_density(base, storage)
    values = np.geomspace(1e-3, 2e4, 15)
    search = SearchOptions(max_frequency=40.0)
    result = sweep(pencil_at, values, 3, search)
    assert result.certified, result.notes
    assert result.full_solves <= 8
    assert max(error for _, error in result.checks[-1:]) < 1e-6
    for k in (2, 7, 12):  # places that were not all check points
        full = leading_modes(pencil_at(values[k]), 3, search)
        for value in full.eigenvalues:
            assert np.abs(result.eigenvalues[k] - value).min() < 1e-5 * abs(value)


def test_damping_sweep(state):
    base, stiffness = state
    cases = [(0.0, 3e-3), (5.0, 1e-3), (20.0, 1e-4), (0.0, 0.0)]

    def damping(index):
        return cases[int(index)]

    def pencil(index):
        alpha, beta = damping(index)
        return base.replace(C=(alpha * base.M + beta * stiffness).tocsr())

    result = sweep(
        pencil, range(4), 3, SearchOptions(max_frequency=30.0), damping_at=damping, stiffness=stiffness, checks=4
    )
    assert result.certified, result.notes
    assert max(error for _, error in result.checks) < 1e-6


def test_a_poor_basis_is_enlarged(state):
    base, _ = state
    basis = TransferBasis(base, modes=2, compression=0.3)
    before = basis.size
    result = sweep(over_density(base), np.geomspace(1, 100, 6), 2, SearchOptions(max_frequency=40.0), basis=basis)
    assert result.basis_size > before
    assert result.checks[0][1] > result.tolerance
    assert result.certified or result.notes


def test_a_sweep_that_cannot_be_certified_says_so(state):
    base, _ = state
    result = sweep(
        over_density(base), np.geomspace(1, 100, 6), 2, SearchOptions(max_frequency=40.0), tolerance=1e-18, max_solves=2
    )
    assert not result.certified and "missed the tolerance" in result.notes[0]


def test_basis_is_orthonormal_in_the_mass(state):
    base, _ = state
    basis = TransferBasis(base)
    assert np.allclose(basis.V.T @ (base.M @ basis.V), np.eye(basis.size), atol=1e-9)
    modes = leading_modes(base, 3, SearchOptions(max_frequency=40.0))
    reduced = leading_modes(basis.reduced(base), 3, SearchOptions(max_frequency=40.0, method="dense"))
    assert np.allclose(modes.eigenvalues, reduced.eigenvalues, rtol=1e-7)
    lifted = basis.lift(reduced.q)
    for i in range(3):
        overlap = np.vdot(modes.q[:, i], lifted[:, i]) / np.linalg.norm(lifted[:, i])
        assert abs(overlap) == pytest.approx(1.0, abs=1e-8)
