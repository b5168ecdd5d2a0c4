"""How equilibria over a list of pressures are found: each from the one before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...case.model import Case
from ...errors import SolveError
from ...model.equilibria import LoadPath, SteadyOptions, model_warnings, state_warnings
from ...model.state import SteadyState
from ...record.record import GrowingRecord
from ...record.states import SUMMARY, read_states, state_row
from ...record.table import printed_head, printed_row
from ..session import Session
from ..study import Study
from .result import STATES, SteadyResult, tables_of


def run_steady(session: Session, record: GrowingRecord) -> None:
    """Equilibria at `steady.pressures` of the case.

    A pressure that is not reached is a failure, and the list goes on from the last equilibrium.
    """
    model, pressures = session.model, session.case.steady.pressures
    path = LoadPath(model, SteadyOptions.of(session.case), observer=record)
    states = read_states(record, STATES)
    known = {state.pressure for state in states}
    if states:
        last = len(states) - 1
        path.q, path.pressure = states[last].q, states[last].pressure
        slope = record.value(STATES, "path/slope", last)
        path.slope = slope if np.isfinite(slope).all() else None
        path.step = float(record.value(STATES, "path/step", last))
    record.begin("steady", len(pressures))
    for sentence in model_warnings(model):
        record.warn(sentence)
    try:
        for pressure in pressures:
            if pressure in known:
                continue
            try:
                state = path.go_to(pressure)
            except SolveError as error:
                record.fail(str(error))
                continue
            record.append(STATES, state_row(model, state) | _way_on(path))
            states.append(state)
            record.item(state)
    finally:
        for sentence in state_warnings(model, states):
            record.warn(sentence)


def _way_on(path: LoadPath) -> dict[str, Any]:
    slope = np.full(path.model.size, np.nan) if path.slope is None else path.slope
    return {"path/slope": slope, "path/step": path.step}


def print_live(_case: Case) -> Callable[[SteadyState], str]:
    """Lines of the table as states are found."""
    head = [*printed_head(SUMMARY)]

    def write(state: SteadyState) -> str:
        lines = [*head, printed_row(SUMMARY, state)]
        head.clear()
        return "\n".join(lines)

    return write


STUDY = Study("steady", tables_of, run_steady, SteadyResult, live=print_live)
