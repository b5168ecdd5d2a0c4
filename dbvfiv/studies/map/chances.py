"""Probability of flutter over a map: columns of sampled valves, whose bands are drawn beside the neutral curves.

The cells of a column share the steady state of each sampled valve, and all valves a space of their leading motions (see
`dbvfiv.studies.stability.neighbours`), made along the whole column. A cell counts as undecided where the growth rates
of a valve are not clear of the errors of that space, and where the constants of its rubber do not hold.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from eigen.columns import ColumnSolver

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, SolveError
from ...record.record import GrowingRecord, Record
from ...texts import json_value
from ..case import Case
from ..inputs import Plan, counted, quasi_random
from ..stability.neighbours import CHECKS, NEAR_SEED, TAKEN, Beside, find_neighbours
from ..stability.place import is_surrounding
from ..stability.verdict import DIVERGES, FLUTTERS
from ..stability.walk import StabilityWalk
from ..workers import Work, Workers, share_all
from .column import MapPlan

#: Probabilities whose curves are drawn.
BANDS = (0.05, 0.5, 0.95)
_CHANCE = "probability"


def _inputs(plan: MapPlan) -> Plan:
    return Plan(plan.case, (plan.x.parameter, plan.y.parameter), "the map")


class Chances:
    """Samples of valves over the cells of columns."""

    def __init__(self, case: Case):
        self.plan = MapPlan(case)
        self.inputs = _inputs(self.plan)

    def check(self) -> None:
        """Refuse a map whose columns are not those of one steady state, or inputs that cannot be used. Raises
        CaseError.
        """
        name, case = self.plan.along.parameter, self.plan.case
        if not is_surrounding(case, name) or case.has_pump:
            raise CaseError(
                f"map.samples is given as {case.map.samples}, and each cell of a map over {self.plan.x.parameter} and "
                f"{self.plan.y.parameter}{' behind a pump' if case.has_pump else ''} has a steady state of its own; it "
                "needs an axis that leaves steady states alone, such as loss_factor or density, or 0.",
                key="map.samples",
            )
        self.inputs.scores_of(np.zeros((1, len(self.inputs.inputs))))

    def column(self, value: float) -> dict[str, Any]:
        """Numbers of samples that flutter and that are undecided in each cell of a column. Raises SolveError if the
        valve of the case has no steady state there, or the space could not be made.
        """
        plan, inputs, count = self.plan, self.inputs, self.plan.case.map.samples
        along, across, law, solver = plan.along, plan.across.parameter, plan.base.storage, ColumnSolver()

        def point(case: Case, row: np.ndarray, place: float) -> Mu:
            return inputs.point(case, row, **({"storage": law} | {across: value, along.parameter: place}))

        def at(row: np.ndarray) -> tuple[StabilityWalk, Mu]:
            walk = inputs.walk(row[:-1], solver)
            return walk, point(walk.case, row[:-1], row[-1])

        def rows(independent: np.ndarray, places: np.ndarray) -> np.ndarray:
            cells = [plan.value(along, coordinate) for coordinate in places]
            return np.column_stack([inputs.numbers(independent), cells])

        d = len(inputs.inputs)
        origin = rows(np.zeros((1, d)), np.array([0.5]))[0]
        scales = np.array([*(one.distribution.scale for one in inputs.inputs), np.ptp(along.values)])
        near = quasi_random(TAKEN + CHECKS, d, NEAR_SEED)
        taken = rows(near[:TAKEN], np.linspace(0.0, 1.0, TAKEN))
        checks = rows(near[TAKEN:], np.linspace(0.0, 1.0, CHECKS + 2)[1:-1])
        own = StabilityWalk(plan.case)
        start = own.equilibrium(plan.place(value, along.values[0], law))

        def far(scores: np.ndarray) -> np.ndarray:
            return rows(scores[:, :-1], np.clip(0.5 + scores[:, -1], 0.0, 1.0))

        shared = find_neighbours(at, origin, scales, start, taken, checks, far)
        beside, (flutters, undecided, diverges) = Beside(at, shared), np.zeros((3, len(along.values)), int)
        for row in rows(quasi_random(count, d, plan.case.uncertainty.seed), np.full(count, 0.5)):
            try:
                walk, place = at(row)
                walk.settle(place, shared.state(row))
                found = beside.verdicts(walk, [point(walk.case, row[:-1], cell) for cell in along.values], row)
            except (SolveError, CaseError, ValueError):
                undecided += 1
                continue
            flutters += [one is not None and one.outcome == FLUTTERS for one in found]
            undecided += [one is None or one.stable is None for one in found]
            diverges += [one is not None and one.outcome == DIVERGES for one in found]
        return {"flutters": flutters.tolist(), "undecided": undecided.tolist(), "diverges": diverges.tolist()}


def _column(chances: Chances, value: float) -> dict[str, Any]:
    try:
        return chances.column(value)
    except (SolveError, ArithmeticError, ValueError) as error:
        return {"failure": str(error)}


def _start(case: dict) -> Chances:
    return Chances(Case.from_dict(case))


def find_chances(case: Case, record: GrowingRecord, workers: int | str) -> None:
    """Keep the columns of a map of probability that an earlier run has not kept."""
    known = {note["value"]: note for note in record.notes(_CHANCE)}
    chances, wanted = Chances(case), [v for v in MapPlan(case).across.values if v not in known]
    row = PARAMETERS[chances.plan.across.parameter]

    def say(value: float, found: dict[str, Any]) -> None:
        if "failure" in found:
            record.warn(f"No probability at {row.amount(value, 4)}: {found['failure']}")

    for value, note in known.items():
        say(value, note)
    with Workers(workers, _start, (case.to_dict(),), record.warn, chances) as team:
        told = lambda value: f"The probability at {row.amount(value, 4)}"  # noqa: E731
        for value, found in share_all(team, wanted, lambda value: Work(_column, (value,)), told):
            record.note(_CHANCE, value=value, **found)
            record.progress(f"probability at {row.amount(value, 4)}")
            say(value, found)


def chance_grid(record: Record, plan: MapPlan) -> np.ndarray:
    """Probability of flutter with the ends of its 95 % interval, and share of the samples that do not return to the
    state without oscillating, (4, y, x); NaN where there is none.
    """
    count, cells = plan.case.map.samples, np.full((4, len(plan.across.values), len(plan.along.values)), np.nan)
    for note in record.notes(_CHANCE):
        if "failure" not in note:
            column = plan.across.values.index(note["value"])
            pairs = zip(note["flutters"], note["undecided"])
            cells[:3, column] = np.transpose([list(vars(counted(*pair, count)).values()) for pair in pairs])
            cells[3, column] = np.array(note.get("diverges", np.nan)) / count
    return cells if plan.transposed else cells.transpose(0, 2, 1)


def summary_of(record: Record, plan: MapPlan) -> dict[str, Any]:
    """Probability of flutter over the cells (y, x) for JSON, None where there is none, with what is uncertain."""
    tables = dict(zip(("value", "low", "high", "diverges"), json_value(chance_grid(record, plan))))
    inputs = [one.summary() for one in _inputs(plan).inputs]
    return {"probability": tables | {"samples": plan.case.map.samples, "inputs": inputs}}


def sentences(record: Record, plan: MapPlan) -> Iterator[str]:
    """Lines on the cells between the bands."""
    value, _, _, diverges = chance_grid(record, plan)
    known = value[np.isfinite(value)]
    most = diverges[diverges > 0].max(initial=0.0)
    counts = [int((known <= BANDS[0]).sum()), int(((known > BANDS[0]) & (known < BANDS[-1])).sum())]
    yield (
        f"Probability of flutter from {plan.case.map.samples} samples a column: up to {100 * BANDS[0]:g} % in "
        f"{counts[0]} cells, more than {100 * BANDS[-1]:g} % in {len(known) - sum(counts)}, between in {counts[1]}."
    )
    if most:
        yield f"Besides, up to {100 * most:.3g} % of the samples of a cell diverge without oscillating."
