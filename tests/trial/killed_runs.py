"""A process that starts studies in children, kills them at random moments, and says what their files hold.

It imports everything and loads the compiled element loops once, and starts nothing of JAX itself, so that a child can
be forked from it. It reads requests from standard input, one JSON document a line, and answers likewise.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path

import numpy as np

import dbvfiv
from dbvfiv.api import Valve
from dbvfiv.errors import CaseError
from dbvfiv.record.record import GrowingRecord, Record
from dbvfiv.studies import KINDS
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.session import find_study

CASE = {"mesh.around": 4, "mesh.along": 6, "drive.pressure": 2e3, "fluid.density": 10}
#: A valve that has cycles.
OSCILLATING = {"mesh.around": 6, "mesh.along": 8, "drive.pressure": 6e3, "damping.alpha": 0.0, "damping.beta": 3e-3}
RUNS = {
    "steady": lambda valve, path: valve.steady([1e3, 2e3, 3e3], output=path),
    "modes": lambda valve, path: valve.modes(output=path),
    "sweep": lambda valve, path: valve.sweep("density=1:1000:4:log", output=path),
    "sensitivity": lambda valve, path: valve.sensitivity(["pressure", "thickness"], output=path),
    "onset": lambda valve, path: valve.onset("alpha=0.1:30:3:log", output=path),
    "map": lambda valve, path: valve.map("density=1:100:3:log", "alpha=0.1:30:3:log", output=path),
    "uncertainty": lambda valve, path: valve.uncertainty(
        "pressure=1000,2000", samples=16, inputs={"thickness": "normal(4 %)"}, output=path
    ),
    "design": lambda valve, path: valve.replace({"design.evaluations": 3, "design.finer": 1}).design(
        {"thickness": "0.7:1.4"}, aim="flow at 2 kPa up", constraints=["mass at most 8 kg"], output=path
    ),
    "response": lambda valve, path: valve.replace({"response.count": 16, "fluid.density": 1000}).response(output=path),
    "identify": lambda valve, path: valve.replace({"uncertainty.inputs": {"thickness": "normal(4 %)"}}).identify(
        [{"frequency": 20.0, "frequency_interval": 1.0}],
        "pressure=1000,3000",
        samples=8,
        round=4,
        rounds=1,
        output=path,
    ),
    "transient": lambda valve, path: valve.transient("20 ms", output=path),
    "levels": lambda valve, path: valve.levels([1e3, 2e3], output=path),
    "cycle": lambda valve, path: valve.replace(OSCILLATING).cycle("density=236:260:2", output=path),
    "closure": lambda valve, path: valve.closure([500, 1000, 1500], output=path),
}
LIMIT = 120.0
#: Columns that count rows of other tables, those that were left out later included, and times of the clock.
COUNTED = ("way/path", "way/buckling", "seconds")


def told(wire: int):
    """Let every record say on a wire what it has promised to keep: from when its file has the name on."""
    for name in ("extend", "note"):
        inner = getattr(GrowingRecord, name)

        def outer(self, *given, _inner=inner, **named):
            _inner(self, *given, **named)
            if self._journal is not None and self._journal._new is None:
                counts = {table: self.rows(table) for table in self.tables} | {"log": len(self.log)}
                os.write(wire, json.dumps(counts).encode() + b"\n")

        setattr(GrowingRecord, name, outer)


class Child:
    """A study in a process of its own."""

    def __init__(self, kind: str, path: Path):
        self.lines: list[dict] = []
        self.status: int | None = None
        self._text = b""
        self.began = time.monotonic()
        self._wire, wire = os.pipe()
        os.set_blocking(self._wire, False)
        self.pid = os.fork()
        if self.pid:
            os.close(wire)
            return
        try:
            told(wire)
            dbvfiv.resume(path) if path.exists() and path.stat().st_size else RUNS[kind](
                dbvfiv.load(thesis_case(), CASE), path
            )
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            os._exit(1)

    def listen(self) -> bool:
        """Take in what the child has said; whether it still runs."""
        if self.status is not None:
            return False
        ended, status = os.waitpid(self.pid, os.WNOHANG)
        if ended:
            self.status = status
        try:
            while text := os.read(self._wire, 65536):
                self._text += text
        except BlockingIOError:
            pass
        *whole, self._text = self._text.split(b"\n")
        self.lines += [json.loads(line) for line in whole]
        if not ended and time.monotonic() - self.began > LIMIT:
            os.kill(self.pid, signal.SIGKILL)
            raise RuntimeError("a child hangs")
        return not ended

    def kill(self, after_lines: int, after: float) -> None:
        """Kill it some time, s, after it has said a number of lines."""
        while len(self.lines) < after_lines and self.listen():
            time.sleep(0.001)
        end = time.monotonic() + after
        while time.monotonic() < end and self.listen():
            time.sleep(0.0005)
        if self.listen():
            os.kill(self.pid, signal.SIGKILL)
            while self.listen():
                time.sleep(0.001)


def contents(path: Path) -> dict:
    """What a file holds: all rows, and what is said of it."""
    result = dbvfiv.load_result(path)
    record = result.record
    columns = {
        f"{table}/{column.name}": record.column(table, column.name)[last_rows(record, table)]
        for table, spec in record.tables.items()
        for column in spec.columns
        if column.name not in COUNTED
    }
    return {
        "counts": {table: record.rows(table) for table in record.tables} | {"log": len(record.log)},
        "columns": columns,
        "complete": result.complete,
        "summary": json.dumps(result.summary(), default=str) if result.complete else "",
    }


def last_rows(record: Record, table: str) -> np.ndarray | slice:
    """Those of the attempt that went to its end; a restart point that was kept again at the same step once."""
    if table == "restart":
        return np.unique(record.column(table, "steps"), return_index=True)[1]
    return slice(None)


def reference(kind: str, path: Path) -> dict:
    """An uninterrupted run, and how often its file was read meanwhile."""
    child, reads, wrong = Child(kind, path), 0, []
    while child.listen():
        time.sleep(0.01)
        if not path.exists() or not path.stat().st_size:
            continue
        promised = dict(child.lines[-1]) if child.lines else {}
        try:
            found = dbvfiv.load_result(path)
            record = found.record
            found.header, found.warnings
            reads += 1
            short = [name for name in record.tables if record.rows(name) < promised.get(name, 0)]
            wrong += [f"{name} has fewer rows than were kept" for name in short]
        except Exception as error:
            wrong.append(f"{type(error).__name__}: {error}")
    if child.status:
        wrong.append("the run failed")
    return {"reads": reads, "wrong": wrong, "lines": len(child.lines), "seconds": time.monotonic() - child.began}


def trial(kind: str, folder: Path, kills: int, chance: random.Random, whole: dict, about: dict) -> dict:
    """Kill a run and its resumes, then let it end; what was lost or differs from the whole run."""
    path, wrong, promised, done = folder / f"{kind}-{chance.random()}.h5", [], {}, 0
    for _ in range(kills):
        child = Child(kind, path)
        if chance.random() < 0.5:
            child.kill(chance.randint(0, about["lines"]), chance.uniform(0, 0.03))
        else:
            child.kill(0, chance.uniform(0.2, about["seconds"]))
        if os.WIFEXITED(child.status):
            if os.WEXITSTATUS(child.status):
                wrong.append("the run failed")
            break
        done += 1
        if not path.exists():
            continue
        if path.stat().st_size and dbvfiv.load_result(path).complete:
            break  # killed between its last word and its end: nothing is left to resume
        if not path.stat().st_size:
            try:
                dbvfiv.load_result(path)
            except CaseError as error:
                if "is empty" not in str(error) or child.lines or promised:
                    wrong.append(f"nothing is left: {error}")
            continue
        try:
            found = contents(path)["counts"]
        except Exception as error:
            wrong.append(f"{type(error).__name__}: {error}")
            break
        if child.lines or find_study(kind).rows_to_keep is None:
            promised = child.lines[-1] if child.lines else promised
            wrong += [f"{name}: {found[name]} of {n} are left" for name, n in promised.items() if found[name] < n]
    if not path.exists() or not path.stat().st_size or not dbvfiv.load_result(path).complete:
        child = Child(kind, path)
        while child.listen():
            time.sleep(0.005)
        if child.status:
            return {"kills": done, "wrong": [*wrong, "the resume failed"]}
    wrong += cycle_differences(whole, contents(path)) if kind == "cycle" else differences(whole, contents(path))
    wrong += [f"{left.name} stays behind" for left in folder.glob(".*")]
    return {"kills": done, "wrong": wrong}


def differences(whole: dict, last: dict) -> list[str]:
    """Where a run that was killed and resumed has other digits than one that never was."""
    other = [name for name, values in whole["columns"].items() if not same(values, last["columns"][name])]
    wrong = [f"{name} differs from an uninterrupted run" for name in other]
    if last["summary"] != whole["summary"]:
        wrong.append("the summary differs from that of an uninterrupted run")
    return wrong


def cycle_differences(whole: dict, last: dict) -> list[str]:
    """The same of a branch of cycles, which goes on without what its corrections had learnt: the cycles that were asked
    for within ten times the tolerance of the last correction.
    """
    wrong, rows = [], []
    for found in (whole["columns"], last["columns"]):
        asked = np.flatnonzero(found["cycles/asked"])
        rows.append(asked[np.argsort(found["cycles/value"][asked])])
    for name in ("value", "amplitude", "frequency", "flow_mean"):
        a, b = (found["columns"][f"cycles/{name}"][asked] for found, asked in zip((whole, last), rows))
        if a.shape != b.shape or not np.allclose(a, b, rtol=1e-4, atol=0.0):
            wrong.append(f"cycles/{name}: {a} in an uninterrupted run, {b} here")
    return wrong


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind in "fc")


def answer(request: dict) -> dict:
    """Trials of one study."""
    kind, folder = request["kind"], Path(request["folder"])
    chance = random.Random(request["seed"])
    about = reference(kind, folder / f"{kind}.h5")
    if about["wrong"]:
        return about | {"kills": 0}
    whole, kills, trials = contents(folder / f"{kind}.h5"), 0, 0
    while kills < request["kills"] and trials < 4 * request["kills"]:  # some end before they are killed
        found = trial(kind, folder, request["in_a_row"], chance, whole, about)
        kills, trials = kills + found["kills"], trials + 1
        about["wrong"] += found["wrong"]
    return about | {"kills": kills}


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # JAX warns of forks; it has not begun to work here
    assert Valve and all(find_study(kind) for kind in KINDS)
    model = dbvfiv.load(thesis_case(), CASE).session.described
    rest = np.zeros(model.shell.size)
    model.shell.force_and_tangent(rest)
    model.shell.mass(rest)
    model.shell.inertia(rest, rest, rest)
    model.station_forces(model.shell.dofs.expand(rest))
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)
