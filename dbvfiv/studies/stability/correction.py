"""Onsets of a column, found on a small model, brought to where the full matrices have them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eigen import Column, Condition

from ...errors import SolveError

#: Growth rate over the size of the eigenvalue up to which an onset counts as neutral.
ACCURATE = 1e-6
#: The same, at which corrections end.
NEUTRAL = 1e-8
#: Corrections at most.
CORRECTIONS = 5
#: Step along the column for the slope of the growth rate, relative.
STEP = 1e-4
#: Largest step along the column, relative.
REACH = 0.05
#: Largest relative distance of a mode from where it was looked for.
MOVED = 0.1
#: Largest relative difference of one mode on the small model and with the full matrices.
SAME = 1e-2


@dataclass(frozen=True)
class OnsetCorrection:
    """Newton steps along a column with eigenvalues of the full matrices and slopes of the small model.

    Parameters
    ----------
    column : Column
    condition : callable
        From a value along the column to its condition.
    direct : callable
        From a value to leading eigenvalues of the full pencil, where corrections on the small model do not settle.
    """

    column: Column
    condition: Callable[[float], Condition]
    direct: Callable[[float], np.ndarray]

    def __call__(self, value: float, frequency: float) -> tuple[float, float, float]:
        """Value, frequency (Hz) and growth rate over the size of the eigenvalue, NaN where no mode was followed."""
        near = 2j * np.pi * frequency
        for eigenvalue in (self._by_correction, self._by_solving):
            found = self._settled(eigenvalue, value, near)
            if found is not None:
                return found
        return value, frequency, float("nan")

    def _settled(self, eigenvalue, value: float, near: complex):
        slope = self._slope(self._small, value, near)
        if not np.isfinite(slope):
            slope = self._slope(self._by_solving, value, near)
        if not np.isfinite(slope) or slope == 0:
            return None
        for _ in range(CORRECTIONS):
            found = eigenvalue(value, near)
            if found is None or not np.isfinite(found):
                return None
            near, left = found, abs(found.real) / max(abs(found), 1.0)
            if left <= NEUTRAL:
                break
            if abs(found.real) > REACH * abs(slope) * (abs(value) or 1.0):
                return None  # a growth rate that hardly changes along the column leads astray
            value -= found.real / slope
        return (value, abs(near.imag) / (2 * np.pi), left) if left <= ACCURATE else None

    def _small(self, value: float, near: complex) -> complex | None:
        """Eigenvalue of the small model; None where it has none near, as where all cells needed the full matrices."""
        found = self.column.nearest(self.condition(value), near)
        return found if abs(found - near) <= MOVED * max(abs(near), 1.0) else None

    def _slope(self, eigenvalue, value: float, near: complex) -> float:
        step = STEP * (abs(value) or 1.0)
        up, down = (eigenvalue(v, near) for v in (value + step, value - step))
        return float("nan") if up is None or down is None else (up.real - down.real) / (2 * step)

    def _by_correction(self, value: float, near: complex) -> complex | None:
        found = self._small(value, near)
        if found is None:
            return None
        change = self.column.corrected(self.condition(value), found)
        return found + change if abs(change) < SAME * max(abs(found), 1.0) else None

    def _by_solving(self, value: float, near: complex) -> complex | None:
        try:
            nearest = _nearest(self.direct(value), near)
        except SolveError:
            return None
        return None if nearest is None or abs(nearest - near) > SAME * max(abs(near), 1.0) else nearest


def _nearest(values: np.ndarray, near: complex) -> complex | None:
    """The eigenvalue next to a place, None if there is none at all."""
    return complex(values[int(np.argmin(np.abs(values - near)))]) if len(values) else None
