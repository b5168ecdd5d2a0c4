"""Tasks shared among workers: processes of this machine, of ``mpiexec``, or of a Dask cluster."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from pydantic import BeforeValidator

from ..case.section import Described
from ..errors import CaseError, SolveError
from ..runtime import mpi_size, prepare

#: Times that a task is tried again after a worker died over it.
TRIES = 3
#: Processes of this machine at most, and seconds in which a scheduler has to answer.
MOST, PATIENCE = 1024, 10
_numbers = itertools.count()
_SCHEMES = ("tcp://", "tls://", "ucx://")


def _number_or_address(given: Any) -> int | str:
    if isinstance(given, str) and given.startswith(_SCHEMES):
        return given
    if isinstance(given, str) and given.strip().isdigit():
        given = int(given)
    if isinstance(given, bool) or not isinstance(given, int):
        raise ValueError("which is neither a number nor an address such as tcp://host:8786")
    if not 1 <= given <= MOST:
        raise ValueError("which is out of range")
    return given


_ALLOWED = f"a number of processes from 1 to {MOST}, or the address of a Dask scheduler such as tcp://host:8786"
#: A key that says who does the work.
WorkersKey = Annotated[int | str, BeforeValidator(_number_or_address), Described("integer or address", _ALLOWED)]


def read_workers(given: Any) -> int | str:
    """Number of processes, or address of a scheduler, that is given beside a case. Raises CaseError."""
    try:
        return _number_or_address(given)
    except ValueError as error:
        raise CaseError(f"Workers are given as {given!r}, {error}; they must be {_ALLOWED}.") from None


WORKERS_HELP = (
    "Processes of this machine that share the work, or the address of a Dask scheduler, tcp://host:8786; under mpiexec "
    "with mpi4py all its processes share it."
)


@dataclass(frozen=True)
class Work:
    """A task as a worker does it: ``function(context, *arguments)``, pickled."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...] = ()


class Lost:
    """Result of a task over which `TRIES` workers died."""

    sentence = f"{TRIES} workers died over this task."


class Workers:
    """Whoever shares the tasks of a study; a context manager, so that workers start once for all of them.

    Parameters
    ----------
    count : int or str
        Processes of this machine, or the address of a Dask scheduler. With ``mpiexec`` its processes take the place of
        those of this machine.
    start : callable
        ``start(*data)`` gives the context of tasks, once in each worker.
    data : tuple
        What it needs, pickled.
    warn : callable
        Told in a sentence when a worker was lost.
    here : optional
        Context of this process, with which it does the tasks itself where nobody shares them.

    Results do not depend on who does a task, as a task knows nothing of the others.
    """

    def __init__(
        self, count: int | str, start: Callable[..., Any], data: tuple, warn: Callable[[str], None], here: Any = None
    ):
        self.count, self.warn = count, warn
        self._folder: TemporaryDirectory | None = None
        self._file: Path | None = None
        self.give(start, *data, here=here)
        self._pool: Executor | None = None
        self._cluster: Any = None

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_error) -> None:
        self._close()
        if self._cluster is not None:
            self._cluster.close()
        if self._folder is not None:
            self._folder.cleanup()

    def give(self, start: Callable[..., Any], *data: Any, here: Any = None) -> None:
        """Context of the tasks that are shared from now on."""
        if self._file is not None:
            self._file.unlink()
        self._file, self._here = None, here
        self._context = None if self._works_alone else pickle.dumps((start, data))

    @property
    def is_here(self) -> bool:
        """True where this process does all the work itself."""
        return self.count == 1 and mpi_size() == 1

    @property
    def _works_alone(self) -> bool:
        """True where this process does the tasks with a context of its own."""
        return self.is_here and self._here is not None

    def share(self, tasks: Iterable[Hashable], ask: Callable[[Any], Any]) -> Iterator[tuple[Any, Any]]:
        """Tasks with their results as they are finished: in any order, in their own where this process does them.
        Raises CaseError if a scheduler does not answer.

        Parameters
        ----------
        ask : callable
            From a task to its `Work`, or to its result where nobody has to work for it; asked in the order of the
            tasks, shortly before a worker is free.

        Yields
        ------
        task, result
            `Lost` is the result where nobody could do the task.
        """
        if self._works_alone:
            for task in tasks:
                work = ask(task)
                yield task, work.function(self._here, *work.arguments) if isinstance(work, Work) else work
            return
        left = list(tasks)
        tries = dict.fromkeys(left, 0)
        while left:
            self._pool = self._pool or self._started()
            lost: list[Any] = []
            finished = False
            try:
                # the last try of a task is its own: one that kills all workers takes no other along
                suspects = [task for task in left if tries[task] == TRIES - 1]
                for task, result in self._round(suspects[:1] or left, ask):
                    if result is Lost:
                        lost.append(task)
                        continue
                    left.remove(task)
                    yield task, result
                finished = True
            finally:
                if lost or not finished:
                    self._close()
            for task in lost:
                tries[task] += 1
                if tries[task] >= TRIES:
                    left.remove(task)
                    yield task, Lost
            if lost:
                self.warn(f"A worker was lost; {len(left)} tasks are given to new ones.")

    def _round(self, tasks: list[Any], ask: Callable[[Any], Any]) -> Iterator[tuple[Any, Any]]:
        """Finished tasks, and those in flight as lost when a worker died; the round then ends."""
        queue, running = list(tasks), {}
        while queue or running:
            while queue and len(running) < self._most:
                task = queue.pop(0)
                work = ask(task)
                if not isinstance(work, Work):
                    yield task, work
                    continue
                try:
                    running[self._pool.submit(_do, self._sent, work)] = task
                except BrokenExecutor:
                    if not running:  # all workers died between two tasks
                        yield task, Lost
                        return
                    queue.insert(0, task)
                    break
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = False
            for future in done:
                task = running.pop(future)
                try:
                    yield task, future.result()
                except Exception as error:
                    if not (isinstance(error, BrokenExecutor) or type(error).__name__ in _LOSSES):
                        raise
                    broken = True
                    yield task, Lost
            if broken:
                for task in running.values():
                    yield task, Lost
                return

    @property
    def _most(self) -> int:
        """Tasks in flight at most: one for each worker, and one that waits."""
        if self._cluster is not None:
            return len(self._cluster.scheduler_info(n_workers=-1)["workers"]) + 1
        return max(self.count if isinstance(self.count, int) else 1, mpi_size() - 1) + 1

    @property
    def _sent(self) -> bytes | Path:
        """Context as a task brings it. Processes of this machine read it from a file: megabytes fill the pipe to them,
        and who writes there hangs when they die (gh-94777 of CPython).
        """
        if not isinstance(self._pool, ProcessPoolExecutor):
            return self._context
        if self._file is None:
            self._folder = self._folder or TemporaryDirectory(prefix="dbvfiv-")
            self._file = Path(self._folder.name, str(next(_numbers)))  # a worker tells contexts by their names
            self._file.write_bytes(self._context)
        return self._file

    def _started(self) -> Executor:
        if isinstance(self.count, str):
            self._cluster = self._cluster or _connected(self.count)
            return self._cluster.get_executor(pure=False)
        if mpi_size() > 1:
            try:
                from mpi4py.futures import MPIPoolExecutor
            except ImportError:
                pass
            else:
                return MPIPoolExecutor(initializer=prepare)
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        return ProcessPoolExecutor(self.count, multiprocessing.get_context("spawn"), _begin)

    def _close(self) -> None:
        if self._pool is None:
            return
        # whatever a worker is at, nobody waits for it; the executor's own way to end them is newer than us
        processes = list((getattr(self._pool, "_processes", None) or {}).values())
        options = {} if self._cluster is not None else {"cancel_futures": True}  # a cluster cancels by itself
        self._pool.shutdown(wait=False, **options)
        self._pool = None
        for process in processes:
            process.kill()
        for process in processes:  # processor time of a process counts when it has ended
            process.join()


#: Errors of a Dask cluster that mean that a worker died; the names, since its package is optional.
_LOSSES = ("KilledWorker", "CancelledError", "FutureCancelledError")


def require_answer(count: int | str) -> None:
    """Refuse the address of a scheduler that does not answer, before anything is computed for it. Raises CaseError."""
    if isinstance(count, str):
        _connected(count).close()


def _connected(address: str) -> Any:
    """Client of a Dask scheduler. Raises CaseError if nobody answers, or the package is not installed."""
    try:
        from distributed import Client
    except ImportError:
        raise CaseError(
            f"Workers are given as {address!r}, the address of a Dask scheduler, but the package distributed is not "
            "installed; `pip install dbvfiv[cluster]` brings it."
        ) from None
    answer: list[Any] = []

    def ask() -> None:
        try:
            answer.append(Client(address, timeout=PATIENCE, set_as_default=False))
        except Exception as error:  # of whatever else answers there: lengths of a web server's words are no memory's
            answer.append(error)

    # a server that is no scheduler may leave the client waiting past its own limit
    asked = threading.Thread(target=ask, daemon=True)
    asked.start()
    asked.join(2 * PATIENCE)
    found = answer[0] if answer else TimeoutError()
    if isinstance(found, Exception):
        raise CaseError(
            f"Workers are given as {address!r}, where no Dask scheduler answers within {PATIENCE} s "
            f"({type(found).__name__}); start one by `dask scheduler`, or give a number of processes."
        )
    return found


def _begin() -> None:
    """Prepare a process of this machine; the one that shares the tasks hears Ctrl-C and SIGTERM, and ends this one."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare()


def _end_with_parent() -> None:
    """Let no worker stay behind when the process that shares the tasks was killed."""
    multiprocessing.parent_process().join()
    os._exit(1)


def share_samples(
    team: Workers, name: str, work: Work, numbers: Sequence, first: int, size: int, wanted: Callable[[int], bool]
) -> Iterator[tuple[int, Any]]:
    """Blocks of samples that hold a wanted one, by their start among the values of all, with what `work` makes of each:
    its function takes the number of the first sample and the values before its own arguments.
    """
    starts = range(0, len(numbers), size)
    asked = [k for k in starts if any(wanted(first + i) for i in range(k, min(k + size, len(numbers))))]
    blocks = {k: Work(work.function, (first + k, numbers[k : k + size], *work.arguments)) for k in asked}
    yield from share_all(team, asked, blocks.__getitem__, lambda k: f"{name} {first + k} and on")


def share_all(team: Workers, tasks: Iterable, ask: Callable[[Any], Any], told: Callable[[Any], str]) -> Iterator:
    """`Workers.share`, with what is lost as the end, when all else is known, so that another attempt does it again.
    Raises SolveError if workers died over a task, with `told` of it.
    """
    lost = []
    for task, found in team.share(tasks, ask):
        if found is Lost:
            lost.append(told(task))
        else:
            yield task, found
    if lost:
        raise SolveError(f"{', '.join(lost)} could not be computed: {Lost.sentence}")


#: One task at a time in a process, whatever threads a cluster has there; what they share is made once.
_one = threading.Lock()
_known: tuple[bytes | Path, Any] | None = None


def _do(context: bytes | Path, work: Work) -> Any:
    """Do a task in a worker, with the context that is made of its pickled start and data, or those of a file."""
    global _known
    with _one:
        if _known is None or _known[0] != context:
            start, data = pickle.loads(context.read_bytes() if isinstance(context, Path) else context)
            _known = context, start(*data)
        return work.function(_known[1], *work.arguments)
