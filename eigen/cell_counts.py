"""Counts of unstable eigenvalues of many cells on a small model, by the argument principle, each in its region."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .family import Condition, PencilFamily
from .phase_count import phase_counts
from .reduced import ReducedFamily
from .winding import unstable_count

#: Share of a band up to which eigenvalues are counted, clear of those at its end.
INSIDE = 0.999


@dataclass(frozen=True)
class CellCounts:
    """Of some cells.

    Attributes
    ----------
    number : (cells,) int array
        Eigenvalues right of `line` up to `band`, conjugates counted apart; -1 where nobody asked.
    certain : (cells,) bool array
    line, band : (cells,) arrays, 1/s, Hz
    """

    number: np.ndarray
    certain: np.ndarray
    line: np.ndarray
    band: np.ndarray

    def select(self, some) -> CellCounts:
        """Those of some cells."""
        return CellCounts(*(own[some] for own in vars(self).values()))

    def enter(self, cells: np.ndarray, found: CellCounts) -> None:
        """Put counts of some cells in."""
        for own, other in zip(vars(self).values(), vars(found).values()):
            own[cells] = other


def counted_band(family: PencilFamily, condition: Condition) -> float:
    """Angular frequency up to which eigenvalues are counted: all where the stiffness relaxes, which damps all."""
    return family.reach(condition).band if family.relaxation(condition.loss) is None else np.inf


def uncounted(family: PencilFamily, conditions) -> CellCounts:
    """What is known before anything is counted."""
    cells = len(conditions)
    bands = np.array([counted_band(family, c) for c in conditions])
    band = np.where(np.isinf(bands), np.inf, INSIDE * bands / (2 * np.pi))
    return CellCounts(np.full(cells, -1), np.zeros(cells, bool), np.zeros(cells), band)


def count_unstable(reduced: ReducedFamily, conditions, hints, within_band: bool = False) -> CellCounts:
    """Count unstable eigenvalues at many conditions, each in its band.

    Parameters
    ----------
    reduced : ReducedFamily
    conditions : sequence of Condition
    hints : sequence of complex arrays
        For each condition, places near which the phase may turn fast.
    within_band : bool
        Also where the stiffness relaxes.
    """
    cells = len(conditions)
    counts = CellCounts(np.zeros(cells, int), np.zeros(cells, bool), np.zeros(cells), np.full(cells, np.inf))
    family = reduced.family
    bands = np.array([family.reach(c).band if within_band else counted_band(family, c) for c in conditions])
    damped = np.array([any(c.damping) for c in conditions])
    whole = np.flatnonzero(np.isinf(bands) & damped)
    if whole.size:
        beside = [_beside(hints[i], conditions[i]) for i in whole]
        found = phase_counts(reduced, [conditions[i] for i in whole], beside)
        counts.number[whole], counts.certain[whole] = found.number, found.certain
    for i in np.setdiff1d(np.arange(cells), whole):
        band = None if np.isinf(bands[i]) else INSIDE * bands[i] / (2 * np.pi)
        found = unstable_count(reduced.pencil(conditions[i]), scale=_scale(reduced), hints=list(hints[i]), band=band)
        counts.number[i], counts.certain[i] = found.number, found.certain
        counts.line[i], counts.band[i] = found.line, found.band
    return counts


def _beside(hints, condition: Condition):
    """Those hints that a count looks beside: the leading ones, and all unstable ones where they cost nothing else."""
    number = 2 if condition.loss == 0 else max(2, int((np.asarray(hints).real > 0).sum()) + 1)
    return hints[:number]


def _scale(reduced: ReducedFamily) -> float:
    """Lowest angular frequency of the structure, rad/s."""
    square = np.linalg.eigvalsh(0.5 * (reduced.K + reduced.K.T))
    return float(np.sqrt(square[square > 0].min(initial=np.inf))) if (square > 0).any() else 1.0
