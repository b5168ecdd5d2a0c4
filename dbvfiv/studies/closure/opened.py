"""The flow before it is turned back slowly: steady states as the inlet pressure falls to nothing."""

from __future__ import annotations

import numpy as np

from ...errors import SolveError
from ...model import ValveModel
from ...model.equilibria import LoadPath, SteadyOptions
from ...record.record import GrowingRecord
from ...record.states import read_states, state_row
from ..case import Case
from ..load_path import go_on, way_on
from .columns import OPENED

#: States of the flow that is turned back, from the open pressure down to a fiftieth of it.
OPEN_STATES = 10


def turn_back(case: Case, record: GrowingRecord) -> None:
    """Steady states of the open valve as the inlet pressure falls; at zero pressure it is at rest, where the back
    pressure begins.

    A pressure that is not reached is a failure; the back pressures do not depend on it.
    """
    if record.notes("turned back"):
        for sentence in record.notes("turned back")[-1]["failures"]:
            record.fail(sentence)
        return
    model = ValveModel(case.replace({"drive.kind": "flow", "drive.side": "inside", "downstream.pressure": 0.0}))
    path = LoadPath(model, SteadyOptions.of(model.case), observer=record)
    states, failures = read_states(record, OPENED), []
    if states:
        go_on(path, record, OPENED, len(states) - 1, states[-1])
    known = {state.pressure for state in states}
    for pressure in np.geomspace(case.closure.open_pressure, case.closure.open_pressure / 50, OPEN_STATES).tolist():
        if pressure in known:
            continue
        record.progress(f"steady state at {pressure:.6g} Pa")
        try:
            record.append(OPENED, state_row(model, path.go_to(pressure)) | way_on(path))
        except SolveError as error:
            failures.append(str(error))
            record.fail(str(error))
    record.note("turned back", failures=failures)
