"""Sampling of a record: gaps in it, uneven steps."""

from __future__ import annotations

import numpy as np

#: In a record with even steps, but for gaps, a gap is longer than this many of them.
_EVEN = 3.5
#: In a record with uneven steps, a gap is longer than this many of its longer steps (95th percentile), as samples at
#: random times lie far apart now and then.
_UNEVEN = 4.0
#: Relative difference of steps that rounded times explain.
_ROUNDED = 0.05
_FEWEST = 8


def gaps_in(time: np.ndarray) -> np.ndarray:
    """Samples (g,) after which a record with times (k,) has a gap."""
    steps = np.diff(time)
    if len(steps) < _FEWEST:
        return np.zeros(0, int)
    typical = np.median(steps)
    even = np.mean(np.abs(steps - typical) <= _ROUNDED * typical) > 0.8
    return np.flatnonzero(steps > (_EVEN * typical if even else _UNEVEN * np.percentile(steps, 95)))


def longest_part(time: np.ndarray) -> tuple[slice, tuple[str, ...]]:
    """Longest part of a record between gaps, the later of equal ones.

    Parameters
    ----------
    time : (k,) array
        Increasing.

    Returns
    -------
    part : slice
        Everything if there is no gap.
    notes : tuple of str
        Sentences on gaps and uneven steps.
    """
    gaps = gaps_in(time)
    edges = np.concatenate([[0], gaps + 1, [len(time)]])
    sizes = np.diff(edges)
    at = len(sizes) - 1 - int(np.argmax(sizes[::-1]))
    part = slice(int(edges[at]), int(edges[at + 1]))
    notes = []
    if len(gaps):
        longest = int(gaps[np.argmax(time[gaps + 1] - time[gaps])])
        word = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
        notes.append(
            f"The record has {word} from {time[longest]:.6g} to {time[longest + 1]:.6g} s; "
            f"what is judged is its longest part without one, {time[part][0]:.6g} to {time[part][-1]:.6g} s."
        )
    steps = np.diff(time[part])
    if len(steps) and np.ptp(steps) > _ROUNDED * np.median(steps):
        notes.append(f"The samples are uneven, {steps.min():.3g} to {steps.max():.3g} s apart, and were interpolated.")
    return part, tuple(notes)
