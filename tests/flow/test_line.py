"""A pipe in front of the valve: steady flow by hand, inertance, flow that turns round, the valve of one degree."""

import math

import numpy as np
import pytest

from dbvfiv.flow import Channel, Stream
from dbvfiv.flow.terms.line import Line
from eigen import CoupledPencil, leading_modes
from tests.flow.test_channel import FLOOR, passage

DENSITY, SUPPLY = 998.0, 18e3


def diameter_of(quarter: float) -> float:
    """Of a circle with four times the area."""
    return math.sqrt(16.0 * quarter / math.pi)


@pytest.mark.parametrize("reservoir", [True, False])
@pytest.mark.parametrize("wide", [None, 0.9, 1.3])
def test_steady_flow_against_a_hand_calculation(reservoir, wide):
    """Bernoulli from the far end to the lips: P_0 + c u^2/2 = U_0^2/2 + (f L/D + K) u^2/2 per density."""
    z, area = passage()
    inlet = diameter_of(area[-1])
    diameter = inlet if wide is None else wide * inlet
    length, friction, loss = 20.0, 0.018, 1.5
    line = Line(length, None if wide is None else diameter, friction, 0.0, loss, reservoir)
    law = Channel(z, FLOOR, terms=[line])
    heads = friction * length / diameter + loss
    ratio = (inlet / diameter) ** 2  # speed in the line over that at the flange
    far = 0.0 if reservoir else ratio**2
    expected = math.sqrt(2 * SUPPLY / DENSITY / ((area[-1] / area[0]) ** 2 + heads * ratio**2 - far))
    velocity = law.inlet_velocity(area, SUPPLY, DENSITY)
    assert velocity == pytest.approx(expected, rel=1e-9)
    flange = SUPPLY - 0.5 * DENSITY * velocity**2 * (1 - far + heads * ratio**2)
    pressure = law.steady_pressure(area, SUPPLY)
    assert pressure[-1] == pytest.approx(flange, rel=1e-9)
    assert pressure == pytest.approx(Channel(z, FLOOR).steady_pressure(area, flange), rel=1e-9, abs=1e-6)
    assert line.lost_head(area[-1], velocity) == pytest.approx(0.5 * heads * (ratio * velocity) ** 2, rel=1e-12)


def test_the_rough_pipe_is_the_end_of_colebrooks_law():
    relative, diameter, reynolds = 1e-3, 0.3, 1e12
    factor = 0.02
    for _ in range(50):
        factor = (-2.0 * math.log10(relative / 3.7 + 2.51 / (reynolds * math.sqrt(factor)))) ** -2
    line = Line(1.0, diameter, roughness=relative * diameter)
    assert float(line.lost(diameter, 6.0)) == pytest.approx(factor * 20.0, rel=1e-7)
    assert factor == pytest.approx(0.0196, abs=5e-5)  # Moody's chart


@pytest.mark.parametrize("reservoir", [True, False])
def test_flow_that_runs_back(reservoir):
    """Into a reservoir it loses the head of its jet; the total head falls towards the far end either way."""
    quarter = 0.012
    diameter = 1.2 * diameter_of(quarter)
    line = Line(10.0, diameter, 0.02, 0.0, 0.5, reservoir)
    ratio = (1 / 1.2) ** 2
    velocity = -3.0
    stream = Stream(np.array([quarter]), np.zeros(1), np.array([velocity]), np.array([velocity]))
    head = float(line.head(stream, {"pipe_length": 10.0}))
    lost = 0.5 * (0.02 * 10.0 / diameter + 0.5) * (ratio * velocity) ** 2
    # pressure at the flange over the far end: -head; total heads differ by what is lost on the way
    assert -head + 0.5 * velocity**2 == pytest.approx(lost + 0.5 * (ratio * velocity) ** 2, rel=1e-12)


@pytest.mark.parametrize("storage", [0.0, 1.0])
def test_its_inertance_stands_beside_the_rate_of_the_velocity_in_every_pressure(storage):
    z, area = passage()
    given, diameter = {"inlet": SUPPLY, "density": DENSITY}, 0.11
    bare = Channel(z, FLOOR, storage)
    velocity = bare.steady_inner(area, given)
    ours = Channel(z, FLOOR, storage, terms=[Line(7.0, diameter, reservoir=True)]).linearise_still(
        area, given, velocity
    )
    theirs = bare.linearise_still(area, given, velocity)
    inertance = DENSITY * 7.0 * 4 * area[-1] / (0.25 * np.pi * diameter**2)
    assert ours["B1"][1:] == pytest.approx(theirs["B1"][1:] - inertance, rel=1e-12)
    assert ours["S1"] == pytest.approx(theirs["S1"] - inertance, rel=1e-12)
    assert ours["B0"][1:] == pytest.approx(theirs["B0"][1:] - DENSITY * velocity[0], rel=1e-12)


def test_a_law_tells_its_length_apart_from_that_of_others():
    z, area = passage()
    law = Channel(z, FLOOR, terms=[Line(7.0)])
    given = {"inlet": SUPPLY, "density": DENSITY}
    longer = law.linearise_still(area, given | {"pipe_length": 9.0})
    assert longer["S1"] == pytest.approx(
        Channel(z, FLOOR, terms=[Line(9.0)]).linearise_still(area, given)["S1"], rel=1e-13
    )


# -- a valve of one degree behind a pipe: (m s^2 + c s + k)(s + r) = B (s + d)

LIP, INLET, WIDTH, LENGTH = 1e-3, 6e-3, 0.2, 4.0
MASS, DAMPING, STIFFNESS = 1.3, 2.0, 900.0


def one_degree(face: float, *terms) -> tuple[CoupledPencil, float]:
    """A plug that the pressure at the flange pushes into the lips, which it narrows, m2 of face, and the inlet velocity
    of a flow with some terms.
    """
    channel, area = Channel(np.array([0.0, 1e-13]), 1e-9, terms=terms), np.array([LIP, INLET])
    given = {"inlet": SUPPLY, "density": DENSITY}
    parts = channel.linearise_still(area, given)
    pencil = CoupledPencil(M=[[MASS]], C=[[DAMPING]], K=[[STIFFNESS]], G=[[0.0, face]], J=[[-WIDTH], [0.0]], **parts)
    return pencil, channel.inlet_velocity(area, **given)


def plug(face: float, loss: float = 0.0) -> tuple[CoupledPencil, float, float, float]:
    """The plug behind a pipe; with B, r and d."""
    pencil, velocity = one_degree(face, Line(LENGTH, loss=loss, reservoir=False))
    ratio = INLET / LIP
    rate = velocity * (ratio**2 - 1.0 + loss) / LENGTH
    return pencil, face * WIDTH * DENSITY * (ratio * velocity) ** 2 / LIP, rate, loss * velocity / LENGTH


@pytest.mark.parametrize("loss", [0.0, 30.0])
def test_a_valve_of_one_degree_has_the_roots_of_its_cubic(loss):
    pencil, strength, rate, lost = plug(2e-6, loss)
    m, c, k = MASS, DAMPING, STIFFNESS
    roots = np.roots([m, c + m * rate, k + c * rate - strength, k * rate - strength * lost])
    found = leading_modes(pencil, 3).eigenvalues
    for root in roots[roots.imag >= 0]:
        assert np.abs(found - root).min() < 1e-8 * abs(root)
