"""Small valves in motion."""

import pytest

from dbvfiv.studies.transient import history
from tests.small_valves import make_valve


@pytest.fixture
def valve():
    """`valve({"fluid.density": 10})`: a coarse model with some keys changed."""
    return make_valve


@pytest.fixture
def all_restart_points(monkeypatch):
    """Keep every restart point, however large."""
    monkeypatch.setattr(history, "RESTART_SHARE", float("inf"))
