"""One-dimensional flow: steady law, linearisation and what it does to a closed passage."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from dbvfiv.flow import Channel, FlowMotion, UniformLoad
from dbvfiv.flow.term import wall_share
from tests.differences import difference

FLOOR = 1e-5


def passage(count: int = 9, seed: int = 0):
    """Positions from the outlet on, and areas that widen towards the inlet, m2."""
    generator = np.random.default_rng(seed)
    z = np.cumsum(generator.uniform(0.5, 1.5, count)) * 0.06
    area = np.linspace(2e-3, 1.2e-2, count) * generator.uniform(0.9, 1.1, count)
    return z, area


def pressures(channel, *motion, inlet, density):
    """Pressures (m,) with what is left at the outlet as the first."""
    pressure, outlet = channel.evaluate(FlowMotion(*motion), {"inlet": inlet, "density": density})
    assert pressure[0] == 0.0
    pressure[0] = outlet[0]
    return pressure


def test_steady_pressure_is_bernoullis():
    """p_k = P (A_o^-2 - A_k^-2)/(A_o^-2 - A_in^-2) (Th. 4.10): nothing at the outlet, everything at the inlet, no
    density.
    """
    z, area = passage()
    channel = Channel(z, FLOOR)
    pressure = channel.steady_pressure(area, 18e3)
    inverse = area**-2.0
    assert pressure == pytest.approx(18e3 * (inverse[0] - inverse) / (inverse[0] - inverse[-1]), rel=1e-7)
    assert pressure[0] == 0.0 and pressure[-1] == pytest.approx(18e3, rel=1e-12)


@pytest.mark.parametrize("density", [1.0, 1000.0])
@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_unsteady_law_at_rest_is_the_steady_one(density, storage):
    z, area = passage()
    channel = Channel(z, FLOOR, storage)
    velocity = channel.inlet_velocity(area, 18e3, density)
    zero = np.zeros(len(z))
    pressure = pressures(channel, area, zero, zero, velocity, 0.0, inlet=18e3, density=density)
    assert pressure == pytest.approx(channel.steady_pressure(area, 18e3), rel=1e-10, abs=1e-7)


def test_volume_flow_is_the_same_everywhere():
    z, area = passage()
    speeds = Channel(z, FLOOR).velocities(area, 2.0)
    assert speeds * area == pytest.approx(2.0 * area[-1], rel=1e-7)


@pytest.mark.parametrize("scale", [1.0, 1e-2])
def test_steady_operator(scale):
    """Open (areas of many floors) and nearly shut (areas below and about the floor)."""
    z, area = passage()
    area = area * np.concatenate([[scale, scale], np.ones(len(area) - 2)])
    channel = Channel(z, FLOOR)
    pressure, slope = channel.steady_operator(area, 18e3)
    assert np.array_equal(pressure, channel.steady_pressure(area, 18e3))
    direction = np.random.default_rng(1).standard_normal(len(z)) * area
    other = difference(lambda a: channel.steady_pressure(a, 18e3), area, direction, 1e-4)
    assert np.abs(slope @ direction - other).max() < 1e-8 * np.abs(other).max()


@pytest.mark.parametrize("storage", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("unsteady, bowed", [(True, False), (True, True), (False, False)])
def test_operators_at_a_moving_state(storage, unsteady, bowed):
    z, area = passage()
    channel = Channel(z, FLOOR, storage, unsteady, bowed=bowed)
    generator = np.random.default_rng(3)
    rate, acceleration = generator.standard_normal(len(z)) * 0.02, generator.standard_normal(len(z)) * 0.5
    velocity, velocity_rate = 1.7, 4.0
    state = [area, rate, acceleration, np.array(velocity), np.array(velocity_rate)]
    motion = FlowMotion(area, rate, acceleration, velocity, velocity_rate)
    parts = channel.linearise(motion, {"inlet": 18e3, "density": 850.0})
    matrices = []
    for name, row in (("A0", "R0"), ("A1", "R1"), ("A2", "R2"), ("B0", "S0"), ("B1", "S1")):
        assert np.all(parts[name][0] == 0.0) and parts[row].shape == (1, parts[name].shape[1])
        matrices.append(np.vstack([parts[row], parts[name][1:]]))
    scales = (area, 0.02, 0.5, 1.0, 1.0)
    for i, (matrix, scale) in enumerate(zip(matrices, scales)):
        direction = scale * generator.standard_normal(np.shape(state[i]))

        def pressure(x):
            moved = list(state)
            moved[i] = x
            return pressures(channel, *moved, inlet=18e3, density=850.0)

        slope = difference(pressure, state[i], direction, 1e-3)
        product = matrix @ np.atleast_1d(direction)
        assert np.abs(product - slope).max() <= 1e-8 * max(np.abs(slope).max(), 1.0)
    if not (storage and unsteady):
        assert not np.any(matrices[2])
    if not unsteady:
        assert not np.any(matrices[1]) and not np.any(matrices[4])
    else:
        assert np.any(matrices[4])


@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_widening_channel(storage):
    """A straight channel whose walls part at a constant rate r: with s counted from the inlet A U(s) = A U - r s,
    exactly.

    p = P - rho [(U(s)^2 - U^2)/2 + U' s + r^2 s^2/(2 A^2)]; the quasi-steady law moves no fluid with the wall.
    """
    z = np.array([0.0, 0.1, 0.25, 0.3, 0.5])
    area, rate, velocity, velocity_rate, density = 4e-3, 0.02, 3.0, -5.0, 900.0
    s = z[-1] - z
    channel = Channel(z, FLOOR, storage)
    one = np.ones(len(z))
    pressure = pressures(channel, area * one, rate * one, 0 * one, velocity, velocity_rate, inlet=18e3, density=density)
    drawn = storage * rate * s / area
    speed = velocity - drawn
    expected = 18e3 - density * (
        0.5 * (speed**2 - velocity**2) + velocity_rate * s + 0.5 * drawn**2 / max(storage, 1.0)
    )
    assert pressure == pytest.approx(expected, rel=1e-7)


def test_storage_conserves_volume():
    """An accelerating wall: the flow into each stretch less the flow out of it changes as the volume's second
    derivative.
    """
    z, area = passage()
    acceleration = 0.5 * np.random.default_rng(4).standard_normal(len(z))
    zero, density, velocity_rate = np.zeros(len(z)), 1000.0, 2.0
    for storage in (0.0, 1.0):
        channel = Channel(z, FLOOR, storage)
        velocity = channel.inlet_velocity(area, 18e3, density)
        still = pressures(channel, area, zero, zero, velocity, 0.0, inlet=18e3, density=density)
        moving = pressures(channel, area, zero, acceleration, velocity, velocity_rate, inlet=18e3, density=density)
        integral = (still - moving) / density  # of dU/dt from the inlet to each station, by the trapezoidal rule
        speed_rate = np.zeros(len(z))
        speed_rate[-1] = velocity_rate
        for k in range(len(z) - 2, -1, -1):
            speed_rate[k] = 2 * (integral[k] - integral[k + 1]) / (z[k + 1] - z[k]) - speed_rate[k + 1]
        flow_rate = area * speed_rate
        growth = 0.5 * np.diff(z) * (acceleration[1:] + acceleration[:-1])
        assert flow_rate[1:] - flow_rate[:-1] == pytest.approx(storage * growth, rel=1e-5, abs=1e-7)


def test_integral_of_the_speed_between_stations():
    """Integral of a piecewise linear speed: a parabola, whose mean over a section lies h (U_b - U_a)/12
    from that of a straight course; stations take it by the lengths of their sections, the ends keep their own.
    """
    z, _ = passage()
    speed, step = np.random.default_rng(5).uniform(1, 9, len(z)), np.diff(z)
    fine = np.linspace(0.0, 1.0, 20001)
    missed = []
    for h, a, b in zip(step, speed, speed[1:]):
        psi = h * (b * (1 - fine) + 0.5 * (a - b) * (1 - fine) ** 2)  # from the side of the inlet
        missed.append(trapezoid(psi - np.interp(fine, [0, 1], psi[[0, -1]]), fine))
    missed = np.array(missed)
    assert missed == pytest.approx(step * np.diff(speed) / 12, rel=1e-6)
    share = np.asarray(wall_share(step, speed))
    assert share[1:-1] * (step[1:] + step[:-1]) == pytest.approx((step * missed)[1:] + (step * missed)[:-1], rel=1e-6)
    assert share[0] == share[-1] == 0.0


def test_added_mass_only_with_storage():
    """The pressure against a wall that accelerates outwards falls everywhere once the inlet velocity has followed (p =
    0 at the outlet).
    """
    z, area = passage()
    quasi_steady = Channel(z, FLOOR, 0.0).linearise_still(area, {"inlet": 18e3, "density": 1000.0})
    assert not np.any(quasi_steady["A2"]) and not np.any(quasi_steady["R2"])
    found = Channel(z, FLOOR, 1.0).linearise_still(area, {"inlet": 18e3, "density": 1000.0})
    added = found["A2"] - found["B1"] @ found["R2"] / found["S1"]
    assert added[0] == pytest.approx(0.0, abs=1e-9) and added[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.all(added[1:-1] < 0.0)


def test_closed_passage_stays_finite_and_smooth():
    """Areas through zero: pressures and slopes finite, monotone in the area, bounded by the inlet pressure."""
    z, area = passage()
    channel = Channel(z, FLOOR)
    levels = np.concatenate([np.linspace(-40 * FLOOR, 40 * FLOOR, 81), [-1e-2, -1.0]])
    for level in levels:
        shut = area.copy()
        shut[0] = level
        pressure, slope = channel.steady_operator(shut, 18e3)
        assert np.isfinite(pressure).all() and np.isfinite(slope).all()
        assert pressure.min() >= 0.0 and pressure.max() <= 18e3 * (1 + 1e-12)
        velocity = channel.inlet_velocity(shut, 18e3, 1000.0)
        assert np.isfinite(velocity) and velocity > 0.0
        operators = channel.linearise_still(shut, {"inlet": 18e3, "density": 1000.0})
        assert all(np.isfinite(part).all() for part in operators.values())
    flows = [
        channel.inlet_velocity(np.concatenate([[level], area[1:]]), 18e3, 1000.0)
        for level in np.linspace(-1e-4, 1e-3, 50)
    ]
    assert np.all(np.diff(flows) >= 0.0)


def test_all_stations_shut():
    z, _ = passage()
    channel = Channel(z, FLOOR)
    shut = np.full(len(z), -1e-3)
    shut[-1] = 1e-2
    pressure, slope = channel.steady_operator(shut, 18e3)
    assert np.isfinite(pressure).all() and np.isfinite(slope).all()


def test_floor_does_not_touch_an_open_passage():
    z, area = passage()
    assert Channel(z, FLOOR).steady_pressure(area, 1.0) == pytest.approx(
        Channel(z, 1e-7).steady_pressure(area, 1.0), abs=1e-8
    )


def test_positions_must_increase():
    with pytest.raises(ValueError, match="increasing positions"):
        Channel(np.array([0.0, 0.1, 0.1]), FLOOR)


def test_uniform_load():
    for sign in (1.0, -1.0):
        load = UniformLoad(5, sign)
        pressure, slope = load.steady_operator(np.ones(5), 7e3)
        assert np.all(pressure == sign * 7e3) and np.all(slope == 0.0)
        assert load.inlet_velocity(np.ones(5), 7e3, 1000.0) == 0.0
