"""A pipe behind the valve: recovery by hand, inertance, flow that turns round, the valve of one degree."""

import math

import numpy as np
import pytest

from dbvfiv.flow import Channel, FlowMotion, Stream
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.line import Line
from dbvfiv.flow.terms.tail import Tail
from eigen import leading_modes
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_line import DAMPING, DENSITY, INLET, LENGTH, LIP, MASS, STIFFNESS, WIDTH, diameter_of, one_degree

DRIVE = 18e3


@pytest.mark.parametrize("wide", [1.0, 1.2, 3.0])
@pytest.mark.parametrize("loss", [0.0, 2.5])
def test_steady_flow_loses_the_head_of_borda_and_carnot(wide, loss):
    """From the flange to the pipe behind: static and velocity head less (U_0 - u)^2/2, less the losses of the pipe."""
    z, area = passage()
    tail = Tail(wide * diameter_of(area[-1]), 7.0, loss)
    law = Channel(z, FLOOR, terms=[tail])
    velocity = law.inlet_velocity(area, DRIVE, DENSITY)
    jet, speed = velocity * area[-1] / area[0], velocity / wide**2
    widening = 0.5 * (jet - speed) ** 2
    assert DRIVE / DENSITY + 0.5 * velocity**2 == pytest.approx(widening + 0.5 * (1 + loss) * speed**2, rel=1e-9)
    pressure = law.steady_pressure(area, DRIVE)
    gained = 0.5 * (jet**2 - speed**2) - widening
    assert pressure[-1] == pytest.approx(DRIVE + DENSITY * (gained - 0.5 * loss * speed**2), rel=1e-9)
    assert float(tail.gained(area[0], jet, speed)) == pytest.approx(gained, rel=1e-9)
    # on the wall it is a free discharge under what the flange has over the pressure around the jet
    assert pressure == pytest.approx(Channel(z, FLOOR).steady_pressure(area, pressure[-1]), rel=1e-9, abs=1e-6)


def test_recovery_is_equation_7_2_of_the_thesis():
    z, area = passage()
    diameter, coefficient = 1.2 * diameter_of(area[-1]), 0.83
    law = Channel(z, FLOOR, terms=[Tail(diameter, expansion=coefficient)])
    jet = law.velocities(area, law.inlet_velocity(area, DRIVE, DENSITY))[0]
    ratio = 16.0 * area[0] / (np.pi * diameter**2)
    recovered = (1.0 - ratio**2 - coefficient) * 0.5 * DENSITY * jet**2
    assert law.steady_pressure(area, DRIVE)[-1] == pytest.approx(DRIVE + recovered, rel=1e-9)
    borda = Channel(z, FLOOR, terms=[Tail(diameter, expansion=(1.0 - ratio) ** 2)]).steady_pressure(area, DRIVE)
    assert borda == pytest.approx(Channel(z, FLOOR, terms=[Tail(diameter)]).steady_pressure(area, DRIVE), rel=1e-9)


def test_a_pipe_without_end_recovers_nothing():
    z, area = passage()
    free = Channel(z, FLOOR).steady_pressure(area, DRIVE)
    wide = Channel(z, FLOOR, terms=[Tail(1e6 * diameter_of(area[-1]))]).steady_pressure(area, DRIVE)
    assert wide == pytest.approx(free, rel=1e-9)


def test_the_drive_works_against_the_pressure_downstream():
    z, area = passage()
    free, held = Channel(z, FLOOR), Channel(z, FLOOR, back=7e3)
    assert held.steady_pressure(area, 25e3) == pytest.approx(free.steady_pressure(area, 18e3), rel=1e-13)
    assert held.inlet_velocity(area, 25e3, DENSITY) == pytest.approx(free.inlet_velocity(area, 18e3, DENSITY))


@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_a_column_behind_is_one_in_front(storage):
    """The pipe around the valve is rigid, so it carries what enters at the flange whatever the walls do."""
    z, area = passage()
    given, diameter = {"inlet": DRIVE, "density": DENSITY}, 1.3 * diameter_of(area[-1])
    inner = np.array([1.7])
    still, behind, front = (
        Channel(z, FLOOR, storage, terms=[term]).linearise_still(area, given, inner)
        for term in (Tail(diameter), Tail(diameter, 6.0), Line(6.0, diameter, reservoir=False))
    )
    bare = Channel(z, FLOOR, storage).linearise_still(area, given, inner)
    for name in ("B1", "S1", "A1", "R1", "A2", "R2"):
        ours = behind[name] - still[name]
        assert ours == pytest.approx(front[name] - bare[name], rel=1e-10, abs=1e-6)


@pytest.mark.parametrize("expansion", [None, 0.8])
@pytest.mark.parametrize("velocity", [1.7, -1.1])
@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_derivatives_against_differences(storage, velocity, expansion):
    z, area = passage()
    law = Channel(z, FLOOR, storage, terms=[Tail(1.3 * diameter_of(area[-1]), 4.0, 1.2, expansion)])
    given, generator, m = {"inlet": DRIVE, "density": DENSITY}, np.random.default_rng(5), len(z)
    motion = FlowMotion(
        area, 1e-4 * generator.standard_normal(m), generator.standard_normal(m), np.array([velocity]), np.array([3.0])
    )
    direction = FlowMotion(*(np.abs(x) * generator.standard_normal(x.shape) for x in motion))
    found = law.linearise(motion, given)
    slope = sum(found[name] @ d for name, d in zip(("A0", "A1", "A2", "B0", "B1"), direction))
    rest = sum(found[name] @ d for name, d in zip(("R0", "R1", "R2", "S0", "S1"), direction))
    step = 1e-5
    (high, up), (low, down) = (
        law.evaluate(FlowMotion(*(x + sign * step * d for x, d in zip(motion, direction))), given) for sign in (1, -1)
    )
    assert slope == pytest.approx((high - low) / (2 * step), rel=1e-6, abs=1e-6 * np.abs(slope).max())
    assert rest == pytest.approx((up - down) / (2 * step), rel=1e-6)


def test_flow_that_runs_back_gets_nothing_from_a_jet():
    quarter = 0.012
    tail = Tail(1.2 * diameter_of(quarter), 10.0, 0.7)
    stream = Stream(np.array([quarter]), np.zeros(1), np.array([-3.0]), np.array([-3.0]), np.array([quarter]))
    speed = -3.0 / 1.44
    assert float(tail.head(stream, {"tail_length": 10.0})) == pytest.approx(-0.35 * speed**2)
    # the head and its slope are continuous where the flow turns round
    heads = [float(tail.gained(0.3 * quarter, jet, 0.2 * jet)) for jet in (1e-6, -1e-6)]
    assert 0.0 < heads[0] < 1e-11 and heads[1] == 0.0


# -- a valve of one degree with a pipe behind

PIPE, FACE = 9e-3, 2e-6


def test_a_valve_of_one_degree_has_the_roots_of_its_cubic():
    """(m s^2 + c s + k) x = S p(x, Q) with the jet's and the pipe's momentum linearised by hand."""
    pencil, velocity = one_degree(FACE, Tail(math.sqrt(16 * PIPE / math.pi), LENGTH))
    flow = velocity * INLET
    s = np.polynomial.Polynomial([0.0, 1.0])
    inertia = LENGTH / PIPE * s
    pipe = 2 * flow * (1 / PIPE**2 - 1 / (LIP * PIPE))  # of the head by the flow, beside the jet's own
    jet = flow * (1 / LIP**2 - 1 / INLET**2)
    by_area = flow**2 / (LIP**2 * PIPE)  # of the recovered head by the section of the jet
    wall = MASS * s**2 + DAMPING * s + STIFFNESS
    # flow = up * area / (jet + pipe + inertia), pressure = - rho [ (inertia + pipe) flow + by_area * area ]
    up = flow**2 / LIP**3 - by_area
    cubic = wall * (jet + pipe + inertia) - FACE * WIDTH * DENSITY * (
        (inertia + pipe) * up + by_area * (jet + pipe + inertia)
    )
    found = leading_modes(pencil, 3).eigenvalues
    roots = cubic.roots()
    for root in roots[roots.imag >= 0]:
        assert np.abs(found - root).min() < 1e-8 * abs(root)


@pytest.mark.slow
def test_time_steps_work_against_the_pressure_downstream():
    z, area = passage()
    rate = 1e-4 * np.ones(len(z))
    found = []
    for back in (0.0, 7e3):
        fluid = MovingFluid(Channel(z, FLOOR, 1.0, terms=[Tail(0.2, 3.0)], back=back), DENSITY)
        state = fluid.moving((area, rate), np.zeros(len(z)), np.array([1.0]), DRIVE + back)
        flow = fluid.step(state, None, 5e-3, 0.5, 1.0, DRIVE + back).at((area, rate), (area, rate))
        found.append((*flow.inner, *flow.pressure))
    assert found[1] == pytest.approx(found[0], rel=1e-12)
