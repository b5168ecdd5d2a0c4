"""Two writers, ignored signals, full disks and locked folders, by the command line."""

import os
import signal
import subprocess
import sys
import time

import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.record.files import WriterLock, check_writable
from dbvfiv.studies.session import Session
from tests.child import start
from tests.small_valves import THESIS_SET

COARSE = (*THESIS_SET, "--set", "mesh.around=4", "--set", "mesh.along=6", "--set", "fluid.density=10")
LONG = ("steady", *COARSE, "-p", "1 kPa:30 kPa:4000")


@pytest.mark.slow
def test_a_second_writer_is_refused_before_anything_is_computed(tmp_path, monkeypatch, misused):
    path = tmp_path / "same.h5"
    first = start(*LONG, "-o", path)
    try:
        for _ in range(4):
            first.stdout.readline()
        monkeypatch.setattr(Session, "mesh", property(lambda self: pytest.fail("something was computed")))
        before = len(dbvfiv.load_result(path).states)
        for arguments in (("steady", *COARSE, "-o", path), ("modes", *COARSE, "-o", path), ("resume", path)):
            misused("being written by another process", *arguments)
        while len(dbvfiv.load_result(path).states) < before + 3:  # the first goes on
            assert first.poll() is None
    finally:
        first.kill()
        first.communicate()
    assert [each.name for each in tmp_path.iterdir()] == ["same.h5"]
    assert len(dbvfiv.load_result(path).states) >= before + 3


def test_checking_a_name_leaves_nothing(tmp_path, coarse_run, refused):
    check_writable(tmp_path / "a.h5")
    check_writable(tmp_path / "new" / "folder" / "a.h5")
    assert not list(tmp_path.iterdir())
    with refused(CaseError):
        check_writable("/dev/null/folder/a.h5")
    before = coarse_run.path.stat()
    check_writable(coarse_run.path)
    after = coarse_run.path.stat()
    assert (before.st_mtime_ns, before.st_size, before.st_ino) == (after.st_mtime_ns, after.st_size, after.st_ino)


def test_a_file_that_only_holds_the_name_of_a_run(tmp_path, command_line):
    path = tmp_path / "a.h5"
    path.touch()  # as a run leaves it that was killed while it began
    for command in ("info", "resume", "plot"):
        outcome = command_line(command, path)
        assert outcome.status == 2 and "is empty" in outcome.err and "a new run may take its name" in outcome.err
    lock = WriterLock(path)
    try:
        outcome = command_line("info", path)
        assert outcome.status == 2 and "about to begin" in outcome.err
    finally:
        lock.release()
    assert command_line("steady", *COARSE, "-p", "1 kPa", "-o", path).status == 0
    assert dbvfiv.load_result(path).complete


@pytest.mark.slow
@pytest.mark.parametrize("pause", [0.01, None])
def test_sigterm_twice_and_in_time(tmp_path, pause):
    """As `timeout` and job systems send it, the second one as late as when the sentence is out; the file says that it
    is not complete and what there is.
    """
    path = tmp_path / "t.h5"
    run = start("transient", *COARSE, "--set", "drive.pressure=2 kPa", "--set", "transient.duration=50", "-o", path)
    while not path.exists() or not path.stat().st_size:
        assert run.poll() is None, run.communicate()
        time.sleep(0.05)
    time.sleep(0.5)
    run.send_signal(signal.SIGTERM)
    said = "" if pause else run.stderr.readline()
    time.sleep(pause or 0.05)
    run.send_signal(signal.SIGTERM)
    err = said + run.communicate(timeout=60)[1]
    assert run.returncode == 143 and err.strip().splitlines()[-1].startswith("Terminated; "), err
    assert not dbvfiv.load_result(path).complete


@pytest.mark.parametrize(
    "number, status",
    [
        pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, -9, marks=pytest.mark.slow),
    ],
)
def test_a_map_ends_with_all_its_processes(tmp_path, number, status):
    path = tmp_path / "m.h5"
    arguments = ("map", *COARSE, "--x", "density=1:100:300:log", "--y", "alpha=0.1:30:4:log", "--workers", 2)
    run = start(*arguments, "-o", path, start_new_session=True)
    try:
        while not path.exists() or not path.stat().st_size or dbvfiv.load_result(path).record.rows("columns") < 3:
            assert run.poll() is None, run.communicate()
            time.sleep(0.1)
        os.killpg(run.pid, number) if number != signal.SIGKILL else run.kill()  # as a terminal or a job system does
        _, err = run.communicate(timeout=60)  # its workers hold the pipe as well
        assert run.returncode == status and "Traceback" not in err and "worker" not in err, err
        assert not dbvfiv.load_result(path).complete and dbvfiv.load_result(path).record.rows("columns") >= 3
        end = time.monotonic() + 20
        while _members(run.pid) and time.monotonic() < end:
            time.sleep(0.05)
        assert not _members(run.pid)
    finally:
        run.kill()


def _members(group: int) -> list[str]:
    """Processes of a group that still run."""
    listed = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True).stdout.splitlines()
    rows = [line.split(None, 2) for line in listed]
    return [row[-1] for row in rows if int(row[0]) == group and not row[1].startswith("Z")]


@pytest.mark.slow
def test_ctrl_c_is_left_to_whoever_ignores_it(tmp_path):
    """A background job of a shell ignores it, and goes on."""
    run = subprocess.Popen(
        ["sh", "-c", "trap '' INT; exec \"$@\"", "sh", *_program(*LONG)], stdout=subprocess.PIPE, text=True
    )
    try:
        for _ in range(4):
            run.stdout.readline()
        run.send_signal(signal.SIGINT)
        for _ in range(5):
            assert run.stdout.readline().strip()
    finally:
        run.kill()
        run.communicate()


def _program(*arguments: object) -> list[str]:

    return [sys.executable, "-m", "dbvfiv", *map(str, arguments)]


@pytest.mark.parametrize("number, status", [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_in_a_callback_of_the_garbage_collector_is_not_lost(number, status):
    """Python ignores what such callbacks raise; JAX has one."""
    code = (
        "import gc, os, signal, sys, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler), signal.signal(signal.SIGTERM, signal.SIG_DFL)\n"
        "from dbvfiv.cli import main\n"
        "def wait():\n"
        "    def send(*_):\n"
        f"        gc.callbacks.remove(send), os.kill(os.getpid(), {int(number)}), time.sleep(0.1)\n"
        "    gc.callbacks.append(send)\n"
        "    gc.collect()\n"
        "    for _ in range(600):\n"
        "        time.sleep(0.1)\n"
        "main.build = lambda: type('Command', (), {'main': lambda *_, **__: wait()})()\n"
        "sys.exit(main.run([]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=50)
    assert done.returncode == status and "Traceback" not in done.stderr, done.stderr


def test_handlers_are_put_back(command_line):
    before = signal.getsignal(signal.SIGTERM)
    assert command_line("--version").status == 0
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.fixture
def small_disk(tmp_path):
    """2 MB."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root")
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount")
    yield disk
    subprocess.run(["umount", disk], check=True)


#: Runs whose files outgrow what is left on that disk.
FILLING: dict[str, tuple[str, ...]] = {
    "steady": ("-p", "1 kPa:30 kPa:400"),
    "closure": ("--set", f"closure.pressures={list(range(20, 3000, 5))}"),
    "transient": ("--set", "transient.duration=50", "--set", "transient.save_every=1 ms"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", [k if k == "steady" else pytest.param(k, marks=pytest.mark.slow) for k in FILLING])
def test_a_full_disk(small_disk, one_sentence, kind):
    path = small_disk / "r.h5"
    mesh = ("--set", "mesh.around=6", "--set", "mesh.along=10", "--set", "drive.pressure=2 kPa")
    run = start(kind, *mesh, *FILLING[kind], "-o", path)
    with open(small_disk / "other", "wb") as other:
        other.write(bytes((1400 if kind == "steady" else 600) * 1024))
    _, err = run.communicate(timeout=120)
    last = err.strip().splitlines()[-1]
    assert run.returncode == 1 and "no room" in last and one_sentence(last), err
    kept = dbvfiv.load_result(path)
    assert not kept.complete and any(kept.record.rows(table) for table in kept.record.tables)
    assert kept.lines()


#: Runs that find a disk full when they are about to keep what they found; how much of it another file takes, KB.
FULL = {
    "modes": ((), 1580),
    "sensitivity": (("--of", "density"), 1580),
    "sweep": (("--over", "density=1:1000:400:log"), 1580),
    "map": (("--x", "density=1:1000:4:log", "--y", "alpha=0.1:30:4:log", "--workers", "1"), 1580),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", FULL)
def test_no_room_for_what_was_found(small_disk, one_sentence, kind):
    (further, taken), path = FULL[kind], small_disk / "r.h5"
    with open(small_disk / "other", "wb") as other:
        other.write(bytes(taken * 1024))
    mesh = ("--set", "mesh.around=6", "--set", "mesh.along=10", "--set", "drive.pressure=2 kPa")
    run = start(kind, *mesh, *further, "-o", path)
    _, err = run.communicate(timeout=300)
    last = err.strip().splitlines()[-1]
    assert run.returncode == 1 and "no room" in last and one_sentence(last), err
    kept = dbvfiv.load_result(path)
    assert not kept.complete and kept.lines() and kept.summary() is not None
    kept.plot(small_disk.parent / "figures") if kept.drawable else None
