"""Run of the closure study: states under back pressure, then the time history of the drive's reversal."""

from __future__ import annotations

from ...case.measured import AREA, SHAPE
from ...errors import SolveError
from ...record.record import GrowingRecord
from ..case import Case
from ..measured.kept import keep_measured
from ..session import Session
from ..study import Study, print_rows
from .columns import COMPARED, REVERSAL, SUMMARY, tables_of, void_rows
from .result import ClosureResult
from .reversal import closing_valve, run_closing, turn_back
from .valve import CONTACT, HELD_LIPS, closure_model
from .walk import ClosureWalk


def run(session: Session, record: GrowingRecord, in_time: bool = False, compare: bool = False) -> None:
    """Equilibria at `closure.pressures` of the case; with `in_time` the turn of its drive, with `compare` the same
    equilibria with the other supports.
    """
    if record.notes("asked"):
        asked = record.notes("asked")[0]
        in_time, compare = asked["in_time"], asked["compare"]
    else:
        record.note("asked", in_time=in_time, compare=compare)
    case, pressures = session.case, session.case.closure.pressures
    keep_measured(record, "closure.measured", case.closure.measured, (AREA, SHAPE), case.fluid.density)
    record.begin("closure", len(pressures) * (2 if compare else 1))
    if case.gravity.is_there:
        record.warn("Gravity has no part in back pressure: wall and fluid weigh nothing in these states.")
    if compare:
        record.item(f"Supports: {case.closure.supports}")
    if case.closure.start == "open":
        turn_back(case, record)
    ClosureWalk(closure_model(case), record).go(pressures)
    if in_time:
        _turn_in_time(case, record)
    if compare:
        other = other_supports(case)
        record.item(f"Supports: {other}")
        ClosureWalk(closure_model(case, other), record, COMPARED).go(pressures)


def other_supports(case: Case) -> str:
    """Kind of supports to compare with."""
    return HELD_LIPS if case.closure.supports == CONTACT else CONTACT


def _turn_in_time(case: Case, record: GrowingRecord) -> None:
    """Follow the turn of the drive; one that was cut short begins anew."""
    if not record.notes("turned"):
        void_rows(record, REVERSAL, 0)
        model = closing_valve(case)
        record.note("turning", shut_below=model.shut_below)
        halvings, failure = 0, ""
        try:
            halvings, failure = run_closing(model, lambda sample: record.append(REVERSAL, sample), record)
        except SolveError as error:
            failure = str(error)
        record.note("turned", halvings=halvings, failure=failure)
    failure = record.notes("turned")[-1]["failure"]
    if failure:
        record.fail(f"The turn of the drive in time was not followed to its end: {failure}")


STUDY = Study("closure", tables_of, run, ClosureResult, live=lambda case: print_rows(case.units.columns(SUMMARY)))
