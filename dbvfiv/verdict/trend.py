"""Trend of a sequence of amplitudes: growth, decay, convergence, or beats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Trend:
    """Straight line through the logarithms of a sequence.

    Attributes
    ----------
    slope : float
        Relative change from one to the next.
    error : float
        Standard error of the slope, widened for residuals that hang together.
    change : float
        Over the whole sequence.
    scatter : float
        Root mean square about the line.
    smooth : bool
        Whether what is left about the line is smooth rather than scattered (von Neumann's ratio).
    """

    slope: float
    error: float
    change: float
    scatter: float
    smooth: bool

    @property
    def significant(self) -> bool:
        return abs(self.slope) > 4.0 * self.error


def trend_of(values: np.ndarray) -> Trend:
    """Trend of positive values (k,), k at least 3."""
    y = np.log(np.maximum(values, 1e-300))
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    scatter = float(np.sqrt(np.mean(left**2)))
    ratio = np.sum(np.diff(left) ** 2) / max(np.sum(left**2), 1e-300)
    freedom = max(len(y) - 2, 1)
    error = np.sqrt(np.sum(left**2) / freedom / (x @ x)) * np.sqrt(max(1.0, 2.0 / max(ratio, 0.1)))
    return Trend(slope, float(error), slope * (len(y) - 1), scatter, bool(len(y) >= 6 and ratio < 0.8))


def remaining(values: np.ndarray) -> float:
    """Relative change still to come if the sequence goes on as it does: geometric extrapolation of two halves; infinite
    if it does not settle.
    """
    half = len(values) // 2
    first, last = trend_of(values[: half + 1]), trend_of(values[-half - 1 :])
    if abs(last.change) < 1e-12:
        return 0.0
    ratio = last.change / first.change if first.change else np.inf
    if not abs(ratio) < 0.7:
        return np.inf
    return last.change * ratio / (1.0 - ratio)


def settled(values: np.ndarray, band: float) -> int:
    """Number of last values that stay within a relative band about the last three's mean."""
    level = values[-3:].mean()
    outside = np.flatnonzero(np.abs(values - level) > band * level)
    return len(values) - (int(outside[-1]) + 1 if len(outside) else 0)


def comes_and_goes(values: np.ndarray, band: float) -> bool:
    """True where the sequence turned back more than once by more than a relative band: beats, no approach."""
    level = values.max()
    turns, direction, reference = 0, 0, values[0]
    for value in values[1:]:
        if direction >= 0 and value < reference - band * level:
            turns, direction, reference = turns + (direction > 0), -1, value
        elif direction <= 0 and value > reference + band * level:
            turns, direction, reference = turns + (direction < 0), 1, value
        elif (direction > 0 and value > reference) or (direction < 0 and value < reference):
            reference = value
    return turns >= 2
