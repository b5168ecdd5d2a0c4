"""Run of the sweep study: follows modes along a parameter and keeps them in a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from ...model.state import SteadyState
from ...record.record import GrowingRecord
from ...record.states import SUMMARY
from ..case import Case
from ..session import Session
from ..stability.place import is_surrounding, require_parameter
from ..study import Study
from .result import BRANCHES, CHECKS, POINTS, STATES, SweepResult, head, point_row, tables_of
from .run import FoundBranches, SweepOptions, SweepPoint, run_sweep


def run(session: Session, record: GrowingRecord) -> None:
    """Modes along `sweep.over` of the case; what is done is kept every few seconds."""
    axis = session.case.sweep.axis
    require_parameter(session.case, axis.parameter)
    stays = is_surrounding(session.case, axis.parameter)
    state = session.equilibrium(record) if stays else None
    found = run_sweep(
        session.model,
        axis,
        options=SweepOptions.of(session.case),
        state=state,
        observer=record,
        keep=lambda part: record.note("kept", **_tables(part)),
    )
    tables, places = _tables(found), {}
    record.note("kept", **tables)  # read while the rows are written
    for table, rows in tables.items():
        first = record.rows(table)  # those before are of an attempt that was ended
        if rows:
            record.extend(table, {name: [row[name] for row in rows] for name in rows[0]})
        places[table] = [first, first + len(rows)]
    verdicts = [verdict.summary() for verdict in found.verdicts]
    record.note("over", certified=found.certified, remarks=list(found.notes), rows=places, verdicts=verdicts)
    for sentence in found.failures:
        record.note("failure", text=sentence)
    if found.interrupted:
        raise KeyboardInterrupt


def _tables(found: FoundBranches) -> dict[str, list[dict[str, Any]]]:
    """Rows of the tables of a sweep."""
    branches, rows = found.branches, []
    for i, number in enumerate(branches.ids):
        for k, value in enumerate(found.values):
            eigenvalue = branches.eigenvalues[i, k]
            there = np.isfinite(eigenvalue.real)
            rows.append(
                {
                    "id": int(number),
                    "value": float(value),
                    "growth_rate": float(eigenvalue.real),
                    "angular_frequency": float(eigenvalue.imag) if there else float("nan"),
                    "confidence": float(branches.confidence[i, k]),
                }
            )
    counts = zip(found.values.tolist(), found.unstable_count.tolist())
    return {
        POINTS: [{"value": value, "unstable_count": count} for value, count in counts],
        BRANCHES: rows,
        CHECKS: [{f.name: getattr(check, f.name) for f in fields(check)} for check in found.checks],
        STATES: [{c.name: getattr(state, c.name) for c in SUMMARY} for state in found.states],
    }


def print_live(case: Case) -> Callable[[Any], str]:
    """Lines of the table as values are solved."""
    top = list(head(case.sweep.axis.parameter))

    def write(item: SweepPoint | SteadyState) -> str:
        if isinstance(item, SteadyState):
            return f"Steady state at {item.pressure:.6g} Pa."
        lines = [*top, point_row(item)]
        top.clear()
        return "\n".join(lines)

    return write


STUDY = Study("sweep", tables_of, run, SweepResult, resumable=False, live=print_live)
