"""Journals: whole rows only, readable at any moment, one writer, room on the disk."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from dbvfiv.errors import CaseError, DiskFull
from dbvfiv.record.files import Header
from dbvfiv.record.record import GrowingRecord, Journal, StoredRecord
from dbvfiv.record.table import TEXT, Column, TableSpec
from dbvfiv.studies.case import Case, thesis_case

ROOT = Path(__file__).parent.parent.parent
TABLE = TableSpec(
    "states",
    (Column("x", "m", "A number"), Column("shape", "m", "A field"), Column("why", "", "A text", TEXT)),
    {"shape": (2000,)},
)


def tables(_mesh=None):
    return (TABLE,)


def header():
    return Header.of("steady", thesis_case())


def row(i):
    return {"x": float(i), "shape": np.full(2000, float(i)), "why": f"because of {i}"}


WRITER = """
import sys
sys.path.insert(0, {root!r})
from tests.record.test_journal import *
with GrowingRecord(header(), None, tables(), {path!r}) as record:
    print("open", flush=True)
    for i in range({count}):
        record.append("states", row(i))
        record.note("thing", number=i, values=np.arange(3.0))
    record.conclude(True)
"""


def start_writer(path, count=100_000):
    code = WRITER.format(root=str(ROOT), path=str(path), count=count)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    writer = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert writer.stdout.readline() == "open\n", writer.stderr.read()
    return writer


def check_whole(path):
    found = StoredRecord(path, tables, Case)
    count = found.rows("states")
    assert np.array_equal(found.column("states", "x"), np.arange(count))
    assert np.all(found.column("states", "shape") == np.arange(count)[:, None])
    assert [note["number"] for note in found.notes("thing")] == list(range(len(found.notes("thing"))))
    assert count - len(found.notes("thing")) in (0, 1) or not found.complete
    return count


def test_a_long_text_ends_with_a_whole_letter(tmp_path):
    path, text = tmp_path / "a.h5", "a" + 400 * "ü"
    with GrowingRecord(header(), None, tables(), path) as record:
        record.append("states", row(0) | {"why": text})
    (kept,) = StoredRecord(path, tables, Case).column("states", "why")
    assert kept == text[:200]
    with h5py.File(path, "r+") as file:  # as earlier versions cut it
        file["tables/states/why"][0] = text.encode()[:400]
    assert StoredRecord(path, tables, Case).value("states", "why", 0) == kept


def test_rows_and_notes_come_back(tmp_path):
    with GrowingRecord(header(), None, tables(), tmp_path / "a.h5") as record:
        for i in range(3):
            record.append("states", row(i))
        record.note("thing", number=0, complex=1 + 2j, text="ü", missing=float("nan"))
        record.warn("Look out.")
        record.fail("It did not work.")
        record.conclude(True)
    again = StoredRecord(tmp_path / "a.h5", tables, Case)
    for mine in (record, again):
        assert mine.rows("states") == 3 and mine.value("states", "why", 1) == "because of 1"
        assert mine.notes("thing")[0]["complex"] == [1, 2] and mine.notes("thing")[0]["text"] == "ü"
        assert np.isnan(mine.notes("thing")[0]["missing"])
        assert mine.warnings == ("Look out.",) and mine.failures == ("It did not work.",) and mine.complete
        assert np.array_equal(mine.column("states", "shape"), np.outer(range(3), np.ones(2000)))


def test_going_on_keeps_rows_and_says_anew_what_failed(tmp_path):
    path = tmp_path / "a.h5"
    with GrowingRecord(header(), None, tables(), path) as record:
        record.append("states", row(0))
        record.fail("It did not work.")
        record.conclude(False)
    with GrowingRecord(header(), None, tables(), path, known=StoredRecord(path, tables, Case)) as record:
        assert record.rows("states") == 1 and not record.failures
        record.append("states", row(1))
        record.conclude(True)
    again = StoredRecord(path, tables, Case)
    assert again.complete and not again.failures and list(again.column("states", "x")) == [0, 1]


@pytest.mark.slow
def test_killed_writers_leave_whole_rows(tmp_path):
    random = np.random.default_rng(1)
    for number in range(6):
        path = tmp_path / f"{number}.h5"
        writer = start_writer(path)
        time.sleep(random.uniform(0.0, 0.4))
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
        check_whole(path)
        with GrowingRecord(header(), None, tables(), path, known=StoredRecord(path, tables, Case)) as record:  # goes on
            record.append("states", row(record.rows("states")))
        check_whole(path)
        assert not list(tmp_path.glob(".*"))


def test_a_running_file_can_be_read_at_any_moment_and_has_one_writer(tmp_path, refused):
    """A second one is told before anything is touched, and the first goes on."""
    path = tmp_path / "a.h5"
    writer = start_writer(path)
    try:
        counts = [check_whole(path) for _ in range(20)]
        with refused(CaseError, match="another process"):
            Journal(path, header(), None, tables())
        until = time.monotonic() + 30
        while counts[-1] <= counts[19] and time.monotonic() < until:
            counts.append(check_whole(path))
        assert counts == sorted(counts) and counts[-1] > counts[0] and counts[-1] > counts[19]
    finally:
        writer.kill()
        writer.communicate()
    Journal(path, header(), None, tables()).close()  # whoever held it is gone


def test_two_writers_in_one_process(tmp_path):
    with Journal(tmp_path / "a.h5", header(), None, tables()), pytest.raises(CaseError):
        Journal(tmp_path / "a.h5", header(), None, tables())


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
def test_a_full_disk_keeps_what_was_found(tmp_path, one_sentence):
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount")
    try:
        record = GrowingRecord(header(), None, tables(), disk / "a.h5")
        with pytest.raises(DiskFull) as caught:
            for i in range(1000):
                record.append("states", row(i))
        record.close()
        assert one_sentence(str(caught.value))
        assert check_whole(disk / "a.h5") == i > 10
    finally:
        subprocess.run(["umount", disk], check=True)


def test_a_folder_that_cannot_be_written(tmp_path, refused):
    if os.geteuid() == 0:
        folder = Path("/proc")
    else:
        folder = tmp_path / "locked"
        folder.mkdir(mode=0o500)
    with refused(CaseError):
        Journal(folder / "a.h5", header(), None, tables())


def test_an_earlier_result_stays_until_a_run_begins(tmp_path):
    """A command that is refused for its arguments took away what another had found."""
    path = tmp_path / "a.h5"
    with GrowingRecord(header(), None, tables(), path) as record:
        record.append("states", row(0))
        record.conclude(True)
    before = path.read_bytes()
    with pytest.raises(CaseError), GrowingRecord(header(), None, tables(), path) as record:
        record.warn("Look out.")
        raise CaseError("It is refused.")
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    with GrowingRecord(header(), None, tables(), path) as record:
        record.begin("steady", 1)
        assert not StoredRecord(path, tables, Case).rows("states")
