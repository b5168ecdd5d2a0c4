"""Reduced basis of structural modes against full solves."""

import numpy as np
import pytest

from eigen import SearchOptions, TransferBasis, leading_modes
from eigen.certificate import response_error
from tests.eigen.test_relaxing_spectra import relaxing_plate
from tests.systems.plate_over_channel import plate_over_channel


@pytest.fixture(scope="module")
def state():
    return plate_over_channel(6, 15, with_parts=True)


def test_basis_is_orthonormal_in_the_mass(state):
    base, _ = state
    basis = TransferBasis(base)
    assert np.allclose(basis.V.T @ (base.M @ basis.V), np.eye(basis.size), atol=1e-9)
    modes = leading_modes(base, 3, SearchOptions(max_frequency=40.0))
    reduced = leading_modes(base.projected(basis.V), 3, SearchOptions(max_frequency=40.0, method="dense"))
    assert np.allclose(modes.eigenvalues, reduced.eigenvalues, rtol=1e-7)
    lifted = basis.V @ reduced.q
    for i in range(3):
        overlap = np.vdot(modes.q[:, i], lifted[:, i]) / np.linalg.norm(lifted[:, i])
        assert abs(overlap) == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("pencil", [plate_over_channel(8, 16), relaxing_plate(8, 16)], ids=["elastic", "viscoelastic"])
def test_a_reduced_operator_has_the_transfer_function(pencil):
    small = pencil.projected(TransferBasis(pencil).V)
    assert response_error(pencil, small, [5.0, 20.0, 60.0]) < 1e-6
