"""Growth rates, and counts of unstable eigenvalues, of a steady state at many conditions, and what vouches for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from eigen import SearchOptions, Workspace, leading_modes

from ..model.dynamics import Conditions, LinearisedState
from .phase_count import phase_counts
from .reduction import StateFamily, StaticSolver

#: Eigenvalues closer to the limit point -1/beta than this share are not listed.
CLEAR = 0.8
#: Estimated relative error of an eigenvalue above which a state is treated directly.
TOLERANCE = 1e-6
#: How a cell was found.
REDUCED, DIRECT, MISSING = 0, 1, 2


@dataclass(frozen=True)
class Column:
    """Cells of one steady state.

    Attributes
    ----------
    growth_rate, frequency : (cells,) arrays, 1/s, Hz
        Of the leading mode.
    second : (cells,) array, 1/s
        Growth rate of the next mode.
    unstable : (cells,) int array
        Eigenvalues with positive growth rate, conjugates counted apart, by the spectrum.
    counted : (cells,) int array
        The same by the argument principle.
    certain : (cells,) bool array
        That count followed the phase everywhere.
    error : float
        Largest estimated relative error of leading eigenvalues among the checked cells.
    how : (cells,) int array
        `REDUCED` or `DIRECT`.
    eigenvalues : callable or None
        From any condition (density, alpha, beta, storage) at the same state to its leading eigenvalues on the small
        model, sorted by growth rate.
    leading : tuple of arrays
        Those of the cells.
    """

    growth_rate: np.ndarray
    frequency: np.ndarray
    second: np.ndarray
    unstable: np.ndarray
    counted: np.ndarray
    certain: np.ndarray
    error: float
    how: np.ndarray
    eigenvalues: Callable[[tuple], np.ndarray] | None = None
    leading: tuple[np.ndarray, ...] = ()

    @property
    def certified(self) -> np.ndarray:
        """Cells for which both counts agree and the leading eigenvalue is accurate."""
        return (self.unstable == self.counted) & self.certain & ((self.how == DIRECT) | (self.error <= TOLERANCE))


def floor_of(beta: float) -> float:
    """Growth rate down to which modes can be listed: clear of the limit point -1/beta."""
    return -CLEAR / beta if beta > 0 else -np.inf


class ColumnSolver:
    """Solves states of one model after another.

    Parameters
    ----------
    snapshots : int
        Conditions at which leading vectors are taken into the second space.
    tolerance : float
        Estimated relative error of an eigenvalue above which a cell is solved directly.
    """

    def __init__(self, snapshots: int = 3, tolerance: float = TOLERANCE):
        self.snapshots, self.tolerance = snapshots, tolerance
        self._static, self._workspace = StaticSolver(), Workspace()

    def solve(self, linear: LinearisedState, conditions) -> Column:
        """All conditions, a sequence of (density, alpha, beta, storage), at one state."""
        conditions = [tuple(map(float, c)) for c in conditions]
        if len(conditions) < 3:
            return self._directly(linear, conditions)
        family = StateFamily(linear, self._static)
        floor = np.array([floor_of(c[2]) for c in conditions])
        places = _spread(conditions, self.snapshots)
        fine = family.fine(
            [conditions[i] for i in places], -np.inf if not np.isfinite(floor).all() else 0.75 * float(floor.min())
        )
        values = fine.eigenvalues(conditions)
        leading = [_leading(row, low) for row, low in zip(values, floor)]
        counts = phase_counts(family.coarse, conditions, [row[:2] for row in leading])
        error = self._error(family, fine, conditions, floor, _between(places))
        column = _column(leading, values, counts, error)
        doubtful = np.flatnonzero(~column.certified)
        column = replace(
            column,
            leading=tuple(row[:8] for row in leading),
            eigenvalues=lambda c: _leading(fine.eigenvalues([c])[0], floor_of(c[2]))[:8],
        )
        return self._repaired(column, linear, conditions, doubtful) if doubtful.size else column

    def _error(self, family, fine, conditions, floor, places) -> float:
        """Relative change of leading eigenvalues under a correction with the full matrices, at conditions the space was
        not made for.

        The two-sided quotient w^H T x / (w^H T' x) of corrected vectors is Newton's correction of the eigenvalue; what
        the space lacks shows in it.
        """
        worst = 0.0
        for i in places:
            condition = conditions[i]
            pairs = fine.pairs(condition, floor[i], 2)
            if pairs.values.size:
                worst = max(worst, float(newton_correction(family, pairs, condition).max()))
        return worst

    def direct(self, linear: LinearisedState, condition, count: int = 6):
        """Leading modes of the full pencil, an `eigen.Spectrum`."""
        density, alpha, beta, storage = condition
        pencil = linear.pencil(Conditions(density, alpha, beta), storage=storage)
        return leading_modes(pencil, count, search_options(beta), workspace=self._workspace)

    def _directly(self, linear, conditions) -> Column:
        family = StateFamily(linear, self._static)
        cells = len(conditions)
        blank = np.full(cells, np.nan)
        column = Column(
            blank,
            blank.copy(),
            blank.copy(),
            np.zeros(cells, int),
            np.zeros(cells, int),
            np.zeros(cells, bool),
            0.0,
            np.full(cells, DIRECT),
        )
        column = self._repaired(column, linear, conditions, np.arange(cells))
        hints = [np.array([complex(g, 2 * np.pi * f)]) for g, f in zip(column.growth_rate, column.frequency)]
        counts = phase_counts(family.coarse, conditions, hints)
        return replace(column, counted=counts.number, certain=counts.certain)

    def _repaired(self, column: Column, linear, conditions, cells) -> Column:
        fields = {
            name: getattr(column, name).copy() for name in ("growth_rate", "frequency", "second", "unstable", "how")
        }
        for i in cells:
            spectrum = self.direct(linear, conditions[i])
            if not len(spectrum):
                continue
            fields["growth_rate"][i], fields["frequency"][i] = spectrum.growth_rate[0], spectrum.frequency[0]
            fields["second"][i] = spectrum.growth_rate[1] if len(spectrum) > 1 else np.nan
            fields["unstable"][i], fields["how"][i] = spectrum.unstable_count, DIRECT
        return replace(column, **fields)


def newton_correction(family: StateFamily, pairs, condition) -> np.ndarray:
    """|w^H T x / (w^H T' x)| over |lambda| of pairs, their vectors corrected once outside the space."""
    right, left = family.corrected(pairs, condition)
    force, inner = family.residual(pairs.values, right, pairs.u, condition)
    top = np.einsum("ij,ij->j", left.conj(), force) + np.einsum("ij,ij->j", pairs.c.conj(), inner)
    # T' by a difference quotient, good enough for the size of a correction
    step = 1e-3 * np.maximum(np.abs(pairs.values), 1.0)
    ahead = family.residual(pairs.values + step, right, pairs.u, condition)
    slope = (
        np.einsum("ij,ij->j", left.conj(), ahead[0] - force) + np.einsum("ij,ij->j", pairs.c.conj(), ahead[1] - inner)
    ) / step
    return np.abs(top / slope) / np.maximum(np.abs(pairs.values), 1.0)


def search_options(beta: float, left: bool = False) -> SearchOptions:
    """How leading modes of the full pencil are searched for at a stiffness damping."""
    return SearchOptions(
        limit_point=-1.0 / beta if beta > 0 else None, max_frequency=None if beta > 0 else 80.0, left=left
    )


def _leading(values: np.ndarray, floor: float) -> np.ndarray:
    """Eigenvalues of the upper half-plane above a floor, sorted by growth rate; the largest of all where none is."""
    upper = values[values.imag >= 0]
    kept = upper[upper.real > floor]
    kept = kept if kept.size else upper[[int(np.argmax(upper.real))]]
    return kept[np.argsort(-kept.real)]


def _column(leading, values, counts, error: float) -> Column:
    cells = len(leading)
    return Column(
        growth_rate=np.array([row[0].real for row in leading]),
        frequency=np.array([row[0].imag / (2 * np.pi) for row in leading]),
        second=np.array([row[1].real if len(row) > 1 else np.nan for row in leading]),
        unstable=(values.real > 0).sum(axis=1),
        counted=counts.number,
        certain=counts.certain,
        error=error,
        how=np.full(cells, REDUCED),
    )


def _spread(conditions, number: int) -> list[int]:
    """Indices of conditions spread over the list."""
    return sorted({int(round(x)) for x in np.linspace(0, len(conditions) - 1, min(number, len(conditions)))})


def _between(places: list[int]) -> list[int]:
    """The middle of the widest gap between places, the first of several."""
    if len(places) < 2:
        return places
    gaps = [(b - a, -a, (a + b) // 2) for a, b in zip(places[:-1], places[1:])]
    return [max(gaps)[2]]
