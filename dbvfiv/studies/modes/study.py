"""How leading modes of a steady state are found and kept."""

from __future__ import annotations

from ...record.record import GrowingRecord
from ...record.states import state_row
from ..session import Session
from ..study import Study
from .certificate import CURVE, Certificate
from .mode import rows_of
from .result import COUNT, MODES, STATE, ModesResult, tables_of
from .run import ModesOptions, run_modes


def run(session: Session, record: GrowingRecord) -> None:
    """Leading modes of the steady state at drive.pressure."""
    if record.notes("certificate"):
        return
    model = session.model
    state = session.equilibrium(record)
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
