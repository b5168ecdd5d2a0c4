"""Plan of a map, and one of its columns: all its cells, and where along it modes reach the imaginary axis."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigen.columns import MISSING

from ...case.axis import Axis, Level
from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, JumpError, SolveError
from ...model.symmetry import Symmetry, chosen_symmetries
from ...texts import shortly
from ..case import Case
from ..stability.line import ROUGH, ParameterLine
from ..stability.place import is_surrounding
from ..stability.samples import Sample, SampleKey
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk
from ..workers import Work, Workers, share_all

#: Relative accuracy of onsets along a column that the full matrices do not correct.
LOCATED = 1e-10


class ColumnTask(NamedTuple):
    """A column to solve."""

    value: float  #: Of the axis across.
    level: int  #: 0 for a column of the grid, more for one that is put between two of them.
    parts: tuple[int, ...]  #: Numbers of the parts of the plan in which it is needed.

    @property
    def key(self) -> tuple[float, int]:
        """Key that identifies the column among the others."""
        return self.value, self.level


@shortly
@dataclass(frozen=True)
class MapPlan:
    """Plan of the map of a case: its cells, and the order in which they are computed."""

    case: Case

    @cached_property
    def x(self) -> Axis:
        return self.case.map.axes[0]

    @cached_property
    def y(self) -> Axis:
        return self.case.map.axes[1]

    @cached_property
    def laws(self) -> tuple[float, ...]:
        """Blends of the continuity laws, one picture each."""
        both = self.case.map.continuity == "both" and "storage" not in (self.x.parameter, self.y.parameter)
        return (0.0, 1.0) if both else (self.base.storage,)

    @cached_property
    def classes(self) -> tuple[Symmetry, ...]:
        """Classes of motion, that of the equilibria first; of the others cells alone are asked for."""
        return chosen_symmetries(self.case.map.symmetry, self.case.part)

    @property
    def parts(self) -> list[tuple[float, Symmetry]]:
        """Continuity law and class of motion of each part: the equilibria's class under every law first, the others
        under that of the case, since the laws differ in no other class.
        """
        own, *others = self.classes
        return [*((law, own) for law in self.laws), *((self.base.storage, other) for other in others)]

    @cached_property
    def curves(self) -> list[tuple[int, Level]]:
        """Law and level of each family of curves: onsets under every law first, then the contours asked for."""
        levels = (Level(), *self.case.map.levels)
        return [(law, level) for level in levels for law in range(len(self.laws))]

    @property
    def transposed(self) -> bool:
        """True where columns run along x: its cells share a steady state, or, where those of neither axis do, a wall
        under pressures that rise.
        """
        along_x, along_y = (is_surrounding(self.case, axis.parameter) for axis in (self.x, self.y))
        return not along_y and (along_x or self.x.parameter == "pressure")

    @property
    def across(self) -> Axis:
        """Axis with one column for each of its values."""
        return self.y if self.transposed else self.x

    @property
    def along(self) -> Axis:
        """Axis of the cells of one column."""
        return self.x if self.transposed else self.y

    @cached_property
    def base(self) -> Mu:
        return Mu.of(self.case)

    def place(self, across: float, along: float, law: float) -> Mu:
        """Parameters of a cell."""
        named = {self.across.parameter: across, self.along.parameter: along}
        return self.base.at(**({"storage": law} | named))

    def told(self, x: float, y: float) -> str:
        """Values of both axes with their units, "pressure = 6 kPa, density = 10 kg/m³"."""
        return f"{PARAMETERS[self.x.parameter].named(x)}, {PARAMETERS[self.y.parameter].named(y)}"

    def line(self, walk: StabilityWalk, across: float, part: int, edges: bool) -> ParameterLine:
        """Line of the cells of a column in a part."""
        (law, motion), along = self.parts[part], self.along
        base = self.place(across, along.values[0], law)
        key = SampleKey(law, motion.name, 0, across)
        asked = along.parameter, along.values, along.log
        return ParameterLine(walk.in_class(motion), base, *asked, edges=edges, counts="brackets", key=key)

    def coordinate(self, axis: Axis, value: float) -> float:
        """0..1 along an axis, in the logarithm if its values are spaced so."""
        a, b = axis.values[0], axis.values[-1]
        return math.log(value / a) / math.log(b / a) if axis.log else (value - a) / (b - a)

    def value(self, axis: Axis, coordinate: float) -> float:
        """Inverse of `coordinate`."""
        a, b = axis.values[0], axis.values[-1]
        return a * (b / a) ** coordinate if axis.log else a + (b - a) * coordinate


@shortly
@dataclass(frozen=True)
class MapColumn:
    """A finished column."""

    value: float  #: Of the axis across.
    level: int  #: 0 for a column of the grid, more for one that was put between two of them.
    samples: dict[int, Sequence[Sample]]  #: Cells by the number of their part, where it was asked for.
    #: (k, 5); number of the family of curves, see `MapPlan.curves`, value along the column, frequency in Hz, +1 where a
    #: mode becomes unstable along the column, -1 where it ceases to be, and the growth rate beyond its level over the
    #: size of the eigenvalue that the full matrices leave there, NaN where it was not corrected by them.
    onsets: np.ndarray
    error: float = np.nan  #: Largest estimated relative error of a leading eigenvalue.
    failure: str = ""  #: Why there is no column; empty if there is one.
    seconds: float = 0.0  #: Processor time.

    @classmethod
    def gap(cls, task: ColumnTask, sentence: str, seconds: float = 0.0) -> MapColumn:
        """A column without a state."""
        return cls(task.value, task.level, {}, np.zeros((0, 5)), failure=sentence, seconds=seconds)

    def has(self, part: int) -> bool:
        """True where the column was solved in a part, given by its number."""
        return any(sample.how != MISSING for sample in self.samples.get(part, ()))

    def numbers(self, part: int, name: str) -> np.ndarray:
        """A quantity of the cells of a part, see `Sample.number`."""
        return np.array([sample.number(name) for sample in self.samples[part]])

    @property
    def band(self) -> float:
        """Frequency, Hz, up to which verdicts hold; infinite for all."""
        return min((sample.band for row in self.samples.values() for sample in row), default=math.inf)

    @property
    def refusal(self) -> str:
        """Why the constants of the rubber do not hold in some or all of the cells; empty where they do."""
        return next((sample.refusal for row in self.samples.values() for sample in row if sample.refusal), "")

    def verdict(self, part: int, cell: int) -> Verdict:
        """Verdict on a cell."""
        return Verdict.undecided(self.failure) if self.failure else self.samples[part][cell].verdict


def grid_of(plan: MapPlan, columns: Iterable[MapColumn], name: str, parts: Iterable[int]) -> np.ndarray:
    """A quantity of finished columns on the grid of a plan, (parts, y values, x values); see `Sample.number`."""
    blank = [Sample(value) for value in plan.along.values]
    found = {column.value: column.samples for column in columns if column.level == 0}
    rows = [[found.get(value, {}).get(part, blank) for value in plan.across.values] for part in parts]
    table = np.array([[[sample.number(name) for sample in cells] for cells in row] for row in rows])
    return table if plan.transposed else table.transpose(0, 2, 1)


def solve_column(plan: MapPlan, walk: StabilityWalk, task: ColumnTask) -> MapColumn:
    """A column; a steady state that is not found leaves a gap with the reason, of the cells that share it.

    On the grid every cell gets a certificate; in columns between, put in for the onset curves, those that onsets lie
    between. Where both axes change the steady state, states are found anew, whatever columns came before.
    """
    started = time.process_time()
    walk = walk if is_surrounding(plan.case, plan.along.parameter) else walk.apart()
    samples: dict[int, Sequence[Sample]] = {}
    onsets, worst = [], 0.0
    try:
        for part in task.parts:
            line = plan.line(walk, task.value, part, task.level > 0)
            samples[part], worst = line.cells(), max(worst, line.error)
            for number, (law, level) in enumerate(plan.curves):
                if part == law and (line.stays or plan.case.map.curve):
                    onsets += [(number, *row) for row in _crossings(line, level)]
    except (SolveError, CaseError) as error:
        return MapColumn.gap(task, str(error), time.process_time() - started)
    table, seconds = np.array(onsets, float).reshape(-1, 5), time.process_time() - started
    return MapColumn(task.value, task.level, samples, table, worst, seconds=seconds)


def _crossings(line: ParameterLine, level: Level) -> list[tuple[float, float, float, float]]:
    """Value, frequency, direction, and the excess that is left over the size of the eigenvalue, where modes become
    unstable or cease to be, or where the leading one crosses another level.
    """
    found, scan = [], line.scan if level == Level() else line.contour(level)
    for crossing in scan.run(line.values):
        if level != Level() and crossing.index:
            continue
        direction = 1.0 if crossing.gains else -1.0
        try:
            onset = line.locate(crossing, ROUGH if line.is_reduced else LOCATED, level, scan)
        except JumpError:  # of the state, or of a list whose leading mode enters or leaves the band
            continue
        except SolveError:  # the state is not found
            if line.stays:
                raise
            continue
        found.append((onset.value, onset.frequency, direction, onset.residual))
    return found


def shared_place(plan: MapPlan, value: float) -> Mu | None:
    """Parameter point whose steady state all cells of a column share; None if cells have states of their own."""
    if not is_surrounding(plan.case, plan.along.parameter):
        return None
    return plan.place(value, plan.along.values[0], plan.laws[0])


class ColumnPool(Workers):
    """Workers that solve columns.

    Parameters
    ----------
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
        """Columns as they are finished, in any order."""
        if self.is_here:
            for task in wanted:
                yield self._recalled(task) or solve_column(self.plan, self.walk, task)
            return
        named = PARAMETERS[self.plan.across.parameter].named
        for _, column in share_all(
            self, sorted(wanted), self._asked, lambda task: f"The column at {named(task.value)}"
        ):
            yield column

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
