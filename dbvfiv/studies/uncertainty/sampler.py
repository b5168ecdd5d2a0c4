"""Verdicts on sampled valves, each with its own steady states next to those of the valve of the case."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from eigen import ColumnSolver

from ...errors import CaseError, SolveError
from ...observer import Observer
from ..inputs import Plan
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
    why: str = ""

    @classmethod
    def of(cls, sample: int, value: float, verdict: Verdict, state: Any = None) -> Found:
        """Row of a verdict and its steady state."""
        read = (np.nan, np.nan) if state is None else (state.outlet_area, state.volume_flow)
        numbers = verdict.growth_rate, verdict.frequency, verdict.damping_ratio
        why = "" if verdict.stable is not None else verdict.reason
        return cls(sample, value, OUTCOMES.index(verdict.outcome), *numbers, *read, why)


class Sampler:
    """Steady states of the case, and verdicts on samples that start from them.

    Parameters
    ----------
    plan : Plan
    states : sequence of (n,) array or None
        Displacements of the case at the values of the range; None where it has no steady state.
    walk : StabilityWalk, optional
        Of the case.
    """

    def __init__(self, plan: Plan, states: Sequence[np.ndarray | None], walk: StabilityWalk | None = None):
        self.plan, self.states, self._walk = plan, states, walk or StabilityWalk(plan.case)
        self._solver = ColumnSolver()

    def found(self, first: int, numbers: np.ndarray) -> list[Found]:
        """Rows of samples, whose values (m, d) are given; the first has the number `first`."""
        if self.plan.is_surrounding:
            return [row for i in range(len(self.plan.values)) for row in self._side_by_side(i, first, numbers)]
        return [found for k, row in enumerate(numbers) for found in self._one(first + k, row)]

    def _side_by_side(self, number: int, first: int, rows: np.ndarray) -> Iterator[Found]:
        """Samples that share the steady state of the case."""
        value, walk = self.plan.values[number], self._walk
        places = [self.plan.place(self.plan.case, value, row) for row in rows]
        try:
            if self.states[number] is None:
                raise SolveError("The valve of the case has no steady state there.")
            walk.settle(places[0], self.states[number])
            state, column = walk.state(places[0]), walk.column(places, snapshots=min(len(places), 7))
            verdicts = [walk.sample(place, column, i, value).verdict for i, place in enumerate(places)]
        except (SolveError, CaseError) as error:
            state, verdicts = None, [Verdict.undecided(str(error))] * len(places)
        for k, verdict in enumerate(verdicts):
            yield Found.of(first + k, value, verdict, state)

    def _one(self, sample: int, row: np.ndarray) -> Iterator[Found]:
        try:
            case = self.plan.redescribed(row)
            walk = StabilityWalk(case, Observer(), solver=self._solver)
        except (SolveError, CaseError) as error:
            walk, failure = None, str(error)
        for value, start in zip(self.plan.values, self.states):
            state, verdict = None, None
            try:
                if walk is None:
                    raise SolveError(failure)
                place = self.plan.place(case, value, row)
                walk.settle(place, start)
                state = walk.state(place)
                verdict = walk.verdict(place)
            except (SolveError, CaseError, ValueError) as error:
                verdict = Verdict.undecided(str(error))
            yield Found.of(sample, value, verdict, state)
