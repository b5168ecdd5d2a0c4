"""Run of the map study: finds a stability map and keeps it in a record."""

from __future__ import annotations

from ...observer import Observer, Observers
from ...record.record import GrowingRecord
from ..session import Session
from ..stability.dimensions import add_classes
from ..stability.walk import StabilityWalk
from ..study import Study
from .column import MapPlan
from .cycles import follow_cycles
from .result import MapResult
from .rows import KeepColumns, keep_checks, keep_curves, known_columns, rows_to_keep, tables_of
from .run import run_map

#: Cells alone, under one law: the laws differ in no class but that of the equilibria. Onsets of the other classes are
#: located along a line, by `onset`.
_PLAIN = {"map.curve": False, "map.refine": 0, "map.continuity": "case", "map.workers": 1}


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
    add_classes(
        record,
        case.map.symmetry,
        case.part,
        lambda symmetry: run_map(case.replace(_PLAIN), Observer(), walk=walk.in_class(symmetry)),
    )
    follow_cycles(case, record, plan, list(found.columns), walk)


STUDY = Study("map", tables_of, run, MapResult, rows_to_keep=rows_to_keep)
