"""Columns shared among processes: of this machine, or of several under ``mpiexec`` where mpi4py is installed."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

import numpy as np

from ...errors import SolveError
from ...runtime import mpi_size, prepare
from ..case import Case
from ..stability.walk import StabilityWalk
from .column import ColumnTask, MapColumn, MapPlan, shared_place, solve_column

#: Times that a column is tried again after a worker died over it.
TRIES = 3

_walk: StabilityWalk | None = None
_plan: MapPlan | None = None


class ColumnPool:
    """Processes that solve columns; a context manager, so that they start once for all rounds of a map.

    Parameters
    ----------
    plan : MapPlan
    workers : int
        1 solves everything here, one after another.
    warn : callable
        Told in a sentence when a worker was lost.
    walk : StabilityWalk
        Of this process. It finds the steady states of all columns in their order, so that the numbers of a column do
        not depend on who solves it.
    known : iterable of MapColumn
        Columns of an interrupted run, given back instead of being solved.
    """

    def __init__(
        self,
        plan: MapPlan,
        workers: int,
        warn: Callable[[str], None],
        walk: StabilityWalk,
        known: Iterable[MapColumn] = (),
    ):
        self.plan, self.workers, self.warn, self.walk = plan, workers, warn, walk
        self.known = {(column.value, column.level): column for column in known}
        self._pool: Executor | None = None

    def __enter__(self) -> ColumnPool:
        return self

    def __exit__(self, *_error) -> None:
        self._close()

    def _close(self) -> None:
        if self._pool is not None:
            # whatever column a worker is at, nobody waits for it; the executor's own way to end them is newer than us
            workers = list((getattr(self._pool, "_processes", None) or {}).values())
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None
            for worker in workers:
                worker.kill()

    @property
    def is_here(self) -> bool:
        """True where this process does all the work itself."""
        return self.workers <= 1 and mpi_size() == 1

    def columns(self, wanted: Iterable[ColumnTask]) -> Iterator[MapColumn]:
        """Columns as they are finished, in any order.

        Parameters
        ----------
        wanted : iterable of ColumnTask
        """
        wanted = list(wanted)
        if self.is_here:
            for task in wanted:
                yield self._recalled(task) or solve_column(self.plan, self.walk, task)
            return
        tries = dict.fromkeys(wanted, 0)
        left = set(wanted)
        while left:
            self._pool = self._pool or _pool(self.plan, self.workers)
            lost: list[ColumnTask] = []
            finished = False
            try:
                for task, column in self._round(sorted(left)):
                    if column is None:
                        lost.append(task)
                        continue
                    left.discard(task)
                    yield column
                finished = True
            finally:
                if lost or not finished:
                    self._close()
            for task in lost:
                tries[task] += 1
                if tries[task] >= TRIES:
                    left.discard(task)
                    yield MapColumn.gap(task, f"{TRIES} workers died over this column.")
            if lost:
                self.warn(f"A worker was lost; {len(left)} columns are given to new ones.")

    def _recalled(self, task: ColumnTask) -> MapColumn | None:
        """A column that is known, and its state for the walk."""
        column = self.known.get(task.key)
        place = shared_place(self.plan, task.value)
        if column is not None and place is not None:
            self.walk.recall(place)
        return column

    def _state(self, task: ColumnTask) -> np.ndarray | None:
        """Steady state of a column, where its cells share one of the case's own design."""
        place = shared_place(self.plan, task.value)
        return None if place is None or place.design else self.walk.equilibrium(place)

    def _round(self, tasks: list[ColumnTask]) -> Iterator[tuple[ColumnTask, MapColumn | None]]:
        """Finished columns, and None for those in flight when a worker died; the round then ends."""
        queue, running = list(tasks), {}
        most = max(self.workers, mpi_size() - 1) + 1
        while queue or running:
            while queue and len(running) < most:
                task = queue.pop(0)
                column = self._recalled(task)
                if column is not None:
                    yield task, column
                    continue
                try:
                    running[self._pool.submit(_solve, task, self._state(task))] = task
                except SolveError as error:
                    yield task, MapColumn.gap(task, str(error))
                except BrokenProcessPool:
                    queue.insert(0, task)
                    break
            if not queue and not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = not running
            for future in done:
                task = running.pop(future)
                try:
                    yield task, future.result()
                except BrokenProcessPool:
                    broken = True
                    yield task, None
            if broken:
                for task in running.values():
                    yield task, None
                return


def _pool(plan: MapPlan, workers: int) -> Executor:
    data = (plan.case.to_dict(),)
    if mpi_size() > 1:
        try:
            from mpi4py.futures import MPIPoolExecutor
        except ImportError:
            pass
        else:
            return MPIPoolExecutor(initializer=_start, initargs=data)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return ProcessPoolExecutor(max(workers, 1), multiprocessing.get_context("spawn"), _start, data)


def _start(case: dict) -> None:
    """Prepare a worker; the process that shares the columns out hears Ctrl-C and SIGTERM, and ends this one."""
    global _plan, _walk
    if multiprocessing.parent_process() is not None:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)
        threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare()
    read = Case.from_dict(case)
    _plan = MapPlan(read)
    _walk = StabilityWalk(read)


def _end_with_parent() -> None:
    """Let no worker stay behind when the process that shares the columns out was killed."""
    multiprocessing.parent_process().join()
    os._exit(1)


def _solve(task: ColumnTask, state: np.ndarray | None) -> MapColumn:
    if state is not None:
        _walk.give(shared_place(_plan, task.value), state)
    return solve_column(_plan, _walk, task)
