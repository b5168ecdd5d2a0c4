"""One mode as results hold it: eigenvalue, shape, and what the flow does."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model.symmetry import EQUILIBRIA, symmetry_named
from ...record.table import Column
from ..state import State
from .run import FoundModes

#: One row for each mode in a result file.
MODE = (
    Column("growth_rate", "1/s", "Real part of the eigenvalue"),
    Column("angular_frequency", "rad/s", "Imaginary part of the eigenvalue, not negative"),
    Column("residual", "", "Relative residual of the full pencil"),
    Column("backward_error", "", "The same against matrix norms"),
    Column(
        "shape",
        "1, rad/m",
        "Displacements and rotations of the nodes, the largest displacement being 1 and real",
        "c16",
    ),
    Column(
        "area",
        "m",
        "Change of the flow area of the computed part at each row, m2 for 1 m of largest displacement",
        "c16",
    ),
    Column("pressure", "Pa/m", "Change of the pressure at each row for 1 m of largest displacement", "c16"),
    Column("inlet_velocity", "1/s", "Change of the inlet velocity for 1 m of largest displacement", "c16"),
)
#: Largest displacement at which shapes are drawn, as a fraction of the valve's length, and as one of the opening that
#: must not close.
_DRAWN, _OPEN = 0.035, 0.85


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode; a conjugate pair is one mode, with frequency >= 0.

    Motion: Re(shape exp(eigenvalue t)), of undetermined amplitude.

    Attributes
    ----------
    number : int
        From 1, by falling growth rate.
    growth_rate : float, 1/s
    angular_frequency : float, rad/s
    residual, backward_error : float
        See `eigen.Spectrum`.
    shape : (nn, c) complex
        Displacements and rotations of the nodes, c = 5; the largest displacement is 1 and
        real.
    area : (m,) complex, m2 per m
    pressure : (m,) complex, Pa per m
        NaN in vacuo.
    inlet_velocity : complex, m/s per m
    symmetry : str
        Class of motion, see `dbvfiv.model.symmetry`.
    """

    number: int
    growth_rate: float
    angular_frequency: float
    residual: float
    backward_error: float
    shape: np.ndarray = field(repr=False)
    area: np.ndarray = field(repr=False)
    pressure: np.ndarray = field(repr=False)
    inlet_velocity: complex = field(repr=False)
    symmetry: str = EQUILIBRIA

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.number}: growth {self.growth_rate:+.5g} 1/s at {self.frequency:.5g} Hz>"

    @property
    def eigenvalue(self) -> complex:
        """1/s."""
        return complex(self.growth_rate, self.angular_frequency)

    @property
    def frequency(self) -> float:
        """Hz."""
        return self.angular_frequency / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """-growth rate over |eigenvalue|; 1 or -1 where nothing oscillates."""
        size = abs(self.eigenvalue)
        return -self.growth_rate / size if size > 0 else 0.0

    @property
    def amplitude(self) -> np.ndarray:
        """(nn,) largest displacement of each node over a cycle, 1 at most."""
        u = self.shape[:, :3]
        square, turning = np.sum(np.abs(u) ** 2, axis=1), np.sum(u**2, axis=1)
        return np.sqrt(0.5 * (square + np.abs(turning)))

    def at_phase(self, phase: float) -> np.ndarray:
        """(nn, c) displacements and rotations at a phase of the cycle, rad; growth or decay left out."""
        return (self.shape * np.exp(1j * phase)).real

    def drawn_amplitude(self, state: State) -> float:
        """Largest displacement, m, at which the mode shows well and the centre line of the duckbill stays open."""
        mesh = state.results.mesh
        largest = _DRAWN * float(np.ptp(mesh.z))
        if not symmetry_named(self.symmetry).moves_lips_apart:
            return largest
        line = mesh.centre_line
        height = mesh.nodes[line, 1] + state.nodal[line, 1]
        swing = np.abs(self.shape[line, 1])
        moving = swing > 1e-3
        room = float(np.min(_OPEN * height[moving] / swing[moving])) if moving.any() else np.inf
        return min(largest, room) if room > 0.05 * largest else 0.2 * largest

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return {
            "growth_rate": self.growth_rate,
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "residual": self.residual,
            "symmetry": self.symmetry,
        }


def rows_of(result: FoundModes) -> list[dict[str, Any]]:
    """Columns of the modes of a run."""
    spectrum = result.spectrum
    stations = result.areas.shape[1:]
    rows = []
    for i, value in enumerate(spectrum.eigenvalues):
        pressure = result.pressures[i] if result.pressures.shape[1:] == stations else np.full(stations, np.nan, complex)
        rows.append(
            {
                "growth_rate": float(value.real),
                "angular_frequency": float(value.imag),
                "residual": float(spectrum.residual[i]),
                "backward_error": float(spectrum.backward_error[i]),
                "shape": result.shapes[i],
                "area": result.areas[i],
                "pressure": pressure,
                "inlet_velocity": complex(result.inlet_velocities[i]),
            }
        )
    return rows
