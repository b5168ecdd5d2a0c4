"""Interrupted and killed studies over parameters go on: nothing is solved twice, and the outcome is that of a run that
was never interrupted.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest

from dbvfiv import resume
from dbvfiv.cli import run
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.observer import Observer
from dbvfiv.record.mesh import MeshData
from dbvfiv.studies import session as sessions
from dbvfiv.studies.case import load_case
from dbvfiv.studies.map.column import MapColumn
from dbvfiv.studies.modes.search import FoundModes
from dbvfiv.studies.session import Session, find_study, kept_run, load_result
from dbvfiv.studies.stability.samples import Sample
from dbvfiv.studies.steady.study import LIMIT
from tests.golden.compare import differences, steady
from tests.observers import Stop
from tests.small_valves import FORMER, SMALL
from tests.studies.map.axes import AXES

ONSET = {"onset.over": "pressure=4 kPa:12 kPa:5", "onset.normal_form": False, "fluid.density": 4.0, **FORMER}
SCAN = {"onset.over": "density=1:1000:4:log", "onset.coarse_mesh": 0, "onset.normal_form": False}
#: Its curves need three rounds of columns.
CURVES = {"map.x": "pressure=500:30000:4", "map.y": "density=1:1000:10:log", "map.checks": 1, "damping.beta": 0.001}
LONG = {"upstream.length": 100.0, "upstream.elements": 2, "drive.pressure": "6 kPa"}
#: Runs by name, the study first.
RUNS = {
    "modes": {"modes.symmetry": "all", "modes.count": 2},
    "modes-undecided": {"modes.symmetry": "all", "modes.count": 2, "upstream.wave_speed": 300.0, **LONG},
    "sweep": {"sweep.over": "density=1:1000:5:log", "sweep.count": 3},
    # a rubber that is unstable at the state is said again by who goes on
    "sensitivity": {"sensitivity.of": ["pressure", "density", "alpha"], "drive.pressure": "36 kPa"},
    "onset": ONSET,
    "onset-classes": SCAN | {"onset.symmetry": "all"},
    "map": AXES,
    "map-curves": CURVES | dict(FORMER),
}


class Watch(Observer):
    """Remembers what was solved; interrupts the run after some items."""

    def __init__(self, most=10**6):
        self.left, self.solved, self.items = most, [], 0

    def item(self, result):
        self.items += 1
        if isinstance(result, Sample):
            self.solved.append((*result.key[:3], result.value))
        elif isinstance(result, MapColumn):
            self.solved.append((result.value, result.level))
        elif isinstance(result, FoundModes):
            self.solved.append(result.modes[0].symmetry)
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def perform(case, name, output=None, observer=None, **choices):
    return Session(case.replace(RUNS[name])).perform(name.split("-")[0], output, observer, **choices)


@pytest.fixture(scope="module")
def wholes(coarse_case):
    """Results of runs that were never interrupted, and what these solved."""
    known = {}

    def whole(name):
        if name not in known:
            watch = Watch()
            known[name] = perform(coarse_case, name, observer=watch), watch
        return known[name]

    return whole


def same(result, whole):
    """To what sums in another order leave: equal runs of one process may differ by rounding."""
    assert result.complete
    found, expected = (dict(part.summary()) for part in (result, whole))
    assert set(found.pop("warnings")) == set(expected.pop("warnings"))
    assert not [*differences(steady(found), steady(expected))]


@pytest.mark.parametrize("key, value", [("value", 2.0), ("criticality", "sub"), ("uncertainty", 1e-3)])
def test_points_next_to_neutral_are_compared(key, value):
    """A growth rate that is left at an onset is not; all else of it is."""
    point = {"growth_rate": 1e-11, "frequency": 50.0, "value": 1.0, "criticality": "super", "uncertainty": 2e-3}
    same, other = point | {"growth_rate": -2e-11}, point | {key: value}
    assert not [*differences(steady([same]), steady([point]))]
    assert [*differences(steady([other]), steady([point]))]


def slow(*where):
    return pytest.param(*where, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "name, share",
    [
        ("modes", 0.5),
        slow("modes-undecided", 0.5),
        ("sweep", 0.5),
        ("sensitivity", 0.5),
        slow("onset", 0.1),
        slow("onset", 0.4),
        slow("onset", 0.7),
        slow("onset", 0.99),
        pytest.param("onset-classes", 0.6, marks=pytest.mark.slow),
        ("map", 0.4),
        slow("map-curves", 0.67),
    ],
)
def test_an_interrupted_run_goes_on(coarse_case, wholes, tmp_path, name, share):
    whole, seen = wholes(name)
    path, first, second = tmp_path / "part.h5", Watch(max(1, int(share * seen.items))), Watch()
    assert not perform(coarse_case, name, path, first).complete and not load_result(path).complete
    result = resume(path, observer=second)
    same(result, whole)
    same(load_result(path), whole)
    if name != "sweep":  # which starts anew
        assert not set(first.solved) & set(second.solved)
        assert len(first.solved) + len(second.solved) == len(seen.solved)
    with pytest.raises(CaseError, match="nothing to resume"):
        resume(path)


@pytest.mark.slow
def test_workers_find_the_same_digits_also_when_they_go_on(coarse_case, wholes, tmp_path):
    path, first, second = tmp_path / "map.h5", Watch(4), Watch()
    assert not perform(coarse_case, "map", path, first, workers=2).complete
    result = resume(path, workers=2, observer=second)
    assert not set(first.solved) & set(second.solved)
    same(result, wholes("map")[0])


def test_a_located_point_is_in_the_file_before_its_normal_form(coarse_case, tmp_path):
    case = coarse_case.replace(ONSET | {"onset.normal_form": True, "onset.coarse_mesh": 0.0})
    result = Session(case).perform("onset", tmp_path / "onset.h5", Stop(0, "normal form"))
    assert not result.complete and len(result.points) == 1
    (point,) = load_result(tmp_path / "onset.h5").points
    assert point["confirmed"] and point["criticality"] is None and point["first_lyapunov_coefficient"] is None


def test_failed_values_are_not_tried_again(coarse_case, tmp_path, monkeypatch):
    honest, tried = LoadPath.go_to, []

    def go_to(self, target):
        if target == 12e3:
            tried.append(target)
            raise SolveError("No equilibrium was found at 12000 Pa.")
        return honest(self, target)

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    path, case = tmp_path / "onset.h5", coarse_case.replace(ONSET | {"onset.coarse_mesh": 0.0})
    assert not Session(case).perform("onset", path, Watch(6)).complete
    result = resume(path)
    assert tried == [12e3] and result.complete and "12000 Pa" in result.failures[0]
    assert 12e3 not in result.values and len(result.points) == 1


def test_steady_pressures_that_come_back_are_found_again_and_missed_ones_are_not(coarse_case, tmp_path, monkeypatch):
    honest, tried = LoadPath.go_to, []

    def go_to(self, target):
        tried.append(target)
        if target == 4e3:
            raise SolveError("No equilibrium was found at 4000 Pa.")
        return honest(self, target)

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    path = tmp_path / "steady.h5"
    case = coarse_case.replace({"steady.pressures": [2e3, 4e3, 6e3, 2e3], "drive.kind": "uniform"})
    assert not Session(case).perform("steady", path, Stop(2)).complete
    result = resume(path)
    assert result.complete and [state.pressure for state in result.states] == [2e3, 6e3, 2e3]
    assert tried == [2e3, 4e3, 6e3, 2e3] and result.failures == ("No equilibrium was found at 4000 Pa.",)


@pytest.fixture
def attempts(monkeypatch):
    """Cases and choices of runs that find nothing, of which the first misses a pressure and is interrupted."""
    made = []

    def run(_session, record, **choices):
        made.append((record.header.case, choices))
        record.begin(record.header.kind, 2)
        record.note(LIMIT, pressure=1e3 + len(made), highest=True)
        if len(made) == 1:
            record.fail("At 2 kPa: no state.")
            raise KeyboardInterrupt

    def of(kind):
        anew = {} if kind == "steady" else {"check": lambda _case: None, "rows_to_keep": None}
        return replace(find_study(kind), run=run, **anew)

    monkeypatch.setattr(sessions, "find_study", of)
    return made


def test_a_kept_run_that_missed_a_pressure_and_was_interrupted_goes_on(coarse_case, tmp_path, attempts):
    path, session = tmp_path / "steady.h5", Session(coarse_case)
    with pytest.raises(KeyboardInterrupt):
        kept_run("steady", session, path)
    for _ in range(2):
        kept = kept_run("steady", session, path)
        assert kept.complete and len(attempts) == 2
        assert [limit.pressure for limit in kept.limits] == [1002.0]  # of the attempt that came to its end
    told = kept_run("steady", session.replace({"project.units": "ft"}), path)
    assert told.case.project.units == "ft" and len(attempts) == 2
    with h5py.File(path, "r+") as file:
        file.attrs["program"] = "dbvfiv 0.0.1"
    kept_run("steady", session, path)  # another program may find another number
    assert len(attempts) == 3


def test_what_settled_levels_said_is_said_again(coarse_case, tmp_path, attempts):
    session = Session(coarse_case)
    session.settled = SimpleNamespace(warnings=("Strain levels did not settle.",))
    part = session.perform("steady", tmp_path / "steady.h5")
    whole = resume(tmp_path / "steady.h5")
    assert part.interrupted and whole.complete and session.settled.warnings[0] in part.warnings
    assert whole.warnings == part.warnings and len(attempts) == 2


@pytest.mark.parametrize(("kind", "name"), [("design", "cases"), ("identify", "posterior")])
def test_a_run_that_goes_on_writes_the_files_that_were_asked_for(
    coarse_case, tmp_path, monkeypatch, attempts, kind, name
):
    monkeypatch.chdir(tmp_path)
    Session(coarse_case).perform(kind, tmp_path / "run.h5", **{name: Path("written")})
    monkeypatch.chdir("/")
    assert resume(tmp_path / "run.h5").complete and attempts[1][1] == {name: tmp_path / "written"}


@pytest.mark.parametrize("lost", ["is there by now", "cannot be written any more"])
def test_a_run_that_goes_on_ends_without_a_file_that_it_may_not_write(coarse_case, tmp_path, attempts, lost):
    folder = tmp_path / "folder"
    folder.mkdir()
    Session(coarse_case).perform("identify", tmp_path / "run.h5", posterior=folder / "known.toml")
    if lost == "is there by now":
        (folder / "known.toml").write_text("# of another run")
    else:
        folder.rmdir()
        folder.write_text("no folder")
    result = resume(tmp_path / "run.h5")
    assert result.complete and attempts[1][1] == {} and any(lost in said for said in result.warnings)


def test_kept_runs_are_those_of_the_pressures_that_were_found(coarse_case, tmp_path, attempts, monkeypatch):
    """At an operating point, and with the sealing pressure of a cracking head."""
    attempts.append(None)
    monkeypatch.setattr(sessions, "operating_pressure", lambda *_: 5e3)
    monkeypatch.setattr(sessions, "sealing_for_cracking", lambda *_: 300.0)
    monkeypatch.setattr(Session, "mesh", MeshData.of(Session(coarse_case).model))
    keys = ["materials.strain_level=10 %", *(f"{key}={value}" for key, value in SMALL.items())]
    pump = load_case(None, ["upstream.pump=[[0, 3.0], [0.1, 0.3]]", "upstream.length=3 m", *keys])
    cracks = {"valve.sealing_pressure": None, "valve.cracking_head": 0.1}
    head = load_case("cases/dbv12-moulded.toml", keys).replace(cracks)
    for case, key, value in ((pump, "drive", 5e3), (head, "valve", 300.0)):
        path = tmp_path / f"{key}.h5"
        for _ in range(2):  # each time by a session that knows nothing
            kept = kept_run("steady", Session(case), path)
        assert value in (kept.case.drive.pressure, kept.case.valve.sealing_pressure) and attempts.pop()[0] == kept.case
        assert len(attempts) == 1


def test_the_command_resumes(coarse_case, tmp_path, capsys):
    path, case = tmp_path / "onset.h5", coarse_case.replace(ONSET | {"onset.coarse_mesh": 0.0})
    assert "ended early" in Session(case).perform("onset", path, Watch(3)).lines()[-1]
    assert run(["resume", str(path), "--animate", "x.gif"]) == 2
    assert "kind 'onset'" in capsys.readouterr().err
    assert run(["resume", str(path)]) == 0
    assert "stable above" in capsys.readouterr().out
    assert run(["resume", str(path)]) == 2
