"""Run of the steady study: equilibria over a list of pressures, each from the one before."""

from __future__ import annotations

from contextlib import suppress

from ...errors import SolveError
from ...model.equilibria import LoadPath, SteadyOptions, model_warnings, state_warnings
from ...record.record import GrowingRecord
from ...record.states import read_states, shown_summary, state_row
from ..load_path import go_on, way_on
from ..measured.kept import keep_measured
from ..session import Session
from ..study import Study, print_rows
from .cracking import NOTE, find_cracking
from .measured import KINDS
from .result import STATES, SteadyResult, tables_of


def run_steady(session: Session, record: GrowingRecord) -> None:
    """Equilibria at `steady.pressures` of the case.

    A pressure that is not reached is a failure, and the list goes on from the last equilibrium.
    """
    model, pressures, case = session.model, session.case.steady.pressures, session.case
    path = LoadPath(model, SteadyOptions.of(session.case), observer=record)
    states = read_states(record, STATES)
    known = {state.pressure for state in states}
    if states:
        go_on(path, record, STATES, len(states) - 1, states[-1])
    keep_measured(record, "steady.measured", case.steady.measured, KINDS, case.fluid.density)
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
            record.append(STATES, state_row(model, state) | way_on(path))
            states.append(state)
            record.item(state)
    finally:
        for sentence in state_warnings(model, states):
            record.warn(sentence)
    if model.flow.has_fluid and states and not record.notes(NOTE):
        record.progress("cracking pressure")
        with suppress(SolveError):  # none is given then
            record.note(NOTE, **find_cracking(model, states, case.steady.cracking_area).summary())


STUDY = Study("steady", tables_of, run_steady, SteadyResult, live=lambda case: print_rows(shown_summary(case)))
