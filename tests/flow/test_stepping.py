"""Steps of a flow against the definition of its law: pressures, slopes, the outlet, long steps."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.flow import Channel
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.line import Line
from dbvfiv.flow.terms.tail import Tail
from tests.flow.test_adding_a_law import LipLoss, Pipe
from tests.flow.test_channel import FLOOR, passage

DENSITY, INLET = 850.0, 18e3
KINDS = [
    pytest.param((LipLoss(0.7), Pipe(3.0, 1.2)), id="with terms"),
    pytest.param((Line(20.0, 0.15, 0.02, 0.0, 1.5), Tail(0.16, 5.0, 0.5)), id="between pipes"),
]


def setting(terms, storage):
    z, area = passage()
    area = np.concatenate([[3 * FLOOR], area[1:]])
    rate = 0.02 * np.random.default_rng(3).standard_normal(len(z))
    return MovingFluid(Channel(z, FLOOR, storage, terms=terms), DENSITY), (area, rate)


@pytest.mark.parametrize("inlet", [INLET, 40.0, -3e3])
@pytest.mark.parametrize("storage", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("terms", KINDS)
def test_a_step_meets_the_law(terms, storage, inlet):
    """Pressures of a step by what the law says of its end, slopes by differences; outwards, and drawn in."""
    fluid, start = setting(terms, storage)
    theta, h, velocity = 0.6, 2e-3, 80.0
    new = 1.05 * start[0], start[1] + velocity * 0.05 * start[0]
    mid = tuple(a + theta * (b - a) for a, b in zip(start, new))
    old = fluid.moving(start, np.zeros(len(start[0])), np.array([0.3]), inlet)
    step = fluid.step(old, start, h, theta, 1.1, inlet)
    flow = step.at(mid, new)
    law, given = fluid.law.reversed(), fluid.parameters(inlet)
    here = old.inner + theta * (flow.inner - old.inner)
    rate = 1.1 * (np.asarray(law.held(*new, flow.inner, given)) - old.held) / h - 0.1 * old.rate
    expected = DENSITY * (np.asarray(law.sources(*mid, here, given)) + rate)
    size = abs(inlet) + DENSITY * np.abs(rate).max()
    assert np.abs(flow.pressure - expected[:-1]).max() <= 1e-10 * size and abs(expected[-1]) <= 1e-10 * size
    change = 1e-6 * start[0] * np.random.default_rng(5).standard_normal(len(start[0]))

    def moved(sign):
        there = mid[0] + sign * theta * change, mid[1] + sign * theta * velocity * change
        return step.at(there, (new[0] + sign * change, new[1] + sign * velocity * change)).pressure

    slope, difference = flow.slopes(velocity) @ change, 0.5 * (moved(1) - moved(-1))
    assert np.abs(slope - difference).max() < 2e-5 * np.abs(difference).max()


@pytest.mark.parametrize(
    "terms", [(LipLoss(0.7), Pipe(0.0, 0.0)), (LipLoss(0.0), Pipe(3.0, 1.2))], ids=["lips", "pipe"]
)
def test_steady_flow_of_a_long_step_is_that_of_the_law(terms):
    fluid, (area, _) = setting(terms, 1.0)
    still = area, np.zeros(len(area))
    state = fluid.moving(still, still[1], np.array([0.1]), INLET)
    flow = fluid.step(state, still, 1e9, 1.0, 1.0, INLET).at(still, still)
    assert flow.inner[0] == pytest.approx(fluid.law.inlet_velocity(area, INLET, DENSITY), rel=1e-8)
    assert flow.pressure == pytest.approx(fluid.law.steady_pressure(area, INLET), rel=1e-7, abs=1e-5)


@pytest.mark.slow
def test_a_state_keeps_its_law_whatever_the_next_inlet_pressure():
    """A flow that is more than a film at its own pressure, and less at the next; a seal took it for a flow for good."""
    z, area = np.linspace(0.0, 0.6, 7), np.array([4e-6, 4e-6, 4e-6, 1e-3, 5e-3, 1e-2, 1.35e-2])
    fluid, still = MovingFluid(Channel(z, 3e-6, 1.0), 1e3, lambda _: 2), np.zeros(7)
    state = fluid.moving((area, still), still, 1.002 * fluid.steady_inner(area, 5e3), 5e3)
    for _ in range(3):
        step = fluid.step(state, (area, still), 1e-3, 0.5, 1.0, 5050.0)
        flow = step.at((area, still), (area, still))
        assert 0 <= flow.pressure.min() and flow.pressure.max() == pytest.approx(5050.0, rel=1e-6)
        state = step.state(flow)
    assert state.velocity == 0.0 and fluid.facing(state.area, state.speed).law.sealed
