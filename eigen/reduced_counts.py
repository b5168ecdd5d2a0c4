r"""Counts of unstable eigenvalues of a reduced family by the argument principle, for many conditions at once.

The response h(s) = J (s^2 M + s C + K)^-1 G of the structure is condensed to the few patterns of motion and force that
matter; then

    d(s) = det [ I - h A, -h B ; R, S ]

is analytic right of the imaginary axis apart from unstable poles of the structure itself, and grows like a power of s,
the number of inner unknowns with a rate; with several it is divided by a stable polynomial of the fluid alone. Its
phase along the imaginary axis is followed for every condition, with points added where it turns fast. No eigenvalue of
the coupled pencil is used except as a hint where to look.

A structure that does not relax is known by its poles. For one that does they are too many: h(i omega) is solved for at
frequencies that neighbouring cells share, and its phase is put relative to that of oscillators that relax alike, one
for each mode. All their numbers are positive, so they are passive and have no zero right of the axis, and the zeros of
the structure itself are counted along. Far above its lower modes, where a coupling hardly changes the phase, what the
structure itself turns it by is followed once for all cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as la

from .count import unstable_count
from .determinant import LARGEST_STEP, LATE, Oscillators, grid, middle, principal, solved, thinned, wide
from .operator import Condition, FluidMotions, PencilFamily

#: Patterns of motion and force weaker than this are left out.
PATTERNS = 1e-5
#: Multiples of the lowest frequency at which patterns of the response are taken.
SAMPLED = (0.0, 0.9, 2.0, 5.0, 20.0, 100.0, 1e3)
#: Lowest frequencies of a structure that relaxes which every walk looks at.
BESIDE = 30
#: Decay over angular frequency up to which a structure answers fast beside a frequency of its own.
NEAR = 0.2
#: Distance of places beside them, over their decay rates: the phase turns by less than a radian over that.
APART = 1.0
#: Frequency, over the highest of these, up to which the structure's own phase is followed in every cell.
EDGE = 1.1
#: Halvings in which the phase of a structure is followed, and places at most.
HALVINGS, MOST = 40, 2000
#: Decay over angular frequency below which zeros are too narrow to be met by chance.
LIGHT = 0.03
#: Share of the largest stiffness that the reference has at least.
SOFTEST = 1e-9
#: Negative eigenvalues that rounding leaves of a positive matrix, over its largest.
ROUNDING = 1e-10
#: Responses kept of a reduced family.
KEPT = 8


class Response:
    """h(s) of a reduced family at one damping, condensed to the patterns that matter.

    Parameters
    ----------
    reduced : Any
    alpha, beta : float

    Attributes
    ----------
    P, Q : (m, r) arrays
        Patterns of motion and of force.
    scale, top : float
        Lowest angular frequency of the structure and one beyond its highest, rad/s.
    beside : array
        Frequencies at which the structure answers fast.
    unstable : int
        Unstable poles of the structure that the phase does not count.
    turned : float
        Angle, rad, by which the phase turns beyond the frequencies that are followed for each cell.
    certain : bool
        Whether that is known.
    """

    turned, certain = 0.0, True

    def __init__(self, reduced: Any, alpha: float, beta: float):
        k = reduced.size
        damping = alpha * reduced.M + beta * reduced.D
        form = np.zeros((2 * k, 2 * k))
        form[:k, k:] = np.eye(k)
        form[k:] = -np.linalg.solve(reduced.M, np.hstack([reduced.K, damping]))
        self.poles, right = la.eig(form)
        left = np.linalg.solve(
            right, np.vstack([np.zeros_like(reduced.G), np.linalg.solve(reduced.M, reduced.G)]).astype(complex)
        )
        self._out, self._in = reduced.J @ right[:k], left
        self.unstable = int(np.sum(self.poles.real > 0))
        scale = self.scale = float(np.abs(self.poles[np.abs(self.poles.imag) > 0]).min(initial=np.inf))
        if not np.isfinite(scale):
            scale = self.scale = float(np.abs(self.poles).min())
        self.P, self.Q = _both_patterns([self._full(1j * scale * f) for f in SAMPLED])
        near = self.poles[(self.poles.imag > 0) & (np.abs(self.poles.real) < NEAR * self.poles.imag)]
        self.beside = near.imag
        self.top = 30.0 * float(np.abs(self.poles).max())
        self._left, self._right = self.P.T @ self._out, self._in @ self.Q

    def _full(self, s: complex) -> np.ndarray:
        return (self._out / (s - self.poles)) @ self._in

    def __call__(self, omega: np.ndarray) -> np.ndarray:
        """h(i omega), (len(omega), r, r)."""
        weight = 1.0 / (1j * np.asarray(omega)[:, None] - self.poles)
        return (self._left[None] * weight[:, None, :]) @ self._right

    def inverse(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inverses of h(i omega), and the phases of its determinants."""
        h = self(omega)
        return np.linalg.inv(h), np.angle(np.linalg.slogdet(h)[0])


class RelaxingResponse:
    """Response of a structure that relaxes; phases are those relative to a passive structure, see the module.

    Parameters
    ----------
    reduced : Any
    alpha, beta, loss : float
    """

    unstable = 0

    def __init__(self, reduced: Any, alpha: float, beta: float, loss: float):
        parts = np.stack([reduced.K, reduced.M, alpha * reduced.M + beta * reduced.D, *reduced.relaxing])
        self._shape, self._flat = reduced.K.shape, parts.reshape(len(parts), -1)
        self._relaxation = reduced.family.relaxation(loss)
        reference = reduced.reference
        damping = alpha * reduced.M + beta * reference.damping
        self._oscillators = Oscillators.of(
            reduced.M, damping, reference.stiffness, reference.relaxing, self._relaxation
        )
        self._known: dict[float, tuple[np.ndarray, float]] = {}
        frequencies = reference.frequencies
        self.scale = float(frequencies[0])
        zeros = self._oscillators.zeros(self._relaxation)
        near = zeros[np.abs(zeros.real) < NEAR * zeros.imag]
        near = near[np.argsort(near.imag)]
        near, high = near[:BESIDE], near[BESIDE:]
        self._edge = EDGE * float(max(near.imag.max(initial=0.0), self.scale))
        self.beside = np.array(thinned(near.imag, np.abs(near.real), APART))
        stiffest = frequencies[-1] * np.sqrt(1.0 + self._relaxation.strengths.sum(axis=1).max(initial=0.0))
        self.top = 30.0 * float(max(stiffest, beta * stiffest**2, alpha))
        motion, force = reduced.J.astype(complex), reduced.G.astype(complex)
        omega = self.scale * np.array(SAMPLED)
        self.P, self.Q = _both_patterns(motion @ solved(self._at(omega), force)[0])
        self._out, self._in = self.P.T @ motion, force @ self.Q
        # what is passive but for the load that follows it turns its phase nowhere up there
        narrow = high[(np.abs(high.real) < LIGHT * high.imag) & (not reference.is_own)]
        self._phase_there, self.turned, self.certain = self._beyond(narrow)

    def _beyond(self, zeros: np.ndarray) -> tuple[float, float, bool]:
        """Phase of the structure at the edge, its turn from there on, and whether that could be followed; looks at
        zeros of the passive structure.
        """
        omega, phase = np.zeros(0), np.zeros(0)
        places = np.array([self._edge, *(w for w in grid(self.scale, self.top, zeros.imag) if w > self._edge)])
        for _ in range(HALVINGS):
            omega, first = np.unique(np.concatenate([omega, places]), return_index=True)
            phase = np.concatenate([phase, self._own(places)])[first]
            far = wide(omega, phase)
            if not far.size or omega.size > MOST:
                break
            places = middle(omega[far], omega[far + 1])
        steps, gap = principal(np.diff(phase)), float(principal(phase[-1]))  # far up both are all inertia
        return phase[0], float(steps.sum()) - gap, bool(np.abs(steps).max() <= LARGEST_STEP + 1e-9 and abs(gap) < LATE)

    def _own(self, omega: np.ndarray) -> np.ndarray:
        """Phase of the structure's determinant over that of the oscillators."""
        return solved(self._at(omega), np.zeros((self._shape[0], 0)))[1].imag - self._passive(omega)

    def _passive(self, omega: np.ndarray) -> np.ndarray:
        """Phase of the oscillators."""
        return np.angle(self._oscillators.values(self._relaxation, 1j * omega)).sum(axis=1)

    def _at(self, omega: np.ndarray) -> np.ndarray:
        """Dynamic stiffness at i omega, (len(omega), k, k)."""
        factors = self._relaxation.factors(1j * omega).T
        even, odd = np.ones_like(omega), np.zeros_like(omega)
        real = np.column_stack([even, -(omega**2), odd, factors.real])
        imaginary = np.column_stack([odd, odd, omega, factors.imag])
        out = np.empty((len(omega), *self._shape), complex)
        # real and imaginary parts side by side, as complex numbers are kept
        both = out.view(float).reshape(len(omega), -1, 2)
        np.matmul(self._flat.T, np.stack([real, imaginary], axis=-1), out=both)
        return out

    def inverse(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Inverses of h(i omega), and the phases of its determinant times that of the structure over the reference's,
        which beyond the edge stays what it is there; kept for the next call.
        """
        new = np.array([w for w in omega if w not in self._known], float)
        if new.size:
            response, own = solved(self._at(new), self._in)
            h = self._out @ response
            relative = np.where(new < self._edge, own.imag - self._passive(new), self._phase_there)
            inverses, logarithms = solved(h, np.eye(h.shape[1]))
            self._known.update(zip(new, zip(inverses, principal(logarithms.imag + relative))))
        inverses, phases = zip(*(self._known[w] for w in omega))
        return np.array(inverses), np.array(phases)


@dataclass(frozen=True)
class Reference:
    """Positive matrices near those of a reduced family, the angular frequencies they have, and whether the symmetric
    parts of the family are positive themselves.
    """

    stiffness: np.ndarray
    damping: np.ndarray
    relaxing: np.ndarray
    frequencies: np.ndarray
    is_own: bool

    @classmethod
    def of(cls, M, K, D, relaxing) -> Reference:
        """From matrices on a space."""
        root, own = np.linalg.cholesky(M), []

        def positive(matrix, least):
            weight, turn = np.linalg.eigh(relative(matrix, root))
            largest = np.abs(weight).max(initial=0.0)
            own.append(bool((weight >= -ROUNDING * largest).all()))
            weight = np.maximum(weight, least * largest)
            turn = root @ turn
            return (turn * weight) @ turn.T, np.sqrt(weight)

        stiffness, frequencies = positive(K, SOFTEST)
        parts = np.array([positive(part, 0.0)[0] for part in relaxing]).reshape(relaxing.shape)
        return cls(stiffness, positive(D, 0.0)[0], parts, frequencies, all(own))


def relative(matrix: np.ndarray, root: np.ndarray) -> np.ndarray:
    """L^-1 sym(K) L^-T, the symmetric part of a matrix seen by a mass L L^T."""
    half = np.linalg.solve(root, 0.5 * (matrix + matrix.T))
    return np.linalg.solve(root, half.T)


def response(reduced: Any, damping: tuple[float, float, float]) -> Response | RelaxingResponse:
    """The response at one damping; the last ones are kept."""
    known = reduced.responses
    if damping not in known:
        if len(known) > KEPT:
            known.clear()
        alpha, beta, loss = damping
        relaxes = reduced.family.relaxation(loss) is not None
        known[damping] = RelaxingResponse(reduced, *damping) if relaxes else Response(reduced, alpha, beta)
    return known[damping]


def _both_patterns(responses) -> tuple[np.ndarray, np.ndarray]:
    """Patterns of motion and of force, equally many, so that h has an inverse."""
    sample = [x / np.abs(x).max() for x in responses]
    P = _patterns([part for x in sample for part in (x.real, x.imag)])
    Q = _patterns([part.T for x in sample for part in (x.real, x.imag)])
    rank = min(P.shape[1], Q.shape[1])
    return P[:, :rank], Q[:, :rank]


def _patterns(parts) -> np.ndarray:
    vectors, weight, _ = np.linalg.svd(np.hstack(parts), full_matrices=False)
    return vectors[:, weight > PATTERNS * weight[0]]


#: Determinants evaluated at once, so that they stay in the processor's cache.
CHUNK = 96
#: Share of its distance from the axis by which a place beside an eigenvalue may be moved, so that cells share it.
PLAY = 0.6
#: Distance from a whole number up to which a count is certain.
CERTAIN = 0.1


#: Share of a band up to which eigenvalues are counted, clear of those at its end.
INSIDE = 0.999


@dataclass(frozen=True)
class CellCounts:
    """Counts of unstable eigenvalues of some cells.

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
        """Counts of some cells."""
        return CellCounts(*(own[some] for own in vars(self).values()))

    def enter(self, cells: np.ndarray, found: CellCounts) -> None:
        """Put counts of some cells in."""
        for own, other in zip(vars(self).values(), vars(found).values()):
            own[cells] = other


def phase_counts(reduced: Any, conditions, hints=None, most_points: int = 400) -> CellCounts:
    """Count unstable eigenvalues at several conditions.

    Parameters
    ----------
    reduced : Any
    conditions : sequence of Condition
    hints : sequence of complex arrays, optional
        For each condition, places near which the phase may turn fast.
    most_points : int
        Per condition.
    """
    cells = len(conditions)
    number, certain = np.zeros(cells, int), np.zeros(cells, bool)
    for damping in dict.fromkeys(c.damping for c in conditions):
        members = [i for i, c in enumerate(conditions) if c.damping == damping]
        walk = _Walk(response(reduced, damping), reduced, [conditions[i] for i in members])
        walk.start([() if hints is None else hints[i] for i in members])
        walk.refine(most_points)
        number[members], certain[members] = walk.counts()
    return CellCounts(number, certain, np.zeros(cells), np.full(cells, np.inf))


class _Walk:
    """Phases along the imaginary axis for conditions of one damping, as sorted arrays per condition."""

    def __init__(self, response: Response | RelaxingResponse, reduced: Any, conditions):
        self.response, self.conditions = response, conditions
        self.root = np.sqrt([c.inertia for c in conditions])
        self._known: dict[int, tuple[dict, dict]] = {}
        self._parts = [self._condensed(reduced.family.parts(c.law)) for c in conditions]
        first = reduced.family.parts(conditions[0].law)
        self.inner = first["S0"].shape[0]
        grows = int(((first["B1"] != 0).any(axis=0) | (first["S1"] != 0).any(axis=0)).sum())
        kinds = list({id(p): p for p in self._parts}.values())
        self._kinds = [FluidMotions(p) for p in kinds]
        self._which = np.array([next(k for k, p in enumerate(kinds) if p is own) for own in self._parts])
        # what the determinants are divided by, in z = s sqrt(inertia)
        self._fluid = [kind.stable() for kind in self._kinds]
        self.order = np.array([grows - len(self._fluid[k]) for k in self._which])
        self.omega = [np.zeros(0) for _ in conditions]
        self.phase = [np.zeros(0) for _ in conditions]
        self._cut = [False] * len(conditions)
        self._laden = [_turning(reduced.laden_frequencies(c), c) for c in conditions]

    def _condensed(self, parts):
        P, Q = self.response.P, self.response.Q
        key = id(parts)
        if key not in self._known:
            made = {}
            for name, value in parts.items():
                value = Q.T @ value if name[0] in "AB" else value
                made[name] = value @ P if name[0] in "AR" else value
            self._known[key] = parts, made  # an object that lives on keeps its id
        return self._known[key][1]

    def _angles(self, cells: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Phase of d(i omega), for pairs of a cell and a frequency."""
        unique, where = np.unique(omega, return_inverse=True)
        inverse, own = self.response.inverse(unique)
        angle = own[where]
        for first in range(0, len(omega), CHUNK):
            some = slice(first, first + CHUNK)
            angle[some] += self._chunk(cells[some], omega[some], inverse[where[some]])
        return angle

    def _chunk(self, cells, omega, inverse) -> np.ndarray:
        """Phase of det [h^-1 - A, -B; R, S]."""
        z, angle = 1j * omega * self.root[cells], np.empty(len(omega))
        for which in np.unique(self._which[cells]):
            mine = self._which[cells] == which
            coupling, own = self._kinds[which].condensed(z[mine])
            angle[mine] = own.imag + np.angle(np.linalg.slogdet(inverse[mine] - coupling)[0])
            if self.inner > 1:
                angle[mine] -= np.angle(z[mine, None] - self._fluid[which]).sum(axis=1)
        return angle

    def _add(self, cells, omega):
        if not len(cells):
            return
        cells, omega = np.asarray(cells), np.asarray(omega, float)
        angles = self._angles(cells, omega)
        for i in np.unique(cells):
            mine = cells == i
            joined, first = np.unique(np.concatenate([self.omega[i], omega[mine]]), return_index=True)
            self.omega[i] = joined
            self.phase[i] = np.concatenate([self.phase[i], angles[mine]])[first]

    def start(self, hints):
        base = grid(self.response.scale, self.response.top, self.response.beside)
        cells, omega = [], []
        for i, hint in enumerate(hints):
            own = [*base, *self._laden[i]]
            for value in [*np.asarray(hint, complex), *self._own_zeros(i)]:
                width, middle = max(abs(value.real), 1e-6 * abs(value)), abs(value.imag)
                own += [
                    _shared(middle + f * width, PLAY * width)
                    for f in (-1.0, 0.0, 1.0)
                    if middle + f * width > 0.3 * width
                ]
            cells += [i] * len(own)
            omega += own
        self._add(cells, omega)

    def _own_zeros(self, cell: int) -> np.ndarray:
        """Frequencies of the fluid alone, near which phases turn fast where it has several unknowns."""
        if self.inner < 2:
            return np.zeros(0)
        zeros = self._kinds[self._which[cell]].zeros
        return zeros[zeros.imag > 0] / self.root[cell]

    def refine(self, most_points):
        # a coupling that carries much added mass reaches its limit late
        for _ in range(5):
            late = [i for i, phase in enumerate(self.phase) if abs(self._gap(i)) > LATE]
            self._add(late, [4.0 * self.omega[i][-1] for i in late])
        for _ in range(40):
            cells, places = [], []
            for i, (omega, phase) in enumerate(zip(self.omega, self.phase)):
                if self._cut[i]:
                    continue
                far = wide(omega, phase)
                if len(omega) + len(far) > most_points:
                    self._cut[i] = True
                    continue
                cells += [i] * len(far)
                places += list(middle(omega[far], omega[far + 1]))
            if not cells:
                return
            self._add(cells, places)

    def _gap(self, cell: int) -> float:
        """Distance from the limit at infinity: a multiple of pi, and a quarter turn more for each inner unknown."""
        last = self.phase[cell][-1] + self.response.turned
        return float(principal(2 * (last - 0.5 * np.pi * self.order[cell])) / 2)

    def counts(self):
        number, certain = [], []
        for i, (_omega, phase) in enumerate(zip(self.omega, self.phase)):
            steps = principal(np.diff(phase))
            turned = steps.sum()
            gap = self._gap(i)
            found = 0.5 * self.order[i] - (turned + self.response.turned - gap) / np.pi + self.response.unstable
            number.append(int(round(found)))
            certain.append(
                bool(
                    abs(found - round(found)) < CERTAIN
                    and abs(gap) < 2 * LATE
                    and np.abs(steps).max() <= LARGEST_STEP + 1e-9
                    and not self._cut[i]
                    and self.response.certain
                )
            )
        return np.array(number), np.array(certain)


def _turning(omega: np.ndarray, condition) -> list[float]:
    """Places, coarser where damping is strong, beside which the frequencies given turn the phase."""
    light = np.full(len(omega), condition.loss > 0)
    if not condition.loss:
        light = 0.5 * (condition.alpha / omega + condition.beta * omega) < NEAR
    return sorted({_shared(w, (0.03 if fast else 0.3) * w) for w, fast in zip(omega, light)})


def _shared(omega: float, play: float) -> float:
    """A frequency near one given, from a grid that neighbouring cells share, so that they share responses too."""
    step = 2.0 ** np.floor(np.log2(play))
    return float(np.round(omega / step) * step)


def counted_band(family: PencilFamily, condition: Condition) -> float:
    """Angular frequency up to which eigenvalues are counted: all where the stiffness relaxes, which damps all."""
    return family.reach(condition).band if family.relaxation(condition.loss) is None else np.inf


def uncounted(family: PencilFamily, conditions) -> CellCounts:
    """Knowledge before anything is counted."""
    cells = len(conditions)
    bands = np.array([counted_band(family, c) for c in conditions])
    band = np.where(np.isinf(bands), np.inf, INSIDE * bands / (2 * np.pi))
    return CellCounts(np.full(cells, -1), np.zeros(cells, bool), np.zeros(cells), band)


def count_unstable(reduced: Any, conditions, hints, within_band: bool = False) -> CellCounts:
    """Count unstable eigenvalues at many conditions, each in its band.

    Parameters
    ----------
    reduced : Any
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
        counts.enter(whole, found)
    for i in np.setdiff1d(np.arange(cells), whole):
        band = None if np.isinf(bands[i]) else INSIDE * bands[i] / (2 * np.pi)
        found = unstable_count(reduced.pencil(conditions[i]), scale=_scale(reduced), hints=list(hints[i]), band=band)
        counts.number[i], counts.certain[i] = found.number, found.certain
        counts.line[i], counts.band[i] = found.line, found.band
    return counts


def _beside(hints, condition: Condition):
    """Hints that a count looks beside: the leading ones, and all unstable ones where they cost nothing else."""
    number = 2 if condition.loss == 0 else max(2, int((np.asarray(hints).real > 0).sum()) + 1)
    return hints[:number]


def _scale(reduced: Any) -> float:
    """Lowest angular frequency of the structure, rad/s."""
    square = np.linalg.eigvalsh(0.5 * (reduced.K + reduced.K.T))
    return float(np.sqrt(square[square > 0].min(initial=np.inf))) if (square > 0).any() else 1.0
