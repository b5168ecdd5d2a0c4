"""Run of the sensitivity study: finds derivatives of an eigenvalue and keeps them in a record."""

from __future__ import annotations

from dataclasses import replace

from eigen import Mode, leading_modes

from ...case.parameters import Mu
from ...errors import CaseError, SolveError
from ...model.dynamics import linearise
from ...model.equilibria import require_equilibrium
from ...model.state import SteadyState
from ...record.record import GrowingRecord
from ...record.states import read_states, state_row
from ..session import Session
from ..stability.family import ValveFamily, name_state_in_failures
from ..stability.place import condition_of
from ..study import Study
from .derivatives import differentiate, parameters_of
from .result import MODE, STATE, VALUES, SensitivityResult, row_of, tables_of

#: Modes searched for beyond the one asked for, so that its rank is certain.
_MARGIN = 3


def run(session: Session, record: GrowingRecord) -> None:
    """Derivatives of the mode `sensitivity.mode` at drive.pressure by the parameters `sensitivity.of`."""
    model, asked = session.model, session.case.sensitivity
    known = parameters_of(model)
    names = asked.of or known
    for name in names:
        lacking = session.case.damping.lacks(name)
        if lacking:
            raise CaseError(f"sensitivity.of names {name!r}, but {lacking}.", key="sensitivity.of")
        if name not in known:
            raise CaseError(
                f"sensitivity.of names {name!r}, by which nothing of this valve can be differentiated; it can by "
                f"{', '.join(known)}."
            )
    if not record.rows(STATE):
        record.append(STATE, state_row(model, session.equilibrium(record)))
    (state,) = read_states(record, STATE)
    mu = Mu.of(session.case)
    mode = _find_mode(session, state, mu)
    record.note(MODE, number=asked.mode, eigenvalue=complex(mode.eigenvalue))
    record.begin("sensitivity", len(names))
    done = set(record.column(VALUES, "parameter"))
    for name in names:
        if name in done:
            continue
        record.progress(name)
        try:
            found = differentiate(model, state.q, state.pressure, mu, mode, name, asked.step)
        except SolveError as error:
            record.fail(str(error))
            continue
        record.append(VALUES, row_of(found))
        record.item(found)


def _find_mode(session: Session, state: SteadyState, mu: Mu) -> Mode:
    """The mode asked for, with its left vector."""
    model, number = session.model, session.case.sensitivity.mode
    require_equilibrium(model, state)
    if model.flow.has_fluid and state.pressure <= model.flow.back:
        raise CaseError(f"Coupled modes need an inlet pressure greater than {model.flow.back:g}.")
    linear = linearise(model, state.q, state.pressure)
    family = ValveFamily(linear, session.case.modes.max_frequency, session.case.modes.count)
    with name_state_in_failures(state.pressure):
        options = replace(family.search(condition_of(Mu.of(session.case))), left=True)
        found = leading_modes(linear.pencil(mu), number + _MARGIN, options)
    if len(found) < number:
        raise SolveError(f"The state at {state.pressure:.6g} Pa has {len(found)} leading modes, and no mode {number}.")
    return found.mode(number - 1)


STUDY = Study("sensitivity", tables_of, run, SensitivityResult)
