"""Columns of a map shared among workers, each with the steady state that its cells share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from ...errors import SolveError
from ..case import Case
from ..stability.walk import StabilityWalk
from ..workers import Lost, Work, Workers
from .column import ColumnTask, MapColumn, MapPlan, shared_place, solve_column


class ColumnPool(Workers):
    """Workers that solve columns.

    Parameters
    ----------
    plan : MapPlan
    workers : int or str
        1 solves everything here, one after another; see `Workers`.
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
        workers: int | str,
        warn: Callable[[str], None],
        walk: StabilityWalk,
        known: Iterable[MapColumn] = (),
    ):
        super().__init__(workers, _start, (plan.case.to_dict(),), warn)
        self.plan, self.walk = plan, walk
        self.known = {(column.value, column.level): column for column in known}

    def columns(self, wanted: Iterable[ColumnTask]) -> Iterator[MapColumn]:
        """Columns as they are finished, in any order.

        Parameters
        ----------
        wanted : iterable of ColumnTask
        """
        if self.is_here:
            for task in wanted:
                yield self._recalled(task) or solve_column(self.plan, self.walk, task)
            return
        for task, column in self.share(sorted(wanted), self._asked):
            yield MapColumn.gap(task, Lost.sentence) if column is Lost else column

    def _asked(self, task: ColumnTask) -> MapColumn | Work:
        column = self._recalled(task)
        if column is not None:
            return column
        try:
            return Work(_solve, (task, self._state(task)))
        except SolveError as error:
            return MapColumn.gap(task, str(error))

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


def _start(case: dict) -> tuple[MapPlan, StabilityWalk]:
    read = Case.from_dict(case)
    return MapPlan(read), StabilityWalk(read)


def _solve(context: tuple[MapPlan, StabilityWalk], task: ColumnTask, state: np.ndarray | None) -> MapColumn:
    plan, walk = context
    if state is not None:
        walk.give(shared_place(plan, task.value), state)
    return solve_column(plan, walk, task)
