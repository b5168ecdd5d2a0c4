"""Results of an OpenFOAM run: pressure and velocity in the cells, and the history of the inlet pressure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista

from ..errors import SolveError

#: Last share of the iterations over which the inlet pressure is watched.
WATCHED = 0.2


@dataclass(frozen=True)
class FlowFields:
    """Fields of the last iteration that was written.

    Attributes
    ----------
    pressure : (nc,) array, m2/s2
        Over the density.
    velocity : (nc, 3) array, m/s
    iterations : int
    history : (n, 2) array
        Iteration and pressure over density at the inlet.
    """

    pressure: np.ndarray
    velocity: np.ndarray
    iterations: int
    history: np.ndarray

    @property
    def unrest(self) -> float:
        """Span of the inlet pressure over the last fifth of the iterations, relative."""
        last = self.history[int((1.0 - WATCHED) * len(self.history)) :, 1]
        return float(np.ptp(last) / abs(last[-1])) if len(last) > 1 else np.inf


def read_fields(folder: str | Path, cells: int) -> FlowFields:
    """Read what a run left in a folder.

    Parameters
    ----------
    cells : int
        How many there are in the mesh.

    Raises
    ------
    SolveError
        If it left nothing, or fields of another mesh.
    """
    folder = Path(folder)
    times = sorted((int(p.name) for p in folder.iterdir() if p.name.isdigit() and int(p.name) > 0), reverse=True)
    if not times:
        raise SolveError(f"No flow was computed in {str(folder)!r} yet.")
    (folder / "case.foam").touch()
    reader = pyvista.POpenFOAMReader(str(folder / "case.foam"))
    reader.case_type = "reconstructed"
    reader.cell_to_point_creation = False
    reader.set_active_time_value(float(times[0]))
    data = reader.read()["internalMesh"].cell_data
    pressure, velocity = (np.array(data[name], float) for name in ("p", "U"))
    if len(pressure) != cells:
        raise SolveError(f"The flow in {str(folder)!r} has {len(pressure)} cells and the mesh of this state {cells}.")
    return FlowFields(pressure, velocity, times[0], _history(folder))


def _history(folder: Path) -> np.ndarray:
    """Inlet pressure over the iterations of all runs in the folder, later ones in place of earlier ones."""
    found: dict[int, float] = {}
    for path in sorted(folder.glob("postProcessing/inletPressure/*/*.dat"), key=lambda p: int(p.parent.name)):
        found |= {int(row[0]): row[1] for row in np.loadtxt(path, ndmin=2)}
    return np.array(sorted(found.items())).reshape(-1, 2)
