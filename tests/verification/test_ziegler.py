"""Ziegler's pendulum: a little damping lowers the flutter load from 7/2 - sqrt 2 to 41/28.

Bolotin, Nonconservative Problems of the Theory of Elastic Stability, 1963: equal dampers.
"""

import numpy as np
import pytest

from eigen import certified_spectrum
from tests.systems.beam import ziegler_pendulum
from tests.verification.critical import coalescence, hopf


def test_undamped_flutter_load():
    found, _ = coalescence(ziegler_pendulum, 1.8, 2.4)
    assert found == pytest.approx(3.5 - np.sqrt(2), abs=1e-9)


def test_vanishing_damping_lowers_the_load():
    found, _ = hopf(lambda p: ziegler_pendulum(p, damping=1e-4), 1.2, 2.0)
    assert found == pytest.approx(41 / 28, abs=1e-6)


@pytest.mark.parametrize("load, damping, unstable", [(1.8, 1e-2, 2), (1.4, 1e-2, 0), (2.3, 1e-2, 2)])
def test_counts_agree_between_the_two_loads(load, damping, unstable):
    result = certified_spectrum(ziegler_pendulum(load, damping), 2)
    assert result.agrees and result.unstable_count == unstable
