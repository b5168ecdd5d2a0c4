"""Beck's and Leipholz's columns: flutter loads and frequencies from converged series.

Reference values: P = 20.05095 EI/L^2 at omega = 11.01556, q = 40.05374 EI/L^3 at 11.03022
(units sqrt(EI/(m L^4))). The tolerances are half a unit of the last printed digit.
"""

import numpy as np
import pytest

from eigen import SearchOptions, certified_spectrum, leading_modes
from tests.systems.beam import beck_column, leipholz_column
from tests.verification.critical import coalescence


@pytest.mark.parametrize(
    "column, load, frequency, tolerance",
    [(beck_column, 20.05095, 11.01556, 5e-6), (leipholz_column, 40.05374, 11.03022, 5e-6)],
)
def test_flutter_load_and_frequency(column, load, frequency, tolerance):
    found, omega = coalescence(column, 0.98 * load, 1.02 * load)
    assert found == pytest.approx(load, abs=tolerance)
    assert omega == pytest.approx(frequency, abs=tolerance)


@pytest.mark.parametrize("load, unstable", [(10.0, 0), (12.0, 2), (21.0, 2)])
def test_both_counts_agree_on_either_side_of_the_flutter_load(load, unstable):
    # vanishing Kelvin-Voigt damping lowers the threshold to 10.94 (Bolotin & Zhinzher 1969)
    result = certified_spectrum(beck_column(load, elements=20, damping=1e-4), 4, SearchOptions(max_frequency=30.0))
    assert result.agrees, result.statement
    assert result.unstable_count == result.unstable_count_independent == unstable


def test_flutter_load_converges_with_the_mesh():
    errors = []
    for elements in (4, 8):
        found, _ = coalescence(lambda p: beck_column(p, elements), 19.5, 20.5)
        errors.append(abs(found - 20.0509536))
    # cubic Hermite elements: eigenvalues of order h^4
    assert 3.5 < np.log2(errors[0] / errors[1]) < 4.5


def test_undamped_column_below_its_load_has_no_growth():
    modes = leading_modes(beck_column(15.0), 3, SearchOptions(max_frequency=30.0))
    assert np.abs(modes.growth_rate).max() < 1e-6
