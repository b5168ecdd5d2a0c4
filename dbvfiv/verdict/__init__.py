"""Verdict on a time series: steady, decaying, limit cycle, growing, closed or irregular.

The package is independent of valves.
"""

from .judge import judge
from .options import JudgeOptions
from .series import Series, in_steps, spectrum
from .verdict import NAMES, Verdict

__all__ = ["NAMES", "JudgeOptions", "Series", "Verdict", "in_steps", "judge", "spectrum"]
