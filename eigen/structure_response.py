"""The response h(i omega) = J (s^2 M + s C + K)^-1 G of the structure of a reduced family, for counts of eigenvalues.

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

from .determinant import LARGEST_STEP, LATE, Oscillators, grid, middle, principal, solved, thinned, wide

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
    """The same of a structure that relaxes; phases are those relative to a passive structure, see the module.

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
