"""Onsets in the classes of motion that the valve's own symmetry leaves out, beside those within it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...model.symmetry import EQUILIBRIA, symmetry_named
from .intervals import Interval, uncertain_intervals
from .other_law import note_of
from .run import FoundOnsets


def note_of_class(found: FoundOnsets) -> dict[str, Any]:
    """Note that a record keeps of the onsets of a symmetry class."""
    said = note_of(found)
    del said["continuity"]
    name = found.options.symmetry
    for point in said["points"]:
        point["symmetry"] = name
    uncertain = uncertain_intervals(found.values, found.certified)
    words = {"symmetry": name, "motion": symmetry_named(name).words}
    return words | said | {"uncertain": [list(stretch) for stretch in uncertain]}


def merge_points(
    own: Iterable[dict[str, Any]], unstable: Sequence[Interval], classes, name: str = EQUILIBRIA
) -> list[dict[str, Any]]:
    """Points of all classes in ascending order. Where another class is unstable a crossing is no edge of stability.

    Parameters
    ----------
    own : iterable of dict
        Points of the class of the equilibria, with the stretches `unstable` in which that is unstable.
    classes : sequence of dict
        As `note_of_class` gives them.
    name : str
        Of the class of the equilibria.
    """
    parts = {name: (list(own), unstable)} | {c["symmetry"]: (c["points"], c["unstable"]) for c in classes}
    merged = []
    for name, (points, _) in parts.items():
        elsewhere = [stretch for other, (_, found) in parts.items() if other != name for stretch in found]
        for point in points:
            covered = any(low <= point["value"] <= high for low, high in elsewhere)
            merged.append(point | {"symmetry": name, "edge": point["edge"] and not covered})
    return sorted(merged, key=lambda point: point["value"])


def leading_of(
    values: np.ndarray, growth: np.ndarray, frequency: np.ndarray, certified, classes, name: str = EQUILIBRIA
) -> dict[str, Any]:
    """The most unstable class at each value that all were asked at.

    Parameters
    ----------
    values, growth, frequency, certified : (s,) arrays
        Of the class of the equilibria.
    classes : sequence of dict
        As `note_of_class` gives them.
    name : str
        Of the class of the equilibria.
    """
    own = zip(values.tolist(), zip(growth.tolist(), frequency.tolist(), np.asarray(certified).tolist()))
    scans = {name: dict(own)}
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
