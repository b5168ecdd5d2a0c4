"""Elastic wall of a channel with one-dimensional ideal unsteady flow (storage continuity).

Reference: Galerkin and exact transfer matrix, agreeing to six digits. mu = 1, U = 1, wall
clamped at the inlet, free at the outlet.
"""

import numpy as np
import pytest

from eigen import SearchOptions, certified_spectrum, leading_modes
from tests.systems.channel_wall import channel_wall, channel_wall_elements
from tests.verification.critical import hopf

TABLE = {
    "flux": [-0.281023 + 3.41853j, -0.051484 + 20.384345j, -0.017775 + 59.920286j],
    "head": [-1.00860 + 0j, -0.149102 + 3.483726j, -0.002491 + 21.415047j],
}
DIGITS = {"flux": [5e-6, 1e-6, 1e-6], "head": [5e-6, 1e-6, 1e-6]}  # as printed


def lowest(pencil, count, band=12.0):
    modes = leading_modes(pencil, pencil.n + 2, SearchOptions(max_frequency=band, method="dense"))
    return modes.eigenvalues[np.argsort(np.abs(modes.eigenvalues))][:count]


@pytest.mark.parametrize("inlet", ["flux", "head"])
def test_table_to_the_printed_digits(inlet):
    found = lowest(channel_wall(1.0, 1.0, inlet), 3)
    for value, expected, digit in zip(found, TABLE[inlet], DIGITS[inlet], strict=True):
        assert abs(value.real - expected.real) <= digit
        assert abs(value.imag - expected.imag) <= digit


@pytest.mark.parametrize("inlet", ["flux", "head"])
def test_finite_elements_converge_to_the_table_with_second_order(inlet):
    errors = [
        np.abs(
            lowest(channel_wall_elements(1.0, 1.0, inlet, elements=n), 3) - lowest(channel_wall(1.0, 1.0, inlet), 3)
        ).max()
        for n in (16, 32)
    ]
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2


@pytest.mark.slow
@pytest.mark.parametrize("inlet", ["flux", "head"])
def test_table_on_a_fine_grid_by_krylov_method(inlet):
    pencil = channel_wall_elements(1.0, 1.0, inlet, elements=320)
    modes = leading_modes(pencil, 4, SearchOptions(method="krylov", max_frequency=12.0))
    found = modes.eigenvalues[np.argsort(np.abs(modes.eigenvalues))]
    # the stiffest element is 1e14 times stiffer than the mode: there rounding sets the residual
    assert np.all((modes.residual < 1e-8) | (modes.backward_error < 2e-14))
    for value, expected in zip(found[:3], TABLE[inlet], strict=True):
        assert abs(value - expected) < 1e-4  # second order: 0.33 / 320^2 times 2


@pytest.mark.parametrize("inlet, velocity, omega", [("flux", 10.0563, 16.3257), ("head", 11.6925, 12.9595)])
def test_free_lip_flutters_with_kelvin_voigt_damping(inlet, velocity, omega):
    found, frequency = hopf(lambda u: channel_wall(u, 1.0, inlet, damping=0.01), 0.98 * velocity, 1.02 * velocity)
    assert found == pytest.approx(velocity, abs=5e-5)
    assert frequency == pytest.approx(omega, abs=5e-5)


@pytest.mark.parametrize("inlet", ["flux", "head"])
@pytest.mark.parametrize("velocity", [5.0, 11.0, 13.0])
def test_both_counts_agree(inlet, velocity):
    result = certified_spectrum(channel_wall(velocity, 1.0, inlet, damping=0.01), 4)
    assert result.agrees, result.statement
