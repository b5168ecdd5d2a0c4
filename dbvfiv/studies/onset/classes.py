"""Onsets in the classes of motion that the valve's own symmetry leaves out, beside those within it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...model.symmetry import EQUILIBRIA, SYMMETRIES
from .intervals import Interval, uncertain_intervals
from .other_law import note_of
from .run import FoundOnsets

#: Kind of the notes that hold them, one for each class.
NOTE = "class"


def note_of_class(found: FoundOnsets) -> dict[str, Any]:
    """What a record keeps of the onsets of a class."""
    said = note_of(found)
    del said["continuity"]
    name = found.options.symmetry
    for point in said["points"]:
        point["symmetry"] = name
    uncertain = uncertain_intervals(found.values, found.certified)
    words = {"symmetry": name, "motion": SYMMETRIES[name].words}
    return words | said | {"uncertain": [list(stretch) for stretch in uncertain]}


def merge_points(own: Iterable[dict[str, Any]], unstable: Sequence[Interval], classes) -> list[dict[str, Any]]:
    """Points of all classes in ascending order. Where another class is unstable a crossing is no edge of stability.

    Parameters
    ----------
    own : iterable of dict
        Points of the class of the equilibria, with the stretches `unstable` in which that is unstable.
    classes : sequence of dict
        As `note_of_class` gives them.
    """
    parts = {EQUILIBRIA: (list(own), unstable)} | {c["symmetry"]: (c["points"], c["unstable"]) for c in classes}
    merged = []
    for name, (points, _) in parts.items():
        elsewhere = [stretch for other, (_, found) in parts.items() if other != name for stretch in found]
        for point in points:
            covered = any(low <= point["value"] <= high for low, high in elsewhere)
            merged.append(point | {"symmetry": name, "edge": point["edge"] and not covered})
    return sorted(merged, key=lambda point: point["value"])


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


def leading_of(values: np.ndarray, growth: np.ndarray, frequency: np.ndarray, certified, classes) -> dict[str, Any]:
    """The most unstable class at each value that all were asked at.

    Parameters
    ----------
    values, growth, frequency, certified : (s,) arrays
        Of the class of the equilibria.
    classes : sequence of dict
        As `note_of_class` gives them.
    """
    own = zip(values.tolist(), zip(growth.tolist(), frequency.tolist(), np.asarray(certified).tolist()))
    scans = {EQUILIBRIA: dict(own)}
    for part in classes:
        scan = part["scan"]
        numbers = zip(scan["growth_rate"], scan["frequency"], scan["certified"])
        scans[part["symmetry"]] = dict(zip(scan["values"], numbers))
    places = sorted(set.intersection(*(set(scan) for scan in scans.values())))
    first = [max(scans, key=lambda name: scans[name][value][0]) for value in places]
    rows = [scans[name][value] for name, value in zip(first, places)]
    return {
        "values": places,
        "growth_rate": [row[0] for row in rows],
        "frequency": [row[1] for row in rows],
        "symmetry": first,
        "certified": [all(scan[value][2] for scan in scans.values()) for value in places],
    }
