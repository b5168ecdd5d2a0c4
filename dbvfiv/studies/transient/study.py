"""Run of the transient study: computes a time history and keeps it in a record."""

from __future__ import annotations

from ...record.record import GrowingRecord
from ..session import Session
from ..study import Study
from .keeping import rows_to_keep
from .result import TransientResult
from .run import Runner
from .tables import RESTART, tables_of


def run(session: Session, record: GrowingRecord) -> None:
    """The history that the section transient of the case asks for, from where the record ends."""
    runner = Runner(session.model, record=record, case=session.case)
    found = runner.resume() if record.rows(RESTART) else runner.start()
    if found.interrupted:
        raise KeyboardInterrupt


STUDY = Study("transient", tables_of, run, TransientResult, rows_to_keep=rows_to_keep)
