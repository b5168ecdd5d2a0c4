"""The verdict on a time series."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

NAMES = ("steady", "decaying", "limit cycle", "growing", "closed", "irregular", "undecided")


@dataclass(frozen=True)
class Verdict:
    """Final behaviour of a time series.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    decided : bool
        True where a longer series would not change the verdict.
    reason : str
        One sentence.
    mean : float
        Over whole cycles where there are cycles, over the end of the series otherwise.
    amplitude : float
        Half the distance between the extremes of the last cycles, or of the end of the series.
    period : float
        s; not a number without cycles.
    cycles : int
        Cycles that the verdict rests on.
    periodicity_error : float
        Root mean square of x(t + T) - x(t) over that of two unrelated signals of the same variance: 0 periodic, 1
        unrelated.
    periodicity_trend : float
        Factor of the periodicity error from one cycle to the next; below 1 while a cycle is being approached.
    amplitude_trend : float
        Relative change of the amplitude from one cycle to the next.
    harmonics : (k, 2) array
        Amplitude and phase, rad, of the first multiples of the frequency: sum a_k cos(2 pi k t / T + phase), t from the
        start of the series.
    rms : float
        Root mean square about the mean, of the same part of the series.
    smallest, largest : float
        Extremes of the whole series.
    noise : float
        Root mean square of white noise about a constant level, where the end of the series is such noise; not a number
        otherwise.
    judged : tuple of float, s
        Beginning and end of the part that the verdict is about: the whole series, or its longest part between gaps.
    notes : tuple of str
        Sentences on the samples: gaps, uneven steps.
    """

    name: str
    decided: bool
    reason: str
    mean: float = np.nan
    amplitude: float = np.nan
    period: float = np.nan
    cycles: int = 0
    periodicity_error: float = np.nan
    periodicity_trend: float = np.nan
    amplitude_trend: float = np.nan
    harmonics: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    rms: float = np.nan
    smallest: float = np.nan
    largest: float = np.nan
    noise: float = np.nan
    judged: tuple[float, float] = (np.nan, np.nan)
    notes: tuple[str, ...] = ()

    @property
    def frequency(self) -> float:
        """Hz; not a number without cycles."""
        return 1.0 / self.period if self.period > 0 else np.nan

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; what is not a number is None."""
        numbers = {
            "mean": self.mean,
            "amplitude": self.amplitude,
            "frequency": self.frequency,
            "period": self.period,
            "periodicity_error": self.periodicity_error,
            "periodicity_trend": self.periodicity_trend,
            "amplitude_trend": self.amplitude_trend,
            "rms": self.rms,
            "smallest": self.smallest,
            "largest": self.largest,
            "noise": self.noise,
        }
        return {
            "verdict": self.name,
            "decided": bool(self.decided),
            "reason": self.reason,
            **{name: float(value) if np.isfinite(value) else None for name, value in numbers.items()},
            "cycles_observed": self.cycles,
            "judged": [float(t) if np.isfinite(t) else None for t in self.judged],
            "notes": list(self.notes),
            "harmonics": [{"amplitude": float(a), "phase": float(p)} for a, p in self.harmonics],
        }
