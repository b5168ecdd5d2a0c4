"""Restart point of a run: all that is needed to continue with the same numbers."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...flow.gas_stepping import GasState
from ...flow.line_stepping import LineState
from ...motion.state import MotionState
from ...record.record import Record
from ...shell import Memory, WallMemory
from .tables import BOOKS, COUNTS, MEMORY_COLUMNS, MOTION_COLUMNS, RESTART

#: Books that not every file has.
_LATER = ("contact_loss", "numerical_loss")


def memory_row(memory: Memory) -> dict[str, Any]:
    """Row of the internal variables of the wall that do not follow from its positions."""
    values = (memory.branches, memory.stretch, memory.work, memory.loss, memory.stored)
    return {column.name: value for column, value in zip(MEMORY_COLUMNS, values, strict=True)}


@dataclass
class Progress:
    """Restart point of a run.

    Attributes
    ----------
    state : MotionState
    steps : int
    saved : int
        Full states kept so far.
    work, dissipation, energy, renewed, contact_loss, numerical_loss : float
        Energy budget, J of the computed part.
    control : tuple of float
        State of the step control.
    eigenvalue : complex
        Eigenvalue, 1/s, of the mode of a kick; not a number without one.
    """

    state: MotionState
    steps: int = 0
    saved: int = 0
    work: float = 0.0
    dissipation: float = 0.0
    energy: float = 0.0
    renewed: float = 0.0
    control: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    eigenvalue: complex = complex(np.nan, np.nan)
    contact_loss: float = 0.0
    numerical_loss: float = 0.0

    @property
    def rows(self) -> int:
        """Rows of the history up to here: one for the start and one for each step."""
        return self.steps + 1

    def row(self) -> dict[str, Any]:
        """A row of the table of restart points."""
        values = {c.name: getattr(self, c.name) for c in (*COUNTS, *BOOKS)}
        values["eigenvalue"] = [self.eigenvalue.real, self.eigenvalue.imag]
        apart = ("memory", "line", "gas")
        values |= {f.name: getattr(self.state, f.name) for f in fields(MotionState) if f.name not in apart}
        values |= {name: part.packed for name in apart[1:] if (part := getattr(self.state, name)) is not None}
        values |= {name: getattr(self, name) for name in _LATER}
        return values if self.state.memory is None else values | memory_row(self.state.memory)

    @classmethod
    def read(cls, record: Record, index: int = -1, wall: WallMemory | None = None) -> Progress:
        """Undo `row` for a restart point of a record, the last one by default; without its memory where no wall is
        given to hold it.
        """
        at = range(record.rows(RESTART))[index]
        values = {c.name: record.value(RESTART, c.name, at) for c in (*COUNTS, *BOOKS, *MOTION_COLUMNS)}
        motion = {c.name: values[c.name] for c in MOTION_COLUMNS}
        state = MotionState(**{name: float(v) if np.ndim(v) == 0 else np.array(v, float) for name, v in motion.items()})
        if wall is not None:
            kept = [record.value(RESTART, c.name, at) for c in MEMORY_COLUMNS]
            state = replace(state, memory=wall.at(state.q, *kept))
        for name, kind in (("line", LineState), ("gas", GasState)):
            if _has(record, name):
                state = replace(state, **{name: kind.unpacked(record.value(RESTART, name, at))})
        return cls(
            state,
            int(values["steps"]),
            int(values["saved"]),
            *(float(values[name]) for name in ("work", "dissipation", "energy", "renewed")),
            tuple(float(value) for value in values["control"]),
            complex(*values["eigenvalue"]),
            *(float(record.value(RESTART, name, at)) if _has(record, name) else 0.0 for name in _LATER),
        )


def _has(record: Record, name: str) -> bool:
    """True where restart points of a record have a column."""
    return any(c.name == name for c in record.tables[RESTART].columns)
