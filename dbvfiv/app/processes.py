"""Worker processes of the valves that are asked, and the runs of the command line, with their queue."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import os
import re
import secrets
import shutil
import signal
import sys
import time
from collections import OrderedDict
from collections.abc import Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import CaseError

#: Valves whose workers are kept; results of one user that are kept, and of them waiting; time of a run, s.
VALVES, KEPT, WAITING, LONGEST = 3, 40, 8, 6 * 3600.0
#: Time for an answer of a worker, and for a run to end that was asked to, s.
PATIENCE, STUBBORN = 300.0, 5.0
#: File of a record in the folder of its run; no data file of a case has such a name.
RECORD = ".record.csv"
#: Beginning of a command line.
PROGRAM = (sys.executable, "-m", "dbvfiv")
#: Largest line of an answer, bytes.
LINE = 64 << 20
#: Added to the priority number of processes that nobody's hand waits for.
BEHIND = 10


class Ended(CaseError):
    """End of a process before its answer."""


def surroundings(**further: str) -> dict[str, str]:
    """Environment of a process that finds this package."""
    found = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(found)} | further


class Worker:
    """One worker process; it is started with the first question, and again after it died.

    Parameters
    ----------
    nice : int
        Added to its priority number, so that others go first.
    """

    def __init__(self, nice: int = 0) -> None:
        self._nice = nice
        self._process: asyncio.subprocess.Process | None = None
        self._waiting: dict[int, asyncio.Future] = {}
        self._numbers = itertools.count()
        self._opened = ""
        self._lock = asyncio.Lock()

    @property
    def pid(self) -> int | None:
        """Number of the process while it lives."""
        return self._process.pid if self._process is not None and self._process.returncode is None else None

    async def start(self) -> None:
        """Start the process, unless it lives."""
        if self.pid is not None:
            return
        environment = surroundings()
        command = (sys.executable, "-m", "dbvfiv.app.worker")
        pipes = {"stdin": asyncio.subprocess.PIPE, "stdout": asyncio.subprocess.PIPE, "limit": LINE}
        self._process = await asyncio.create_subprocess_exec(*command, env=environment, start_new_session=True, **pipes)
        _put_behind(self._process.pid, self._nice)
        self._waiting, self._opened = {}, ""
        self._reader = asyncio.create_task(_read(self._process, self._waiting))

    async def ask(self, do: str, **question: Any) -> Any:
        """Answer to a question.

        Raises
        ------
        CaseError
            With the sentence of what went wrong.
        """
        await self.start()
        number = next(self._numbers)
        self._waiting[number] = waiting = asyncio.get_running_loop().create_future()
        try:
            self._process.stdin.write(json.dumps({"id": number, "do": do, **question}).encode() + b"\n")
            await self._process.stdin.drain()
            found = await asyncio.wait_for(waiting, PATIENCE)
        except (TimeoutError, ConnectionError):
            self._waiting.pop(number, None)
            self.end()
            raise CaseError("The process that computes did not answer and was ended; ask again.") from None
        if "ended" in found:
            raise Ended(found["error"])
        if "error" in found:
            raise CaseError(found["error"])
        return found["answer"]

    async def about(self, case: Path, do: str, **question: Any) -> Any:
        """Answer to a question on a case file, which is opened before; asked once more where the process ends."""
        try:
            return await self._about(case, do, **question)
        except Ended:
            return await self._about(case, do, **question)

    async def _about(self, case: Path, do: str, **question: Any) -> Any:
        async with self._lock:
            if self.pid is None or self._opened != str(case):
                self._opened = ""  # whatever comes of it, the valve before is closed
                self._parameters = await self.ask("open", case=str(case))
                self._opened = str(case)
        return self._parameters if do == "open" else await self.ask(do, **question)

    def end(self) -> None:
        """End the process."""
        if self.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.pid, signal.SIGKILL)


async def _read(process: asyncio.subprocess.Process, asked: dict[int, asyncio.Future]) -> None:
    """Hand the answers of a process to the questions that it was asked, until it ends."""
    while line := await process.stdout.readline():
        found = json.loads(line)
        waiting = asked.pop(found["id"], None)
        if waiting is not None and not waiting.done():
            waiting.set_result(found)
    await process.wait()
    for waiting in asked.values():
        if not waiting.done():
            waiting.set_result({"error": "The process that computes ended; ask again.", "ended": True})
    asked.clear()


class Workers:
    """Workers of the valves that were asked last: one predicts, one confirms; and one that draws for all.

    A pair that nobody asks any more goes on with the next valve: what it has imported and compiled serves again.
    """

    def __init__(self) -> None:
        self.drawing = Worker(BEHIND // 2)
        self._pairs: OrderedDict[Path, tuple[Worker, Worker]] = OrderedDict()
        self._askers: dict[Path, set[object]] = {}

    def of(self, case: Path, asker: object) -> tuple[Worker, Worker]:
        """Workers of a case file for one of those who ask, who gives up the valve that he asked before; those of the
        valve that was not asked for longest are ended where too many live.
        """
        for others in self._askers.values():
            others.discard(asker)
        free = next((path for path in reversed(self._pairs) if not self._askers[path]), None)
        key = case if case in self._pairs else free
        pair = (Worker(), Worker(BEHIND)) if key is None else self._pairs.pop(key)
        self._pairs[case], self._askers[case] = pair, self._askers.pop(key, set()) | {asker}
        while len(self._pairs) > VALVES:
            last, workers = self._pairs.popitem(last=False)
            del self._askers[last]
            for worker in workers:
                worker.end()
        return pair

    def leave(self, asker: object) -> None:
        """Nobody waits for the valve of one who asked, unless others do."""
        for others in self._askers.values():
            others.discard(asker)

    def end(self) -> None:
        """End all."""
        for worker in (self.drawing, *itertools.chain(*self._pairs.values())):
            worker.end()


@dataclass(eq=False)
class Run:
    """A run of the command line in a folder of its own, which holds its case, journal, output and results."""

    folder: Path
    kind: str  #: Study, report, or verdict of a record.
    title: str
    arguments: list[str] = field(default_factory=list)
    state: str = "waiting"  #: waiting, running, done, failed, cancelled or interrupted.
    #: made, started and ended: s; since 1970.
    made: float = 0.0
    started: float = 0.0
    ended: float = 0.0
    process: asyncio.subprocess.Process | None = None

    @property
    def name(self) -> str:
        """Name of its folder."""
        return self.folder.name

    @property
    def page(self) -> Path:
        """Page of a report, or the result file."""
        return self.folder / ("report.html" if self.kind == "report" else "result.h5")

    @property
    def case(self) -> Path:
        """Case file, which has the name of the valve."""
        return next(self.folder.glob("*.toml"), self.folder / "valve.toml")

    @property
    def is_live(self) -> bool:
        """True where it runs or will."""
        return self.state in ("running", "waiting")

    @property
    def can_resume(self) -> bool:
        """True where it was ended before its end."""
        return self.state in ("cancelled", "interrupted") and self.process is None

    def keep(self) -> None:
        """Write the journal."""
        kept = {name: value for name, value in vars(self).items() if name not in ("folder", "process")}
        draft = self.folder / "run.json.new"
        draft.write_text(json.dumps(kept))
        draft.replace(self.folder / "run.json")

    @classmethod
    def read(cls, folder: Path) -> Run | None:
        """Run of a folder; one that was running when the server ended is interrupted."""
        try:
            run = cls(folder, **json.loads((folder / "run.json").read_text()))
        except (OSError, ValueError, TypeError):
            return None
        if run.is_live:
            run.state = "interrupted"
        return run

    def progress(self) -> tuple[float, str]:
        """Share that is done, and what the bar says, with the time that is left."""
        try:
            with open(self.folder / "errors.txt", "rb") as file:
                file.seek(max(0, os.fstat(file.fileno()).st_size - 600))
                line = re.split(r"[\r\n]+", file.read().decode("utf-8", "replace").strip())[-1]
        except OSError:
            return 0.0, ""
        share = re.search(r"(\d+)\s?%", line)
        left = re.search(r"<([\d:]+)", line)
        said = re.sub(r"\s*\|.*?\|\s*", " ", line)
        said = f"{said.split('[')[0].strip()}; {left[1]} left" if left else said.strip()
        return (float(share[1]) / 100 if share else 0.0), said[:160]

    def output(self) -> str:
        """Text that it printed, and the sentence of its failure."""
        said = []
        for name in ("output.txt", "errors.txt"):
            with contextlib.suppress(OSError):
                text = (self.folder / name).read_bytes()[-20_000:].decode("utf-8", "replace")
                said += [line.rsplit("\r", 1)[-1].rstrip() for line in text.split("\n")]
        return "\n".join(line for line in said if line and not re.search(r"\d%\|", line))

    def commands(self) -> list[list[str]]:
        """Command lines, one after another; a study that was begun goes on in its file."""
        if self.kind == "report":
            return [["report", self.case.name, "-o", "report.html", "--workers", "1", *self.arguments]]
        if self.kind == "verdict":
            return [["verdict", RECORD, "--plots", "figures"]]
        if self.kind == "compare":
            beside = ["compare", RECORD, "result.h5", "-o", "figures/record.png"]
            return [["modes", self.case.name, "-o", "result.h5", *self.arguments], beside]
        if (self.folder / "result.h5").exists():
            return [["resume", "result.h5"]]
        return [[self.kind, self.case.name, "-o", "result.h5", *self.arguments]]


class Runs:
    """Queue of the runs of all users, so many at once."""

    def __init__(self, at_once: int = 1):
        self.at_once = at_once
        self._queue: list[Run] = []
        self._running: set[Run] = set()
        self._known: dict[Path, dict[str, Run]] = {}
        self._tasks: set[asyncio.Task] = set()

    def of(self, folder: Path) -> list[Run]:
        """Runs of the folder of a user, the newest first, without results of which the kind is still to be told."""
        return sorted((run for run in self._all(folder).values() if run.kind), key=lambda run: -run.made)

    def _all(self, folder: Path) -> dict[str, Run]:
        if folder not in self._known:
            found = [Run.read(path) for path in sorted((folder / "runs").glob("*")) if path.is_dir()]
            self._known[folder] = {run.name: run for run in found if run is not None}
        return self._known[folder]

    def add(self, folder: Path, kind: str, title: str, files: dict[str, bytes], arguments: list[str]) -> Run:
        """Put a run with its files into the queue. Raises CaseError where a user has too many."""
        if sum(run.is_live for run in self.of(folder)) >= WAITING:
            raise CaseError(f"{WAITING} runs are waiting already; cancel one or wait.")
        run = self._make(folder, kind, title, files, arguments)
        self._enqueue(run)
        return run

    def keep(self, folder: Path, title: str, result: Path | bytes) -> Run:
        """Keep a result file that was made elsewhere beside the runs; its kind is to be told yet. Raises CaseError
        where a user has too many.
        """
        run = self._make(folder, "", title, {"result.h5": result}, [])
        run.state = "done"
        return run

    def _make(self, folder: Path, kind: str, title: str, files: dict[str, Path | bytes], arguments: list[str]) -> Run:
        known = self._all(folder)
        if len(known) >= KEPT:
            raise CaseError(f"{KEPT} results are kept already; delete some.")
        own = folder / "runs" / f"{time.time_ns():x}-{secrets.token_hex(3)}"
        own.mkdir(parents=True)
        for name, content in files.items():
            if isinstance(content, Path):
                shutil.copyfile(content, own / name)
            else:
                (own / name).write_bytes(content)
        run = Run(own, kind, title, arguments, made=time.time())
        known[run.name] = run
        return run

    def resume(self, run: Run) -> None:
        """Put a run that was ended into the queue again."""
        if run.can_resume:
            self._enqueue(run)

    def _enqueue(self, run: Run) -> None:
        run.state = "waiting"
        run.keep()
        self._queue.append(run)
        self._next()

    def cancel(self, run: Run) -> None:
        """End a run, which keeps what it found."""
        if run in self._queue:
            self._queue.remove(run)
        if run.is_live:
            run.state = "cancelled"
            run.keep()
            if run.process is not None:
                self._start(_insist(run.process))

    def delete(self, folder: Path, run: Run) -> None:
        """End a run and delete its folder."""
        self.cancel(run)
        self._all(folder).pop(run.name, None)
        shutil.rmtree(run.folder, ignore_errors=True)

    def _next(self) -> None:
        while self._queue and len(self._running) < self.at_once:
            run = self._queue.pop(0)
            self._running.add(run)
            self._start(self._perform(run))

    def _start(self, work: Coroutine) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _perform(self, run: Run) -> None:
        try:
            if run.state == "waiting":  # not cancelled since it left the queue
                run.state, run.started = "running", time.time()
                run.keep()
            status = 0
            with open(run.folder / "output.txt", "wb") as out, open(run.folder / "errors.txt", "wb") as errors:
                for command in run.commands():
                    if run.state == "running" and status == 0:
                        status = await self._carry_out(run, command, out, errors)
            if run.state == "running":
                run.state = "done" if status == 0 else "interrupted" if status in (130, 143, -9, -15) else "failed"
        except OSError:
            run.state = "failed"
        finally:
            run.ended, run.process = time.time(), None
            self._running.discard(run)
            with contextlib.suppress(OSError):  # of one that was deleted
                run.keep()
            self._next()

    async def _carry_out(self, run: Run, command: list[str], out: Any, errors: Any) -> int:
        """Exit status of a command line of a run."""
        streams = {"stdin": asyncio.subprocess.DEVNULL, "stdout": out, "stderr": errors, "start_new_session": True}
        environment = surroundings(DBVFIV_BAR="1", COLUMNS="100")
        run.process = await asyncio.create_subprocess_exec(
            *PROGRAM, *command, cwd=run.folder, env=environment, **streams
        )
        _put_behind(run.process.pid, BEHIND)
        if run.state != "running":  # cancelled while it was being started
            self._start(_insist(run.process))
        try:
            return await asyncio.wait_for(run.process.wait(), LONGEST)
        except TimeoutError:
            self.cancel(run)
            return await run.process.wait()

    async def end(self) -> None:
        """End all runs; those that ran or waited are interrupted, and go on when they are resumed."""
        self._queue.clear()
        await asyncio.gather(*(_insist(run.process) for run in self._running if run.process is not None))


async def _insist(process: asyncio.subprocess.Process) -> None:
    """End a process: it is asked, asked again where a library has swallowed that, and killed."""
    for number in (signal.SIGTERM, signal.SIGTERM, signal.SIGKILL):
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(process.wait(), STUBBORN)


def _put_behind(pid: int, nice: int) -> None:
    """Let other processes go first."""
    with contextlib.suppress(OSError, AttributeError):  # ended already, or a system without priorities
        os.setpriority(os.PRIO_PROCESS, pid, os.getpriority(os.PRIO_PROCESS, 0) + nice)
