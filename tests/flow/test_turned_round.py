"""Steps of a fluid whose drive turns round: one velocity at every drive, and what is drawn in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbvfiv.flow import Channel
from dbvfiv.flow.stepping import MovingFluid


def _fluid(storage=0.0):
    return MovingFluid(Channel(np.linspace(0, 0.5, 8), 1e-6, storage), 1000.0)


AREA = 1e-4 * np.array([1.0, 1.1, 1.5, 3.0, 6.0, 9.0, 12.0, 13.0])
RATE = 1e-3 * np.array([0.0, -0.5, -1.0, 0.5, 1.0, 0.0, -0.3, 0.0])


def flow(fluid, inlet, old, h, passage, known=0.0):
    """Step from a velocity, equations at its end, in a passage that stays; `known` changes what is held at outlet."""
    state = fluid.moving(passage, np.zeros(8), np.array([old]), inlet)
    held = state.held.copy()
    held[8] += known * h
    return fluid.step(replace(state, held=held), passage, h, 1.0, 1.0, inlet).at(passage, passage)


@pytest.mark.parametrize("storage", [0.0, 1.0])
@pytest.mark.parametrize("inlet", [-3e4, -500.0, 0.0, 40.0, 2e4])
@pytest.mark.parametrize("known", [-4.0, 0.0, 4.0])
def test_there_is_one_velocity_at_every_drive_and_it_meets_the_outlet(storage, inlet, known):
    fluid, h, passage = _fluid(storage), 1.0 / 80.0, (AREA, RATE)
    found = flow(fluid, inlet, 0.0, h, passage, known)
    law = fluid.law.reversed()
    given = law.values({"inlet": inlet, "density": 1000.0})
    held = lambda u: float(law.held(*passage, np.array([u]), given)[8])  # noqa: E731

    def outlet(u):
        source = float(law.sources(*passage, np.array([u]), given)[8])
        return 1000.0 * (source + (held(u) - held(0.0)) / h - known)

    u = found.inner[0]
    assert abs(outlet(u)) <= 1e-9 * (abs(inlet) + 1000 * (abs(known) + 0.5 * found.speed[0] ** 2 + abs(held(u)) / h))
    assert outlet(u + 1e-3) < outlet(u) and found.pressure[0] == 0.0


def test_steady_flow_drawn_in_is_sucked_to_the_throat_and_lost_behind_it():
    fluid, inlet = _fluid(), -3e3
    area = 1e-4 * np.array([1.2, 1.1, 0.5, 0.8, 0.7, 9.0, 12.0, 13.0])
    found = flow(fluid, inlet, 0.0, 1e9, (area, np.zeros(8)))
    p, speed = found.pressure, found.speed
    # to the throat as Bernoulli says, then a jet, and the same again in the second narrowing
    assert p[1:3] == pytest.approx(-500 * speed[1:3] ** 2)
    assert p[3] == pytest.approx(p[2])
    assert p[4] == pytest.approx(p[3] - 500 * (speed[4] ** 2 - speed[3] ** 2))
    assert p[5:] == pytest.approx(inlet)
    assert speed[-1] < 0
