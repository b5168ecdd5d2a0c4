"""The drive turns from flow to back pressure in time: the valve shuts, stays shut, and nothing runs away."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.flow import Channel
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.closure.reversal import Closing, ContactValve, Turn, closing_valve, run_closing
from tests.small_valves import FORMER

COARSE = {"mesh.around": 6, "mesh.along": 10, "closure.pressures": ["10 kPa"]}


def _fluid(storage=0.0):
    return MovingFluid(Channel(np.linspace(0, 0.5, 8), 1e-6, storage), 1000.0)


AREA = 1e-4 * np.array([1.0, 1.1, 1.5, 3.0, 6.0, 9.0, 12.0, 13.0])
RATE = 1e-3 * np.array([0.0, -0.5, -1.0, 0.5, 1.0, 0.0, -0.3, 0.0])


def flow(fluid, inlet, old, h, passage, known=0.0):
    """Step from a velocity, equations at its end, in a passage that stays; `known` changes what is held at outlet."""
    state = fluid.moving(passage, np.zeros(8), np.array([old]), inlet)
    held = state.held.copy()
    held[8] += known * h
    return fluid.step(replace(state, held=held), passage, h, 1.0, 1.0, inlet).at(passage, passage)


@pytest.mark.parametrize("storage", [0.0, 1.0])
@pytest.mark.parametrize("inlet", [-3e4, -500.0, 0.0, 40.0, 2e4])
@pytest.mark.parametrize("known", [-4.0, 0.0, 4.0])
def test_there_is_one_velocity_at_every_drive_and_it_meets_the_outlet(storage, inlet, known):
    fluid, h, passage = _fluid(storage), 1.0 / 80.0, (AREA, RATE)
    found = flow(fluid, inlet, 0.0, h, passage, known)
    law = fluid.law.reversed()
    given = law.values({"inlet": inlet, "density": 1000.0})
    held = lambda u: float(law.held(*passage, np.array([u]), given)[8])  # noqa: E731

    def outlet(u):
        source = float(law.sources(*passage, np.array([u]), given)[8])
        return 1000.0 * (source + (held(u) - held(0.0)) / h - known)

    u = found.inner[0]
    assert abs(outlet(u)) <= 1e-9 * (abs(inlet) + 1000 * (abs(known) + 0.5 * found.speed[0] ** 2 + abs(held(u)) / h))
    assert outlet(u + 1e-3) < outlet(u) and found.pressure[0] == 0.0


def test_steady_flow_drawn_in_is_sucked_to_the_throat_and_lost_behind_it():
    fluid, inlet = _fluid(), -3e3
    area = 1e-4 * np.array([1.2, 1.1, 0.5, 0.8, 0.7, 9.0, 12.0, 13.0])
    found = flow(fluid, inlet, 0.0, 1e9, (area, np.zeros(8)))
    p, speed = found.pressure, found.speed
    # to the throat as Bernoulli says, then a jet, and the same again in the second narrowing
    assert p[1:3] == pytest.approx(-500 * speed[1:3] ** 2)
    assert p[3] == pytest.approx(p[2])
    assert p[4] == pytest.approx(p[3] - 500 * (speed[4] ** 2 - speed[3] ** 2))
    assert p[5:] == pytest.approx(inlet)
    assert speed[-1] < 0


def test_contact_of_the_coupled_valve_is_part_of_its_exact_tangent():
    model = ContactValve(thesis_case(COARSE))
    generator = np.random.default_rng(4)
    nodal = 2e-4 * generator.standard_normal((len(model.mesh.nodes), 5))
    nodal[:, 1] -= 3e-4
    q = model.shell.dofs.restrict(nodal)
    assert model.faces.state(q).touching.any()
    direction = generator.standard_normal(model.size)
    tangent = model.tangent(q, 2e3)
    assert tangent.residual == pytest.approx(model.residual(q, 2e3), abs=1e-9 * np.abs(tangent.residual).max())
    h = 1e-10
    change = (model.residual(q + h * direction, 2e3) - model.residual(q - h * direction, 2e3)) / (2 * h)
    assert model.apply(tangent, direction) == pytest.approx(change, rel=1e-3, abs=1e-4 * np.abs(change).max())


def test_a_history_that_opens_again_is_not_shut_before_it_shuts_for_good():
    turn = Turn(1e4, 0.1, 0.4)
    assert [turn(t) for t in (0.0, 0.3, 0.5, 0.9)] == pytest.approx(
        [1e4, 0.0, -1e4, -1e4], abs=1e-9
    ) and turn.zero == pytest.approx(0.3)

    def sample(time, passage):
        still = dict.fromkeys(("mass_flow", "lowest_pressure", "highest_pressure", "penetration"), 0.0)
        return SimpleNamespace(time=time, least_opening=passage, **still)

    history = [sample(0.1 * i, passage) for i, passage in enumerate((9, 9, 9, 1, 5, 1, 1, 1))]
    result = Closing(tuple(history), turn, 2.0)
    assert result.first_shut == pytest.approx(0.2) and result.closing_time == pytest.approx(0.4)
    assert result.summary()["stays_shut"] is True
    assert Closing(tuple(history[:5]), turn, 2.0).closing_time is None


def test_water_is_turned_round_and_the_valve_shuts_and_stays_shut():
    case = thesis_case(COARSE | {"closure.reversal_time": "0.2 s", "closure.reversal_hold": "0.2 s", **FORMER})
    model, samples = closing_valve(case), []
    halvings, failure = run_closing(model, lambda sample: samples.append(SimpleNamespace(**sample)))
    result = Closing(samples, Turn.of(case), model.shut_below, halvings, failure)
    told = result.summary()
    assert not result.failure and told["stays_shut"]
    assert result.samples[0].inlet_pressure == 10e3 and result.samples[-1].inlet_pressure == -10e3
    assert result.samples[-1].time == pytest.approx(0.42)
    assert 0.1 < told["closing_time"] < 0.4
    for sample in result.samples:
        assert np.isfinite(list(vars(sample).values())).all()
        assert sample.least_opening >= 0.0 and sample.contact_force >= 0.0
    assert told["largest_penetration"] < 1e-4
    # it takes little more than the drive to stop the water; where sections meet, single steps may ask for more
    lowest, highest = np.array([[s.lowest_pressure, s.highest_pressure] for s in result.samples]).T
    assert np.percentile(lowest, 2) > -3e4 and np.percentile(highest, 98) < 3e4
    assert -1e6 < told["lowest_pressure"] and told["highest_pressure"] < 1e6
    # shut, what still passes is a thousandth of the flow there was
    late = [s.mass_flow for s in result.samples if s.time > 0.35]
    assert max(np.abs(late)) < 2e-3 * result.samples[0].mass_flow
    flat = max(s.lip_displacement for s in result.samples if s.time > 0.35)
    assert flat < 1e-6
    # between the faces, which are 0.38 mm apart at rest and turn a little as the duckbill bends
    assert all(0.0 <= s.lip_opening < 0.38e-3 for s in result.samples if s.time > 0.35)
    assert max(s.lip_opening for s in result.samples) > 1e-3
