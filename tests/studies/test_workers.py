"""Tasks shared among processes of this machine, of ``mpiexec`` and of a Dask cluster: the same results from all, with a
worker killed half way.
"""

import inspect
import os
import signal
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace

import pytest

from dbvfiv import api
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.runtime import mpi_size
from dbvfiv.studies import KINDS
from dbvfiv.studies import workers as module
from dbvfiv.studies.case import Case
from dbvfiv.studies.session import find_study
from dbvfiv.studies.workers import Lost, Work, Workers, read_workers, require_answer, share_all
from tests.studies.work import TASKS, dies, expected, root_of, run_under_mpi, start


def shared(count, function=root_of, tasks=TASKS, said=None, on_result=lambda task: None):
    found = {}
    with Workers(count, start, (3,), (said if said is not None else []).append) as team:
        for task, result in team.share(tasks, lambda task: Work(function, (task,))):
            found[task] = result
            on_result(task)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_new_workers_are_for_the_studies_that_share_their_work(kind, monkeypatch, refused):
    monkeypatch.setattr(api, "kind_of", lambda _: kind)
    monkeypatch.setattr(api, "resume_result", lambda *_, **given: given)
    if "workers" in inspect.signature(find_study(kind).run).parameters:
        assert api.resume("r.h5", workers="2") == {"workers": 2}
    else:
        with refused(CaseError, match=f"Workers belong to .*'r.h5' is of kind '{kind}'"):
            api.resume("r.h5", workers="2")


@pytest.mark.parametrize("kind", ["map", "identify"])
def test_a_number_of_workers_may_be_a_text(kind, monkeypatch):
    monkeypatch.setattr(api.Valve, "_ask", lambda *_, **choices: choices["workers"])
    ask = getattr(api.Valve(Case(), "valve"), kind)
    assert (ask(workers="2"), ask(workers=None), ask(workers="tcp://host:1")) == (2, None, "tcp://host:1")


@pytest.mark.slow
def test_processes_give_what_one_gives_and_a_killed_one_costs_nothing_but_time():
    killed, said = [], []

    def kill(_task):
        import multiprocessing

        if not killed:
            killed.append(multiprocessing.active_children()[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    assert shared(2, said=said, on_result=kill) == expected()
    assert killed and any("worker was lost" in sentence for sentence in said)


def test_processes_killed_between_two_calls_are_started_again():
    import multiprocessing

    said, found = [], {}
    with Workers(2, start, (3,), said.append) as team:
        for tasks in (TASKS[:2], TASKS[2:]):
            found |= team.share(tasks, lambda task: Work(root_of, (task,)))
            for process in multiprocessing.active_children():
                process.kill()
                process.join()
    assert found == expected() and any("worker was lost" in sentence for sentence in said)


def test_a_task_that_kills_every_worker_is_given_up(monkeypatch):
    monkeypatch.setattr(module, "TRIES", 2)
    assert shared(1, dies, (2, 1, 3)) == {2: Lost, 1: expected()[1], 3: expected()[3]}


def test_what_is_lost_ends_a_study_after_all_else_so_that_it_can_be_resumed(monkeypatch):
    found = {1: "one", 2: Lost, 3: "three"}
    team, known = SimpleNamespace(share=lambda tasks, ask: ((task, found[task]) for task in tasks)), []
    with pytest.raises(SolveError, match=r"Column 2 could not be computed: \d+ workers died"):
        for pair in share_all(team, found, None, lambda task: f"Column {task}"):
            known.append(pair)
    assert known == [(1, "one"), (3, "three")]


def test_contexts_that_are_over_leave_nothing_behind():
    found = []
    with Workers(1, start, (1,), print) as team:
        for power in range(1, 8):
            team.give(start, power)
            assert dict(team.share((8,), lambda task: Work(root_of, (task,)))) == {8: 8 ** (1 / power)}
            found.append((len(os.listdir("/proc/self/fd")), len([*team._sent.parent.iterdir()])))
    assert found == found[:1] * 7


def test_what_is_known_is_not_asked_of_workers():
    with Workers(2, start, (3,), print) as team:
        assert dict(team.share((1, 2), lambda task: -task)) == {1: -1, 2: -2}


def test_a_cluster_gives_what_one_process_gives(cluster):
    address, processes = cluster

    def kill(_task):
        processes[0].kill()

    assert shared(address, on_result=kill) == expected()


def test_a_scheduler_that_does_not_answer_is_said(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(module, "PATIENCE", 1)
    with pytest.raises(CaseError, match="no Dask scheduler answers within 1 s"):
        shared("tcp://127.0.0.1:9")


@pytest.mark.slow
def test_a_server_that_is_no_scheduler_is_said(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(module, "PATIENCE", 1)
    server = ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        with pytest.raises(CaseError, match="no Dask scheduler answers"):
            require_answer(f"tcp://127.0.0.1:{server.server_port}")
    finally:
        server.shutdown()


@pytest.mark.parametrize("given", ["few", "http://host:1", 0, 5000, True, 1.5])
def test_workers_that_are_none_are_refused(given):
    with pytest.raises(CaseError, match="Workers are given as"):
        read_workers(given)


@pytest.mark.slow
def test_processes_of_mpiexec_give_what_one_gives():
    done = run_under_mpi(3, "tests.studies.work")
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == repr(sorted(expected().items()))


def test_the_number_of_processes_of_mpiexec_is_read(monkeypatch):
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"):
        monkeypatch.delenv(name, raising=False)
    assert mpi_size() == 1
    monkeypatch.setenv("PMI_SIZE", "4")
    assert mpi_size() == 4
