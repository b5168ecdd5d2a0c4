"""Verdict on a time series: steady, decaying, limit cycle, growing, closed or irregular.

The package is independent of valves.
"""

from .judge import NAMES, JudgeOptions, Verdict, judge
from .series import Series, in_steps, spectrum

__all__ = ["NAMES", "JudgeOptions", "Series", "Verdict", "in_steps", "judge", "spectrum"]
