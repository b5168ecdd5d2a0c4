"""Least squares with unknowns that are not negative."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.materials import prony
from dbvfiv.materials.prony import nonnegative


@pytest.mark.parametrize("method", ["Lawson and Hanson", "Stark and Parker"])
def test_the_least_of_all(method, monkeypatch):
    """Conditions of Karush, Kuhn and Tucker: x >= 0, gradient >= 0, one of the two zero in each unknown."""
    if method == "Stark and Parker":

        def going_round(*_args, **_options):
            raise RuntimeError("Maximum number of iterations reached.")

        monkeypatch.setattr(prony, "nnls", going_round)
    random = np.random.default_rng(3)
    for rows, unknowns in ((6, 3), (40, 8), (5, 5)):
        matrix, target = random.standard_normal((rows, unknowns)), random.standard_normal(rows)
        found = nonnegative(matrix, target)
        gradient = matrix.T @ (matrix @ found - target)
        assert found.min() >= 0 and gradient.min() > -1e-9
        assert np.abs(found * gradient).max() < 1e-9
