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

from dbvfiv.flow import Channel, Stream
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
    assert ours["B1"][1:] == pytest.approx(theirs["B1"][1:] - 850.0 * 4.0)
    assert ours["S1"] == pytest.approx(theirs["S1"] - 850.0 * 4.0)
    assert ours["A2"] == pytest.approx(theirs["A2"]) and ours["B0"] == pytest.approx(theirs["B0"])


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
