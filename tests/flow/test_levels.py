"""Levels of the fluid along a channel that stands upright: still water, Torricelli, and what stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.quantity import GRAVITY
from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.line import Line

Z = np.linspace(0.0, 0.56, 9)
AREA = np.linspace(1e-3, 0.012, 9)
RHO, BACK = 1000.0, 2e3


def channel(up: float, outside: float = 0.0, terms=()) -> Channel:
    """Gravity points to the inlet for up = 1."""
    depth = up * GRAVITY * Z
    return Channel(Z, 1e-6, levels=RHO * depth, levels_outside=outside * depth, back=BACK, terms=terms)


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize("outside", [0.0, 1000.0])
def test_still_water(up, outside):
    law = channel(up, outside)
    still = BACK + up * RHO * GRAVITY * Z[-1]
    assert law.back == pytest.approx(still)
    assert law.steady_pressure(AREA, still) == pytest.approx(up * (RHO - outside) * GRAVITY * Z, abs=1e-9)
    motion = FlowMotion.still(AREA, np.zeros(1))
    pressure, residual = law.evaluate(motion, {"inlet": still, "density": RHO})
    assert np.abs(residual).max() < 1e-9 and pressure == pytest.approx(law.steady_pressure(AREA, still), abs=1e-9)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_torricelli(up):
    """Speed of the jet from the head and the fall; pressures on the way by Bernoulli's law with heights."""
    law, inlet = channel(up), 9e3
    velocity = law.inlet_velocity(AREA, inlet, RHO)
    speed = velocity * AREA[-1] / AREA
    assert speed[0] ** 2 - velocity**2 == pytest.approx(2 * ((inlet - BACK) / RHO - up * GRAVITY * Z[-1]))
    absolute = inlet + 0.5 * RHO * (velocity**2 - speed**2) - RHO * GRAVITY * up * (Z[-1] - Z)
    assert law.steady_pressure(AREA, inlet) == pytest.approx(absolute - BACK, abs=1e-8)


def test_the_same_fluid_on_both_sides_leaves_the_drive_alone():
    plain, wet = Channel(Z, 1e-6), channel(1.0, RHO)
    assert wet.steady_pressure(AREA, wet.back + 5e3) == pytest.approx(plain.steady_pressure(AREA, 5e3), abs=1e-9)


def test_a_line_in_front_loses_what_it_loses_without():
    line = Line(10.0, 0.2, friction=0.02, loss=1.0)
    plain, upright = Channel(Z, 1e-6, terms=[line]), channel(-1.0, terms=[line])
    found = upright.steady_pressure(AREA, upright.back + 5e3) - upright.static
    assert found == pytest.approx(plain.steady_pressure(AREA, 5e3), abs=1e-9)


def test_steps_see_the_levels():
    law, motion = channel(1.0), FlowMotion(AREA, 0.01 * AREA, 0 * AREA, np.array([0.4]), np.array([0.0]))
    fluid, passage = MovingFluid(law, RHO), (AREA, 0.01 * AREA)
    state = fluid.moving(passage, 0 * AREA, motion.inner, 9e3)
    found = fluid.instant(state, 9e3).at(passage, passage).pressure
    rates = [law.evaluate(motion._replace(inner_rate=np.array([x])), {"inlet": 9e3, "density": RHO}) for x in (0, 1)]
    (none, first), (unit, second) = rates
    share = -first[0] / (second[0] - first[0])  # the velocity changes so that the outlet's pressure vanishes
    assert found == pytest.approx(none + share * (unit - none), rel=1e-12, abs=1e-9)
