"""Runs in their queue and workers behind the page: what does not end is killed, what goes wrong is a sentence."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import dbvfiv
from dbvfiv.app import processes
from dbvfiv.app.page import Page
from dbvfiv.app.processes import Run, Runs, Worker, Workers
from dbvfiv.app.server import Site
from dbvfiv.app.worker import Desk
from dbvfiv.errors import CaseError
from dbvfiv.studies.modes.search import ModeShape

#: A program that ignores what asks it to end.
STUBBORN = (
    "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('there', flush=True); time.sleep(60)"
)


async def until(condition, seconds: float = 20.0) -> None:
    """Wait until something holds."""
    for _ in range(int(seconds / 0.02)):
        if condition():
            return
        await asyncio.sleep(0.02)
    raise AssertionError(f"not within {seconds:g} s")


@pytest.fixture
def stubborn(monkeypatch, tmp_path):
    """A queue whose runs do not end when they are asked to."""
    (tmp_path / "stubborn.py").write_text(STUBBORN)
    monkeypatch.setattr(processes, "STUBBORN", 0.2)
    monkeypatch.setattr(processes, "PROGRAM", (sys.executable, str(tmp_path / "stubborn.py")))
    return Runs(), tmp_path / "user"


def test_runs_that_ignore_signals_are_killed(stubborn):
    runs, home = stubborn

    async def day() -> None:
        first, second = (runs.add(home, "steady", f"steady {i}", {}, []) for i in range(2))
        await until(lambda: "there" in first.output())
        runs.cancel(first)
        await until(lambda: first.process is None and "there" in second.output(), 30)
        assert first.state == "cancelled" and first.can_resume
        third = runs.add(home, "steady", "steady 2", {}, [])
        await runs.end()
        await until(lambda: second.process is None)
        assert second.state == "interrupted" and third.process is None

    asyncio.run(day())
    assert [run.state for run in Runs().of(home)] == ["interrupted", "interrupted", "cancelled"]


def test_a_run_that_is_cancelled_while_it_starts_ends(stubborn):
    runs, home = stubborn

    async def day() -> None:
        run = runs.add(home, "steady", "steady", {}, [])
        await asyncio.sleep(0)
        runs.cancel(run)
        await until(lambda: run.ended and run.process is None)
        assert run.state == "cancelled"

    asyncio.run(day())


def test_users_keep_so_many(stubborn, monkeypatch):
    runs, home = stubborn
    monkeypatch.setattr(processes, "KEPT", 2)
    for number in range(2):
        runs.keep(home, f"{number}.h5", b"")
    with pytest.raises(CaseError, match="2 results are kept"):
        runs.keep(home, "3.h5", b"")


def test_so_many_wait(stubborn, monkeypatch):
    """And one that is cancelled before it starts does not run."""
    runs, home = stubborn
    monkeypatch.setattr(processes, "WAITING", 1)

    async def day() -> None:
        run = runs.add(home, "steady", "steady", {}, [])
        with pytest.raises(CaseError, match="1 runs are waiting already"):
            runs.add(home, "steady", "another", {}, [])
        runs.cancel(run)
        await until(lambda: run.ended)
        assert run.state == "cancelled" and not run.output() and runs.of(home) == [run]

    asyncio.run(day())


def test_a_run_ends_after_the_longest_time(stubborn, monkeypatch):
    runs, home = stubborn
    monkeypatch.setattr(processes, "LONGEST", 0.2)

    async def day() -> None:
        run = runs.add(home, "steady", "steady", {}, [])
        await until(lambda: run.ended and run.process is None)
        assert run.state == "cancelled"

    asyncio.run(day())


def test_a_result_is_listed_as_soon_as_its_kind_is_known(tmp_path):
    runs = Runs()
    run = runs.keep(tmp_path, "six.h5", b"")
    assert not runs.of(tmp_path)
    run.kind = "steady"
    assert runs.of(tmp_path) == [run]


def test_pages_that_open_together_keep_the_result_of_the_start_once(tmp_path):
    class Drawing:
        async def ask(self, question, **about):
            await asyncio.sleep(0.01)
            return {"kind": "steady", "case": ""}

    start = tmp_path / "result.h5"
    start.write_bytes(b"result")
    site = Site(tmp_path / "site", start, workers=SimpleNamespace(drawing=Drawing()))
    pages = [Page(site, site.home("a")) for _ in range(3)]

    async def opened():
        return await asyncio.gather(*(page._result_of_start(start) for page in pages))

    assert len({run.name for run in asyncio.run(opened())}) == len(site.runs.of(site.home("a"))) == 1


def test_a_spoiled_journal_is_passed_over(tmp_path):
    for number, text in enumerate(("", "{", '{"kind": 1}', '{"kind": "map", "title": "t", "process": 3, "x": 1}')):
        folder = tmp_path / "runs" / str(number)
        folder.mkdir(parents=True)
        (folder / "run.json").write_text(text)
    assert not Runs().of(tmp_path)
    (folder / "run.json").write_text(json.dumps({"kind": "map", "title": "t", "state": "running"}))
    assert Run.read(folder).state == "interrupted"


@pytest.mark.slow
def test_a_worker_says_what_went_wrong_and_answers_on(tmp_path):
    (tmp_path / "bad.toml").write_text("[valve]\nlenght = 1")

    async def day() -> None:
        worker = Worker()
        for question, said in (
            ({"do": "open", "case": str(tmp_path / "bad.toml")}, "valve.lenght"),
            ({"do": "predict", "values": {}}, "No valve is open"),
            ({"do": "header", "path": str(tmp_path / "bad.toml")}, "bad.toml"),
            ({"do": "nonsense"}, "failed unexpectedly"),
        ):
            with pytest.raises(CaseError, match=said):
                await worker.ask(**question)
        before = worker.pid
        worker.end()
        await until(lambda: worker.pid is None)
        with pytest.raises(CaseError, match="No valve is open"):
            await worker.ask("margin", values={})
        assert worker.pid != before
        worker.end()

    asyncio.run(day())


def test_workers_go_on_with_the_next_valve():
    workers = Workers()
    a, b, c, d = (Path(name) for name in "abcd")
    pair = workers.of(a, "one")
    assert workers.of(b, "one") is pair  # alone: its processes serve the next valve
    assert workers.of(b, "two") is pair  # both tabs ask one valve
    other = workers.of(c, "one")
    assert other is not pair and workers.of(b, "two") is pair
    workers.leave("two")
    assert workers.of(d, "three") is pair
    assert workers.of(c, "one") is other


def test_a_valve_that_was_left_is_opened_again(monkeypatch):
    """Whatever became of the one between: refused, or no longer waited for."""
    asked = []

    async def ask(self, do, **question):
        asked.append((do, question.get("case", "")))
        if question.get("case") == "b":
            raise CaseError("No steady state.")
        return {}

    monkeypatch.setattr(Worker, "ask", ask)
    monkeypatch.setattr(Worker, "pid", property(lambda self: 1))

    async def day() -> None:
        worker = Worker()
        for case in ("a", "a", "b", "a"):
            with contextlib.suppress(CaseError):
                await worker.about(Path(case), "predict")

    asyncio.run(day())
    assert [case for do, case in asked if do == "open"] == ["a", "b", "a"]


def test_so_many_valves_are_held():
    workers = Workers()
    pairs = [workers.of(Path(str(number)), number) for number in range(processes.VALVES + 1)]
    assert workers.of(Path("0"), 0) is not pairs[0]
    assert workers.of(Path("2"), 2) is pairs[2]


def test_a_mode_that_sways_is_animated_as_it_sways():
    """Both lips the same way, not towards each other."""
    mesh = dbvfiv.load(None, {"mesh.around": 6, "mesh.along": 8}).session.mesh
    shape = np.zeros(mesh.nodal_shape, complex)
    shape[:, 1] = mesh.z[0] + 1.0 - mesh.nodes[:, 2] / mesh.z[-1]
    state = SimpleNamespace(nodal=np.zeros(mesh.nodal_shape), results=SimpleNamespace(mesh=mesh))
    mode = ModeShape(1, 1.0, 60.0, 0.0, 0.0, shape, np.zeros(1), np.zeros(1), 0j, "SA")
    desk = Desk()
    desk.valve = SimpleNamespace(modes=lambda pressure, **_: SimpleNamespace(modes=[mode], mesh=mesh, state=state))
    first, *_, last = desk.motion({"pressure": 5e3}, frames=2)["frames"]
    moved = first[:, 1] - last[:, 1]  # from one end of the swing to the other
    assert moved.min() >= 0.0 and moved.max() > 0.01


@pytest.mark.slow
def test_a_result_that_names_other_files_is_not_read(tmp_path):
    path, secret = tmp_path / "six.h5", tmp_path / "secret.csv"
    secret.write_text("token,open sesame")
    dbvfiv.load(None, {"mesh.around": 6, "mesh.along": 8}).steady(pressure=5e3, output=path)
    desk = Desk()
    assert desk.header(str(path), inside=True)["kind"] == "steady"
    with h5py.File(path, "r+") as file:
        data = json.loads(file["case/json"].asstr()[()])
        data["valve"]["key_points"] = str(secret)
        del file["case/json"]
        file["case/json"] = json.dumps(data)
    with pytest.raises(CaseError, match="without their folder") as told:
        desk.header(str(path), inside=True)
    assert "sesame" not in str(told.value)
