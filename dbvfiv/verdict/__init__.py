"""Verdict on a time series: steady, decaying, limit cycle, growing, closed, chatters or irregular; of a measured
record also its lines, with intervals.

The package is independent of valves.
"""

from .judge import NAMES, RECORDED, JudgeOptions, Verdict, judge
from .motion import judge_record
from .series import Series, Shuttings, in_steps, spectrum

__all__ = [
    "NAMES",
    "RECORDED",
    "JudgeOptions",
    "Series",
    "Shuttings",
    "Verdict",
    "in_steps",
    "judge",
    "judge_record",
    "spectrum",
]
