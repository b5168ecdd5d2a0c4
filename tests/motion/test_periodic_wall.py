"""The wall's matrices at fewer phases than samples: near those at all of them, and at all where lips touch."""

import numpy as np
import pytest

from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion
from dbvfiv.motion import periodic as periodic_wall
from dbvfiv.motion.periodic import PeriodicValve
from tests.motion.test_periodic import motion_of, valve_of
from tests.small_valves import make_valve

SERIES = Harmonics(8)


def resolved(model, mu, size=4e-3):
    """A motion whose harmonics fall by a third each, as those of cycles do."""
    found = motion_of(model, mu, size, harmonics=SERIES.count)
    c = found.coefficients.copy()
    k = (np.arange(1, SERIES.size) + 1) // 2
    c[1:] *= (k**2 * 0.3 ** (k - 1))[:, None]
    return PeriodicMotion(SERIES, c, found.omega)


def evaluations(model, monkeypatch) -> list:
    """Of the structure's tangent from now on."""
    taken, structure = [], model.structure
    monkeypatch.setattr(model, "structure", lambda q: taken.append(1) or structure(q))
    return taken


@pytest.mark.parametrize(("rough", "phases", "error"), [(False, 15, 1e-6), (True, 11, 1e-3)])
def test_fewer_phases_are_near_all(monkeypatch, rough, phases, error):
    model, mu, system = valve_of("storage")
    motion = resolved(model, mu)
    change = np.random.default_rng(3).standard_normal((SERIES.size, 2)) @ motion.coefficients[1:3]
    monkeypatch.setattr(periodic_wall, "LEAST", SERIES.samples)
    exact = system.linearise(motion, mu).apply(change)
    monkeypatch.undo()
    taken = evaluations(model, monkeypatch)
    found = system.linearise(motion, mu, rough).apply(change)
    assert len(taken) == phases < SERIES.samples
    assert np.linalg.norm(found - exact) < error * np.linalg.norm(exact)


@pytest.mark.parametrize("rough", [False, True])
def test_all_phases_where_something_touches(monkeypatch, rough):
    model = make_valve({"supports.contact": "faces", "supports.contact_stiffness": 1e7, "valve.initial_gap": 1e-3})
    _, mu, _ = valve_of("storage")
    system, motion = PeriodicValve(lambda _: model, mu), motion_of(model, mu, size=8e-2)
    coefficients = motion.coefficients.copy()
    coefficients[0, : model.size] = 0.0  # about lips at rest
    motion = PeriodicMotion(motion.harmonics, coefficients, motion.omega)
    assert any(model.touching(x[: model.size]) for x in motion.samples)
    taken = evaluations(model, monkeypatch)
    system.linearise(motion, mu, rough)
    assert len(taken) == motion.harmonics.samples
