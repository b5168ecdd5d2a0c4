"""Restart data of a load path over steady states, kept in the rows of its states."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model.load_steps import LoadSteps
from ..model.state import SteadyState
from ..record.mesh import MeshData
from ..record.record import Record
from ..record.table import Column

PATH_RESTART = (
    Column("path/slope", "m/Pa, rad/Pa", "Derivative of the free unknowns by the pressure"),
    Column("path/step", "Pa", "Load step that is tried next"),
)


def restart_shapes(mesh: MeshData) -> dict[str, tuple[int, ...]]:
    """Shapes of those columns that are not scalars."""
    return {"path/slope": (int(mesh.free.sum()),)}


def restart_row(path: LoadSteps) -> dict[str, Any]:
    """Restart columns of the state that a load path has just reached."""
    slope = np.full(path.model.size, np.nan) if path.slope is None else path.slope
    return {"path/slope": slope, "path/step": path.step}


def restore_path(path: LoadSteps, record: Record, table: str, row: int, state: SteadyState) -> None:
    """Restore a load path as it was at the state in a row of a table."""
    path.q, path.pressure = state.q, state.pressure
    slope = record.value(table, "path/slope", row)
    path.slope = slope if np.isfinite(slope).all() else None
    path.step = float(record.value(table, "path/step", row))
