r"""Leading eigenvalues of reduced pencils of viscoelastic walls, for many conditions at once.

The exact linear form is several times as large as the pencil. Instead a real quadratic surrogate, :math:`\varphi_g(s)
\approx a_g + b_g s` matched at a typical frequency, gives places to start from, and two-sided Rayleigh quotient
iteration (Ruhe 1973; Schreiber 2008) takes them to eigenvalues of the rational problem, all cells at once. Real
eigenvalues near zero or right of it, which the surrogate may miss because it is too stiff there, are bracketed by the
sign of the determinant. Cells in which two starts met are solved by the exact linear form.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la

from .count import middle
from .operator import OVERDAMPED, Condition
from .reduced_counts import relative

#: Pairs of a cell and a place evaluated at once, so that they stay in the processor's cache.
CHUNK = 128
#: Steps of an iteration at most.
STEPS = 12
#: Steps for a scalar Rayleigh quotient.
SCALAR = 6
#: Relative change at which an iteration ends; its error falls with the third power.
SETTLED = 1e-5
#: Relative distance below which two eigenvalues are one.
SAME = 1e-7
#: Relative distance an eigenvalue may lie from its start.
REACH = 0.6
#: Places on the real axis at which the sign of the determinant is looked at, and halvings between two of them.
REAL, HALVINGS = 12, 45


@dataclass(frozen=True, eq=False)
class RationalCells:
    r"""Pencils :math:`\sum_i c_i(s) B_i + \sum_g \varphi_g(s) K_g`.

    The c_i are 1, s and s^2 of the structure, and 1, z and z^2 of a coupling with z = s sqrt(inertia).

    Attributes
    ----------
    bases : list of (6 + g, n, n) real arrays
        K, M, D, the three parts of a coupling in its powers of z, and the K_g, all of them bordered to one order.
    law : (cells,) int array
        Which of the bases.
    given : (cells, 3) array
        Root of the inertia, alpha, beta.
    strengths : (cells, g, j) array
    times : (j,) array
    """

    bases: list[np.ndarray]
    law: np.ndarray
    given: np.ndarray
    strengths: np.ndarray
    times: np.ndarray

    @property
    def size(self) -> int:
        """Order n of each pencil."""
        return self.bases[0].shape[1]

    @property
    def number(self) -> int:
        """Number of cells."""
        return len(self.law)

    def factors(self, cells: np.ndarray, s: np.ndarray) -> np.ndarray:
        """phi_g(s) of pairs of a cell and a place, (p, g)."""
        x = s[:, None] * self.times
        return np.einsum("pgj,pj->pg", self.strengths[cells], x / (1.0 + x))

    def slopes(self, cells: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Derivatives of the factors, (p, g)."""
        return np.einsum("pgj,pj->pg", self.strengths[cells], self.times / (1.0 + s[:, None] * self.times) ** 2)

    def weights(self, cells: np.ndarray, s: np.ndarray, factors: np.ndarray | None = None) -> np.ndarray:
        """Factors by which the bases are multiplied in T(s), (p, 6 + g); with other factors phi_g where given."""
        root, alpha, beta = self.given[cells].T
        factors = self.factors(cells, s) if factors is None else factors
        z = s * root
        return np.column_stack([np.ones_like(s), s * (s + alpha), s * beta, np.ones_like(s), z, z * z, factors])

    def weight_slopes(self, cells: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Factors in T'(s)."""
        root, alpha, beta = self.given[cells].T
        zero = np.zeros_like(s)
        return np.column_stack(
            [zero, 2 * s + alpha, beta + zero, zero, root + zero, 2 * s * root**2, self.slopes(cells, s)]
        )

    def combined(self, cells: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Sums of the bases with weights, (p, n, n); real for real weights."""
        n = self.size
        out = np.empty((len(cells), n, n), weights.dtype)
        for law in np.unique(self.law[cells]):
            mine = self.law[cells] == law
            flat = self.bases[law].reshape(weights.shape[1], -1)
            if np.iscomplexobj(weights):
                # one product of real matrices, whose columns are real and imaginary parts
                both = np.ascontiguousarray(weights[mine]).view(float).reshape(-1, weights.shape[1], 2)
                out[mine] = np.matmul(flat.T, both).view(complex).reshape(-1, n, n)
            else:
                out[mine] = (weights[mine] @ flat).reshape(-1, n, n)
        return out

    def at(self, cells: np.ndarray, s: np.ndarray, factors: np.ndarray | None = None) -> np.ndarray:
        """T(s) of pairs of a cell and a place, (p, n, n); with other factors phi_g where given."""
        return self.combined(cells, self.weights(cells, s, factors))

    def slope(self, cells: np.ndarray, s: np.ndarray) -> np.ndarray:
        """T'(s), (p, n, n)."""
        return self.combined(cells, self.weight_slopes(cells, s))

    def signs(self, cells: np.ndarray, s: np.ndarray) -> np.ndarray:
        """Sign of det T at real places."""
        found = np.empty(len(cells))
        for i in range(0, len(cells), CHUNK):
            some = slice(i, i + CHUNK)
            found[some] = np.linalg.slogdet(self.at(cells[some], s[some]))[0]
        return found


@dataclass(frozen=True)
class Refined:
    """Eigenvalues (p,) with right and left vectors (p, n), and whether the iteration settled near its start."""

    values: np.ndarray
    right: np.ndarray
    left: np.ndarray
    settled: np.ndarray | None

    def __getitem__(self, some) -> Refined:
        settled = None if self.settled is None else self.settled[some]
        return Refined(self.values[some], self.right[some], self.left[some], settled)


@dataclass(frozen=True)
class Surrogate:
    """Real quadratic stand-in phi_g(s) ~ a_g + b_g s of each cell, (cells, g) each."""

    level: np.ndarray
    slope: np.ndarray

    @classmethod
    def at(cls, problem: RationalCells, frequency: float) -> Surrogate:
        """Matched at an angular frequency, rad/s."""
        cells = np.arange(len(problem.strengths))
        factors = problem.factors(cells, np.full(len(cells), 1j * frequency))
        return cls(factors.real, factors.imag / frequency)


def started(problem: RationalCells, surrogate: Surrogate | None, cells, values, steps: int = 1) -> Refined:
    """Eigenvectors of surrogates, or of the pencils themselves without one, and their rational Rayleigh quotients.

    Parameters
    ----------
    problem : RationalCells
    surrogate : Surrogate or None
    cells : (p,) int array
    values : (p,) complex array
        Eigenvalues of the surrogates, or of the pencils.
    steps : int
        Inverse iterations; more than one where values are only near those of the pencils.
    """
    cells, values = np.asarray(cells, int), np.asarray(values, complex)
    n = problem.size
    # without a preferred direction, and the same for every cell
    probe = np.random.default_rng(7).standard_normal((2, n)) + 0j
    out = Refined(values.copy(), np.empty((len(values), n), complex), np.empty((len(values), n), complex), None)
    for first in range(0, len(values), CHUNK):
        some = slice(first, first + CHUNK)
        i, s = cells[some], values[some] * (1.0 + 1e-7)
        factors = None if surrogate is None else surrogate.level[i] + surrogate.slope[i] * s[:, None]
        matrix = problem.at(i, s, factors)
        found = _solved_both(matrix, *(np.broadcast_to(own, (len(i), n)) for own in probe))
        for _ in range(steps - 1):
            found = _solved_both(matrix, *_images(problem.slope(i, s), *found))
        x, y = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in found)
        out.right[some], out.left[some] = x, y
        out.values[some] = _quotient(problem, i, values[some], x, y)
    return out


def _quotient(problem: RationalCells, cells, s, x, y) -> np.ndarray:
    """Zero of y^H T(s) x near s."""
    projected = np.empty((len(cells), len(problem.bases[0])), complex)
    for law in np.unique(problem.law[cells]):
        mine = problem.law[cells] == law
        for i, basis in enumerate(problem.bases[law]):
            projected[mine, i] = ((y[mine].conj() @ basis) * x[mine]).sum(axis=1)
    for _ in range(SCALAR):
        value = (problem.weights(cells, s) * projected).sum(axis=1)
        slope = (problem.weight_slopes(cells, s) * projected).sum(axis=1)
        with np.errstate(all="ignore"):
            change = value / slope
        s = s - np.where(np.isfinite(change) & (np.abs(change) < REACH * np.abs(s)), change, 0.0)
    return s


def refined(problem: RationalCells, cells, start: Refined) -> Refined:
    """Eigenpairs near those to start from.

    Parameters
    ----------
    problem : RationalCells
    cells : (p,) int array
    start : Refined
    """
    cells = np.asarray(cells, int)
    found = Refined(start.values.copy(), start.right.copy(), start.left.copy(), np.zeros(len(cells), bool))
    for first in range(0, len(cells), CHUNK):
        active = np.arange(first, min(first + CHUNK, len(cells)))
        for _ in range(STEPS):
            if not active.size:
                break
            active = active[~_stepped(problem, cells, found, active)]
    near = np.abs(found.values - start.values) <= REACH * np.abs(start.values) + 1e-300
    return Refined(found.values, found.right, found.left, found.settled & near)


def _stepped(problem: RationalCells, cells, found: Refined, active) -> np.ndarray:
    """One step of the iterations that are still going; which of them have ended."""
    s = found.values[active]
    s = np.where(np.abs(s) > 0, s, 1e-12)
    matrix, slope = problem.at(cells[active], s), problem.slope(cells[active], s)
    right, left = _images(slope, found.right[active], found.left[active])
    try:
        x, y = _solved_both(matrix, right, left)
    except np.linalg.LinAlgError:  # an exact eigenvalue: a little beside it
        found.values[active] = s * (1.0 + 1e-10)
        return np.zeros(len(active), bool)
    size = np.linalg.norm(x, axis=1, keepdims=True)
    x, right, y = x / size, right / size, y / np.linalg.norm(y, axis=1, keepdims=True)
    moved = np.matmul(slope, x[..., None])[..., 0]
    with np.errstate(all="ignore"):
        change = (y.conj() * right).sum(axis=1) / (y.conj() * moved).sum(axis=1)
    lost = ~np.isfinite(change)
    change[lost] = 0.0
    found.values[active] = s - change
    found.right[active], found.left[active] = x, y
    done = ~lost & (np.abs(change) <= SETTLED * np.abs(s))
    found.settled[active] = done
    return done | lost


def _images(matrices: np.ndarray, right: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """T right and T^H left of matrices (p, n, n); vectors are (p, n)."""
    return np.matmul(matrices, right[..., None])[..., 0], np.matmul(left.conj()[:, None], matrices)[:, 0].conj()


def _solved_both(matrices: np.ndarray, right: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """T^-1 right and T^-H left of complex matrices (p, n, n), each factored once; vectors are (p, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        If one is singular.
    """
    factor, solve = la.get_lapack_funcs(("getrf", "getrs"), dtype=complex)
    x, y = np.empty(right.shape, complex), np.empty(left.shape, complex)
    for i, matrix in enumerate(matrices):
        lu, pivots, singular = factor(matrix)
        if singular:
            raise np.linalg.LinAlgError("A pencil is singular at the place.")
        x[i], y[i] = solve(lu, pivots, right[i])[0], solve(lu, pivots, left[i], trans=2)[0]
    return x, y


def real_roots(problem: RationalCells, low: np.ndarray, top: float) -> tuple[np.ndarray, np.ndarray]:
    """Real eigenvalues between `low` and `top`: cells and values.

    They are looked for where the determinant has other signs at the two ends; of an even number of them only those
    that the surrogate shows are known, and an independent count sees the others.

    Parameters
    ----------
    low : (cells,) array
        Of each cell, not positive: the edge of its own creep.
    top : float
        Positive.
    """
    every = np.arange(problem.number)
    odd = np.flatnonzero(problem.signs(every, low) * problem.signs(every, np.full(problem.number, top)) < 0)
    slowest = 1.0 / problem.times.max()
    below = low[odd, None] * [1.0, 0.1]
    above = np.concatenate([[0.0], np.geomspace(0.1 * slowest, top, REAL)])
    grid = np.hstack([below, np.broadcast_to(above, (len(odd), len(above)))])
    signs = problem.signs(np.repeat(odd, grid.shape[1]), grid.ravel()).reshape(grid.shape)
    rows, gaps = np.nonzero(signs[:, :-1] * signs[:, 1:] < 0)
    a, b, sign, rows = grid[rows, gaps], grid[rows, gaps + 1], signs[rows, gaps], odd[rows]
    for _ in range(HALVINGS if rows.size else 0):
        place = middle(a, b)
        same = problem.signs(rows, place) == sign
        a, b = np.where(same, place, a), np.where(same, b, place)
    return rows, 0.5 * (a + b)


def bordered(parts: Mapping[str, np.ndarray]) -> np.ndarray:
    """[-A, -B; R, S] of the parts of a coupling, for each power of the scaled eigenvalue, (3, k + b, k + b)."""
    k, b = len(parts["A0"]), len(parts["S0"])
    out = np.zeros((3, k + b, k + b))
    for power in range(3):
        out[power, :k, :k], out[power, k:, :k] = -parts[f"A{power}"], parts[f"R{power}"]
        if power < 2:
            out[power, :k, k:], out[power, k:, k:] = -parts[f"B{power}"], parts[f"S{power}"]
    return out


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
        rows = self._each(conditions)
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
        rows = self._each(conditions)
        return [self.pairs(c, chosen(c, np.array(row, complex))) for c, row in zip(conditions, rows)]

    def _each(self, conditions: list[Condition]) -> list[list[complex]]:
        """Leading eigenvalues of each cell in the upper half-plane."""
        problem = self.problem(conditions)
        rows: list[list[complex]] = [[] for _ in conditions]
        doubtful = np.zeros(len(conditions), bool)
        cells, start = self._starts(conditions, problem)
        place = _places(cells, start.values.real)  # rank in its cell, by growth rate
        first, wanted = 0, np.ones(len(conditions), bool)
        while wanted.any():
            taken = np.flatnonzero((place >= first) & (place < first + TAKEN) & wanted[cells])
            if not taken.size:
                break
            found = refined(problem, cells[taken], start[taken])
            new = [ok and _joined(rows[i], v) for i, v, ok in zip(cells[taken], found.values, found.settled)]
            lost = taken[~np.array(new, bool)]
            for i, growth in zip(cells[lost], start.values[lost].real):
                watched = sorted((v.real for v in rows[i]), reverse=True)[:WATCHED]
                doubtful[i] |= len(watched) < WATCHED or growth > watched[-1]
            # one after another as long as all that were found are unstable
            wanted = np.array([bool(row) and min(v.real for v in row) > 0 for row in rows])
            first += TAKEN
        edges = np.array([self.reduced.family.reach(c).creep for c in conditions])
        for i, value in zip(*real_roots(problem, edges, self._top)):
            _joined(rows[i], value)
        for i in np.flatnonzero(doubtful):
            # modes of a doubtful cell go on in the next one
            row = self._followed(problem, i, rows[i - 1], rows[i]) if i and doubtful[i - 1] else None
            rows[i] = list(self._exactly(conditions[i])) if row is None else row
        return rows

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
        if not (found.settled.all() and all(_joined(row, value) for value in found.values)):
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


def _joined(row: list[complex], value: complex) -> bool:
    """Put an eigenvalue among others of its cell, conjugates counting once; False if it was there before."""
    value = complex(value.real, abs(value.imag))
    if any(abs(value - other) <= SAME * abs(other) for other in row):
        return False
    row.append(value)
    return True
