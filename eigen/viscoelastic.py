"""Leading eigenvalues of reduced pencils of viscoelastic walls, for many conditions at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .family import Condition, bordered
from .operator import OVERDAMPED
from .rational import ALIKE, LEAST, RATIO, SAME, STEP, RationalCells, Refined, Surrogate, real_roots, refined, started
from .structure_response import relative


class Mode(NamedTuple):
    """An eigenvalue with its right and left vectors, (n,) each."""

    value: complex
    right: np.ndarray
    left: np.ndarray


def solved_cells(conditions) -> np.ndarray:
    """Cells to be solved from nothing: all where the conditions follow each other too far apart, or differ in more than
    the inertia.
    """
    every = np.arange(len(conditions))
    inertia = np.array([c.inertia for c in conditions])
    if len(conditions) < LEAST or len({(c.law, c.damping) for c in conditions}) > 1 or not (inertia > 0).all():
        return every
    widest = np.abs(np.diff(np.log(inertia))).max()
    step = min(STEP, int(np.log(RATIO) / max(widest, 1e-300)))
    return every if step < 2 else np.union1d(every[::step], every[-1:])


def in_between(first: list[Mode], second: list[Mode], share: float) -> list[Mode]:
    """Modes to start from, a share of the way from one cell to another: between where one has its like there, and all
    that have none.
    """
    others, out = list(second), []
    for mode in first:
        distance = [abs(mode.value - other.value) for other in others]
        nearest = int(np.argmin(distance)) if distance else -1
        if distance and distance[nearest] <= ALIKE * abs(mode.value):
            other = others.pop(nearest)
            vectors = mode if share < 0.5 else other
            mode = vectors._replace(value=(1.0 - share) * mode.value + share * other.value)
        out.append(mode)
    return out + others


#: Eigenvalues of a cell that are taken from the surrogate to the rational pencil.
TAKEN = 6
#: Eigenvalues of a surrogate from which the first of these are chosen.
STARTED = 10
#: Room above a band for starts.
ROOM = 1.1
#: Growth rates of a cell that have to be right; a start that was lost below them does not matter.
WATCHED = 2
#: Lowest motions of the structure from which it is read how much of the stiffness relaxes.
TYPICAL = 8
#: Relative distance by which a mode may lie from half-way between its neighbours.
MOVED = 0.1
#: Real eigenvalues are looked for up to this many times the highest frequency of typical motions.
TOP = 3.0


class SmallSpectra:
    """Eigenvalues of the pencils of a reduced family that relax.

    Parameters
    ----------
    reduced : Any
    """

    def __init__(self, reduced: Any):
        self.reduced = reduced
        root = np.linalg.cholesky(reduced.M)
        squares, motions = np.linalg.eigh(relative(reduced.K, root))
        low = np.flatnonzero(squares > 0)[:TYPICAL]
        #: Typical angular frequency, rad/s.
        self.frequency = float(np.exp(0.5 * np.log(squares[low]).mean())) if low.size else 1.0
        self._top = TOP * float(np.sqrt(squares[low[-1]])) if low.size else 1.0
        motions = np.linalg.solve(root.T, motions[:, low])
        parts = np.einsum("ai,gab,bi->gi", motions, reduced.relaxing, motions)
        #: Share of each relaxing part in the stiffness of typical motions, (g,).
        self.shares = (parts / squares[low]).mean(axis=1) if low.size else np.ones(len(reduced.relaxing))
        #: The same of the stiffest motions.
        self.stiff_shares = np.array([np.trace(relative(part, root)) for part in reduced.relaxing]) / squares.sum()

    def problem(self, conditions: list[Condition]) -> RationalCells:
        """The rational pencils of conditions."""
        laws = {law: i for i, law in enumerate(dict.fromkeys(c.law for c in conditions))}
        relaxations = [self.reduced.family.relaxation(c.loss) for c in conditions]
        return RationalCells(
            [self._basis(law) for law in laws],
            np.array([laws[c.law] for c in conditions]),
            np.array([(np.sqrt(c.inertia), c.alpha, c.beta) for c in conditions]),
            *_together(relaxations),
        )

    def _basis(self, law) -> np.ndarray:
        """Bordered matrices of `RationalCells` under one law."""
        reduced, k = self.reduced, self.reduced.size
        coupling = bordered(reduced.coupling(law))
        basis = np.zeros((6 + len(reduced.relaxing), *coupling.shape[1:]))
        basis[:3, :k, :k] = reduced.K, reduced.M, reduced.D
        basis[3:6] = coupling
        basis[6:, :k, :k] = reduced.relaxing
        return basis

    def leading(self, conditions: list[Condition]) -> np.ndarray:
        """Leading eigenvalues with their conjugates, (cells, w) complex; NaN where there are fewer."""
        rows, _ = self._found(conditions)
        out = np.full((len(conditions), 2 * max(map(len, rows), default=0)), complex(np.nan, np.nan))
        for line, row in zip(out, rows):
            values = np.array(row, complex)
            values = np.concatenate([values, values[values.imag > 0].conj()])
            line[: values.size] = values
        return out

    def leading_pairs(self, conditions: list[Condition], chosen) -> list[Refined]:
        """Leading eigenpairs of each pencil; `chosen` picks among the eigenvalues of a condition in the upper
        half-plane.
        """
        rows, vectors = self._found(conditions)
        out = []
        for i, (condition, row) in enumerate(zip(conditions, rows)):
            values = chosen(condition, np.array(row, complex))
            known = [vectors.get((i, complex(value))) for value in values]
            lacking = [k for k, pair in enumerate(known) if pair is None]
            if lacking:
                found = self.pairs(condition, values[lacking])
                for place, k in enumerate(lacking):
                    known[k] = found.right[place], found.left[place]
            size = self.reduced.size + len(self.reduced.coupling(condition.law)["S0"])
            right, left = (np.array([pair[side] for pair in known]).reshape(len(values), size) for side in (0, 1))
            out.append(Refined(values, right, left, None))
        return out

    def _found(self, conditions: list[Condition]) -> tuple[list[list[complex]], dict]:
        """Leading eigenvalues of each cell in the upper half-plane; and right and left vectors, where they came along,
        by cell and eigenvalue.
        """
        solved = solved_cells(conditions)
        if len(solved) == len(conditions):
            return self._each(conditions)
        rows: list[list[complex]] = [[] for _ in conditions]
        vectors = {}

        def enter(cells, found):
            for i, row in zip(cells, found[0]):
                rows[i] = row
            vectors.update({(cells[i], value): pair for (i, value), pair in found[1].items()})

        enter(solved, self._each([conditions[i] for i in solved]))
        known = {i: [Mode(v, *vectors[i, v]) for v in rows[i] if (i, v) in vectors] for i in solved}
        between = np.setdiff1d(np.arange(len(conditions)), solved)
        next_one = np.searchsorted(solved, between)
        # beside one solved by the exact linear form, which brings no vectors, none can be started
        whole = {i: all((i, v) in vectors for v in rows[i] if v.imag > 0) for i in solved}
        starts = [
            in_between(known[a], known[b], (i - a) / (b - a)) if whole[a] and whole[b] else []
            for i, a, b in zip(between, solved[next_one - 1], solved[next_one])
        ]
        *found, doubtful = self._from([conditions[i] for i in between], starts)
        enter(between, found)
        if doubtful.any():
            enter(between[doubtful], self._each([conditions[i] for i in between[doubtful]]))
        return rows, vectors

    def _from(self, conditions: list[Condition], starts) -> tuple[list[list[complex]], dict, np.ndarray]:
        """The same from modes near those of each cell; and in which cells one of them was lost."""
        problem = self.problem(conditions)
        cells = np.repeat(np.arange(len(conditions)), [len(own) for own in starts])
        rows: list[list[complex]] = [[] for _ in conditions]
        vectors = {}
        doubtful = np.array([not own for own in starts])
        if cells.size:
            values, right, left = (np.array(part) for part in zip(*(mode for own in starts for mode in own)))
            found = refined(problem, cells, Refined(values, right, left, None))
            near = np.abs(found.values - values) <= MOVED * np.abs(values)
            doubtful[cells[~_entered(found, found.settled & near, cells, rows, vectors)]] = True
        self._add_real(problem, conditions, rows)
        return rows, vectors, doubtful

    def _each(self, conditions: list[Condition]) -> tuple[list[list[complex]], dict]:
        """The same, every cell from nothing."""
        problem = self.problem(conditions)
        rows: list[list[complex]] = [[] for _ in conditions]
        vectors = {}
        doubtful = np.zeros(len(conditions), bool)
        cells, start = self._starts(conditions, problem)
        place = _places(cells, start.values.real)  # rank in its cell, by growth rate
        first, wanted = 0, np.ones(len(conditions), bool)
        while wanted.any():
            taken = np.flatnonzero((place >= first) & (place < first + TAKEN) & wanted[cells])
            if not taken.size:
                break
            found = refined(problem, cells[taken], start[taken])
            lost = taken[~_entered(found, found.settled, cells[taken], rows, vectors)]
            for i, growth in zip(cells[lost], start.values[lost].real):
                watched = sorted((v.real for v in rows[i]), reverse=True)[:WATCHED]
                doubtful[i] |= len(watched) < WATCHED or growth > watched[-1]
            # one after another as long as all that were found are unstable
            wanted = np.array([bool(row) and min(v.real for v in row) > 0 for row in rows])
            first += TAKEN
        self._add_real(problem, conditions, rows)
        for i in np.flatnonzero(doubtful):
            # modes of a doubtful cell go on in the next one
            row = self._followed(problem, i, rows[i - 1], rows[i]) if i and doubtful[i - 1] else None
            rows[i] = list(self._exactly(conditions[i])) if row is None else row
        return rows, vectors

    def _add_real(self, problem: RationalCells, conditions, rows) -> None:
        """Put real eigenvalues to those of each cell."""
        edges = np.array([self.reduced.family.reach(c).creep for c in conditions])
        for i, value in zip(*real_roots(problem, edges, self._top)):
            _joined(rows[i], complex(value))

    def pairs(self, condition: Condition, values) -> Refined:
        """Eigenpairs of one pencil at eigenvalues, or near places close to them."""
        values = np.asarray(values, complex)
        problem, cells = self.problem([condition]), np.zeros(len(values), int)
        return refined(problem, cells, started(problem, None, cells, values))

    def _followed(self, problem: RationalCells, cell: int, before: list[complex], known: list[complex]):
        """Eigenvalues of a cell that those of the cell before lead to, and those known; None where two of them meet or
        one is lost.
        """
        starts = np.array(sorted(before, key=lambda value: -value.real)[:TAKEN], complex)
        cells = np.full(starts.size, cell)
        found, row = refined(problem, cells, started(problem, None, cells, starts)), []
        if not (found.settled.all() and all(_joined(row, complex(value)) for value in found.values)):
            return None
        for value in known:
            _joined(row, value)
        return row

    def _exactly(self, condition: Condition) -> np.ndarray:
        """Leading eigenvalues by the exact linear form."""
        F, E = self.reduced.pencil(condition).first_order()
        values = np.linalg.eigvals(np.linalg.solve(E, F))
        reach = self.reduced.family.reach(condition)
        values = values[(values.imag >= 0) & reach.is_mode(values)]
        values = values[np.argsort(-values.real)]
        return values[: max(TAKEN, int(np.sum(values.real > 0)) + 1)]

    def _starts(self, conditions, problem: RationalCells) -> tuple[np.ndarray, Refined]:
        """Cells, and pairs to start from in the upper half-plane, from surrogates."""
        reduced = self.reduced
        surrogate = Surrogate.at(problem, self.frequency)
        flat = reduced.relaxing.reshape(len(reduced.relaxing), -1)
        shape = (-1, reduced.size, reduced.size)
        matrices = reduced.first_order(
            conditions, (surrogate.level @ flat).reshape(shape), (surrogate.slope @ flat).reshape(shape)
        )
        values = np.linalg.eigvals(matrices)
        # relaxation is no start, and the real axis is searched on its own
        swings = (values.imag > OVERDAMPED * np.abs(values)) | ((values.real > 0) & (values.imag >= 0))
        growth = np.where(swings, self._estimates(problem, surrogate, np.where(swings, values, 1.0)).real, -np.inf)
        band = np.array([self.reduced.family.reach(c).band for c in conditions])
        growth = np.where((values.imag <= ROOM * band[:, None]) | (values.real > 0), growth, -np.inf)
        order = np.argsort(-growth, axis=1)[:, :STARTED]
        cells = np.repeat(np.arange(len(conditions)), order.shape[1])
        kept = np.isfinite(np.take_along_axis(growth, order, 1)).ravel()
        cells, picked = cells[kept], np.take_along_axis(values, order, 1).ravel()[kept]
        return cells, started(problem, surrogate, cells, picked)

    def _estimates(self, problem, surrogate, values) -> np.ndarray:
        """Eigenvalues of surrogates corrected by the share that relaxes of typical motions."""
        cells = np.repeat(np.arange(len(values)), values.shape[1])
        true = problem.factors(cells, values.ravel()).reshape(*values.shape, -1)
        missed = true - surrogate.level[:, None] - surrogate.slope[:, None] * values[..., None]
        return values * (1.0 + 0.5 * (missed @ self.shares) / (1.0 + true @ self.shares))


def _together(relaxations) -> tuple[np.ndarray, np.ndarray]:
    """Strengths (cells, g, j) over the times (j,) of all."""
    times = np.unique(np.concatenate([relaxation.times for relaxation in relaxations]))
    strengths = np.zeros((len(relaxations), len(relaxations[0].strengths), len(times)))
    for own, relaxation in zip(strengths, relaxations):
        own[:, np.searchsorted(times, relaxation.times)] = relaxation.strengths
    return strengths, times


def _places(cells: np.ndarray, growth: np.ndarray) -> np.ndarray:
    """Rank of each within its cell, the fastest growing first."""
    order = np.lexsort((-growth, cells))
    sorted_cells = cells[order]
    begins = np.searchsorted(sorted_cells, sorted_cells)
    out = np.empty(len(cells), int)
    out[order] = np.arange(len(cells)) - begins
    return out


def _entered(
    found: Refined, kept: np.ndarray, cells: np.ndarray, rows: list[list[complex]], vectors: dict
) -> np.ndarray:
    """Put those kept among the eigenvalues and vectors of their cells; which of all were new there."""
    new = np.zeros(len(cells), bool)
    for j in np.flatnonzero(kept):
        i, value = cells[j], complex(found.values[j])
        if _joined(rows[i], value):
            vectors[i, value] = found.right[j], found.left[j]
            new[j] = True
    return new


def _joined(row: list[complex], value: complex) -> bool:
    """Put an eigenvalue among others of its cell, conjugates counting once; False if it was there before."""
    value = complex(value.real, abs(value.imag))
    if any(abs(value - other) <= SAME * abs(other) for other in row):
        return False
    row.append(value)
    return True
