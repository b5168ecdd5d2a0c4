"""One-degree valve, exact: Hopf point B = k + c r - m k r/(c + m r), omega^2 = k r/(c + m r)."""

import numpy as np
import pytest

from eigen import certified_spectrum, leading_modes
from tests.systems.one_degree_valve_pencil import one_degree_valve
from tests.verification.critical import hopf


def test_eigenvalues_are_the_roots_of_the_cubic():
    B, r, m, c, k = 0.7, 0.5, 1.3, 0.2, 2.0
    roots = np.roots([m, c + m * r, k + c * r - B, k * r])
    found = leading_modes(one_degree_valve(B, r, m, c, k), 3).eigenvalues
    for root in roots[roots.imag >= 0]:
        assert np.abs(found - root).min() < 1e-13


def test_hopf_point():
    found, omega = hopf(lambda B: one_degree_valve(B, 0.5), 0.1, 0.4)
    assert found == pytest.approx(13 / 60, abs=1e-9)  # 0.216667
    assert omega == pytest.approx(np.sqrt(0.5 / 0.6), abs=1e-9)  # 0.912871


@pytest.mark.parametrize("B, unstable", [(0.2, 0), (0.23, 2), (-0.5, 0), (-5.0, 0)])
def test_counts_agree_and_the_opening_type_is_always_stable(B, unstable):
    result = certified_spectrum(one_degree_valve(B, 0.5), 2)
    assert result.agrees and result.unstable_count == unstable
