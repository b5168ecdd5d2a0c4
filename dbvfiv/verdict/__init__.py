"""What a time series does in the end: steady, decaying, limit cycle, growing, closed or irregular. Knows nothing of
valves.
"""

from .judge import JudgeOptions, judge
from .series import Series, spectrum
from .verdict import NAMES, Verdict

__all__ = ["NAMES", "JudgeOptions", "Series", "Verdict", "judge", "spectrum"]
