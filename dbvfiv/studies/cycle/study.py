"""How a branch of cycles is followed and kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import CycleBranchOptions, CyclePoint, SpecialCycle

from ...case.parameters import PARAMETERS
from ...errors import CaseError
from ...record.record import GrowingRecord
from ...record.table import printed_head, printed_row
from ..case import Case
from ..session import Session
from ..stability.place import check_scan
from ..stability.walk import StabilityWalk
from ..study import Study
from .orbit import Orbit
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
from .start import cycle_solver, find_onset, first_cycles, periodic_system

#: Displacement of the lip, m, that a step of one along the branch stands for.
UNIT = 10e-3
#: First step along a branch.
STEP = 0.1
#: The lips just touch at their middle.
TOUCHING = "lips touch"


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
    record.begin("cycle", None)
    walk = StabilityWalk(case, record, session.model)
    system = periodic_system(case, walk)
    onset = find_onset(case, walk, record)
    frequency = onset.eigenvalue.imag / (2 * np.pi)
    if not record.notes("onset"):
        record.note("onset", value=onset.value, frequency=frequency)
    solver = cycle_solver(system, onset)
    name = PARAMETERS[axis.parameter].system_name or axis.parameter
    lip = int(session.model.shell.dofs.index[session.model.mesh.rows[0, 0], 1])
    branch = _Branch(record, system, name, axis.parameter)
    known = read_points(record, onset.place.mu(), name)
    if len(known) < 2:
        record.progress(f"first cycles, beside {axis.parameter} = {onset.value:.6g}")
        first = first_cycles(solver, onset, name, lip, case, walk.equilibrium(onset.place))
        tracer = branch.tracer(solver, case, first[0].motion, lip)
        tracer.start(*first, tell=branch.keep)
    else:
        tracer = branch.tracer(solver, case, known[0].motion, lip)
        tracer.restore(known)
    reason = tracer.run(branch.keep)
    record.note(ENDED, reason=reason)
    if "no further cycle" in reason:
        record.fail(f"The branch ends at {axis.parameter} = {tracer.points[-1].value:.6g}: {reason.rstrip('.')}.")


class _Branch:
    """Keeps the cycles of a branch in a record as they are found."""

    def __init__(self, record: GrowingRecord, system, name: str, parameter: str):
        self.record, self.system, self.name, self.parameter = record, system, name, parameter

    def tracer(self, solver, case: Case, first, lip: int) -> CycleTracer:
        """A tracer of the branch that begins with a motion `first`."""
        asked, axis = case.cycle, case.cycle.axis
        swing = np.sqrt(2.0) * np.linalg.norm(first.coefficients[1:3, lip])
        whole = np.linalg.norm(first.coefficients[1:] / self.system.scales)
        width = axis.values[-1] - axis.values[0]
        options = CycleBranchOptions(
            step=min(STEP, asked.max_step),
            min_step=min(1e-4, asked.max_step),
            max_step=asked.max_step,
            scale=0.5 * width,
            motion_scale=UNIT * whole / swing,
            limits=(axis.values[0], axis.values[-1]),
            values=axis.values,
            max_points=asked.max_points,
            exponents=asked.exponents,
            tail=asked.tolerance,
            max_harmonics=asked.max_harmonics,
        )
        return CycleTracer(solver, self.name, options, {TOUCHING: lambda cycle: self.orbit(cycle).lip_extremes[0]})

    def orbit(self, cycle) -> Orbit:
        """What is looked at of a cycle."""
        return Orbit(self.system.model(cycle.mu), cycle.mu, cycle.motion)

    def keep(self, item: CyclePoint | SpecialCycle) -> None:
        """Keep a cycle, or a special point."""
        record = self.record
        if isinstance(item, SpecialCycle):
            orbit = self.orbit(item.point.cycle)
            record.note(SPECIAL, **special_note(item, self.parameter, orbit))
            record.progress(f"{item.kind} at {self.parameter} = {item.value:.6g}")
            return
        orbit = self.orbit(item.cycle)
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
