"""Phases followed along a line: what several counts by the argument principle share."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

#: Largest accepted step of the phase between neighbours, rad.
LARGEST_STEP = np.pi / 3
#: Distance of the last phase from its limit that calls for higher frequencies, rad.
LATE = 0.1
#: Places between far below and far above the frequencies of a structure that every walk looks at.
GRID = 17


def principal(angle):
    """Angles brought to -pi..pi."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def grid(scale: float, top: float, beside) -> list[float]:
    """Places to begin with: zero, those spread over the frequencies of a structure, and those given."""
    return [0.0, *np.geomspace(0.1 * scale, top, GRID), *beside]


def middle(a, b) -> np.ndarray:
    """Where intervals are parted: on the positive axis in proportion where they are wide, else in length."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.where((a > 0) & (b > 4 * a), np.sqrt(np.abs(a * b)), 0.5 * (a + b))


def wide(omega: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Intervals between ascending places over which the phase turns too far and which are not yet too short."""
    far = np.flatnonzero(np.abs(principal(np.diff(phase))) > LARGEST_STEP)
    return far[np.diff(omega)[far] > 1e-10 * omega[far + 1]]


def thinned(places, widths, apart: float) -> list[float]:
    """Places that lie apart by a share of their widths: zeros that are all well damped share theirs."""
    kept: list[float] = []
    for i in np.argsort(widths):
        at = bisect_left(kept, places[i])
        if all(abs(places[i] - w) > apart * widths[i] for w in kept[max(0, at - 1) : at + 1]):
            kept.insert(at, float(places[i]))
    return kept
