"""A ring under outside follower pressure buckles with n waves at (n^2 - 1) EI / R^3, in the class its waves belong to.

cos 2t is symmetric about both planes of the quarter, sin 2t antisymmetric about both; cos 3t and sin 3t are symmetric
about one of them. Motions of the whole ring are held by one more support each, which carries nothing.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model.load_steps import LoadSteps
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.studies.closure.buckling import BucklingWatch, spectrum_of
from tests.systems.pressed import class_matrices
from tests.verification.test_closure_buckling import EI, RADIUS, _options, _ring


def _free(model, signs, elements) -> np.ndarray:
    """Unknowns of a class of the ring, without strain along its axis; no rigid motion."""
    first, last = (np.arange(model.mesh.node_count).reshape(elements + 1, 2)[i] for i in (0, -1))
    free = np.ones((model.mesh.node_count, 5), bool)
    free[:, [2, 3]] = False
    for nodes, across, sign in ((first, 0, signs[0]), (last, 1, signs[1])):
        free[np.ix_(nodes, [across, 4] if sign > 0 else [1 - across])] = False
    if signs == (-1, -1):
        free[first, 0] = False  # no turning about the axis
    elif -1 in signs:
        free[first if signs[0] < 0 else last, 0 if signs[0] < 0 else 1] = False  # no sway
    return free


def _critical(name: str, elements: int) -> float:
    model, signs = _ring(elements), SYMMETRIES[name].signs
    free = _free(model, signs, elements)
    watch = BucklingWatch(
        model, _options(), lambda q, p: spectrum_of(*class_matrices(model, free, True, q, p), pressure=p, count=3)
    )
    steps = LoadSteps(model, _options(), accepted=watch.see)
    for p in np.array([0.5, 2.5, 3.4, 6.0, 7.5, 8.8]) * EI / RADIUS**3:
        steps.reach(p)
        if watch.found:
            break
    return watch.found[0].pressure * RADIUS**3 / EI


@pytest.mark.parametrize("name, waves", [("SS", 2), ("AA", 2), ("SA", 3), ("AS", 3)])
def test_a_ring_buckles_in_every_class(name, waves):
    exact = waves**2 - 1
    errors = np.array([_critical(name, n) for n in (12, 24, 48)]) / exact - 1
    assert abs(errors[-1]) < 3e-3, errors
    assert np.all(np.abs(errors[1:]) < 0.35 * np.abs(errors[:-1])), errors
