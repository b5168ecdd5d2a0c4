"""First states from result files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import CaseError
from ...motion.equations import ValveMotion
from ...motion.state import MotionState, consistent_state
from ...record.files import kind_of
from ...record.record import Record, StoredRecord
from ...record.states import state_table
from ..case import Case
from .tables import STATES, tables_of


def stored_state(motion: ValveMotion, case: Case, inlet: float) -> MotionState:
    """State `transient.start_state` of `transient.start_file`, a steady or a transient result on the same mesh.

    A wall that relaxes starts without stress in its branches: states do not hold what it remembered.

    Parameters
    ----------
    motion : ValveMotion
    case : Case
    inlet : float
        Inlet pressure of the first instant, Pa.

    Raises
    ------
    CaseError
        If the file cannot be read, has no such state, or belongs to another mesh.
    """
    path, index, model = Path(case.transient.start_file), case.transient.start_state, motion.model
    record, moving = _read(path)
    count = record.rows(STATES)
    if not count:
        raise CaseError(f"{str(path)!r} holds no states to start from.")
    if not -count <= index < count:
        raise CaseError(f"{str(path)!r} holds {count} states, so there is no state {index}.")
    if record.mesh.nodes.shape != model.mesh.nodes.shape:
        raise CaseError(
            f"The states of {str(path)!r} belong to a mesh of {len(record.mesh.nodes)} nodes and this case's has "
            f"{len(model.mesh.nodes)}."
        )
    q = model.shell.dofs.restrict(record.value(STATES, "nodal", index))
    if not moving:
        speed = float(record.value(STATES, "station_velocity", index)[-1])
        return consistent_state(motion, 0.0, q, np.zeros(model.size), speed, inlet)
    v = model.shell.dofs.restrict(record.value(STATES, "nodal_rate", index))
    return consistent_state(motion, 0.0, q, v, float(record.value(STATES, "inlet_velocity", index)), inlet)


def _read(path: Path) -> tuple[Record, bool]:
    """The record of a file, and whether its states move."""
    kind = kind_of(path)
    if kind == "transient":
        return StoredRecord(path, tables_of, Case), True
    if kind == "steady":
        return StoredRecord(path, lambda mesh: (state_table(STATES, mesh),), Case), False
    raise CaseError(
        f"{str(path)!r} holds a result of kind {kind!r}; a run starts from a state of a steady or a transient result."
    )
