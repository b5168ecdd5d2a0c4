"""How a branch of cycles is followed and kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from continuation.cycle_points import CyclePoint, SpecialCycle

from ...errors import CaseError
from ...motion.periodic import check_periodic
from ...record.record import GrowingRecord
from ...record.table import printed_head, printed_row
from ..case import Case
from ..orbits.follower import Follower
from ..session import Session
from ..stability.place import check_scan
from ..stability.walk import StabilityWalk
from ..study import Study
from .result import CycleResult
from .rows import (
    COLUMNS,
    CYCLES,
    ENDED,
    SERIES,
    SPECIAL,
    cycle_row,
    read_points,
    series_rows,
    special_note,
    tables_of,
)
from .start import find_onset


@dataclass(frozen=True)
class Row:
    """A row of the table of cycles as it is printed."""

    numbers: dict

    def __getattr__(self, name):
        return self.numbers[name]


def run(session: Session, record: GrowingRecord) -> None:
    """Cycles along `cycle.over` of the case; every one is kept as it is found."""
    case, axis = session.case, session.case.cycle.axis
    check_scan(case, axis.parameter)
    if axis.parameter == "density" and case.has_pump:
        raise CaseError("Over the density a pump has no steady state to keep; give drive.pressure.", key="cycle.over")
    check_periodic(session.model)
    record.begin("cycle", None)
    walk = StabilityWalk(case, record, session.model)
    onset = find_onset(case, walk, record)
    frequency = onset.eigenvalue.imag / (2 * np.pi)
    if not record.notes("onset"):
        record.note("onset", value=onset.value, frequency=frequency)
    follower = Follower(case, walk, onset.place, axis.parameter, onset.spectrum)
    keeper = _Keeper(record, follower)
    known = read_points(record, onset.place.mu(), follower.name)
    if len(known) < 2:
        record.progress(f"first cycles, beside {axis.parameter} = {onset.value:.6g}")
        first = follower.from_onset(onset)
        tracer = follower.tracer(axis.values, first[0].motion)
        tracer.start(*first, tell=keeper.keep)
    else:
        tracer = follower.tracer(axis.values, known[0].motion)
        tracer.restore(known)
    reason = tracer.run(keeper.keep)
    record.note(ENDED, reason=reason)
    if "no further cycle" in reason:
        record.fail(f"The branch ends at {axis.parameter} = {tracer.points[-1].value:.6g}: {reason.rstrip('.')}.")


class _Keeper:
    """Keeps the cycles of a branch in a record as they are found."""

    def __init__(self, record: GrowingRecord, follower: Follower):
        self.record, self.follower = record, follower

    def keep(self, item: CyclePoint | SpecialCycle) -> None:
        """Keep a cycle, or a special point."""
        record, follower = self.record, self.follower
        if isinstance(item, SpecialCycle):
            orbit = follower.orbit(item.point.cycle)
            record.note(SPECIAL, **special_note(item, follower.parameter, orbit))
            record.progress(f"{item.kind} at {follower.parameter} = {item.value:.6g}")
            return
        orbit = follower.orbit(item.cycle)
        row = cycle_row(item, orbit)
        # the series first: the row vouches for it
        record.extend(SERIES, series_rows(record.rows(CYCLES), item.motion, orbit.model.size))
        record.append(CYCLES, row)
        if row["least_speed"] < 0:
            record.warn(
                "Fluid is drawn in during some cycles. Their flow has the law of outward flow, so they are not to be "
                "relied on; runs in time have a law for either way."
            )
        record.item(Row(row))


def print_live(case: Case) -> Callable[[Row], str]:
    """Lines of the table as cycles are found."""
    head = [*printed_head(COLUMNS)]

    def write(row: Row) -> str:
        lines = [*head, printed_row(COLUMNS, row)]
        head.clear()
        return "\n".join(lines)

    return write


STUDY = Study("cycle", tables_of, run, CycleResult, live=print_live)
