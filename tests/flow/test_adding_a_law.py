"""The exercise of docs/adding-a-flow-law.md: its code as it stands there, held against what it should do; tests/studies
runs it on a copy of the package.
"""

from __future__ import annotations

import importlib.util
import re
import sys
import tempfile
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from dbvfiv.flow import Channel, FlowMotion, Stream
from tests.flow.test_channel import FLOOR, passage

ROOT = Path(__file__).parents[2]
TERM, KEY, PIPE = re.findall(r"```python\n(.*?)```", (ROOT / "docs/adding-a-flow-law.md").read_text(), re.S)


def module(name: str, source: str) -> ModuleType:
    """A module of a name with a source, as if its file were there."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "module.py"
        path.write_text(source)
        spec = importlib.util.spec_from_file_location(name, path)
        made = importlib.util.module_from_spec(spec)
        sys.modules[name] = made
        spec.loader.exec_module(made)
    return made


def with_key(source: str) -> str:
    """The source of the keys with the exercise's line in it."""
    place = "    unsteady: StrictBool = key("
    assert source.count(place) == 1
    return source.replace(place, KEY.split("\n", 1)[1] + place)


_FILE = module("dbvfiv.flow.terms.lip_loss", TERM + "\n\n" + PIPE)
LipLoss, Pipe, from_case = _FILE.LipLoss, _FILE.Pipe, _FILE.from_case


def test_steady_flow_is_bernoullis_with_a_loss():
    z, area = passage()
    coefficient, inlet, density = 0.6, 18e3, 850.0
    law = Channel(z, FLOOR, terms=[LipLoss(coefficient)])
    speed = law.velocities(area, law.inlet_velocity(area, inlet, density))
    assert inlet == pytest.approx(0.5 * density * ((1 + coefficient) * speed[0] ** 2 - speed[-1] ** 2), rel=1e-12)
    pressure = law.steady_pressure(area, inlet)
    assert pressure[1:] == pytest.approx(inlet - 0.5 * density * (speed[1:] ** 2 - speed[-1] ** 2), rel=1e-12)
    assert pressure[0] == 0.0
    none = Channel(z, FLOOR, terms=[LipLoss(0.0)])
    assert none.steady_pressure(area, inlet) == pytest.approx(Channel(z, FLOOR).steady_pressure(area, inlet), rel=1e-13)


def test_steady_flow_behind_a_pipe():
    z, area = passage()
    inlet, density, loss = 18e3, 850.0, 2.5
    law, bare = Channel(z, FLOOR, terms=[Pipe(4.0, loss)]), Channel(z, FLOOR)
    velocity = law.inlet_velocity(area, inlet, density)
    behind = inlet - 0.5 * density * loss * velocity**2
    assert law.steady_pressure(area, inlet) == pytest.approx(bare.steady_pressure(area, behind), rel=1e-12)
    assert velocity == pytest.approx(bare.inlet_velocity(area, behind, density), rel=1e-12)


def test_a_pipe_adds_its_inertance_to_every_pressure():
    z, area = passage()
    given = {"inlet": 18e3, "density": 850.0}
    bare = Channel(z, FLOOR, 1.0)
    velocity = bare.steady_inner(area, given)
    ours = Channel(z, FLOOR, 1.0, terms=[Pipe(4.0, 0.0)]).linearise_still(area, given, velocity)
    theirs = bare.linearise_still(area, given, velocity)
    assert ours.B1[1:] == pytest.approx(theirs.B1[1:] - 850.0 * 4.0)
    assert ours.S1 == pytest.approx(theirs.S1 - 850.0 * 4.0)
    assert ours.A2 == pytest.approx(theirs.A2) and ours.B0 == pytest.approx(theirs.B0)


@pytest.mark.parametrize("velocity", [1.7, -0.8])
@pytest.mark.parametrize("term", [LipLoss(0.6), Pipe(4.0, 2.5)], ids=["lips", "pipe"])
def test_jacobians_against_complex_steps(term, velocity):
    """The whole law's derivative by one direction in all arguments, by the step that has no rounding.

    |U| is written as sign(U) U, which agrees and is analytic.
    """
    z, area = passage()
    given = {"inlet": 18e3, "density": 850.0}
    m, generator = len(z), np.random.default_rng(4)
    law = Channel(z, FLOOR, 0.8, terms=[term])
    motion = FlowMotion(
        area, 0.02 * generator.standard_normal(m), generator.standard_normal(m), np.array([velocity]), np.array([3.0])
    )
    direction = FlowMotion(*(np.abs(x) * generator.standard_normal(x.shape) for x in motion))
    found = law.linearise(motion, given)
    upper = sum(getattr(found, name) @ d for name, d in zip(("A0", "A1", "A2", "B0", "B1"), direction))
    lower = sum(getattr(found, name) @ d for name, d in zip(("R0", "R1", "R2", "S0", "S1"), direction))
    step = 1e-30
    moved = [x + 1j * step * d for x, d in zip(motion, direction)]
    p = by_hand(law, term, *moved, **given)
    value, outlet = law.evaluate(motion, given)
    assert p.real[1:] == pytest.approx(value[1:], rel=1e-11) and p.real[0] == pytest.approx(outlet[0], rel=1e-11)
    assert upper[1:] == pytest.approx(p.imag[1:] / step, rel=1e-10, abs=1e-10 * np.abs(upper).max())
    assert lower[0] == pytest.approx(p.imag[0] / step, rel=1e-10)


def by_hand(law, term, area, rate, acceleration, inner, inner_rate, inlet, density):
    """Pressures in numpy with complex numbers, rates of the speeds by the product rule."""
    x = area / law.floor - 1.0
    grown = np.exp(-x)
    slope = 1.0 / (1.0 + grown)
    open_ = law.floor * (1.0 + x + np.log(1.0 + grown))
    opened, opened_rate = slope * rate, slope * acceleration + slope * (1.0 - slope) / law.floor * rate**2

    def upstream(values):
        pieces = 0.5 * law.step * (values[1:] + values[:-1])
        return np.append(np.cumsum(pieces[::-1])[::-1], 0.0)

    discharge = open_[-1] * inner[0] - law.storage * upstream(opened)
    discharge_rate = opened[-1] * inner[0] + open_[-1] * inner_rate[0] - law.storage * upstream(opened_rate)
    speed = discharge / open_
    inertia = upstream(discharge_rate / open_ - speed * opened / open_)
    head = 0.5 * (speed**2 - inner[0] ** 2)
    if isinstance(term, LipLoss):
        head[0] += 0.5 * term.coefficient * np.sign(speed[0].real) * speed[0] ** 2
    else:
        head += 0.5 * term.loss * np.sign(inner[0].real) * inner[0] ** 2
        inertia = inertia + term.length * inner_rate[0]
    return inlet - density * (head + inertia)


def test_the_key_is_understood_and_makes_the_term():
    keys = module("dbvfiv.case.physics_of_the_exercise", with_key((ROOT / "dbvfiv/case/physics.py").read_text()))
    assert from_case(SimpleNamespace(fluid=keys.Fluid())) is None
    term = from_case(SimpleNamespace(fluid=keys.Fluid(lip_loss=0.5)))
    assert term.coefficient == 0.5 and [p.name for p in term.parameters] == ["lip_loss"]
    with pytest.raises(ValueError):
        keys.Fluid(lip_loss=-1.0)


def test_the_loss_opposes_the_flow_either_way():
    speed = np.array([2.0, 1.0])
    for sign in (1.0, -1.0):
        stream = Stream(np.ones(2), np.zeros(2), sign * speed, sign * speed[-1:])
        assert np.asarray(LipLoss(0.5).head(stream, {"lip_loss": 0.5})) == pytest.approx([sign, 0.0])
