"""Heads, loss and coefficients against hand calculations."""

import math

import numpy as np
import pytest

from dbvfiv.case.quantity import GRAVITY, WATER
from dbvfiv.model.state import Hydraulics
from tests.flow.test_gas import DENSITY, RATIO, SOUND, gas_of


def test_a_lossless_jet_loses_its_velocity_head():
    """Bernoulli from the flange to the lip without losses: the total head is that of the jet."""
    density, flange, lips = 998.0, 0.06, 0.002
    jet = 7.0
    speed = jet * lips / flange
    pressure = 0.5 * density * (jet**2 - speed**2)
    found = Hydraulics.of(pressure, density, jet * lips, speed)
    assert found.head_loss == pytest.approx(jet**2 / (2 * GRAVITY), rel=1e-13)
    assert found.loss_coefficient == pytest.approx((flange / lips) ** 2, rel=1e-12)
    assert found.discharge_coefficient == pytest.approx(lips / flange, rel=1e-12)


def test_kv_is_the_flow_of_water_at_one_bar():
    found = Hydraulics.of(25e3, 1000.0, 0.02, 0.8)
    assert found.kv == pytest.approx(0.02 * 3600 * 2.0)
    assert found.cv == pytest.approx(1.156 * found.kv)
    heavier = Hydraulics.of(25e3 * 1.2, 1200.0, 0.02, 0.8)  # the same velocities in a denser fluid
    assert heavier.kv == pytest.approx(found.kv)


def test_without_flow_nothing_is_divided_by():
    found = Hydraulics.of(1e3, 1000.0, 0.0, 0.0)
    assert found.loss_coefficient == math.inf and found.discharge_coefficient == 0.0 and found.kv == 0.0


@pytest.mark.parametrize("inlet", [2e3, 80e3, 200e3])
def test_a_gas_loses_the_enthalpy_of_its_jet(inlet):
    """Nozzle without losses, from a jet that is next to incompressible to one that is as fast as sound: its head is
    that of enthalpy and speed, and water flows through the same passage by Bernoulli.
    """
    area, law = np.linspace(2e-3, 6e-3, 9), gas_of(np.linspace(0.0, 0.5, 9))
    speed = law.steady_velocities(area, inlet, DENSITY)
    flow = law.inlet_density(area, inlet, DENSITY) * speed[-1] * area[-1] / DENSITY
    fluid = {"sound_speed": SOUND, "heat_capacity_ratio": RATIO}
    found = Hydraulics.of(inlet, DENSITY, flow, speed[-1], jet_velocity=speed[0], compressed=fluid)
    sonic = speed[0] >= SOUND
    assert sonic == (inlet > 1e5)
    kept = (speed[0] ** 2 - SOUND**2) / (RATIO - 1) if sonic else 0.0
    assert found.head_loss == pytest.approx((0.5 * speed[0] ** 2 + kept) / GRAVITY, rel=1e-9)
    assert found.loss_coefficient == pytest.approx((speed[0] ** 2 + 2 * kept) / speed[-1] ** 2, rel=1e-9)
    water = area[0] * np.sqrt(2e5 / WATER / (1 - (area[0] / area[-1]) ** 2))
    assert found.kv == pytest.approx(3600 * water, rel=1e-9)
