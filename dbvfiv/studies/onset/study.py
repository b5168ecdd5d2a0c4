"""How onsets along one parameter are found and kept."""

from __future__ import annotations

from ...observer import Observers
from ...record.record import GrowingRecord
from ..session import Session
from ..stability.walk import StabilityWalk
from ..study import Study
from .result import OnsetResult
from .rows import KeepItems, known_items, tables_of
from .run import run_onset


def run(session: Session, record: GrowingRecord) -> None:
    """Onsets along `onset.over` of the case; every sample and point is kept as it is found."""
    found = run_onset(
        session.case,
        observer=Observers(KeepItems(record), record),
        known=known_items(record, session.case),
        walk=StabilityWalk(session.case, record, session.model),
    )
    for sentence in found.failures:
        record.fail(sentence)
    if found.interrupted:
        raise KeyboardInterrupt


STUDY = Study("onset", tables_of, run, OnsetResult)
