"""Small valves in motion."""

import numpy as np
import pytest

from tests.small_valves import find_open_state, make_valve


@pytest.fixture
def valve():
    """`valve({"fluid.density": 10})`: a coarse model with some keys changed."""
    return make_valve


@pytest.fixture
def open_state():
    """A strongly deformed equilibrium of the coarse mesh, whose unknowns do not depend on fluid or damping."""
    return np.array(find_open_state())
