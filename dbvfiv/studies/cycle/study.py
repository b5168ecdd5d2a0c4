"""Run of the cycle study: follows a branch of cycles and keeps it in a record."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import CyclePoint, SpecialCycle

from ...case.parameters import Mu
from ...errors import CaseError, SolveError
from ...motion.periodic import check_periodic
from ...record.record import GrowingRecord
from ..case import Case
from ..orbits import MODES, Follower
from ..session import Session
from ..stability.place import check_scan
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk
from ..study import Study, print_rows
from .result import (
    COLUMNS,
    CYCLES,
    ENDED,
    SERIES,
    SPECIAL,
    VERDICT,
    CycleResult,
    cycle_row,
    read_points,
    series_rows,
    special_note,
    tables_of,
)
from .start import find_onset, given_motion

#: Distance of the second cycle from one of a file, over the range.
AWAY = 0.02


def run(session: Session, record: GrowingRecord) -> None:
    """Cycles along `cycle.over` of the case; every one is kept as it is found."""
    case, axis = session.case, session.case.cycle.axis
    check_scan(case, axis.parameter)
    if axis.parameter == "density" and case.has_pump:
        raise CaseError("Over the density a pump has no steady state to keep; give drive.pressure.", key="cycle.over")
    check_periodic(session.model)
    record.begin("cycle", None)
    walk = StabilityWalk(case, record, session.model)
    if case.cycle.start == "file":
        _from_file(case, walk, record)
    else:
        _from_onset(case, walk, record)
    record.progress("verdict on the steady state")
    try:
        verdict = walk.verdict(Mu.of(case))
    except SolveError as error:
        verdict = Verdict.undecided(str(error))
    record.note(VERDICT, **verdict.summary())


def _from_onset(case: Case, walk: StabilityWalk, record: GrowingRecord) -> None:
    axis = case.cycle.axis
    onset = find_onset(case, walk, record)
    if not record.notes("onset"):
        record.note("onset", value=onset.value, frequency=onset.eigenvalue.imag / (2 * np.pi))
    follower = Follower(case, walk, onset.place, axis.parameter, onset.spectrum)
    keeper = _Keeper(record, follower)
    known = read_points(record, onset.place.for_system(), follower.name)
    if len(known) < 2:
        record.progress(f"first cycles, beside {axis.parameter} = {onset.value:.6g}")
        keeper.known = len(known)
        tracer, missed = follower.begin(onset, axis.values, keeper.keep)
        for sentence in missed:
            record.warn(sentence)
    else:
        tracer = follower.tracer(axis.values, known[0].motion)
        tracer.restore(known)
    keeper.follow(tracer)


def _from_file(case: Case, walk: StabilityWalk, record: GrowingRecord) -> None:
    """Down from the motion of the file, then up from there."""
    axis = case.cycle.axis
    given = given_motion(case, walk)
    record.progress(f"the cycle at {axis.parameter} = {given.value:.6g}")
    follower = Follower(case, walk, given.place, axis.parameter, walk.spectrum(given.place, MODES))
    ended = {note["leg"] for note in record.notes(ENDED)}
    low, high = axis.values[0], axis.values[-1]
    for leg, end in enumerate((low, high)):
        if leg in ended or given.value == end:
            continue
        keeper = _Keeper(record, follower, leg)
        known = read_points(record, given.place.for_system(), follower.name, leg)
        if not known:
            cycle = follower.near(given.motion, given.value)
            tracer = follower.tracer(axis.values, cycle.motion)
            tracer.begin(cycle, given.value in axis.values, keeper.keep)
        else:
            tracer = follower.tracer(axis.values, known[0].motion)
            tracer.restore(known)
        if len(tracer.points) < 2:
            step = np.clip(end - given.value, -AWAY * (high - low), AWAY * (high - low))
            try:
                second = follower.near(tracer.points[0].motion, float(given.value + step))
            except SolveError as error:
                keeper.end(tracer, f"no further cycle was found: {error}")
                continue
            tracer.extend(second, False, keeper.keep)
        keeper.follow(tracer)


class _Keeper:
    """Keeps the cycles of a branch in a record as they are found."""

    def __init__(self, record: GrowingRecord, follower: Follower, leg: int = 0):
        self.record, self.follower, self.leg = record, follower, leg
        #: Of the cycles to come, how many the record holds already.
        self.known = 0

    def follow(self, tracer: CycleTracer) -> None:
        """Follow a leg to its end."""
        self.end(tracer, tracer.run(self.keep))

    def end(self, tracer: CycleTracer, reason: str) -> None:
        """Note why a leg ended."""
        self.record.note(ENDED, reason=reason, leg=self.leg)
        if "no further cycle" in reason:
            at = f"{self.follower.parameter} = {tracer.points[-1].value:.6g}"
            self.record.fail(f"The branch ends at {at}: {reason.rstrip('.')}.")

    def keep(self, item: CyclePoint | SpecialCycle) -> None:
        """Keep a cycle, or a special point."""
        record, follower = self.record, self.follower
        if isinstance(item, SpecialCycle):
            orbit = follower.orbit(item.point.cycle)
            record.note(SPECIAL, **special_note(item, follower.parameter, orbit))
            record.progress(f"{item.kind} at {follower.parameter} = {item.value:.6g}")
            return
        if self.known:
            self.known -= 1
            return
        orbit = follower.orbit(item.cycle)
        row = cycle_row(item, orbit, self.leg)
        # the series first: the row vouches for it
        record.extend(SERIES, series_rows(record.rows(CYCLES), item.motion, orbit.model.size))
        record.append(CYCLES, row)
        if row["least_speed"] < 0:
            record.warn(
                "Fluid is drawn in during some cycles. Their flow has the law of outward flow, so they are not to be "
                "relied on; runs in time have a law for either way."
            )
        record.item(SimpleNamespace(**row))


STUDY = Study("cycle", tables_of, run, CycleResult, live=lambda case: print_rows(COLUMNS))
