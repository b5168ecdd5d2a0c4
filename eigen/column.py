"""Cells of one state, and what vouches for each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from .agreement import Certificate
from .family import Condition
from .pencil import CoupledPencil

#: Estimated relative error of an eigenvalue above which a cell is treated directly.
TOLERANCE = 1e-6
#: How a cell was found.
REDUCED, DIRECT, MISSING = 0, 1, 2


@dataclass(frozen=True)
class Column:
    """Cells of one state.

    Attributes
    ----------
    growth_rate, frequency : (cells,) arrays, 1/s, Hz
        Of the leading mode; NaN if none was found.
    second : (cells,) array, 1/s
        Growth rate of the next mode.
    unstable : (cells,) int array
        Eigenvalues right of `line` up to `band`, conjugates counted apart, by the spectrum.
    counted : (cells,) int array
        As many as `unstable`, by the argument principle; -1 where nobody asked.
    certain : (cells,) bool array
        That count followed the phase everywhere.
    error : float
        Largest estimated relative error of leading eigenvalues among the checked cells.
    how : (cells,) int array
        `REDUCED` or `DIRECT`.
    line, band : (cells,) arrays, 1/s, Hz
        Region counted.
    eigenvalues : callable or None
        From any condition at the same state to its leading eigenvalues on the small model, sorted by growth rate.
    nearest : callable or None
        From a condition and a place to the eigenvalue of the small model next to it.
    corrected : callable or None
        From a condition and an eigenvalue of the small model to Newton's correction of it by the full matrices.
    cell : callable or None
        From any further condition at the same state to a column of this one cell.
    pencil : callable or None
        From any condition at the same state to its pencil on the small model.
    leading : list of arrays
        Leading eigenvalues of the cells.
    """

    growth_rate: np.ndarray
    frequency: np.ndarray
    second: np.ndarray
    unstable: np.ndarray
    counted: np.ndarray
    certain: np.ndarray
    error: float
    how: np.ndarray
    line: np.ndarray
    band: np.ndarray
    eigenvalues: Callable[[Condition], np.ndarray] | None = None
    nearest: Callable[[Condition, complex], complex] | None = None
    corrected: Callable[[Condition, complex], complex] | None = None
    cell: Callable[[Condition], Column] | None = None
    pencil: Callable[[Condition], CoupledPencil] | None = None
    leading: list[np.ndarray] = field(default_factory=list)

    @classmethod
    def blank(cls, cells: int) -> Column:
        """Cells that nobody solved."""
        nothing = (np.full(cells, np.nan) for _ in range(3))
        none, unsure = np.full(cells, -1), np.zeros(cells, bool)
        region = np.zeros(cells), np.full(cells, np.inf)
        empty = [np.zeros(0, complex)] * cells
        return cls(*nothing, none, none.copy(), unsure, 0.0, np.full(cells, MISSING), *region, leading=empty)

    @classmethod
    def joined(cls, parts: Sequence[Column]) -> Column:
        """Cells of several columns as one, which has no small model."""
        own = [field.name for field in fields(cls) if isinstance(getattr(parts[0], field.name), np.ndarray)]
        cells = {name: np.concatenate([getattr(part, name) for part in parts]) for name in own}
        leading = [row for part in parts for row in part.leading]
        return cls(**cells, error=max(part.error for part in parts), leading=leading)

    def spread(self, cells: Sequence[int], number: int) -> Column:
        """Column of more cells: these at the given places, the others blank, neither listed nor counted."""
        out = Column.blank(number)
        for own in fields(self):
            values = getattr(self, own.name)
            if isinstance(values, np.ndarray):
                getattr(out, own.name)[list(cells)] = values
        for i, row in zip(cells, self.leading):
            out.leading[i] = row
        small = {name: getattr(self, name) for name in ("eigenvalues", "nearest", "corrected", "cell", "pencil")}
        return replace(out, error=self.error, **small)

    @property
    def certified(self) -> np.ndarray:
        """Cells for which both counts agree and the leading eigenvalue is accurate."""
        return np.array([self.certificate(i).agrees for i in range(len(self.unstable))], bool)

    def certificate(self, cell: int) -> Certificate:
        """What vouches for a cell."""
        accurate = self.how[cell] == DIRECT or self.error <= TOLERANCE
        known = bool(np.isfinite(self.growth_rate[cell]))
        return Certificate(
            int(self.unstable[cell]),
            int(self.counted[cell]),
            bool(self.certain[cell] and accurate and known),
            float(self.line[cell]),
            float(self.band[cell]),
        )
