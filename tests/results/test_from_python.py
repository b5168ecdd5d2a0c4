"""What a notebook does: arrays, texts, copies, and what is shown of an object."""

import json
import pickle

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.studies.case import thesis_case
from tests.small_valves import SMALL

COARSE = SMALL | {"drive.pressure": 2e3, "fluid.density": 10}


@pytest.fixture(scope="module")
def valve():
    return dbvfiv.Valve(thesis_case(COARSE), "dbv12")


RUNS = {
    "steady": lambda valve, **o: valve.steady([1e3, 2e3], **o),
    "modes": lambda valve, **o: valve.modes(**o),
    "sweep": lambda valve, **o: valve.sweep("density=1:100:3:log", **o),
    "sensitivity": lambda valve, **o: valve.sensitivity("pressure", **o),
    "onset": lambda valve, **o: valve.onset("alpha=0.1:30:3:log", **o),
    "map": lambda valve, **o: valve.replace({"map.curve": False, "map.refine": 0}).map(
        "density=1:100:2:log", "alpha=0.1:30:2:log", **o
    ),
    "transient": lambda valve, **o: valve.transient("5 ms", **o),
    "closure": lambda valve, **o: valve.closure("1 kPa", **o),
}


@pytest.mark.parametrize("kind", RUNS)
def test_results_can_be_copied(tmp_path, valve, kind):
    path = tmp_path / "r.h5"
    result = RUNS[kind](valve, output=path)
    result.model, result.lines()  # what is worked out on the way must do no harm
    stored = dbvfiv.load_result(path)
    text = pickle.dumps(stored)
    path.unlink()  # a copy holds everything itself
    for copy in (pickle.loads(pickle.dumps(result)), pickle.loads(text)):
        assert json.dumps(copy.summary(), default=str) == json.dumps(result.summary(), default=str)
        assert copy.complete and copy.lines() == result.lines() and repr(copy) == repr(result)
        assert copy.model.size == result.model.size
        copy.save(tmp_path / "again.h5")
        assert dbvfiv.load_result(tmp_path / "again.h5").lines() == result.lines()
    assert f"{type(result).__name__} of 'dbv12', complete: " in repr(result)
    if kind == "closure":
        (pressed,) = result.states
        assert pickle.loads(pickle.dumps(pressed)).summary() == pressed.summary()


def test_states_and_modes_can_be_copied(valve):
    state = valve.steady(2e3)
    copy = pickle.loads(pickle.dumps(state))
    assert copy.summary() == state.summary() and np.array_equal(copy.layers.stress, state.layers.stress)
    assert copy.modes(count=1).modes[0].growth_rate == pytest.approx(state.modes(count=1).modes[0].growth_rate)
    for ask in (state.pencil, state.modes):
        with pytest.raises(CaseError, match="the pressure it was found at"):
            ask(pressure="3 kPa")
    alone = pickle.loads(pickle.dumps(state.solution()))
    assert np.array_equal(alone.q, state.q)
    mode = state.modes(count=1).modes[0]
    again = pickle.loads(pickle.dumps(mode))
    assert again.eigenvalue == mode.eigenvalue and np.array_equal(again.shape, mode.shape)
    assert "2 kPa" in repr(state) and "Hz" in repr(mode) and len(repr(mode)) < 80


def test_a_valve_can_be_copied_and_says_what_it_is(valve):
    valve.model
    copy = pickle.loads(pickle.dumps(valve))
    assert copy.case == valve.case and copy.name == valve.name and copy.model.size == valve.model.size
    assert repr(valve) == "<Valve 'dbv12': 6 x 8 elements, 5 layers, 2 kPa, 10 kg/m3>"


@pytest.mark.slow
def test_arrays_and_single_texts(valve):
    found = valve.steady(np.linspace(1e3, 2e3, 3))
    assert [state.pressure for state in found.states] == [1000, 1500, 2000] and found.nearest(1600).pressure == 1500
    assert [state.pressure for state in valve.steady(np.array(["1 kPa"])).states] == [1000]
    assert [state.pressure for state in valve.steady(["500 Pa", 1000]).states] == [500, 1000]
    assert [state.pressure for state in valve.closure(np.linspace(500, 1000, 2)).states] == [500, 1000]
    assert [state.pressure for state in valve.steady().states] == [2e3]  # as the command does: that of the drive


def test_one_pressure_gives_a_state(coarse_valve, coarse_run):
    state = coarse_valve.steady(pressure="18 kPa")
    assert state.pressure == 18e3 and state.mass_flow == pytest.approx(coarse_run.states[1].mass_flow, rel=1e-6)
    assert state.model is coarse_valve.model
    assert coarse_valve.steady(pressure=np.float64(500)).pressure == 500


def test_failures_are_raised(coarse_valve, refused):
    with pytest.raises(SolveError, match="No equilibrium"):
        coarse_valve.replace({"steady.max_iterations": 2, "steady.min_step": 0.3}).steady(pressure=100)
    for pressure in (-1, float("nan"), "3 mm", [], True, None.__class__):
        with pytest.raises(CaseError):
            coarse_valve.steady(pressure=pressure)
    with refused(CaseError):
        dbvfiv.load(thesis_case(), {"shell.metric": "true"})


def test_what_the_package_offers():
    results = (
        "Steady Modes Sweep Sensitivity Levels Onset Map Closure Transient Cycle Uncertainty Design Response Identify"
    )
    public = {"Valve", "load", "load_result", "resume", "CaseError", "SolveError", "Observer", "State"}
    public |= {f"{name}Result" for name in results.split()}
    assert public <= set(dir(dbvfiv)) and public == set(dbvfiv.__all__)
    assert isinstance(dbvfiv.load(thesis_case(), COARSE), dbvfiv.Valve) and issubclass(dbvfiv.CaseError, ValueError)
    with pytest.raises(AttributeError):
        dbvfiv.laod


@pytest.mark.parametrize(
    "changes, key, value",
    [
        ({"drive.pressure": "6 kPa"}, "drive.pressure", 6e3),
        ({"drive.pressure": "6000"}, "drive.pressure", 6e3),
        (["drive.pressure=6 kPa"], "drive.pressure", 6e3),
        ('drive.pressure = "6 kPa"', "drive.pressure", 6e3),
        ({"mesh.around": "8"}, "mesh.around", 8),
        (["mesh.around=8", "shell.metric=shifted"], "shell.metric", "shifted"),
        ({"mesh.around": np.int64(8)}, "mesh.around", 8),
        ({"drive.pressure": np.float64(3e3)}, "drive.pressure", 3e3),
        ({"steady.pressures": np.array([1e3, 2e3])}, "steady.pressures", (1e3, 2e3)),
        (["steady.pressures=[1e3, 2e3]"], "steady.pressures", (1e3, 2e3)),
    ],
)
def test_changes_as_people_write_them(tmp_path, changes, key, value):
    (tmp_path / "a.toml").write_text("")
    own = dbvfiv.load(tmp_path / "a.toml", changes)
    assert own.name == "a"
    for valve in (own, dbvfiv.load(thesis_case()).replace(changes)):
        found = valve.case
        for part in key.split("."):
            found = getattr(found, part)
        assert found == value


@pytest.mark.parametrize(
    "changes, words",
    [
        (5, "Changes are given as 5"),
        ({5: 3}, "given as 5"),
        (["drive.pressure"], "drive.pressure"),
        ([7], "given as 7"),
        ({"mesh.around": "eight"}, "eight"),
        ({"mesh.around": "3"}, "mesh.around"),
        ({"steady.pressures": "1 kPa"}, "steady.pressures"),
    ],
)
def test_changes_that_are_none(changes, words, refused):
    with refused(CaseError) as caught:
        dbvfiv.load(thesis_case(), changes)
    assert words in str(caught.value)


@pytest.mark.slow
def test_no_damping_and_no_pressure(valve, tmp_path, command_line):
    found = valve.replace({"map.refine": 1}).map("density=1:100:2:log", "pressure=1000:3000:2", alpha=0, beta=0)
    assert found.complete and found.lines()
    path = tmp_path / "t.h5"
    valve.transient("5 ms", pressure=0, output=path)
    assert command_line("info", path).status == 0
