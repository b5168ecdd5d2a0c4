"""Sweeps as lines of a table for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .sweep import Crossing, SweepResults

#: What each parameter is called and shown in, and the factor from SI to that.
SHOWN = {
    "pressure": ("Static inlet pressure", "kPa", 1e-3),
    "density": ("Fluid density", "kg/m³", 1.0),
    "alpha": ("Mass damping α", "1/s", 1.0),
    "beta": ("Stiffness damping β", "s", 1.0),
}
_SI = {"pressure": "Pa", "density": "kg/m^3", "alpha": "1/s", "beta": "s"}


def units_of(parameter: str) -> str:
    """SI unit of a parameter."""
    return _SI[parameter]


def head(parameter: str) -> tuple[str, str]:
    """Names and units above the table."""
    return (
        f"{parameter:>12} {'growth rate':>12} {'frequency':>11} {'unstable':>9}",
        f"{_SI[parameter]:>12} {'1/s':>12} {'Hz':>11}",
    )


def row_of(point: Any) -> str:
    """One line for a value just solved (`dbvfiv.studies.sweep.SweepPoint`): the leading mode and the number of unstable
    eigenvalues.
    """
    leading = point.eigenvalues[0] if len(point.eigenvalues) else complex(np.nan, np.nan)
    return _row(point.value, leading.real, abs(leading.imag) / (2 * np.pi), point.unstable_count)


def rows_of_sweep(result: SweepResults) -> list[str]:
    """One line for each value: the leading branch."""
    rows = []
    for i, value in enumerate(result.values):
        there = [b for b in result.branches if np.isfinite(b.growth_rate[i])]
        leading = max(there, key=lambda b: b.growth_rate[i], default=None)
        growth, frequency = (leading.growth_rate[i], leading.frequency[i]) if leading else (np.nan, np.nan)
        rows.append(_row(value, growth, frequency, result.unstable_count[i]))
    return rows


def crossing_line(result: SweepResults, crossing: Crossing) -> str:
    """One sentence on a crossing of zero growth."""
    _, unit, factor = SHOWN[result.parameter]
    becomes = "unstable" if crossing.to_unstable else "stable"
    how = f"at {crossing.frequency:.4g} Hz" if crossing.frequency > 0 else "without oscillation"
    return (
        f"Branch {crossing.branch} becomes {becomes} near {result.parameter} "
        f"{factor * crossing.value:.4g} {unit} {how} (interpolated)."
    )


def _row(value: float, growth: float, frequency: float, unstable: int) -> str:
    return f"{value:>12.6g} {growth:>12.4f} {frequency:>11.4f} {unstable:>9d}"
