"""Branches of limit cycles that start from a cycle of another branch, or from a run in time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from continuation.cycle_points import SpecialCycle
from continuation.cycles import Cycle
from continuation.harmonics import Harmonics
from continuation.options import Reason
from continuation.periodic import PeriodicMotion
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.observer import Observer
from dbvfiv.record.record import GrowingRecord
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.cycle import start, study
from dbvfiv.studies.cycle.start import _cycle_of
from dbvfiv.studies.orbits import Follower, _goes_on, _Refused
from dbvfiv.studies.session import load_result, resume_result
from tests.observers import Stop
from tests.studies.test_cycle import session_of


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("cycles") / "cycles.h5"
    session_of(cycle__over="density=230:250:2", cycle__exponents=0).perform("cycle", path)
    return path


def started(file, **changes):
    given = {"cycle__start": "file", "cycle__start_file": str(file), "cycle__over": "density=226:233:2"}
    return session_of(**given | {"cycle__exponents": 0} | changes)


class _Stopper(Observer):
    """Interrupts once the way up has begun."""

    def __init__(self):
        self.last = np.inf

    def item(self, result):
        if result.value > self.last:
            raise KeyboardInterrupt
        self.last = result.value


def test_both_ways_from_a_cycle_and_resumed(file, tmp_path):
    (there,) = (p for p in load_result(file).points if p.value == 230.0)
    path = tmp_path / "ways.h5"
    part = started(file).perform("cycle", path, _Stopper())
    assert part.interrupted and {p.leg for p in part.points} == {0, 1}
    whole = resume_result(path)
    values = [p.value for p in whole.points]
    assert whole.complete and whole.onset is None
    assert values == sorted(values, reverse=True) and {values[0], values[-1]} == {233.0, 226.0}
    (again,) = (p for p in whole.points if p.value == 230.0)
    assert np.isclose(again.amplitude, there.amplitude, rtol=1e-4)
    assert np.all(np.diff([p.amplitude for p in whole.points]) > 0)
    assert "branch" in whole.figures()


def test_what_an_ended_leg_missed_is_said_again(file, tmp_path, monkeypatch):
    """Down from the cycle there is none; on the way up a cycle draws in fluid, and the run is interrupted."""
    near, row = Follower.near, study.cycle_row

    def only_up(follower, guess, value):
        if value < 230.0:
            raise SolveError("No cycle was found.")
        return near(follower, guess, value)

    path = tmp_path / "ways.h5"
    with monkeypatch.context() as patched:
        patched.setattr(Follower, "near", only_up)
        patched.setattr(study, "cycle_row", lambda *given: row(*given) | {"least_speed": -1.0})
        part = started(file).perform("cycle", path, Stop(2))
    assert part.interrupted and len(part.failures) == 1 and study.DRAWN_IN in part.warnings
    whole = resume_result(path)
    assert whole.complete and whole.failures == part.failures and set(part.warnings) <= set(whole.warnings)
    assert whole.points[0].value == 233.0


def test_special_points_of_the_part_before_are_told_to_the_branch(file):
    result = load_result(file)
    record = GrowingRecord(result.header, result.mesh, study.tables_of(result.mesh))
    orbit = SimpleNamespace(lip_extremes=(0.0, 1e-3))
    keeper = study._Keeper(record, SimpleNamespace(case=result.case, parameter="density", orbit=lambda _: orbit))
    point = SimpleNamespace(cycle=None, motion=SimpleNamespace(omega=1.0))
    for value in (240.0, 241.0):
        keeper.keep(SpecialCycle("fold", point, value, 0.0, True))
    told = []
    tracer = SimpleNamespace(next_step=0.01, points=[], known=[])
    tracer.run = lambda step: told.extend(tracer.known) or Reason.POINTS()
    keeper.follow(tracer)
    assert told == [("fold", 240.0), ("fold", 241.0)]


def made_cycle(size, value):
    return Cycle(PeriodicMotion(Harmonics(1), np.array([[0.0], [size], [0.0]]), 1.0), {"density": value}, 0.0, 0, 0)


def test_a_branch_that_turns_round_at_once_begins_with_its_smaller_cycles():
    """The second cycle lies nearer to the onset than the first; a value asked for lies nearer than both."""
    follower, taken, tracer = object.__new__(Follower), [], SimpleNamespace()
    tracer.extend = lambda cycle, *_: taken.append(cycle.mu["density"])
    vars(follower).update(name="density", parameter="density", lip=0, tracer=lambda *_: tracer)
    follower.from_onset = lambda *_: (made_cycle(0.0, 240.0), made_cycle(1.0, 238.0), made_cycle(1.25, 239.0), False)
    follower.beside = lambda _onset, _first, value: made_cycle(0.5, value)
    _, missed = follower.begin(SimpleNamespace(value=240.0), [200.0, 239.5], None)
    assert taken == [239.5, 238.0, 239.0]
    assert len(missed) == 1 and "turns round beside the onset" in missed[0]


@pytest.mark.parametrize(("end", "taken"), [(250.0, 1e-3), (240.2, 1.25e-4)])
def test_first_cycles_lie_within_the_range(end, taken):
    """Smaller ones than asked for beside an end of it, where larger ones would lie beyond."""
    follower, tried = object.__new__(Follower), []
    case = SimpleNamespace(cycle=SimpleNamespace(amplitude=1e-3))
    vars(follower).update(name="density", parameter="density", case=case)

    def beside(_onset, amplitude):
        tried.append(amplitude)
        if amplitude == 5e-4:
            raise _Refused("It must be at most 241.")
        return *(made_cycle(k * amplitude, 240.0 + 2e6 * (k * amplitude) ** 2) for k in (0, 1, 2)), True

    follower._beside_rest = beside
    rest, first, second, _ = follower.from_onset(SimpleNamespace(value=240.0), [200.0, end])
    assert tried[-1] == taken and rest.mu["density"] < first.mu["density"] < second.mu["density"] <= end
    with pytest.raises(SolveError, match=r"cycle.amplitude\): cycles lie beyond the range"):
        follower.from_onset(SimpleNamespace(value=240.0), [200.0, 240.0])


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("ratio", [2.0, 1.25])
def test_a_fold_up_to_the_second_cycle_is_seen_by_its_value(side, ratio):
    """Also one so far below the first cycle that both lie beyond the onset."""
    for fold, goes_on in ((0.5, False), (0.65, False), (0.9 * ratio, False), (1.1 * ratio, True)):
        values = [5.0 + side * r**2 * (1 - 0.5 * (r / fold) ** 2) for r in (0.0, 1.0, ratio)]
        assert _goes_on(*values, ratio) == goes_on


def test_the_last_period_of_a_run_is_at_the_pressure_of_its_drive(tmp_path, monkeypatch):
    """Pressure of the hold, 6 kPa for the 18 kPa of the case; the lip, alone in a limit cycle, has the frequency."""
    table = tmp_path / "hold.csv"
    table.write_text("time [s], pressure [kPa]\n0, 0\n0.1, 6\n")
    steady, lasting = ({"verdict": name, "frequency": f} for name, f in (("steady", None), ("limit cycle", 40.0)))
    run = SimpleNamespace(
        kind="transient",
        case=session_of(drive__pressure=18e3, transient__drive_table=str(table)).case,
        mesh=SimpleNamespace(differs_from=lambda model: ""),
        history={"time": np.array([0.0, 0.5])},
        verdict={"verdict": "limit cycle", "frequency": None, "mass_flow": steady, "lip_displacement": lasting},
    )
    monkeypatch.setattr(start, "load_result", lambda _: run)
    model = SimpleNamespace(flow=SimpleNamespace(inner=2), pump=None)
    walk = SimpleNamespace(built=lambda _: SimpleNamespace(model=model))
    asked = started(table, cycle__over="pressure=4 kPa:8 kPa:3").case
    with pytest.raises(CaseError, match="an elastic line, or a compressed fluid, does not start"):
        start.given_motion(asked, walk)
    monkeypatch.setattr(start, "_last_period", lambda _model, _case, place, _run: place.pressure)
    given = start.given_motion(asked, walk)
    assert given.value == given.motion == 6e3
    model.pump = object()
    monkeypatch.setattr(start, "operating_pressure", lambda _: 7e3)
    assert start.given_motion(asked, walk).value == 7e3  # where a run behind a pump ends


def test_a_series_without_its_cycle_is_cut(file):
    result = load_result(file)
    record = GrowingRecord(result.header, result.mesh, study.tables_of(result.mesh))
    for number, count in enumerate((2, 3)):
        motion = result.points[0].orbit.motion.resized(count)
        record.extend(study.SERIES, study.series_rows(number, motion, result.model.size))
    record.append(study.CYCLES, result.points[0].numbers)
    assert study.rows_to_keep(record, result.case) == {study.CYCLES: 1, study.SERIES: 5}


@pytest.mark.slow
def test_over_another_parameter(file):
    """From the nearest cycle of a branch over the density to one over the pressure."""
    (there,) = (p for p in load_result(file).points if p.value == 230.0)
    found = started(file, cycle__over="pressure=5.9 kPa:6 kPa:2", fluid__density=230.0).perform("cycle")
    assert found.points[0].value == 6e3 and found.points[-1].value == 5.9e3
    assert np.isclose(found.points[0].amplitude, there.amplitude, rtol=1e-4)


@pytest.mark.slow
def test_from_a_run_in_time(file, tmp_path):
    """The cycle is that of the branch from the onset; the run's steps leave it a little off."""
    (there,) = (p for p in load_result(file).points if p.value == 230.0)
    path = tmp_path / "run.h5"
    run = {"start": "kick", "kick_opening": there.amplitude, "step": 1e-3, "duration": 1.5}
    changes = {f"transient__{key}": value for key, value in run.items()} | {"fluid__density": 230.0}
    result = session_of(**changes, transient__stop_when=["limit cycle"]).perform("transient", path)
    assert result.verdict["verdict"] == "limit cycle"
    found = started(path, cycle__over="density=229:230:2").perform("cycle")
    assert found.points[0].value == 230.0 and np.isclose(found.points[0].amplitude, there.amplitude, rtol=1e-4)
    assert found.points[-1].value == 229.0


@pytest.mark.parametrize("number, value", [(None, 250.0), (0, 230.0), (1, 240.0), (-2, 240.0)])
def test_the_cycle_of_a_number_is_that_of_its_row(number, value):
    """In the order in which cycles lie on the branch and are printed; the last one by default, as everywhere."""
    keys = {"cycle.over": "density=226:233:2", "cycle.start": "file", "cycle.start_file": __file__}
    keys |= {} if number is None else {"cycle.start_cycle": number}
    # a branch that went up from its start first, and down afterwards
    points = [SimpleNamespace(number=row, value=value) for row, value in ((2, 230.0), (0, 240.0), (1, 250.0))]
    result = SimpleNamespace(points=points, parameter="density")
    assert _cycle_of(thesis_case(keys), result).value == value


def stored(kind, case, **more):
    """A result of a case as `given_motion` reads it."""
    return SimpleNamespace(kind=kind, case=case, mesh=SimpleNamespace(differs_from=lambda model: ""), **more)


@pytest.mark.parametrize(
    ("over", "changes", "value"),
    [
        ("thickness=0.5:1.5:3", {"valve.thickness_factor": 0.9}, 0.9 / 1.2),
        ("angle=30:60:4", {"layers.2.angle": 40.0, "layers.3.angle": -40.0}, 40.0),
        ("strain=0.1:0.6:6", {"materials.strain_level": 0.2}, 0.2),
        ("pipe_length=1:9:3", {"upstream.length": 5.0, "upstream.diameter": 0.3}, 5.0),
        ("pipe_length=1:9:3", {}, None),
    ],
)
def test_a_motion_starts_at_the_value_that_its_own_valve_has(monkeypatch, over, changes, value):
    """Parameters of the wall and of pipes too; a factor on the thickness counts from this case."""
    line = {"upstream__length": 2.0, "upstream__diameter": 0.3} if "pipe" in over else {}
    keys = {"cycle__start": "file", "cycle__start_file": "run.h5", "cycle__over": over, "valve__thickness_factor": 1.2}
    case = session_of(**keys | line).case
    monkeypatch.setattr(start, "load_result", lambda _: stored("transient", thesis_case(changes)))
    monkeypatch.setattr(start, "_last_period", lambda model, *_: model)
    monkeypatch.setattr(start, "ValveModel", lambda case: case.upstream.length)
    model = SimpleNamespace(pump=None, case=case)
    walk = SimpleNamespace(built=lambda _: SimpleNamespace(model=model))
    if value is None:
        with pytest.raises(CaseError, match="has no one pipe_length to start from"):
            start.given_motion(case, walk)
        return
    given = start.given_motion(case, walk)
    assert given.value == pytest.approx(value) and given.place[case.cycle.axis.parameter] == given.value
    assert given.motion == (value if line else model)  # the line that the run had


def test_the_cycle_nearest_to_this_wall_is_taken():
    """Values of a branch over the thickness count from the wall of its own case; one over a line that is not there
    needs a number.
    """
    points = [SimpleNamespace(number=k, value=value) for k, value in enumerate((0.8, 1.0, 1.2))]
    result = stored("cycle", thesis_case({"valve.thickness_factor": 0.5}), points=points, parameter="thickness")
    result.nearest = lambda value: min(points, key=lambda point: abs(point.value - value))
    case = thesis_case({"cycle.over": "pressure=5 kPa:6 kPa:2", "valve.thickness_factor": 0.58})
    assert _cycle_of(case, result).value == 1.2
    result.parameter = "pipe_length"
    with pytest.raises(CaseError, match="of which this valve has no one value; give cycle.start_cycle"):
        _cycle_of(case, result)


def test_files_that_nothing_starts_from(file, tmp_path):
    with pytest.raises(CaseError, match=r"cycle.start_file.*none with start = 'file'"):
        session_of(cycle__start="file")
    with pytest.raises(CaseError, match=r"beyond the range from 100 kg/m³ to 200 kg/m³"):
        started(file, cycle__over="density=100:200:2").perform("cycle")
    with pytest.raises(CaseError, match="there is no cycle 99"):
        started(file, cycle__start_cycle=99).perform("cycle")
    with pytest.raises(CaseError, match="belongs to a mesh of"):
        started(file, mesh__around=4).perform("cycle")
    with pytest.raises(CaseError, match="belongs to another valve"):
        started(file, valve__scale=0.8).perform("cycle")
    other = tmp_path / "steady.h5"
    session_of().perform("steady", other)
    with pytest.raises(CaseError, match="of kind 'steady'"):
        started(other).perform("cycle")
    run = tmp_path / "short.h5"
    session_of(transient__duration=2e-3, fluid__density=230.0).perform("transient", run)
    with pytest.raises(CaseError, match="has not settled on a cycle"):
        started(run).perform("cycle")
