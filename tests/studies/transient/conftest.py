"""Small valves in motion."""

import pytest

from tests.small_valves import make_valve


@pytest.fixture
def valve():
    """`valve({"fluid.density": 10})`: a coarse model with some keys changed."""
    return make_valve
