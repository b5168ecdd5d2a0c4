"""Run of the map study: finds a stability map and keeps it in a record."""

from __future__ import annotations

from ...observer import Observers
from ...record.record import GrowingRecord
from ..session import Session
from ..stability.walk import StabilityWalk
from ..study import Study
from .classes import look_at_classes
from .column import MapPlan
from .cycles import follow_cycles
from .result import MapResult
from .rows import KeepColumns, keep_checks, keep_curves, known_columns, rows_to_keep, tables_of
from .run import run_map


def run(session: Session, record: GrowingRecord, workers: int | None = None) -> None:
    """The map of `map` of the case; every column is kept as it is finished.

    Parameters
    ----------
    workers : int, optional
        Processes that share the columns; those of the case by default. Under ``mpiexec`` with mpi4py all its processes.
    """
    case, plan = session.case, MapPlan.of(session.case)
    walk = StabilityWalk(case, record, session.model)
    found = run_map(
        case,
        Observers(KeepColumns(record, plan), record),
        workers,
        known_columns(record, case).values(),
        walk,
    )
    if found.interrupted:
        raise KeyboardInterrupt
    keep_checks(record, found.checks)
    keep_curves(record, found.curves)
    look_at_classes(case, record, walk)
    follow_cycles(case, record, plan, list(found.columns), walk)


STUDY = Study("map", tables_of, run, MapResult, rows_to_keep=rows_to_keep)
