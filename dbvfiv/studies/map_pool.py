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


def columns(
    plan: MapPlan,
    wanted: Iterable[tuple[float, int]],
    workers: int,
    warn: Callable[[str], None],
    walk: StabilityWalk | None = None,
) -> Iterator[MapColumn]:
    """Columns as they are finished, in any order.

    Parameters
    ----------
    plan : MapPlan
    wanted : (value, level) pairs
    workers : int
        1 solves them here, one after another.
    warn : callable
        Told in a sentence when a worker was lost.
    walk : StabilityWalk, optional
        Of this process.
    """
    wanted = list(wanted)
    if workers <= 1 and mpi_size() == 1:
        walk = walk or StabilityWalk(plan.case)
        for value, level in wanted:
            yield solve_column(plan, walk, value, level)
        return
    tries = dict.fromkeys(wanted, 0)
    left = set(wanted)
    while left:
        pool = _pool(plan, workers)
        lost: list[tuple[float, int]] = []
        try:
            for task, column in _round(pool, sorted(left), max(workers, mpi_size() - 1)):
                if column is None:
                    lost.append(task)
                    continue
                left.discard(task)
                yield column
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
        for task in lost:
            tries[task] += 1
            if tries[task] >= TRIES:
                left.discard(task)
                yield MapColumn.missing(plan, *task, f"{TRIES} workers died over this column.")
        if lost:
            warn(f"A worker was lost; {len(left)} columns are given to new ones.")


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
