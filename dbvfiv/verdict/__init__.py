"""What a time series does in the end: steady, decaying, limit cycle, growing, closed or irregular. Knows nothing of
valves.
"""

from .judge import judge
from .options import JudgeOptions
from .series import Series, in_steps, spectrum
from .verdict import NAMES, Verdict

__all__ = ["NAMES", "JudgeOptions", "Series", "Verdict", "in_steps", "judge", "spectrum"]
