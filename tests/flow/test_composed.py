"""Laws that are made of others: a compressed fluid behind an elastic line, with a pump, losses and a pipe behind."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from dbvfiv.case.quantity import GRAVITY
from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.elastic_line import ElasticLine, LineChannel
from dbvfiv.flow.gas import GasChannel
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.gap_friction import GapFriction
from dbvfiv.flow.terms.line import Line
from dbvfiv.flow.terms.pump import Pump
from dbvfiv.flow.terms.tail import Tail
from tests.differences import difference
from tests.flow.answers import answer, frequencies
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_gas import DENSITY, SHUT, SOUND, TINY, at_rest

jax.config.update("jax_enable_x64", True)
SUPPLY = 6e3
LOSSY = {"diameter": 0.2, "friction": 0.02, "loss": 1.5}


def behind(z, line: Line, speed=300.0, sound=SOUND, floor=FLOOR, more=(), pump=None, perimeter=None):
    """A gas behind an elastic line, or without a speed of sound the fluid that is not compressed."""
    keys = {"reversible": True, "density": DENSITY, "perimeter": perimeter}
    drives = [] if pump is None else [pump]

    def fluid(terms):
        channel = Channel(z, floor, 1.0, terms=terms, **keys)
        return GasChannel(channel, sound) if sound else channel

    return LineChannel(fluid(more), fluid([line, *drives, *more]), ElasticLine(line, speed, 3, pump))


def everything(z, pump=None, sound=SOUND, tail=0.2):
    """A gas that rubs, behind an elastic line with a pump and before a pipe."""
    pump = pump or Pump([0.0, 1.0, 3.0], [600.0, 500.0, 100.0], DENSITY, SUPPLY)
    more = [GapFriction(1.8e-5), Tail(tail, 3.0, 0.5)]
    perimeter = np.linspace(0.1, 0.2, len(z))
    return behind(z, Line(7.0, **LOSSY), sound=sound, more=more, pump=pump, perimeter=perimeter)


def given(inlet=SUPPLY) -> dict[str, float]:
    return {"inlet": inlet, "density": DENSITY}


def test_an_organ_pipe_of_two_halves():
    """One pipe, of which the passage is a part and the line the rest, with its outlet shut: an odd number of quarter
    waves, of which a cell of the box scheme holds 2 atan(w h/(2 c)) and the line w L/c.
    """
    near, far, step, cells = 0.56, 0.8, 1e-6, 7
    z = np.concatenate([[0.0], step + np.linspace(0.0, near, cells + 1)])
    area = np.concatenate([[SHUT], np.full(cells + 1, 5e-3)])
    w = frequencies(at_rest(behind(z, Line(far), SOUND, floor=TINY), area))[:3] / SOUND
    phase = w * far + 2 * cells * np.arctan(0.5 * w * near / cells)
    assert phase == pytest.approx(0.5 * np.pi * (2 * np.arange(3) + 1), rel=1e-4)


@pytest.mark.slow
def test_a_stiff_gas_is_the_incompressible_law():
    """Answers of the pressures to the areas at a frequency differ by 1/c^2."""
    z, area = passage()
    plain, s = everything(z, sound=None), 20.0 + 250.0j
    expected, gaps = answer(plain.linearise_still(area, given()), s), []
    for sound in (1e4, 1e5):
        law = everything(z, sound=sound)
        found = answer(law.linearise_still(area, given()), s)
        gaps.append(np.abs(found - expected).max() / np.abs(expected).max())
        assert law.steady_pressure(area, SUPPLY) == pytest.approx(plain.steady_pressure(area, SUPPLY), rel=1e3 / sound)
    assert gaps[0] / gaps[1] == pytest.approx(100.0, rel=0.1) and gaps[1] < 1e-5


@pytest.mark.slow
def test_steady_flow():
    """It meets the equations and is that behind the line's rigid column."""
    z, area = passage()
    pump = Pump([0.0, 1.0, 3.0], [600.0, 500.0, 100.0], DENSITY, SUPPLY)
    for line, drive in ((Line(7.0, **LOSSY), pump), (Line(7.0, 0.2), None)):
        law = behind(z, line, more=[Tail(0.2, 3.0, 0.5)], pump=drive)
        inner = law.steady_inner(area, given())
        pressure, rest = law.evaluate(FlowMotion.still(area, inner), given())
        assert pressure == pytest.approx(law.rigid.steady_pressure(area, SUPPLY), rel=1e-10, abs=1e-7)
        if drive is None:
            assert np.abs(rest).max() < 1e-9 * SUPPLY
        else:  # but for what the pump gives at another flow than that of its operating point
            own = np.delete(rest, law.channel.inner)
            assert np.abs(own).max() < 1e-9 * SUPPLY
        assert pressure == pytest.approx(law.steady_pressure(area, SUPPLY), rel=1e-10, abs=1e-7)
        slope = law.steady_operator(area, SUPPLY)[1]
        way = area * np.linspace(-1.0, 1.0, len(z))
        expected = difference(lambda x: law.steady_pressure(x, SUPPLY), area, way, 1e-5)
        assert np.abs(slope @ way - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.slow
def test_a_pump_and_pipes_carry_the_mass_flow_of_a_gas():
    """At the density around the jet, as the steady states that operating points are found with: a pump that has the
    supply's pressure at that flow leaves the flow as it is, and an elastic line loses what its rigid column does.
    """
    z, area = passage()

    def fed(flow):
        heads = np.array([2.0, 1.0, 0.0]) * SUPPLY / (DENSITY * GRAVITY)
        return everything(z, Pump([0.0, flow, 2 * flow], heads, DENSITY, SUPPLY))

    law = fed(1.0)
    waves = law.steady_inner(area, given())
    inner = waves[: law.channel.inner]
    flow = 4 * area[-1] * inner[0] * np.exp(inner[-1] / SOUND)
    assert flow == pytest.approx(4 * area[-1] * inner[0] * law.inlet_density(area, SUPPLY, DENSITY) / DENSITY, rel=1e-9)
    assert flow > 1.01 * 4 * area[-1] * inner[0]
    for known, still in ((flow, True), (flow / DENSITY, False)):
        for one, unknowns in ((fed(known), waves), (fed(known).rigid, inner)):
            rest = one.evaluate(FlowMotion.still(area, unknowns), given())[1]
            assert (np.abs(rest).max() < 1e-9 * SUPPLY) == still


@pytest.mark.slow
def test_jacobians_of_everything_together():
    z, area = passage()
    law, rng = everything(z), np.random.default_rng(4)
    inner = law.steady_inner(area, given()) * rng.uniform(0.9, 1.1, law.inner)
    motion = FlowMotion(area, 0.02 * rng.standard_normal(len(z)), rng.standard_normal(len(z)), inner, 10.0 * inner)
    way = FlowMotion(*(np.abs(part).max() * rng.standard_normal(part.shape) for part in motion))
    way = way._replace(area=0.1 * area * way.area / np.abs(way.area).max())
    found, d = law.linearise(motion, given()), 1e-5
    ends = [law.evaluate(FlowMotion(*(a + s * d * b for a, b in zip(motion, way))), given()) for s in (1, -1)]
    for names, (ahead, back) in zip((("A0", "A1", "A2", "B0", "B1"), ("R0", "R1", "R2", "S0", "S1")), zip(*ends)):
        slope = sum(found[name] @ b for name, b in zip(names, way))
        assert np.abs(slope - (ahead - back) / (2 * d)).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.slow
def test_steps_of_everything_together():
    """Slopes against differences; books that close to rounding with any step, and steps that take the less the shorter
    they are. The gas takes in what the line hands over, but for what a pipe behind gives back.
    """
    (z, area), period = passage(), 0.2
    shape = np.linspace(0.3, 0.0, len(z))

    def at(t):
        x = 2 * np.pi * t / period
        return area * (1 + 0.5 * shape * (1 - np.cos(x))), area * np.pi / period * shape * np.sin(x)

    taken = []
    for tail, count in ((1e6, 50), (0.2, 50), (0.2, 100)):
        law = everything(z, tail=tail)
        fluid = MovingFluid(law, DENSITY)
        start = fluid.steady_inner(area, SUPPLY)
        state, h = fluid.moving(at(0.0), np.zeros(len(z)), start, SUPPLY), 0.5 * period / count
        before = fluid.energies(area, start)
        for i in range(count):
            new = at((i + 1) * h)
            step = fluid.step(state, None, h, 1.0, 1.5, SUPPLY)
            flow = step.at(new, new)
            state = flow.state()
        after, books = fluid.energies(*new[:1], state.inner), dict(zip(law.book_names, state.books))
        gained = {name: after[name] - before[name] for name in before}
        gas = [value for name, value in books.items() if name.startswith("gas_")]
        line = [value for name, value in books.items() if name.startswith("line_")]
        assert abs(gained["gas_energy"] - gas[0] + sum(gas[1:])) < 1e-11 * gas[0]
        waves = gained["line_kinetic_energy"] + gained["line_elastic_energy"]
        assert abs(waves - line[0] + sum(line[1:])) < 1e-11 * line[0]
        assert (abs(books["line_work"] - books["gas_supply"]) < 1e-10 * books["line_work"]) == (tail > 1.0)
        taken.append(books["line_step_loss"])
    assert taken[1] > 2.5 * taken[2] > 0.0
    way = area * np.linspace(1.0, -1.0, len(z))
    expected = difference(lambda x: step.at((x, new[1]), (x, new[1])).pressure, new[0], way, 1e-5)
    assert np.abs(flow.slopes(0.0) @ way - expected).max() < 1e-6 * np.abs(expected).max()
