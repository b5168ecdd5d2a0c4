"""Following modes along a parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from .factor import Workspace
from .operator import CoupledPencil
from .pairs import coupling_of_modes
from .search import leading_modes
from .spectrum import SearchOptions, Spectrum


@dataclass(frozen=True)
class TrackOptions:
    """Options of `track`.

    Attributes
    ----------
    count : int
        Leading modes reported at every value.
    margin : int
        Further modes computed, so that a mode does not get lost when its rank changes.
    search : SearchOptions
        Left vectors are always computed.
    least_confidence : float
        A step is halved while a match is less certain than this.
    max_halvings : int
    """

    count: int = 6
    margin: int = 4
    search: SearchOptions = field(default_factory=SearchOptions)
    least_confidence: float = 0.8
    max_halvings: int = 6

    def __post_init__(self):
        if self.count < 1 or self.margin < 0 or self.max_halvings < 0:
            raise ValueError("count must be positive, margin and max_halvings not negative.")
        if not 0 < self.least_confidence < 1:
            raise ValueError("least_confidence must lie between 0 and 1.")


@dataclass(frozen=True)
class Branches:
    """Eigenvalues along a parameter, one row a branch.

    Attributes
    ----------
    ids : ndarray of int, shape (k,)
    values : ndarray, shape (p,)
        The parameter.
    eigenvalues : ndarray, shape (k, p)
        NaN where the mode was not among those computed. The conjugate of an oscillatory branch
        is not listed; of two real branches that merge into a pair one carries on with the
        positive, one with the negative imaginary part.
    confidence : ndarray, shape (k, p)
        0..1, of the match with the value before, the least over the steps taken; 1 at the start
        of a branch.
    solves : int
        Spectra computed.
    """

    ids: np.ndarray
    values: np.ndarray
    eigenvalues: np.ndarray
    confidence: np.ndarray
    solves: int

    def __repr__(self) -> str:
        sure = f"confidence at least {np.nanmin(self.confidence):.2g}" if self.confidence.size else "none followed"
        return f"<Branches: {len(self.ids)} eigenvalues over {len(self.values)} values, {sure}, {self.solves} spectra>"

    @property
    def growth_rate(self) -> np.ndarray:
        """1/s, shape (k, p)."""
        return self.eigenvalues.real

    @property
    def frequency(self) -> np.ndarray:
        """Hz, not negative, shape (k, p)."""
        return np.abs(self.eigenvalues.imag) / (2 * np.pi)


@dataclass(frozen=True)
class _State:
    """All eigenvalues computed at one parameter, conjugates apart."""

    pencil: CoupledPencil
    values: np.ndarray
    q: np.ndarray
    u: np.ndarray
    w: np.ndarray
    W: np.ndarray
    leading: np.ndarray

    @staticmethod
    def of(pencil: CoupledPencil, spectrum: Spectrum, count: int) -> _State:
        pair = np.flatnonzero(spectrum.eigenvalues.imag > 0)
        rank = np.arange(len(spectrum))
        own = spectrum.eigenvalues, spectrum.q, spectrum.u, spectrum.left_q, spectrum.left_u
        both = (np.concatenate([a, a[..., pair].conj()], axis=-1) for a in own)
        return _State(pencil, *both, np.concatenate([rank, rank[pair]]) < count)


def track(
    pencil_at: Callable[[float], CoupledPencil],
    values,
    options: TrackOptions | None = None,
    *,
    solver: Callable[[CoupledPencil], Spectrum] | None = None,
    observer: Callable[[float, int], None] | None = None,
) -> Branches:
    """Follow the leading modes along a parameter.

    From one value to the next a mode is predicted by a Newton step on the new pencil (its first
    derivative), and matched by the product |w_i^H T[l_i, l_j] x_j| |w_j^H T[l_j, l_i] x_i| of
    left and right vectors of either side, which is one for the same mode and zero for another.
    Where a match is doubtful the step is halved. Two real modes and the pair they merge
    into are compared as planes.

    Parameters
    ----------
    pencil_at : callable
        Pencil at a parameter value.
    values : sequence of float
    options : TrackOptions, optional
    solver : callable, optional
        Spectrum with left vectors of a pencil; default `leading_modes`.
    observer : callable, optional
        Called as observer(value, solves) after each value.

    Returns
    -------
    Branches
    """
    options = options or TrackOptions()
    values = np.asarray(values, float)
    if solver is None:
        solver = _default_solver(options)
    follower = _Follower(pencil_at, solver, options)
    for value in values:
        follower.advance(float(value))
        if observer is not None:
            observer(float(value), follower.solves)
    return follower.branches(values)


def _default_solver(options):
    workspace = Workspace()
    search = replace(options.search, left=True)
    number = options.count + options.margin
    return lambda pencil: leading_modes(pencil, number, search, workspace=workspace)


class _Follower:
    def __init__(self, pencil_at, solver, options):
        self.pencil_at, self.solver, self.options = pencil_at, solver, options
        self.solves = 0
        self.state: _State | None = None
        self.parameter = 0.0
        self.ids = np.zeros(0, int)
        self.next_id = 0
        self.history: list[dict[int, tuple[complex, float, bool]]] = []

    def _solve(self, value):
        pencil = self.pencil_at(value)
        self.solves += 1
        return _State.of(pencil, self.solver(pencil), self.options.count)

    def _fresh(self, number):
        self.next_id += number
        return np.arange(self.next_id - number, self.next_id)

    def advance(self, value):
        if self.state is None:
            self.state, self.parameter = self._solve(value), value
            self.ids = self._fresh(self.state.values.size)
            confidence = np.ones(self.ids.size)
        else:
            start = {int(i): 1.0 for i in self.ids}
            least = self._step(value, self.options.max_halvings, self._solve(value), start)
            confidence = np.array([least.get(int(i), 1.0) for i in self.ids])
        self.history.append(
            {
                int(i): (complex(v), float(c), bool(l))
                for i, v, c, l in zip(self.ids, self.state.values, confidence, self.state.leading)
            }
        )

    def _step(self, value, halvings, target, least):
        """Match the current state with the one at `value`, over halved steps where in doubt."""
        pairs, confidence = match(self.state, target)
        doubtful = [
            i for i, c in zip(pairs[0], confidence) if c < self.options.least_confidence and self.state.leading[i]
        ]
        lost = np.setdiff1d(np.flatnonzero(self.state.leading), pairs[0])
        if halvings and (doubtful or lost.size):
            middle = 0.5 * (self.parameter + value)
            least = self._step(middle, halvings - 1, self._solve(middle), least)
            return self._step(value, halvings - 1, target, least)
        ids = np.full(target.values.size, -1)
        ids[pairs[1]] = self.ids[pairs[0]]
        new = ids < 0
        ids[new] = self._fresh(int(new.sum()))
        least = dict(least)
        for i, c in zip(pairs[0], confidence):
            key = int(self.ids[i])
            least[key] = min(least.get(key, 1.0), float(c))
        self.state, self.parameter, self.ids = target, value, ids
        return least

    def branches(self, values) -> Branches:
        rows, ids = [], []
        for i in range(self.next_id):
            seen = [h.get(i) for h in self.history]
            known = [s for s in seen if s is not None]
            if not any(s[2] for s in known):
                continue  # never among the leading ones
            if all(s[0].imag < 0 for s in known):
                continue  # the conjugate of a branch listed
            rows.append([(s[0], s[1]) if s else (np.nan, np.nan) for s in seen])
            ids.append(i)
        table = np.array(rows, complex).reshape(len(rows), len(values), 2)
        return Branches(np.array(ids, int), values, table[..., 0], table[..., 1].real, self.solves)


def match(first: _State, second: _State):
    """One-to-one match of the eigenvalues of two states.

    Returns
    -------
    (i, j), confidence
        Indices into both, and 0..1 for each pair.
    """
    forward = coupling_of_modes(first.pencil, first.values, first.w, first.W, second.values, second.q, second.u)
    backward = coupling_of_modes(second.pencil, second.values, second.w, second.W, first.values, first.q, first.u)
    alike = np.minimum(np.abs(forward * backward.T), 1.0)
    alike = np.where(np.isfinite(alike), alike, 0.0)
    predicted = _predict(first, second.pencil)
    reach = 0.05 * np.abs(first.values) + 2 * np.abs(predicted - first.values)
    reach = np.where(reach > 0, reach, 1.0)
    far = np.minimum(np.abs(second.values - predicted[:, None]) / reach[:, None], 1.0)
    rows, cols = linear_sum_assignment((1.0 - alike) + 0.3 * far)
    confidence = alike[rows, cols].copy()
    for k, (i, j) in enumerate(zip(rows, cols)):
        other = np.delete(alike[i], j)
        rival = other.max(initial=0.0)
        confidence[k] *= 1.0 - min(1.0, rival / max(alike[i, j], 1e-300)) ** 2
    confidence = _merged_planes(first, second, rows, cols, forward, backward, confidence)
    keep = (confidence > 0.02) | (far[rows, cols] < 0.2)
    return (rows[keep], cols[keep]), confidence[keep]


def _merged_planes(first, second, rows, cols, forward, backward, confidence):
    """Confidence where two real modes become a pair or a pair splits: compare the planes."""
    confidence = confidence.copy()
    for a, (i, j) in enumerate(zip(rows, cols)):
        real_before, real_after = first.values[i].imag == 0, second.values[j].imag == 0
        if real_before == real_after:
            continue
        for b in range(a + 1, len(rows)):
            k, l = rows[b], cols[b]
            pair = second.values[[j, l]] if real_before else first.values[[i, k]]
            others = first.values[[i, k]] if real_before else second.values[[j, l]]
            if abs(pair[0] - pair[1].conj()) > 1e-12 * abs(pair[0]) or (others.imag != 0).any():
                continue
            there = forward[np.ix_([i, k], [j, l])]
            back = backward[np.ix_([j, l], [i, k])]
            plane = min(1.0, float(np.sqrt(abs(np.linalg.det(there @ back)))))
            confidence[a] = max(confidence[a], plane)
            confidence[b] = max(confidence[b], plane)
    return confidence


def _predict(state: _State, pencil: CoupledPencil) -> np.ndarray:
    """l - w^H T_new(l) x, a Newton step on the new pencil (w^H T' x = 1)."""
    f, g = pencil.apply(state.values, state.q, state.u)
    move = np.sum(state.w.conj() * f, axis=0) + np.sum(state.W.conj() * g, axis=0)
    return np.where(np.isfinite(move), state.values - move, state.values)
