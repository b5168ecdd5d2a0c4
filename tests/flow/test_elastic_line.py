"""Waves in a line: organ pipe, water hammer, friction against characteristics, rigid limit, steps against the law."""

from __future__ import annotations

import jax
import numpy as np
import pytest
import scipy.linalg as la

from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.elastic_line import DEGREE, ElasticLine, LineChannel, default_elements, element
from dbvfiv.flow.stepping import FluidState, MovingFluid, packed_size
from dbvfiv.flow.terms.line import Line
from tests.flow.answers import frequencies
from tests.flow.test_channel import FLOOR, passage
from tests.flow.waves import Waves, march, unbalanced

jax.config.update("jax_enable_x64", True)
DENSITY, SUPPLY = 998.0, 18e3
QUARTER = 0.012


def line_of(length=20.0, speed=1000.0, elements=3, **keys) -> ElasticLine:
    return ElasticLine(Line(length, keys.pop("diameter", 0.2), **keys), speed, elements)


def behind(line: ElasticLine, storage=0.0) -> LineChannel:
    z, _ = passage()
    return LineChannel(Channel(z, FLOOR, storage), Channel(z, FLOOR, storage, terms=[line.line]), line)


def shut_frequencies(line: ElasticLine) -> np.ndarray:
    """Angular frequencies of a lossless line with a pressure at its far end and no flow at the flange."""
    law = Waves(line, QUARTER)
    return frequencies(law.linearise_still(np.zeros(1), {"inlet": 0.0, "density": DENSITY}, np.zeros(line.size)), 1e-9)


def test_organ_pipe():
    """c/(4 L) (2 n + 1) with an open and a shut end, errors by the eighth power of the element's length; a half of a
    wavelength in an element leaves 1.5e-4, which is what `resolved` says.
    """
    exact = 0.5 * np.pi * 1000.0 / 20.0 * (2 * np.arange(40) + 1)
    errors = []
    for elements in (4, 8):
        line = line_of(elements=elements, diameter=0.3)
        found = shut_frequencies(line)
        assert len(found) == 4 * elements  # no mode too many
        errors.append(found[:4] / exact[:4] - 1)
    assert np.log2(errors[0][1:] / errors[1][1:]) == pytest.approx(8.0, abs=0.3)
    inside = 2 * np.pi * behind(line).resolved({}) >= exact
    assert inside.sum() == 8 and np.abs(found[:8] / exact[:8] - 1).max() < 2e-4


def test_as_many_elements_as_resolve_two_hundred_hertz():
    assert default_elements(20.0, 1000.0) == 8
    assert default_elements(0.1, 1000.0) == 2 and default_elements(1000.0, 1000.0) == 16


@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_the_rigid_column_is_the_limit_of_a_fast_line(storage):
    """Eliminated at a frequency, the line's own unknowns leave the rigid column's operators but for (s/c)^2."""
    keys = {"friction": 0.02, "loss": 1.5, "reservoir": False}
    z, area = passage()
    given, s = {"inlet": SUPPLY, "density": DENSITY}, 20.0 + 250.0j
    column = Channel(z, FLOOR, storage, terms=[Line(7.0, 0.2, **keys)])
    rigid = column.linearise_still(area, given)
    expected = np.array([rigid["S0"] + s * rigid["S1"], rigid["B0"][5:6] + s * rigid["B1"][5:6]]).ravel()
    gaps = []
    for speed in (1e4, 1e5, 1e6):
        law = behind(line_of(7.0, speed, **keys), storage)
        found = law.linearise_still(area, given)
        S, B = found["S0"] + s * found["S1"], found["B0"] + s * found["B1"]
        own = la.solve(S[1:, 1:], -S[1:, :1])
        got = np.array([S[0, 0] + S[:1, 1:] @ own[:, 0], B[5, 0] + B[5:6, 1:] @ own[:, 0]]).ravel()
        gaps.append(np.abs(got / expected - 1).max())
        assert law.steady_pressure(area, SUPPLY) == pytest.approx(column.steady_pressure(area, SUPPLY), rel=1e-13)
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.05) and gaps[1] / gaps[2] == pytest.approx(100, rel=0.2)
    assert gaps[2] < 0.5 * (abs(s) * 7.0 / 1e6) ** 2  # tanh(x)/x = 1 - x^2/3 + ...


def test_steady_flow_meets_the_equations():
    z, area = passage()
    for reservoir in (True, False):
        law = behind(line_of(7.0, 800.0, friction=0.02, loss=3.0, reservoir=reservoir), 1.0)
        given = {"inlet": SUPPLY, "density": DENSITY}
        inner = law.steady_inner(area, given)
        pressure, rest = law.evaluate(FlowMotion.still(area, inner), given)
        assert np.abs(rest).max() < 1e-9 * SUPPLY
        assert pressure == pytest.approx(law.steady_pressure(area, SUPPLY), rel=1e-10, abs=1e-6)
        assert np.ptp(inner[: 1 + law.line.size // 2]) == 0.0


def test_a_line_without_a_flow_has_the_pressure_behind_the_valve():
    z, area = passage()
    line, narrow = line_of(7.0, 800.0), 16 * area[-1] / (np.pi * 0.2**2)  # the inlet's area over the line's
    law = LineChannel(Channel(z, FLOOR, back=1e4), Channel(z, FLOOR, back=1e4, terms=[line.line]), line)
    inner = MovingFluid(law, DENSITY).steady_inner(area, 0.0)
    velocity, pressure = np.split(inner, [-(line.size // 2)])
    assert not velocity.any() and DENSITY * 800.0 * narrow * pressure == pytest.approx(np.full(line.size // 2, 1e4))


@pytest.mark.slow
def test_water_hammer():
    """A flow that is stopped raises the pressure by rho c dU at the flange, for 2 L/c, and lowers it as much for the
    next 2 L/c (Joukowsky 1898).
    """
    length, speed, velocity = 20.0, 1000.0, 0.5
    stop, step = 0.4 * length / speed, length / speed / 200
    waves = MovingFluid(Waves(line_of(length, speed, 24, diameter=None), QUARTER), DENSITY)
    flange = lambda t: 0.5 * velocity * (1.0 + np.cos(np.pi * min(1.0, t / stop)))  # noqa: E731
    pressure, states = march(waves, flange, step, 1600, SUPPLY)
    rise = (pressure - SUPPLY) / (DENSITY * speed * velocity)  # the velocity head is a part of 4000
    time = (np.arange(1600) + 0.5) * step * speed / length
    for low, high, sign in [(0.5, 1.9, 1), (2.5, 3.9, -1), (4.5, 5.9, 1), (6.5, 7.9, -1)]:
        plateau = rise[(time > low) & (time < high)]
        assert np.mean(plateau) == pytest.approx(sign, abs=2e-3)
        assert np.abs(plateau - sign).max() < 0.01
    assert unbalanced(waves, states) < 1e-11
    assert states[-1].books[1] == states[-1].books[3] == 0.0


@pytest.mark.parametrize("theta, rate", [(0.6, 1.1), (1.0, 1.0), (1.0, 1.5)])
def test_what_damped_steps_take_is_in_the_books(theta, rate):
    line = line_of(friction=0.02, loss=2.0)
    waves = MovingFluid(Waves(line, QUARTER), DENSITY)
    flange = lambda t: 0.5 + 0.3 * np.sin(40.0 * t)  # noqa: E731
    _, states = march(waves, flange, 2e-3, 100, SUPPLY, theta=theta, rate=rate)
    assert unbalanced(waves, states) < 1e-12 and states[-1].books[3] > 0.0
    assert len(states[-1].packed) == packed_size(1, line.size)
    again = FluidState.unpacked(states[-1].packed)
    assert all(np.array_equal(getattr(again, name), value) for name, value in vars(states[-1]).items())


def characteristics(length, speed, loss, velocity, supply, nodes, count):
    """Sudden stop by the method of characteristics: heads over density at the flange; friction by the trapezoidal rule
    along them.
    """
    dt = length / (nodes - 1) / speed
    w = np.full(nodes, velocity)
    h = supply - 0.5 * loss * velocity * abs(velocity) * np.linspace(0, 1, nodes)
    drag = 0.5 * loss / length
    out = []
    for _ in range(count):
        new_w, new_h = w.copy(), h.copy()
        for _ in range(3):  # the friction at the new instant is iterated
            mean = 0.5 * (drag * w[:-1] * np.abs(w[:-1]) + drag * new_w[1:] * np.abs(new_w[1:]))
            back = 0.5 * (drag * w[1:] * np.abs(w[1:]) + drag * new_w[:-1] * np.abs(new_w[:-1]))
            right = w[:-1] + h[:-1] / speed - dt * mean  # arrives at 1..
            left = w[1:] - h[1:] / speed - dt * back  # arrives at ..n-2
            new_w[1:-1], new_h[1:-1] = 0.5 * (right[:-1] + left[1:]), 0.5 * speed * (right[:-1] - left[1:])
            new_h[0], new_w[0] = supply, left[0] + supply / speed
            new_w[-1], new_h[-1] = 0.0, speed * right[-1]
        w, h = new_w, new_h
        out.append(h[-1])
    return np.array(out), dt


@pytest.mark.slow
def test_friction_wears_a_blow_down_as_by_characteristics():
    """A line that loses much: mean pressures over each half period at the shut flange within 0.1 % of the blow."""
    length, speed, velocity, loss = 20.0, 1000.0, 1.0, 400.0
    expected, dt = characteristics(length, speed, loss, velocity, SUPPLY / DENSITY, 801, 6400)
    line = line_of(length, speed, 24, diameter=None, loss=loss, reservoir=False)
    head = lambda velocity, source, area, parameters, steady=False: source  # noqa: E731
    line.far_head = head  # a total pressure, as the other solution has it
    waves = MovingFluid(Waves(line, QUARTER), DENSITY)
    waves.traced = waves.law
    step = length / speed / 400
    flange = lambda t: velocity if t <= 1e-6 else 0.0  # noqa: E731
    pressure, states = march(waves, flange, step, 3200, SUPPLY)
    ours, theirs = pressure / DENSITY, expected
    half = 2 * length / speed
    mean = lambda x, d, i: x[int(round((i + 0.05) * half / d)) : int(round((i + 0.95) * half / d))].mean()  # noqa: E731
    steps = [(mean(ours, step, i), mean(theirs, dt, i)) for i in range(4)]
    for found, other in steps:
        assert found == pytest.approx(other, abs=0.001 * speed * velocity)
    worn = abs(steps[3][1] - SUPPLY / DENSITY) / abs(steps[0][1] - SUPPLY / DENSITY)
    assert worn < 0.8  # it does wear down
    assert unbalanced(waves, states) < 1e-11 and np.all(np.diff([s.books[1] for s in states]) >= 0)


def check_step(line: ElasticLine, inlet: float):
    """Rates and pressures of a step meet the line's own equations; its slope is that of differences."""
    rng, fluid = np.random.default_rng(3), MovingFluid(Waves(line, inlet), DENSITY)
    k, h, theta, rate = line.size // 2, 2e-3, 0.6, 1.1
    inner = np.append(rng.standard_normal(k), 0.3 * rng.standard_normal(k))
    ends = [(np.array([x]), np.zeros(1)) for x in (-0.3, -0.4667)]
    old = fluid.moving(ends[0], np.zeros(1), inner, SUPPLY)
    step = fluid.step(old, ends[0], h, theta, rate, SUPPLY)
    mid = (ends[0][0] + theta * (ends[1][0] - ends[0][0]), np.zeros(1))
    flow = step.at(mid, ends[1])
    new = flow.state()
    law, given = fluid.law, {"inlet": SUPPLY, "density": DENSITY}
    here = old.inner + theta * (new.inner - old.inner)
    still = law.evaluate(FlowMotion.still(mid[0], here), given)
    changed = DENSITY * ((1 - rate) * old.rate + rate * new.rate)
    size = np.abs(changed).max()
    assert np.abs(still[1] + changed[1:]).max() < 1e-10 * size
    assert flow.pressure == pytest.approx(still[0] + changed[:1], rel=1e-11)
    d = 1e-5
    ahead, behind = (step.at((mid[0] + theta * x, mid[1]), (ends[1][0] + x, mid[1])).pressure for x in (d, -d))
    assert flow.slopes(0.0)[0] == pytest.approx((ahead - behind) / (2 * d), rel=1e-6)


@pytest.mark.parametrize("reservoir", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_what_a_step_solves_is_the_law(reservoir):
    _, area = passage()
    check_step(line_of(7.0, 800.0, friction=0.03, loss=2.0, reservoir=reservoir), area[-1])


def test_a_rigid_column_of_its_length_where_the_step_is_long():
    """Over a step that is long against L/c the impedance is that of the rigid column."""
    own = np.sqrt(16 * QUARTER / np.pi)
    fluid = MovingFluid(Waves(line_of(7.0, 1e5, diameter=own), QUARTER), DENSITY)
    still, moved = ((np.array([x]), np.zeros(1)) for x in (0.0, 0.1))
    state = fluid.moving(still, np.zeros(1), np.zeros(fluid.law.inner), 0.0)
    flow = fluid.step(state, still, 1e-2, 0.5, 1.0, 0.0).at((0.5 * moved[0], still[1]), moved)
    assert flow.slopes(0.0)[0, 0] / DENSITY == pytest.approx(-7.0 / 1e-2, rel=1e-3)


def test_the_element():
    one = element(4)
    assert one.mass.sum() == pytest.approx(1.0, rel=1e-14) and one.weights.sum() == pytest.approx(1.0, rel=1e-14)
    assert one.finer @ (one.value @ one.nodes**4) ** 2 == pytest.approx(1 / 9, rel=1e-12)
    assert one.slope @ one.nodes**4 == pytest.approx(4 * one.points**3, rel=1e-12)


def test_friction_damps_all_waves_alike():
    """Around a uniform flow friction is 2 |w| times the mass, on the quickest wave of an element too, which is 0 at the
    points of the pressure.
    """
    line, parameters = line_of(friction=0.02), {"pipe_length": 20.0, "wave_speed": 1000.0}

    @jax.jit
    def parts(flow):
        friction = jax.jacfwd(lambda w: line.friction(w, 0.05, parameters))(flow)
        momentum = jax.jacfwd(lambda w: line.held(w, np.zeros(DEGREE * 3), 0.05, parameters)[0])(flow)
        return friction, momentum, line.segments(0.05, parameters)

    slope, mass, segments = parts(np.full(DEGREE * 3 + 1, 1.7))
    lost, ratio = segments.lost.sum(), segments.ratio[0]
    assert lost > 0
    np.testing.assert_allclose(slope, 2 * 1.7 * lost / (ratio * 20.0) * mass, atol=1e-12 * np.abs(slope).max())
