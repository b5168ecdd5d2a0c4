"""Columns shared among processes: of this machine, or of several under ``mpiexec`` where mpi4py is installed."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from ..case.model import Case
from ..runtime import mpi_size
from .map_column import MapColumn, MapPlan, solve_column
from .stability_walk import StabilityWalk

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
    walk : StabilityWalk, optional
        Of this process.
    """

    def __init__(self, plan: MapPlan, workers: int, warn: Callable[[str], None], walk: StabilityWalk | None = None):
        self.plan, self.workers, self.warn = plan, workers, warn
        self.walk = walk
        self._pool: Executor | None = None

    def __enter__(self) -> ColumnPool:
        return self

    def __exit__(self, *_error) -> None:
        self._close()

    def _close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            self._pool = None

    @property
    def is_here(self) -> bool:
        """Whether this process does all the work itself."""
        return self.workers <= 1 and mpi_size() == 1

    def columns(self, wanted: Iterable[tuple[float, int]]) -> Iterator[MapColumn]:
        """Columns as they are finished, in any order.

        Parameters
        ----------
        wanted : (value, level) pairs
        """
        wanted = list(wanted)
        if self.is_here:
            self.walk = self.walk or StabilityWalk(self.plan.case)
            for value, level in wanted:
                yield solve_column(self.plan, self.walk, value, level)
            return
        tries = dict.fromkeys(wanted, 0)
        left = set(wanted)
        while left:
            self._pool = self._pool or _pool(self.plan, self.workers)
            lost: list[tuple[float, int]] = []
            finished = False
            try:
                for task, column in _round(self._pool, sorted(left), max(self.workers, mpi_size() - 1)):
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
                    yield MapColumn.missing(self.plan, *task, f"{TRIES} workers died over this column.")
            if lost:
                self.warn(f"A worker was lost; {len(left)} columns are given to new ones.")


def _round(
    pool: Executor, tasks: list[tuple[float, int]], workers: int
) -> Iterator[tuple[tuple[float, int], MapColumn | None]]:
    """Finished columns, and None for those in flight when a worker died; the round then ends."""
    queue, running = list(tasks), {}
    while queue or running:
        while queue and len(running) < workers + 1:
            task = queue.pop(0)
            try:
                running[pool.submit(_solve, *task)] = task
            except BrokenProcessPool:
                queue.insert(0, task)
                break
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
    data = (plan.case.to_dict(), plan.laws)
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


def _start(case: dict, laws: tuple[float, ...]) -> None:
    """Prepare a worker."""
    global _plan, _walk
    from dataclasses import replace

    from ..runtime import prepare

    prepare()
    read = Case.from_dict(case)
    _plan = replace(MapPlan.of(read), laws=tuple(laws))
    _walk = StabilityWalk(read)


def _solve(value: float, level: int) -> MapColumn:
    return solve_column(_plan, _walk, value, level)
