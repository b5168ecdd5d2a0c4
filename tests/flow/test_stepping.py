"""Evaluators of a time step against the traceable definition of the law: values and slopes to 1e-12."""

from __future__ import annotations

from functools import partial

import jax
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
    pytest.param((), id="either way"),
    pytest.param((LipLoss(0.7), Pipe(3.0, 1.2)), id="with terms"),
    pytest.param((Line(20.0, 0.15, 0.02, 0.0, 1.5),), id="with a line from a reservoir"),
    pytest.param((Line(5.0, None, 0.0, 1e-4, 0.5, False),), id="with a line"),
    pytest.param((Tail(0.16, 5.0, 0.5),), id="with a pipe behind"),
]
#: outward, with one station of rest reversed by the moving walls, and drawn in
VELOCITIES = [1.7, 0.02, -1.1]


@jax.jit
def definition(law, area, rate, inner, parameters):
    speed = lambda a, r, u: law.speeds(a, r, u[0], parameters["storage"])  # noqa: E731
    parts = speed, partial(law.psi, parameters=parameters), partial(law.heads, parameters=parameters)
    return [part(area, rate, inner) for part in parts]


@jax.jit
def definition_slopes(law, area, rate, inner, parameters):
    """Derivatives of speeds, psi and heads by areas, rates and inlet velocity."""
    return jax.jacfwd(lambda *at: definition(law, *at, parameters), argnums=(0, 1, 2))(area, rate, inner)


def close(found, expected, scale=None):
    expected = np.asarray(expected)
    scale = np.abs(expected).max() if scale is None else scale
    assert np.abs(found - expected).max() <= 1e-12 * scale


def setting(terms, storage):
    z, area = passage()
    area = np.concatenate([[3 * FLOOR], area[1:]])
    rate = 0.02 * np.random.default_rng(3).standard_normal(len(z))
    law = Channel(z, FLOOR, storage, terms=terms, reversible=True)
    return law, MovingFluid(law, DENSITY), area, rate, law.values({"inlet": INLET, "density": DENSITY})


@pytest.mark.parametrize("velocity", VELOCITIES)
@pytest.mark.parametrize("storage", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("terms", KINDS)
def test_values(terms, storage, velocity):
    law, fluid, area, rate, parameters = setting(terms, storage)
    flow = fluid.state(area, rate, velocity)
    inner = np.array([velocity])
    speed, psi, head = (np.asarray(part) for part in definition(law, area, rate, inner, parameters))
    close(flow.speed, speed)
    close(flow.psi, psi)
    psi_rate = np.linspace(-3.0, 2.0, law.count)
    close(fluid.pressure(flow, psi_rate, INLET), INLET - DENSITY * (head + psi_rate))


@pytest.mark.parametrize("velocity", VELOCITIES)
@pytest.mark.parametrize("storage", [0.0, 0.6, 1.0])
@pytest.mark.parametrize("terms", KINDS)
def test_slopes(terms, storage, velocity):
    law, fluid, area, rate, parameters = setting(terms, storage)
    inner = np.array([velocity])
    speeds, psis, _ = definition_slopes(law, area, rate, inner, parameters)
    for evaluated, defined in ((fluid.slopes, speeds), (fluid.psi_slopes, psis)):
        for found, expected in zip(evaluated(area, rate, velocity), defined):
            close(np.reshape(found, np.shape(expected)), expected, np.abs(expected).max() or 1.0)


@pytest.mark.parametrize("velocity", VELOCITIES)
@pytest.mark.parametrize("storage", [0.0, 1.0])
@pytest.mark.parametrize("terms", KINDS)
def test_slopes_of_the_pressures_in_a_step(terms, storage, velocity):
    """The pressures of a step as a function of the new areas and inlet velocity, by the definition and chain rule."""
    law, fluid, old_area, old_rate, parameters = setting(terms, storage)
    theta, per_step, weight, old = 0.6, 80.0, 60.0, velocity + 0.05

    area, new_rate = 1.05 * old_area, old_rate + per_step * 0.05 * old_area
    new = area, new_rate
    mid = old_area + theta * (area - old_area), old_rate + theta * (new_rate - old_rate)
    speed = old + theta * (velocity - old)
    by_area, by_speed = fluid.pressure_slopes(mid, new, speed, velocity, theta, per_step, weight)
    _, _, head = definition_slopes(law, *mid, np.array([speed]), parameters)
    _, psi, _ = definition_slopes(law, *new, np.array([velocity]), parameters)
    close(by_area, -DENSITY * (theta * (head[0] + per_step * head[1]) + weight * (psi[0] + per_step * psi[1])))
    close(by_speed, -DENSITY * (theta * head[2] + weight * psi[2])[:, 0])


@pytest.mark.parametrize("inlet", [18e3, 40.0, -3e3])
@pytest.mark.parametrize("storage", [0.0, 1.0])
@pytest.mark.parametrize("terms", [(), (LipLoss(0.7), Pipe(3.0, 1.2))], ids=["bare", "with terms"])
def test_the_velocity_of_a_step_meets_the_outlet(terms, storage, inlet):
    _, fluid, area, rate, _ = setting(terms, storage)
    mid, new, old, theta, weight, known = (area, rate), (1.1 * area, -rate), 0.3, 0.6, 80.0, 2.0
    u = fluid.velocity(mid, new, inlet, old, theta, weight, known)
    psi_rate = weight * fluid.state(*new, u).psi + known
    outlet = fluid.pressure(fluid.state(*mid, old + theta * (u - old)), psi_rate, inlet)[0]
    assert abs(outlet) <= 1e-10 * (abs(inlet) + DENSITY * abs(psi_rate[0]))


@pytest.mark.parametrize("terms", [(LipLoss(0.7),), (Pipe(3.0, 1.2),)], ids=["lips", "pipe"])
def test_steady_flow_of_a_long_step_is_that_of_the_law(terms):
    law, fluid, area, _, _ = setting(terms, 1.0)
    at = (area, np.zeros(law.count))
    u = fluid.velocity(at, at, INLET, 0.1, 1.0, 0.0, 0.0)
    assert u == pytest.approx(law.inlet_velocity(area, INLET, DENSITY), rel=1e-12)
    pressure = fluid.pressure(fluid.state(*at, u), np.zeros(law.count), INLET)
    assert pressure == pytest.approx(law.steady_pressure(area, INLET), rel=1e-10, abs=1e-8)
