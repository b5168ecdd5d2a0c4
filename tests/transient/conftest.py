"""Small valves in motion."""

from functools import cache

import numpy as np
import pytest

import dbvfiv
from dbvfiv.model import ValveModel


@cache
def small_model(*changes):
    case = dbvfiv.load().case.replace({"mesh.around": 6, "mesh.along": 8} | dict(changes))
    return ValveModel(case)


@pytest.fixture
def valve():
    """`valve({"fluid.density": 10})`: a coarse model with some keys changed."""
    return lambda changes={}: small_model(
        *sorted((k, tuple(v) if isinstance(v, list) else v) for k, v in changes.items())
    )


@pytest.fixture
def open_state():
    """A strongly deformed equilibrium of the coarse mesh, whose unknowns do not depend on fluid or damping."""
    from dbvfiv.transient.start import steady_positions

    return np.array(_open_state(steady_positions))


@cache
def _open_state(find):
    return find(small_model(), 12e3)
