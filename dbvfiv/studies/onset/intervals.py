"""Stretches of a scan that are known to be stable or unstable, and those that are not known."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

Interval = tuple[float, float]

#: Relative distance from an onset within which values of a scan say nothing of the state.
BESIDE = 1e-7


def known_intervals(
    values: np.ndarray, growth: np.ndarray, certified: np.ndarray, edges: Iterable[float], unstable: bool
) -> list[Interval]:
    """Intervals in which a state is known to be unstable, or stable.

    Parameters
    ----------
    values : (s,) array
        Values of the scan, ascending.
    growth : (s,) array, 1/s
        Growth rate of the leading mode there.
    certified : (s,) bool array
        Nothing is claimed beside a value without a certificate.
    edges : iterable of float
        Onsets at which the state changes between stable and unstable.
    unstable : bool
        True for the unstable intervals, False for the stable ones.
    """
    edges, found = sorted(edges), []
    # right at an onset the sign of the growth rate is that of rounding
    away = [all(abs(v - e) > BESIDE * abs(e) for e in edges) or v in (values[0], values[-1]) for v in values]
    values, growth, certified = (np.asarray(part)[np.array(away, bool)] for part in (values, growth, certified))
    for i in range(len(values) - 1):
        if not (certified[i] and certified[i + 1]):
            continue
        marks = [values[i], *(e for e in edges if values[i] < e < values[i + 1]), values[i + 1]]
        state = bool(growth[i] > 0)
        for a, b in zip(marks[:-1], marks[1:]):
            if state == unstable:
                _append(found, float(a), float(b))
            state = not state
    return found


def uncertain_intervals(values: np.ndarray, certified: np.ndarray) -> list[Interval]:
    """Intervals in which nothing is claimed, because a neighbour in the scan lacks a certificate."""
    found: list[Interval] = []
    for i in range(len(values) - 1):
        if not (certified[i] and certified[i + 1]):
            _append(found, float(values[i]), float(values[i + 1]))
    return found


def common_stretches(parts: Sequence[Sequence[Interval]]) -> list[Interval]:
    """Stretches that lie in all of some lists."""
    found = list(map(tuple, parts[0]))
    for part in parts[1:]:
        pairs = ((max(a, c), min(b, d)) for a, b in found for c, d in part)
        found = [(low, high) for low, high in pairs if low < high]
    return sorted(found)


def joined_stretches(parts: Sequence[Sequence[Interval]]) -> list[Interval]:
    """Stretches that lie in any of some lists, those that touch joined."""
    found: list[Interval] = []
    for low, high in sorted(tuple(stretch) for part in parts for stretch in part):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def _append(found: list[Interval], low: float, high: float) -> None:
    """Add an interval, joined with the last one if they touch."""
    if found and found[-1][1] == low:
        found[-1] = (found[-1][0], high)
    else:
        found.append((low, high))
