"""A closure run that is stopped or killed goes on where it stood."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.api import load, resume
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.closure import walk as walked
from dbvfiv.studies.closure.walk import BUCKLED_CLASS, ClosureWalk
from dbvfiv.studies.session import load_result
from tests.observers import Stop
from tests.small_valves import FORMER

COARSE = {"mesh.around": 6, "mesh.along": 10, "closure.max_step": "3 kPa", "closure.eigenvalues": 2}
PRESSURES = [4e3, 1.2e4, 2e4]


@pytest.fixture(scope="module")
def whole():
    return load(thesis_case(), COARSE).closure(PRESSURES)


def agree(result, whole):
    assert result.complete and [s.pressure for s in result.states] == PRESSURES
    for a, b in zip(result.states, whole.states):
        assert np.array_equal(a.nodal, b.nodal)
        assert a.energy_balance == b.energy_balance
        assert (a.load_steps, a.iterations) == (b.load_steps, b.iterations)
    assert [vars(p) for p in result.walk] == [vars(p) for p in whole.walk]
    assert json.dumps(result.summary()) == json.dumps(whole.summary())
    assert result.warnings == whole.warnings and not result.failures


def test_a_run_goes_on_wherever_it_was_interrupted(whole, tmp_path):
    """Before the first state, on the way from the second to the third, and at its end."""
    path = tmp_path / "run.h5"
    stop = Stop(0, "equilibrium at 1050 Pa")
    first = load(thesis_case(), COARSE).closure(PRESSURES, output=path, observer=stop)
    assert not first.states and first.walk
    second = resume(path, observer=Stop(2, "equilibrium"))
    assert not second.complete and len(second.states) == 2
    assert len(load_result(path).walk) > len([p for p in whole.walk if p.pressure <= PRESSURES[1]])
    agree(resume(path), whole)
    with pytest.raises(CaseError, match="nothing to resume"):
        resume(path)


@pytest.mark.slow
def test_a_walk_that_is_stopped_beyond_a_limit_meets_it_again(tmp_path):
    path = tmp_path / "run.h5"
    thin = {"mesh.around": 8, "mesh.along": 14, "valve.thickness_factor": 0.4, "closure.max_step": "0.5 kPa"} | dict(
        FORMER
    )
    complete = load(thesis_case(), thin).closure([3e3, 8e3])
    first = load(thesis_case(), thin).closure([3e3, 8e3], output=path, observer=Stop(0, "arclength point 5"))
    assert not first.complete and len(first.states) == 1
    last = resume(path)
    assert json.dumps(last.summary()) == json.dumps(complete.summary())
    assert last.before_limit is not None and np.array_equal(last.before_limit.nodal, complete.before_limit.nodal)


def test_what_buckles_in_another_class_is_said_again(whole):
    """By a walk that has seen no state itself."""
    walk, said = object.__new__(ClosureWalk), []
    walk.model, notes = whole.model, {BUCKLED_CLASS: [{"pressure": 7e3, "symmetry": "SA"}]}
    walk.record = SimpleNamespace(rows=lambda _: 0, notes=notes.get, warn=lambda *sentences: said.extend(sentences))
    walk._warn_of_states()
    assert len(said) == 1 and said[0].startswith("The wall buckles at 7000 Pa in class SA: ")


@pytest.mark.parametrize(("beyond", "noted"), [(False, [{"SA": -1.0}]), (True, [])])
def test_other_classes_are_looked_at_up_to_a_limit_point(beyond, noted):
    """The collapsed wall that sways at 20 kPa made that its first limit, met at 27.6 kPa as the pressure rises."""
    walk, notes = object.__new__(ClosureWalk), []
    walk.own, sways = (SimpleNamespace(see=lambda *_, a=a: SimpleNamespace(lowest=a), before=None) for a in (1.0, -1.0))
    walk.watches, walk.beyond_limit, walk._keep_buckling = {"SS": walk.own, "SA": sways}, beyond, lambda: None
    walk.record = SimpleNamespace(note=lambda _, pressure, lowest: notes.append(lowest))
    assert walk._watch(2e4, np.zeros(1)).lowest == 1.0 and notes == noted


def test_a_state_that_arclength_has_led_to_goes_on_as_it_is_taken_up_again():
    """With the same slope, or with none in the path and in the ledger."""
    for slope in (None, np.array([2.0])):
        walk, begun, kept = object.__new__(ClosureWalk), [], []
        walk.energy = SimpleNamespace(begin=lambda *given: begun.append(given), totals=(1.0, 1.0, 0.0))
        walk.model = SimpleNamespace(nodal=lambda q: q, shell=SimpleNamespace(dofs=SimpleNamespace(restrict=np.array)))
        walk.steps = SimpleNamespace(pressure=3e3, q=np.array([1.0]), step=10.0, slope=slope, reach=fails)
        walk._kept, walk.steps.settle = {}, lambda: None
        walk._go_past_limit = walk._watch = lambda *_: None
        walk._keep_state = lambda *given: kept.append({"way/slope": np.array([np.nan])} | named(given[-1]))
        walk._go_to(3e3)
        row = kept[0] | {"pressure": 3e3, "nodal": np.array([1.0]), "beyond_limit": True}
        walk._value, walk.record, walk.watches, walk.own = lambda name, _: row[name], NoRows, {"SS": 0}, NoRows
        walk._take_up(0)
        assert begun[0] == begun[1] == (walk.steps.q, 3e3, slope) and walk.steps.slope == slope


class NoRows:
    """A record and a watch that hold nothing."""

    found = ()

    @staticmethod
    def rows(_):
        return 0


def fails(_target):
    raise SolveError("No equilibrium was found.")


def named(way):
    """Restart data by the names of their columns."""
    return {f"way/{name}": value for name, value in way.items()}


@pytest.mark.parametrize(("target", "kept"), [(8e3, 1), (2e3, 0)])
def test_a_walk_that_is_lost_as_the_pressure_falls_has_no_last_state_before_a_limit(target, kept, monkeypatch):
    monkeypatch.setattr(walked, "LoadCurve", lambda *_: None)
    monkeypatch.setattr(walked, "follow_past_limits", lambda _curve, target: fails(target))
    walk, found = object.__new__(ClosureWalk), []
    walk.steps = SimpleNamespace(pressure=5e3, q=None, options=SimpleNamespace(newton=None))
    walk.model = SimpleNamespace(case=thesis_case())
    walk.record = SimpleNamespace(progress=lambda _: None)
    walk._keep_before_limit = lambda *given: found.append(given)
    with pytest.raises(SolveError, match="Arclength did not get under way"):
        walk._go_past_limit(target, SolveError("No equilibrium was found."))
    assert found == [(5e3, None)] * kept
