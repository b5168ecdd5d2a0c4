"""Verdicts on sampled valves, each with its own steady states next to those of the valve of the case."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from eigen import ColumnSolver

from ...case.parameters import Mu
from ...errors import CaseError, SolveError
from ..inputs import Plan
from ..stability.neighbours import At, Beside, Neighbours
from ..stability.verdict import OUTCOMES, Verdict
from ..stability.walk import StabilityWalk


class Found(NamedTuple):
    """One sampled valve at one value of the range.

    Attributes
    ----------
    sample : int
    value : float
        Of the range, SI; the inlet pressure where there is none.
    outcome : int
        Number of the outcome of its verdict in `OUTCOMES`.
    growth_rate, frequency, damping_ratio : float, 1/s, Hz
        Of the leading oscillating mode, and the least ratio; NaN where nothing is known.
    opening, flow : float, m2, m3/s
        Area between the lips and volume flow, NaN without a steady state.
    apart : bool
        Found with its full matrices although samples share a space.
    why : str
        Of a sample that is undecided or not valid.
    """

    sample: int
    value: float
    outcome: int
    growth_rate: float
    frequency: float
    damping_ratio: float
    opening: float
    flow: float
    apart: bool = False
    why: str = ""

    @classmethod
    def of(cls, sample: int, value: float, verdict: Verdict, state: Any = None, apart: bool = False) -> Found:
        """Row of a verdict and its steady state."""
        read = (np.nan, np.nan) if state is None else (state.outlet_area, state.volume_flow)
        numbers = verdict.growth_rate, verdict.frequency, verdict.damping_ratio
        why = "" if verdict.stable is not None else verdict.reason
        return cls(sample, value, OUTCOMES.index(verdict.outcome), *numbers, *read, apart, why)


class Start(NamedTuple):
    """Steady state of the case at a value of the range.

    Attributes
    ----------
    q : (n,) array
        Displacements.
    lift : float, Pa
        Behind a pump, its pressure beyond that of the pump's table, which samples share.
    """

    q: np.ndarray
    lift: float


class Sampler:
    """Steady states of the case, and verdicts on samples that start from them.

    Parameters
    ----------
    plan : Plan
    states : sequence of Start or None
        Of the case at the values of the range; None where it has no steady state.
    neighbours : mapping, optional
        What samples have in common, by the numbers of the values; without it each is found with its full matrices.
    walk : StabilityWalk, optional
        Of the case.
    """

    def __init__(
        self,
        plan: Plan,
        states: Sequence[Start | None],
        neighbours: Mapping[int, Neighbours] = {},
        walk: StabilityWalk | None = None,
    ):
        self.plan, self.states, self._walk = plan, states, walk or StabilityWalk(plan.case)
        self._solver, self._neighbours = ColumnSolver(), neighbours
        self._found: dict[int, Beside] = {}

    def found(self, first: int, numbers: np.ndarray) -> list[Found]:
        """Rows of samples, whose values (m, d) are given; the first has the number `first`."""
        if self.plan.is_surrounding:
            return [row for i in range(len(self.plan.values)) for row in self._side_by_side(i, first, numbers)]
        return [found for k, row in enumerate(numbers) for found in self._one(first + k, row)]

    def _side_by_side(self, number: int, first: int, rows: np.ndarray) -> Iterator[Found]:
        """Samples that share the steady state of the case."""
        value, walk = self.plan.values[number], self._walk
        places = [self.plan.place(self.plan.case, row, value) for row in rows]
        try:
            if (start := self.states[number]) is None:
                raise SolveError("The valve of the case has no steady state there.")
            met = walk.meet_pump(places[0], start.lift, start.q).pressure
            places = [place.at(pressure=met) for place in places]
            walk.settle(places[0], start.q)
            state, column = walk.state(places[0]), walk.column(places, snapshots=min(len(places), 7))
            verdicts = [walk.sample(*pair, value).verdict for pair in zip(places, column.cells)]
        except (SolveError, CaseError) as error:
            state, verdicts = None, [Verdict.undecided(str(error))] * len(places)
        for k, verdict in enumerate(verdicts):
            yield Found.of(first + k, value, verdict, state)

    def _one(self, sample: int, row: np.ndarray) -> Iterator[Found]:
        walk = None
        for i, value in enumerate(self.plan.values):
            state, near = None, self._neighbours.get(i)
            apart = near is not None
            try:
                walk = walk or self.plan.walk(row, self._solver)
                lift, q = (0.0, None) if self.states[i] is None else (self.states[i].lift, self.states[i].q)
                q = q if near is None else near.state(row)
                place = walk.meet_pump(self.plan.place(walk.case, row, value), lift, q)
                walk.settle(place, q)
                state = walk.state(place)
                verdict = self._beside(i).verdicts(walk, [place], row)[0] if near else None
                apart = apart and verdict is None
                verdict = verdict or walk.verdict(place)
            except (SolveError, CaseError, ValueError) as error:
                verdict = Verdict.undecided(str(error))
            yield Found.of(sample, value, verdict, state, apart)

    def walks(self, i: int) -> At:
        """Function from values of the inputs to the walk of a sample and its parameter point at a value of the range,
        where the case has a steady state.
        """
        plan, start, solver = self.plan, self.states[i], ColumnSolver()

        def at(row: np.ndarray) -> tuple[StabilityWalk, Mu]:
            walk = plan.walk(row, solver)
            return walk, walk.meet_pump(plan.place(walk.case, row, plan.values[i]), start.lift, start.q)

        return at

    def _beside(self, i: int) -> Beside:
        if i not in self._found:
            self._found[i] = Beside(self.walks(i), self._neighbours[i])
        return self._found[i]
