"""Shuttings of a valve that opens and shuts: when, how regularly, and with what speed its lips meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

#: Level over that of a shut valve from which on it is open; between the two it is what it was.
_OPEN = 2.0
#: Shuttings that make chatter, and longest standstill at the end, in intervals, that is not the end of it.
_FEWEST, _STILL = 3, 3.0
#: Standard errors by which the mean interval may change between the two halves.
_EVEN = 4.0


@dataclass(frozen=True)
class Shuttings:
    """Shuttings in even or uneven samples.

    Attributes
    ----------
    shut, opened : (k,) int arrays
        Samples at which the valve was found shut, and those at which it had last been found open again before.
    intervals : (k - 1,) array, s
    goes_on : bool
        True where the series ends before a further one is overdue.
    """

    shut: np.ndarray
    opened: np.ndarray
    intervals: np.ndarray
    goes_on: bool

    @classmethod
    def of(cls, time: np.ndarray, values: np.ndarray, level: float) -> Shuttings:
        """Shuttings of a signal (k,) at times (k,): from twice a level or more to the level or less."""
        known = np.flatnonzero((values <= level) | (values > _OPEN * level))
        shut = values[known] <= level
        falls, rises = (np.flatnonzero(shut[1:] & ~shut[:-1]) + 1, np.flatnonzero(~shut[1:] & shut[:-1]) + 1)
        if len(falls) and (not len(rises) or rises[0] > falls[0]):
            rises = np.insert(rises, 0, 0)
        at = known[falls]
        intervals = np.diff(time[at])
        overdue = time[-1] - time[at[-1]] if len(at) else np.inf
        return cls(at, known[rises[: len(falls)]], intervals, bool(overdue <= _STILL * intervals.max(initial=0.0)))

    @property
    def chatters(self) -> bool:
        """True of several that go on."""
        return len(self.shut) >= _FEWEST and self.goes_on

    def kept(self, least: int) -> np.ndarray:
        """The later half of the intervals (k,), s, but not fewer than some number if there are as many."""
        return self.intervals[-max(least, len(self.intervals) // 2) :]

    def is_settled(self, least: int) -> bool:
        """True where enough intervals are known and the mean of the kept ones does not change beyond chance."""
        first, last = np.array_split(self.kept(least), 2)
        if len(first) + len(last) < least:
            return False
        error = np.sqrt(first.var() / len(first) + last.var() / len(last))
        return bool(abs(first.mean() - last.mean()) <= max(_EVEN * error, 0.02 * last.mean()))

    def evidence(self, time: np.ndarray, opening, velocity, flow) -> dict[str, Any]:
        """Numbers of the chatter, SI, for JSON, from opening, m, velocity of a lip, m/s, and mass flow, kg/s, (k,).

        The speed of a lip is the largest inwards between its widest opening and the shutting.
        """
        whole = slice(self.shut[0], self.shut[-1] + 1)
        widest, speed, shut = [], [], 0.0
        for begin, end, before in zip(self.opened[1:], self.shut[1:], self.shut[:-1]):
            top = begin + int(np.argmax(opening[begin : end + 1]))
            widest.append(float(opening[top]))
            speed.append(float(max(0.0, -np.min(velocity[top : end + 1]))))
            shut += float(time[begin] - time[before])
        length = float(time[self.shut[-1]] - time[self.shut[0]])
        trapezoids = 0.5 * (flow[whole][1:] + flow[whole][:-1]) @ np.diff(time[whole])
        return {
            "shuttings": len(self.shut),
            "rate": 1.0 / float(self.intervals.mean()),
            "interval_scatter": float(self.intervals.std() / self.intervals.mean()),
            "shut_share": shut / length,
            "opening": float(np.mean(widest)),
            "largest_opening": max(widest),
            "impact_speed": float(np.mean(speed)),
            "largest_impact_speed": max(speed),
            "mean_flow": float(trapezoids / length),
        }
