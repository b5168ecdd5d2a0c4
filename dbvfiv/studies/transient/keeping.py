"""Storage of a run in its record: the history in batches, full states, and restart points."""

from __future__ import annotations

from collections.abc import Mapping
from time import monotonic
from typing import Any

import numpy as np

from ...errors import CaseError
from ...model import ValveModel
from ...motion.control import RunOptions
from ...motion.state import MotionState
from ...record.record import GrowingRecord, Record
from ..case import Case
from .progress import Progress
from .tables import HISTORY, RESTART, STATES, row_bytes

#: Rows of the history are held back no longer than this, s, for whoever watches.
BATCH_SECONDS = 5.0
#: Share of what else a run has kept that its restart points may take.
RESTART_SHARE = 0.125
#: Beyond that share, one is kept when so much time, s, or this part of the whole, would be lost without it.
RESTART_SECONDS, RESTART_LOSS = 30.0, 0.02


class Keeper:
    """Keeps a run in a record, which holds the rows of an earlier part already where it goes on.

    The history can be read by the names of its columns at any time.

    Parameters
    ----------
    record : GrowingRecord
    model : ValveModel
    """

    def __init__(self, record: GrowingRecord, model: ValveModel):
        self.record, self.model = record, model
        self._sizes = {name: row_bytes(table) for name, table in record.tables.items()}
        self._kept = {name: record.rows(name) for name in record.tables}
        self._pending: dict[str, list[Any]] = {c.name: [] for c in record.tables[HISTORY].columns}
        self._begun = self._written = self._restarted = monotonic()

    @property
    def rows(self) -> int:
        """Rows of the history, those held back included."""
        return self._kept[HISTORY] + len(self._pending["time"])

    def __contains__(self, name: str) -> bool:
        """True where the history has a column of that name."""
        return name in self._pending

    def __getitem__(self, name: str) -> np.ndarray:
        """A column of the history."""
        self.flush()
        return self.record.column(HISTORY, name)

    def append(self, row: Mapping[str, Any]) -> None:
        """Take a row of the history; it is written with others within some seconds."""
        for name, values in self._pending.items():
            values.append(row[name])
        if monotonic() - self._written > BATCH_SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write what was held back."""
        rows, self._pending = self._pending, {name: [] for name in self._pending}
        self._written = monotonic()
        count = len(rows["time"])
        if count:
            self.record.extend(HISTORY, rows)
            self._kept[HISTORY] += count

    def state(self, state: MotionState, row: Mapping[str, Any]) -> None:
        """Keep a full state; `row` is that of the history."""
        model = self.model
        values = {
            "time": state.time,
            "nodal": model.nodal(state.q),
            "nodal_rate": model.nodal(state.v),
            "station_pressure": row["station_pressure"],
            "station_area": row["station_area"],
            "inlet_velocity": row["inlet_velocity"],
        }
        self.record.append(STATES, values)
        self._kept[STATES] += 1

    def restart(self, progress: Progress, needed: bool = False) -> None:
        """Keep a point to go on from, after all that came before it.

        They are large: unless one is needed, it is left out while those that there are take their share of the file
        and little would be lost without it.
        """
        self.flush()
        if needed or self._restart_pays():
            self.record.append(RESTART, progress.row())
            self._kept[RESTART] += 1
            self._restarted = monotonic()

    def _restart_pays(self) -> bool:
        others = sum(self._sizes[name] * self._kept[name] for name in (HISTORY, STATES))
        if self._sizes[RESTART] * self._kept[RESTART] <= RESTART_SHARE * others:  # the first is always there
            return True
        now = monotonic()
        return now - self._restarted > max(RESTART_SECONDS, RESTART_LOSS * (now - self._begun))


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows of each table that a run goes on from: those up to its last restart point; none without one.

    Parameters
    ----------
    known : Record
        What the earlier attempt kept.
    case : Case
        The case as it is to go on, perhaps with a later end.

    Raises
    ------
    CaseError
        If the run is over and the case does not ask for more.
    """
    whole = [
        index
        for index in range(known.rows(RESTART))
        if known.value(RESTART, "steps", index) < known.rows(HISTORY)
        and known.value(RESTART, "saved", index) <= known.rows(STATES)
    ]
    if not whole:
        return {HISTORY: 0, STATES: 0, RESTART: 0}
    last = Progress.read(known, whole[-1])
    if known.complete and not known.failures and not _goes_on(last.state.time, known.header.case, case):
        name, advice = f"The run in {str(known.path)!r}", "give a later one with --duration"
        if last.state.time < RunOptions.of(case).end:
            raise CaseError(f"{name} was ended by its verdict at {last.state.time:.6g} s; {advice} to go on.")
        raise CaseError(f"{name} has reached its end at {last.state.time:.6g} s; {advice}.")
    return {HISTORY: last.rows, STATES: last.saved, RESTART: whole[-1] + 1}


def _goes_on(time: float, before: Case, now: Case) -> bool:
    """True where the end of a finished run was moved to a later time."""
    return time < RunOptions.of(now).end and now.transient.duration > before.transient.duration
