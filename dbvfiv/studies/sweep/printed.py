"""Sweeps as lines of a table for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...case.parameters import PARAMETERS
from .run import SweepPoint

if TYPE_CHECKING:
    from .result import Crossing, SweepResult


def head(parameter: str) -> tuple[str, str]:
    """Names and units above the table."""
    return (
        f"{parameter:>12} {'growth rate':>12} {'frequency':>11} {'unstable':>9}",
        f"{PARAMETERS[parameter].quantity.si:>12} {'1/s':>12} {'Hz':>11}",
    )


def point_row(point: SweepPoint) -> str:
    """One line for a value just solved: the leading mode and the number of unstable
    eigenvalues.
    """
    leading = point.eigenvalues[0] if len(point.eigenvalues) else complex(np.nan, np.nan)
    return _row(point.value, leading.real, abs(leading.imag) / (2 * np.pi), point.unstable_count)


def rows_of_sweep(result: SweepResult) -> list[str]:
    """One line for each value: the leading branch."""
    rows = []
    for i, value in enumerate(result.values):
        there = [b for b in result.branches if np.isfinite(b.growth_rate[i])]
        leading = max(there, key=lambda b: b.growth_rate[i], default=None)
        growth, frequency = (leading.growth_rate[i], leading.frequency[i]) if leading else (np.nan, np.nan)
        outcome = result.verdicts[i].outcome if result.verdicts else ""
        rows.append(f"{_row(value, growth, frequency, result.unstable_count[i])}  {outcome}".rstrip())
    return rows


def crossing_line(result: SweepResult, crossing: Crossing) -> str:
    """One sentence on a crossing of zero growth."""
    shown = PARAMETERS[result.parameter]
    becomes = "unstable" if crossing.to_unstable else "stable"
    how = f"at {crossing.frequency:.4g} Hz" if crossing.frequency > 0 else "without oscillation"
    place = f"{crossing.value / shown.scale:.4g} {shown.shown_unit}".rstrip()
    under = f" under {result.case.continuity}" if result.case.continuity else ""
    return f"Branch {crossing.branch} becomes {becomes} near {result.parameter} {place} {how}{under} (interpolated)."


def _row(value: float, growth: float, frequency: float, unstable: int) -> str:
    return f"{value:>12.6g} {growth:>12.4f} {frequency:>11.4f} {unstable:>9d}"
