"""A map in the classes of motion that the valve's own symmetry leaves out: cells of the grid, the most unstable named.

These classes have no onset curves of their own in the map; `onset` locates their onsets along a line.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...model.symmetry import EQUILIBRIA, symmetry_named
from ...observer import Observer
from ...record.record import GrowingRecord
from ..case import Case
from ..stability.classes import NOTE, classes_to_look_at
from ..stability.walk import StabilityWalk
from .run import FoundMap, run_map

_GRIDS = ("growth_rate", "frequency", "unstable", "counted", "certified")
#: Cells alone, under one law: the laws differ in no class but that of the equilibria.
_PLAIN = {"map.curve": False, "map.refine": 0, "map.continuity": "case", "map.workers": 1}


def look_at_classes(case: Case, record: GrowingRecord, walk: StabilityWalk) -> None:
    """Cells of the grid in the other classes, where they are asked for and not in the record yet."""
    for symmetry in classes_to_look_at(record, case.map.symmetry, case.part):
        found = run_map(case.replace(_PLAIN), Observer(), walk=walk.in_class(symmetry))
        for sentence in found.warnings:
            record.warn(f"In class {symmetry.name}: {sentence}")
        if found.interrupted:
            raise KeyboardInterrupt
        record.note(NOTE, **note_of_class(found, symmetry.name))


def note_of_class(found: FoundMap, name: str) -> dict[str, Any]:
    """Note that a record keeps of a symmetry class: its grids as tables (y, x)."""
    grids = {grid: found.grid(grid)[0].tolist() for grid in _GRIDS}
    return {"symmetry": name, "motion": symmetry_named(name).words} | grids


def summary_of(note: dict[str, Any]) -> dict[str, Any]:
    """Plain numbers of a class for JSON."""
    return {
        "symmetry": note["symmetry"],
        "motion": note["motion"],
        "growth_rate": note["growth_rate"],
        "frequency": note["frequency"],
        "unstable_count": note["unstable"],
        "unstable_count_independent": note["counted"],
        "certified": [[bool(cell) for cell in row] for row in note["certified"]],
    }


def leading_of(
    growth: np.ndarray, frequency: np.ndarray, notes: list[dict[str, Any]], own: str = EQUILIBRIA
) -> dict[str, Any]:
    """Growth rate, frequency and class of the most unstable motion in each cell, from tables (y, x) of the class of the
    equilibria, `own`, and the notes of the others; a gap stays one.
    """
    names = [own, *(note["symmetry"] for note in notes)]
    rates = np.stack([growth, *(np.array(note["growth_rate"], float) for note in notes)])
    frequencies = np.stack([frequency, *(np.array(note["frequency"], float) for note in notes)])
    gap = np.isnan(rates[0])
    first = np.argmax(np.where(np.isnan(rates), -np.inf, rates), axis=0)
    pick = lambda table: np.where(gap, np.nan, np.take_along_axis(table, first[None], axis=0)[0])  # noqa: E731
    symmetry = [[None if g else names[i] for g, i in zip(*rows)] for rows in zip(gap, first)]
    return {"growth_rate": pick(rates).tolist(), "frequency": pick(frequencies).tolist(), "symmetry": symmetry}
