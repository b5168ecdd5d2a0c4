"""Run of the steady study: equilibria over a list of pressures, each from the one before."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

import numpy as np
from scipy.optimize import brentq

from ...case.quantity import head_of
from ...errors import SolveError
from ...model import ValveModel
from ...model.equilibria import LoadPath, SteadyOptions, model_warnings, state_warnings
from ...model.state import SteadyState
from ...record.record import GrowingRecord
from ...record.states import read_states, restart_row, restore_path, shown_summary, state_row
from ..measured.kept import keep_measured
from ..session import Session
from ..study import Study, print_rows
from .result import CRACKING, KINDS, STATES, Cracking, SteadyResult, tables_of


def run_steady(session: Session, record: GrowingRecord) -> None:
    """Equilibria at `steady.pressures` of the case.

    A pressure that is not reached is a failure, and the list goes on from the last equilibrium.
    """
    model, pressures, case = session.model, session.case.steady.pressures, session.case
    path = LoadPath(model, SteadyOptions.of(session.case), observer=record)
    states = read_states(record, STATES)
    known = {state.pressure for state in states}
    if states:
        restore_path(path, record, STATES, len(states) - 1, states[-1])
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
            record.append(STATES, state_row(model, state) | restart_row(path))
            states.append(state)
            record.item(state)
    finally:
        for sentence in state_warnings(model, states):
            record.warn(sentence)
    if model.flow.has_fluid and states and not record.notes(CRACKING):
        record.progress("cracking pressure")
        with suppress(SolveError):  # none is given then
            record.note(CRACKING, **find_cracking(model, states, case.steady.cracking_area).summary())


#: Relative accuracy of the cracking pressure.
_ACCURACY = 1e-5


def find_cracking(model: ValveModel, states: Iterable[SteadyState], area_ratio: float) -> Cracking:
    """Cracking pressure between rest and the states found.

    Parameters
    ----------
    model : ValveModel
        With a flow.
    states : iterable of SteadyState
    area_ratio : float
        Passage at the lips over that at rest.

    Raises
    ------
    SolveError
        If a state on the way is not found.
    """
    rest = model.rows.areas(model.nodal(model.rest()))[0]
    wanted = np.log(area_ratio * rest)
    open_ = [state for state in states if np.log(max(state.station_area[0], rest)) >= wanted]
    if not open_:
        return Cracking(area_ratio, None, None)
    upper = min(open_, key=lambda state: state.pressure)
    path = LoadPath(model, SteadyOptions.of(model.case))
    back = model.flow.back

    def missing(drive: float) -> float:
        """Logarithm of the passage over the one wanted, at a pressure over that downstream."""
        if drive == 0.0 and model.weight is None:
            return -np.log(area_ratio)
        return float(np.log(max(path.go_to(back + drive).station_area[0], rest * 1e-6)) - wanted)

    if missing(0.0) >= 0.0:  # the weight alone has opened it
        return Cracking(area_ratio, 0.0, 0.0)
    drive = brentq(missing, 0.0, upper.pressure - back, xtol=1e-12, rtol=_ACCURACY)
    return Cracking(area_ratio, float(drive), head_of(float(drive), model.case.fluid.density))


STUDY = Study("steady", tables_of, run_steady, SteadyResult, live=lambda case: print_rows(shown_summary(case)))
