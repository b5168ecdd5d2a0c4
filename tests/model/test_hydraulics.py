"""Heads, loss and coefficients against hand calculations."""

import math

import pytest

from dbvfiv.case.quantity import GRAVITY
from dbvfiv.model.state import Hydraulics


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
