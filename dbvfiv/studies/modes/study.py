"""How leading modes of a steady state are found and kept."""

from __future__ import annotations

from ...model.state import SteadyState
from ...record.record import GrowingRecord
from ...record.states import state_row
from ..session import Session
from ..stability.laws import STORAGE, other_law, require_two_laws
from ..study import Study
from .certificate import CURVE, Certificate
from .mode import rows_of
from .other_law import NOTE, note_of
from .result import COUNT, MODES, STATE, ModesResult, tables_of
from .run import ModesOptions, run_modes


def run(session: Session, record: GrowingRecord) -> None:
    """Leading modes of the steady state at drive.pressure, under both continuity laws where that is asked for."""
    case = session.case
    both = case.modes.continuity == "both"
    if both:
        require_two_laws(case, "modes", "modes.in_vacuo leaves the fluid out" if case.modes.in_vacuo else "")
    wanted = [not record.notes("certificate"), both and not record.notes(NOTE)]
    if not any(wanted):
        return
    state = session.equilibrium(record)
    if wanted[0]:
        _keep(session, record, state)
    if wanted[1]:
        law = other_law(case)
        found = run_modes(
            session.model, state, options=ModesOptions.of(case), observer=record, storage=float(law == STORAGE)
        )
        record.note(NOTE, **note_of(found, law))


def _keep(session: Session, record: GrowingRecord, state: SteadyState) -> None:
    """Modes under the case's own law."""
    model = session.model
    found = run_modes(model, state, options=ModesOptions.of(session.case), observer=record)
    if not record.rows(STATE):
        record.append(STATE, state_row(model, state))
    for row in rows_of(found)[record.rows(MODES) :]:
        record.append(MODES, row)
    said = {note["text"] for note in record.notes("remark")}
    for sentence in found.notes:
        if sentence not in said:
            record.note("remark", text=sentence)
    certificate = Certificate.of(found)
    if not record.rows(COUNT):
        record.extend(COUNT, {column.name: getattr(certificate, column.name) for column in CURVE})
    record.note("certificate", **certificate.note())


STUDY = Study("modes", tables_of, run, ModesResult)
