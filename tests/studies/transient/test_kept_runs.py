"""Runs in time and their files: growing, torn, resumed."""

from dataclasses import asdict, replace

import h5py
import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.motion import stepper
from dbvfiv.motion.control import ControlOptions, RunOptions
from dbvfiv.motion.scheme import scheme
from dbvfiv.record.files import Header
from dbvfiv.record.mesh import MeshData
from dbvfiv.record.record import GrowingRecord, Journal, StoredRecord
from dbvfiv.studies.case import Case
from dbvfiv.studies.session import Session, load_result
from dbvfiv.studies.transient import history
from dbvfiv.studies.transient.history import (
    FACES,
    GAS,
    HISTORY,
    LINE,
    MEMORY,
    RELAXING,
    RESTART,
    STATES,
    Progress,
    rows_to_keep,
    tables_of,
)
from dbvfiv.studies.transient.run import Runner, assess
from tests.observers import Stop

from .runs import SHORT, transient


def test_a_file_holds_the_run(tmp_path, valve):
    model = valve(SHORT)
    kept = transient(model, "small", tmp_path / "run.h5")
    assert [state.time for state in kept.states] == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    result = load_result(tmp_path / "run.h5")
    assert result.complete and result.kind == "transient" and result.case == model.case
    assert all(np.array_equal(result.history[name], kept.history[name]) for name in kept.history)
    assert [state.time for state in result.states] == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    lip = result.mesh.rows[0, 0]
    assert result.states[-1].nodal[lip, 1] == result.history["lip_displacement"][-1]
    assert result.states[2].nodal_rate[lip, 1] == result.history["lip_velocity"][10]
    assert result.summary()["steps"] == 20 and result.summary()["decided"] is False
    assert "lip opening" in "\n".join(result.lines())
    export = result.export(tmp_path / "run.vtkhdf")
    with h5py.File(export) as file:
        assert file["VTKHDF/Steps/Values"][:] == pytest.approx([0, 0.005, 0.01, 0.015, 0.02])
    # a state of it starts another run
    again = Runner(
        type(model)(
            model.case.replace(
                {
                    "transient.start": "state",
                    "transient.start_file": str(tmp_path / "run.h5"),
                    "transient.start_state": 2,
                    "transient.duration": 0.002,
                }
            )
        )
    ).start()
    assert again.history["lip_displacement"][0] == result.history["lip_displacement"][10]
    assert again.history["mass_flow"][0] == pytest.approx(result.history["mass_flow"][10], rel=1e-6)
    with pytest.raises(CaseError, match="a file that the case reads"):
        Session(again.case).perform("transient", tmp_path / "run.h5")
    assert len(load_result(tmp_path / "run.h5").states) == 5


#: Light fluid: the lips are slamming when the run is interrupted.
SLAMS = {"transient.duration": 0.045, "fluid.density": 1.2, "damping.alpha": 0.0, "drive.pressure": 6e3}
#: Waves in a line and a wall that relaxes; a gas.
WAVES = {"upstream.length": 6.0, "upstream.wave_speed": 600.0, "upstream.loss": 1.5, "upstream.elements": 2}
LOSSY = WAVES | {
    "transient.duration": 0.025,
    "fluid.density": 1.2,
    "drive.pressure": 6e3,
    "damping.model": "loss factor",
}
AIR = {"fluid.density": 1.2, "fluid.continuity": "storage", "fluid.sound_speed": 343.0, "drive.pressure": 6e3}


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys, after, column",
    [
        pytest.param(SLAMS, 66, "stops", id="slams", marks=pytest.mark.slow),
        pytest.param(SLAMS | {"transient.adaptive": True}, 1, "stops", id="slams, adaptive"),
        pytest.param(LOSSY, 40, "line_supply", id="line and relaxing wall", marks=pytest.mark.slow),
        pytest.param(
            LOSSY | {"transient.adaptive": True}, 40, "branch_loss", id="both, adaptive", marks=pytest.mark.slow
        ),
        pytest.param(AIR | {"transient.duration": 0.006}, 9, "gas_supply", id="gas"),
    ],
)
def test_a_resumed_run_gives_the_same_numbers(tmp_path, valve, keys, after, column, all_restart_points):
    steps = {"transient.step": 5e-4, "transient.numerical_damping": 0.1, "transient.local_error": 1e-4}
    model = valve(SHORT | steps | keys)
    whole = transient(model, output=tmp_path / "whole.h5")
    assert whole.history[column].max() > 0
    stopped = transient(model, output=tmp_path / "parts.h5", observer=Stop(after))
    assert not stopped.complete and len(stopped.history["time"]) == after + 1
    known = StoredRecord(tmp_path / "parts.h5", tables_of, Case)
    every = 20 if model.case.transient.adaptive else 7
    assert rows_to_keep(known, model.case)[HISTORY] == 1 + every * (after // every)
    resumed = dbvfiv.resume(tmp_path / "parts.h5")
    assert resumed.complete
    for name in whole.history:
        assert np.array_equal(resumed.history[name], whole.history[name]), name
    assert [s.time for s in resumed.states] == [s.time for s in whole.states]
    assert np.array_equal(resumed.states[-1].nodal, whole.states[-1].nodal)


@pytest.mark.slow
def test_nothing_is_kept_of_what_is_not_there(tmp_path, valve):
    """A rigid column in front, an elastic wall, a fluid that is not compressed, lips with stops."""
    rigid = {name: value for name, value in WAVES.items() if "wave" not in name and "elements" not in name}
    run = transient(valve(SHORT | rigid | {"transient.duration": 0.005}), output=tmp_path / "run.h5")
    absent = {c.name for columns in (RELAXING, LINE, GAS, FACES) for c in columns}
    assert not absent & set(run.history) and "dissipated" not in "\n".join(run.lines())
    with h5py.File(tmp_path / "run.h5") as file:
        assert not {"line_places", "relaxing", "gas_unknowns", "face_nodes"} & set(file["mesh"])
        assert not {"line", "gas", "contact_loss", *(c.name for c in MEMORY)} & set(file["tables/restart"])


def test_a_run_without_its_last_verdict_is_judged_from_the_hold_too(tmp_path, valve, monkeypatch):
    """As one that was killed, or that still goes on."""
    table = tmp_path / "drive.csv"
    table.write_text("0, 1000\n0.01, 6000\n")
    changes = {"transient.drive_table": str(table), "damping.alpha": 400.0, "transient.duration": 0.04}
    result = transient(valve(SHORT | changes))
    kept, history = result.verdict, result.history
    assert kept["mass_flow"]["mean"] != assess(history, result.model).summary()["mass_flow"]["mean"]
    del vars(result)["verdict"]
    monkeypatch.setattr(result.record, "notes", lambda what: [])
    for name in ("verdict", "mass_flow", "lip_displacement"):
        assert result.verdict[name] == kept[name]


def test_a_finished_run_goes_on_to_a_later_end(tmp_path, valve):
    path = tmp_path / "run.h5"
    transient(valve(SHORT), output=path)
    with pytest.raises(CaseError, match="has reached its end"):
        dbvfiv.resume(path)
    with pytest.raises(CaseError, match="has reached its end"):
        dbvfiv.resume(path, duration=0.01)
    assert load_result(path).complete
    longer = dbvfiv.resume(path, duration=0.03)
    assert longer.history["time"][-1] == pytest.approx(0.03) and longer.case.transient.duration == 0.03
    assert load_result(path).complete


def test_states_are_due_by_the_time(tmp_path, valve):
    """An end between two of them shifts none, and the last one is kept once."""
    path, every = tmp_path / "run.h5", {"transient.duration": 0.005, "transient.save_every": 0.002}
    times = [state.time for state in transient(valve(SHORT | every), output=path).states]
    assert times == pytest.approx([0.0, 0.002, 0.004, 0.005])
    times = [state.time for state in dbvfiv.resume(path, duration=0.01).states]
    assert times == pytest.approx([0.0, 0.002, 0.004, 0.005, 0.006, 0.008, 0.01])
    run = transient(valve(SHORT | every | {"transient.save_every": 0.0015}))
    assert [state.time for state in run.states] == pytest.approx([0.0, 0.002, 0.003, 0.005])
    run = transient(valve(SHORT | every), observer=Stop(3))
    assert [state.time for state in run.states] == pytest.approx([0.0, 0.002, 0.003])
    assert np.allclose(run.states[-1].station_area, run.history["station_area"][-1])


@pytest.mark.parametrize("step, duration, every", [(1e-5, 1.0, 0.2), (2e-5, 2.0, 0.2), (5e-5, 1.0, 0.05)])
def test_rounded_times_meet_the_end_and_the_states(step, duration, every):
    options = RunOptions(duration, scheme("newmark"), ControlOptions(step), save_every=every)
    time, steps, saved = 0.0, 0, []
    while time < options.end:
        before, time, steps = time, time + step, steps + 1
        if options.states_due(time) > options.states_due(before):
            saved.append(time)
    assert steps == round(duration / step)
    assert saved == pytest.approx(every * np.arange(1, round(duration / every) + 1), abs=1e-9)


def test_what_is_said_of_the_rubber_is_said_again(tmp_path, valve):
    path, state = tmp_path / "run.h5", {"transient.start": "steady", "drive.pressure": 36e3}
    run = transient(valve(SHORT | state | {"materials.constants": "published"}), output=path, observer=Stop(9))
    (said,) = [text for text in run.warnings if "The rubber's constants are unstable here: at 36000 Pa" in text]
    assert run.interrupted and said in dbvfiv.resume(path).warnings


def test_a_state_in_whose_write_a_run_is_interrupted_is_kept_once(tmp_path, valve, monkeypatch):
    inner = GrowingRecord.append

    def append(record, table, row):
        inner(record, table, row)
        if table == STATES and record.rows(STATES) == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(GrowingRecord, "append", append)
    run = transient(valve(SHORT), output=tmp_path / "run.h5")
    assert run.interrupted and [state.time for state in run.states] == pytest.approx([0, 0.005])


@pytest.mark.slow
def test_torn_restart_points_are_passed_over(tmp_path, valve, all_restart_points):
    path = tmp_path / "run.h5"
    whole = transient(valve(SHORT), output=path)
    steps = StoredRecord(path, tables_of, Case).column(RESTART, "steps")
    assert list(steps) == [0, 7, 14, 20]
    with h5py.File(path, "r+") as file:
        file["tables/restart/#"][-1] = 0  # its last row did not arrive whole
        file["tables/history/#"].resize(14, axis=0)  # nor did the rows that the one before stands upon
        file["log"].resize(0, axis=0)
    known = StoredRecord(path, tables_of, Case)
    assert rows_to_keep(known, whole.case) == {HISTORY: 8, STATES: 2, RESTART: 2}
    resumed = dbvfiv.resume(path)
    assert all(np.array_equal(resumed.history[name], whole.history[name]) for name in whole.history)


def test_a_resume_that_dies_at_once_leaves_the_file_as_it_was(tmp_path, valve, monkeypatch):
    path = tmp_path / "run.h5"
    transient(valve(SHORT), output=path, observer=Stop(9))
    before = path.read_bytes()

    def die(self, documents):
        raise OSError("The machine goes down.")

    with monkeypatch.context() as patched:
        patched.setattr(Journal, "write_log", die)  # when the rows are copied
        with pytest.raises(OSError, match="goes down"):
            dbvfiv.resume(path)
    assert path.read_bytes() == before and [file.name for file in tmp_path.iterdir()] == ["run.h5"]
    assert dbvfiv.resume(path).complete


@pytest.mark.slow
def test_restart_points_take_little_of_the_file(tmp_path, valve, monkeypatch):
    changes = {"transient.duration": 0.3, "transient.restart_every": 7, "transient.step": 5e-4}
    transient(valve(changes), output=tmp_path / "run.h5")
    record = StoredRecord(tmp_path / "run.h5", tables_of, Case)
    sizes = {table.name: table.row_bytes * record.rows(table.name) for table in record.tables.values()}
    first_and_last = 2 * record.tables[RESTART].row_bytes
    assert sizes[RESTART] - first_and_last <= history.RESTART_SHARE * (sizes[HISTORY] + sizes[STATES])
    assert 2 < record.rows(RESTART) < 601 // 7
    # but no more than so many seconds of work may be lost
    monkeypatch.setattr(history, "RESTART_SECONDS", 0.0)
    monkeypatch.setattr(history, "RESTART_LOSS", 0.0)
    transient(valve(changes), output=tmp_path / "run.h5")
    assert StoredRecord(tmp_path / "run.h5", tables_of, Case).rows(RESTART) == 2 + 600 // 7


@pytest.mark.slow
def test_a_run_that_fails_keeps_everything_and_says_where(tmp_path, valve, monkeypatch):
    step = stepper.Stepper.step

    def refuse(self, state, h):
        if state.time > 0.0105:
            raise stepper.StepFailure("Nothing helps.")
        return step(self, state, h)

    monkeypatch.setattr(stepper.Stepper, "step", refuse)
    result = transient(valve(SHORT), output=tmp_path / "run.h5")
    assert len(result.failures) == 1
    assert "No step was found from 0.011 s on, after 11 steps" in result.failures[0]
    kept = load_result(tmp_path / "run.h5")
    assert kept.failures == result.failures and not kept.complete
    assert kept.history["time"][-1] == pytest.approx(0.011)
    monkeypatch.undo()
    assert dbvfiv.resume(tmp_path / "run.h5").complete  # with better luck


def test_a_run_that_fails_or_is_interrupted_at_once_can_be_read_and_resumed(
    tmp_path, valve, monkeypatch, command_line, misused
):
    path = tmp_path / "run.h5"

    def refuse(self, state, h):
        raise stepper.StepFailure("Nothing helps.")

    def interrupt(self, state, h):
        raise KeyboardInterrupt

    whole = transient(valve(SHORT))
    for step, failures in ((refuse, 1), (interrupt, 0)):
        with monkeypatch.context() as patched:
            patched.setattr(stepper.Stepper, "step", step)
            result = transient(valve(SHORT), output=path)
        assert len(result.failures) == failures and not result.complete and result.interrupted == (not failures)
        assert result.summary()["verdict"] == "undecided" and not result.drawable
        assert command_line("info", path).status == 0
        for arguments in (["plot", path, "--animate", 1], ["compare", path], ["verdict", path]):
            misused("", *arguments)
        resumed = dbvfiv.resume(path)
        assert resumed.complete and np.array_equal(resumed.history["mass_flow"], whole.history["mass_flow"])


def test_a_resumed_run_is_ended_by_the_same_verdict(tmp_path, valve, all_restart_points):
    changes = {
        "transient.duration": 1.3,
        "transient.stop_when": ["steady"],
        "transient.numerical_damping": 0.1,
        "transient.restart_every": 50,
        "transient.step": 5e-3,
        "drive.pressure": 6e3,
        "transient.start": "kick",
        "damping.alpha": 5.0,
        "transient.kick_opening": 1e-6,
    }
    model = valve(changes)
    whole = transient(model)
    assert whole.stopped and whole.complete
    judged = whole.record.notes("verdict")
    first = next(note["steps"] for note in judged if note["decided"])
    end = len(whole.history["time"]) - 1
    assert first < end
    transient(model, output=tmp_path / "run.h5", observer=Stop((first + end) // 2))
    resumed = dbvfiv.resume(tmp_path / "run.h5")
    assert resumed.stopped and np.array_equal(resumed.history["time"], whole.history["time"])
    with pytest.raises(CaseError, match="was ended by its verdict"):
        dbvfiv.resume(tmp_path / "run.h5")
    assert load_result(tmp_path / "run.h5").complete
    longer = dbvfiv.resume(tmp_path / "run.h5", duration=1.6)  # beyond the verdict at 1.5 s, the same again
    assert longer.complete and not longer.stopped


def test_progress_and_history_go_through_a_file_unchanged(tmp_path, valve):
    model, path = valve(), tmp_path / "run.h5"
    mesh = MeshData.of(model)
    with GrowingRecord(Header.of("transient", model.case), mesh, tables_of(mesh), path) as record:
        run = Runner(model, replace(RunOptions.of(model.case), duration=0.003), record).start()
    stored = StoredRecord(path, tables_of, Case)
    again = Progress.read(stored)
    np.testing.assert_equal(asdict(again.state), asdict(run.progress.state))
    left, right = ({n: v for n, v in vars(p).items() if n != "state"} for p in (again, run.progress))
    assert np.isnan([left.pop("eigenvalue"), right.pop("eigenvalue")]).all()
    assert left == right
    part = StoredRecord(stored.path, tables_of, Case).cut({HISTORY: 2})
    assert (part.rows(HISTORY), part.rows(STATES)) == (2, stored.rows(STATES)) and part.log == stored.log
    assert np.array_equal(part.column(HISTORY, "station_area"), run.history["station_area"][:2])
    assert part.value(HISTORY, "time", -1) == run.history["time"][1]
    with pytest.raises(IndexError):
        part.value(HISTORY, "time", 2)


def test_a_run_without_a_step_can_be_read(valve, tmp_path):
    hard = {"drive.pressure": 1e6, "transient.step": 0.5, "transient.duration": 1.0, "transient.smallest_step": 1.0}
    kept = transient(valve(hard), "stuck", tmp_path / "run.h5")
    assert kept.failures and kept.verdict["verdict"] == "undecided" and "No step" in kept.verdict["reason"]
    assert load_result(tmp_path / "run.h5").lines() == kept.lines()
