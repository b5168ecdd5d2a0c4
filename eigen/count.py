"""Number of eigenvalues right of a line, by the argument principle on the determinant of a pencil."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from .determinant import Determinant, Structure, middle, principal, thinned
from .operator import CoupledPencil


@dataclass(frozen=True)
class CountOptions:
    """Steps by which the phase of the determinant f is followed, found by trying on valves with few and many modes."""

    #: Largest increment of the phase between neighbours, rad: far from pi, where it becomes ambiguous.
    phase: float = np.pi / 3
    size: float = 1.0  #: Largest increment of log |f|, which feels zeros beside the line.
    predicted: float = 1.5  #: Largest increment of log f that the slope at a neighbour may predict.
    apart: float = 0.4  #: Distance of two places beside zeros that relax, over the distance of the zero from the line.
    beside: tuple[int, ...] = (-10, -3, -1, 0, 1, 3, 10)  #: Places beside a hint, in its distances from the line.
    points: int = 4000  #: Points at most.


OPTIONS = CountOptions()


@dataclass(frozen=True)
class Count:
    """Eigenvalues right of a vertical line, counted without computing any.

    Attributes
    ----------
    number : int
        Conjugates counted apart.
    certain : bool
        False if the phase could not be followed everywhere; then `notes` says why.
    line : float
        Growth rate of the line, 1/s.
    band : float
        Hz, infinite if all frequencies were counted.
    distance : float
        Distance from an integer of the winding found before the limit at infinity, where the
        phase is known exactly, is put in.
    frequencies : ndarray, shape (k,)
        Points used, Hz, ascending from zero; beyond `band` they lie to the right at that frequency.
    phase : ndarray, shape (k,)
        Continuous phase there, rad.
    largest_increment : float
        Largest phase increment between neighbours, rad.
    evaluations : int
    notes : tuple of str
    """

    number: int
    certain: bool
    line: float
    band: float
    distance: float
    frequencies: np.ndarray
    phase: np.ndarray
    largest_increment: float
    evaluations: int
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        sure = "certain" if self.certain else "not certain"
        region = f"right of {self.line:.6g} 1/s up to {self.band:.6g} Hz"
        return f"<Count: {self.number} eigenvalues {region}, {sure}, {self.evaluations} evaluations>"


def unstable_count(
    pencil: CoupledPencil,
    *,
    line: float | None = None,
    band: float = np.inf,
    hints=(),
    scale: float | None = None,
    max_points: int = OPTIONS.points,
    structure: Structure | None = None,
) -> Count:
    """Count the eigenvalues with growth rate above a line by the argument principle.

    The phase of det T(line + i omega) relative to a stable structure is followed from zero
    frequency to infinity, where its limit is known. The inner unknowns of the fluid are
    kept, so it contributes no poles; what the structure alone contributes, through an
    unsymmetric stiffness or negative damping, is counted along.

    Parameters
    ----------
    pencil : CoupledPencil
        M symmetric, positive definite; treated densely. The poles of what relaxes have to lie left of the line.
    line : float, optional
        Growth rate, 1/s. Default 0; for a structure without any damping, but gyroscopic, whose
        eigenvalues may lie on the imaginary axis, a small positive value, which `Count.line` reports.
    band : float
        Hz. Count only eigenvalues up to this frequency: the path turns off to the right there.
        For structures with hardly any damping, or a pencil that is only good up to there.
    hints : iterable of complex
        Places near which the phase may turn fast (eigenvalues of structure or pencil).
        They add points, nothing else.
    scale : float, optional
        A typical angular frequency, rad/s.
    max_points : int
    structure : Structure, optional
        Of the pencil, where it is known; its line is that of the count.

    Returns
    -------
    Count

    Examples
    --------
    >>> import numpy as np
    >>> count = unstable_count(CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, -4.0])))
    >>> count.number, count.certain
    (1, True)
    """
    scale = scale or pencil.typical_frequency
    if structure is None:
        structure = Structure(pencil, counted_line(pencil, scale) if line is None else line)
    line, determinant = structure.line, Determinant(pencil, structure)
    # a zero of the pencil can hide from a coarse walk only beside a zero of the reference
    own = [line + z for z in structure.reference_zeros()]
    hints = [complex(h) for h in hints]
    if pencil.relaxation is None:
        hints, own = hints + own, []
    if pencil.b > 1:
        zeros = pencil.fluid.zeros
        hints += list(zeros[zeros.imag > 0])
    walk = _Walk(determinant, max_points, band)
    walk.start(scale, hints, own, structure.slowest)
    walk.refine()
    return walk.count()


class _Walk:
    """The phase along the line, refined until neighbours are close."""

    def __init__(self, determinant, max_points, band):
        self.f, self.max_points = determinant, max_points
        self.band = float(band)
        self.turn = 2 * np.pi * self.band
        self.values: dict[float, complex] = {}
        self.known: list[float] = []
        self.notes: list[str] = []

    def _add(self, *omegas):
        """Evaluate at places that are not known yet."""
        new: list[float] = []
        for omega in map(float, omegas):
            i = bisect_left(self.known, omega)
            if all(abs(omega - w) > 1e-12 * omega for w in self.known[max(0, i - 1) : i + 1]):
                self.known.insert(i, omega)
                new.append(omega)
        for omega, value in zip(new, self.f.at([self._place(w) for w in new])):
            if np.isfinite(value):
                self.values[omega] = complex(value)
            else:
                self.known.remove(omega)
                self._complain(f"An eigenvalue lies on the line, at {omega / (2 * np.pi):.6g} Hz.")

    def _place(self, t):
        """Up the line to the band's end, there to the right."""
        return complex(0.0, t) if t <= self.turn else complex(t - self.turn, self.turn)

    def _complain(self, sentence):
        if sentence not in self.notes:
            self.notes.append(sentence)

    def start(self, scale, hints, zeros=(), slowest=np.inf):
        self._add(0.0)
        self.smallest = 1e-9 * scale
        self.values.setdefault(0.0, 0j)  # kept as a place even where the value is lost
        steps = scale * 10.0 ** np.arange(-3, 1.01, 0.25)
        # two real zeros that grow slowly turn the phase by nothing between places far above both
        last = np.clip(np.log10(slowest / scale) - 3.0, -9.0, -3.0)
        places = [*steps, *scale * 10.0 ** np.arange(-3.5, last, -0.5)]
        widths = []
        if np.isfinite(self.turn):
            places += [self.turn, *(self.turn + steps)]
        for h, offsets in [*((h, OPTIONS.beside) for h in hints), *((h, (0,)) for h in zeros)]:
            if h.imag == 0 or abs(h.imag) > self.turn:
                continue
            width = max(abs(h.real - self.f.line), 1e-9 * abs(h))
            # on a grid, so that pencils of one structure share its responses
            step = 2.0 ** np.floor(np.log2(0.5 * width))
            beside = [step * round((abs(h.imag) + offset * width) / step) for offset in offsets]
            places += [omega for omega in beside if omega > 0]
            widths += [width for omega in beside if omega > 0]
        if self.f.pencil.relaxation is not None:
            own = len(places) - len(widths)
            places[own:] = thinned(places[own:], widths, OPTIONS.apart)
        self._add(*places[: self.max_points // 2])
        top = max(self.values)
        settled = 0
        for _ in range(40):
            top *= 10.0**0.5
            self._add(float(top))
            gap = self._tail(top)
            settled = settled + 1 if abs(gap) < 0.05 else 0
            if settled >= (3 if self.f.degree is not None else 10):
                break
        else:
            self.notes.append("The phase did not settle towards its limit at high frequency.")

    def _tail(self, top):
        """Distance of the phase from its limit; without a known limit, from a multiple of pi/2."""
        phase = self.values[top].imag
        if np.isfinite(self.turn):
            target = self.f.leading_phase if self.f.degree is not None else np.pi * round(phase / np.pi)
            return principal(target - phase)
        if self.f.degree is None:
            return (phase + np.pi / 4) % (np.pi / 2) - np.pi / 4
        return principal(self.f.leading_phase + 0.5 * np.pi * self.f.degree - phase)

    def refine(self):
        """Bisect until neither an interval nor its neighbours point to a hidden zero."""
        while True:
            omegas = np.array(sorted(self.values))
            wanted = self._suspects(omegas)
            if not wanted.size:
                return
            middles = []
            for i in wanted:
                a, b = omegas[i], omegas[i + 1]
                where = f"{b / (2 * np.pi):.6g} Hz"
                if b - a <= 1e-11 * b or b <= self.smallest:
                    self.notes.append(f"An eigenvalue lies on the line, near {where}.")
                    return
                if len(self.values) + len(middles) >= self.max_points:
                    self.notes.append(f"{self.max_points} points did not resolve the phase near {where}.")
                    return
                middles.append(float(middle(a, b)))
            self._add(*middles)
            for place in middles:
                if place not in self.values:
                    self._complain(f"The phase could not be resolved near {place / (2 * np.pi):.6g} Hz.")
                    return

    def _suspects(self, omegas):
        """Intervals to bisect.

        Besides a large increment of phase or size, a steep neighbour gives a zero away: two
        zeros, one on either side of the line, turn the phase by nothing in all.
        """
        raw = np.array([self.values[w] for w in omegas])
        steps = np.diff(raw)
        steps = steps.real + 1j * ((steps.imag + np.pi) % (2 * np.pi) - np.pi)
        length = np.diff(np.log(omegas[1:]))
        length = np.concatenate([[1.0], length])  # the first interval begins at zero
        slope = np.abs(steps) / np.maximum(length, 1e-14)
        beside = np.maximum(np.concatenate([[0.0], slope[:-1]]), np.concatenate([slope[1:], [0.0]]))
        power = self.f.power  # a growth like that hides nothing
        near = (slope > power) | (np.arange(slope.size) == 0)
        return np.flatnonzero(
            (np.abs(steps.imag) > OPTIONS.phase)
            | (near & (np.abs(steps.real) > OPTIONS.size))
            | ((beside > power) & (beside * length > OPTIONS.predicted))
        )

    def count(self) -> Count:
        omegas = np.array(sorted(self.values))
        raw = np.array([self.values[w] for w in omegas])
        steps = principal(np.diff(raw.imag))
        phase = raw[0].imag + np.concatenate([[0.0], np.cumsum(steps)])
        tail = self._tail(omegas[-1])
        # to the right of a band the path ends at the real axis, where a power has no phase
        degree = 0 if np.isfinite(self.turn) else self.f.degree
        if degree is None:
            # |f| ~ omega^degree over the last decade
            k = max(0, len(omegas) - 4)
            slope = (raw[-1].real - raw[k].real) / np.log(omegas[-1] / omegas[k])
            degree = int(round(slope))
            self.notes.append(
                "The leading coefficient at infinity vanishes; its degree was "
                f"estimated as {degree} from the growth of the determinant."
            )
            tail = 0.0
        winding = 0.5 * degree - (phase[-1] - phase[0]) / np.pi
        closed = 0.5 * degree - (phase[-1] + tail - phase[0]) / np.pi
        number = int(round(closed))
        distance = float(abs(winding - number))
        largest = float(np.abs(steps).max(initial=0.0))
        certain = not [n for n in self.notes if "estimated" not in n]
        if abs(closed - number) > 0.05 or number < 0:
            certain = False
            self.notes.append("The winding is not a whole number.")
        return Count(
            number=number,
            certain=certain,
            line=self.f.line,
            band=self.band,
            distance=distance,
            frequencies=omegas / (2 * np.pi),
            phase=phase,
            largest_increment=largest,
            evaluations=self.f.evaluations,
            notes=tuple(self.notes),
        )


def counted_line(pencil: CoupledPencil, scale: float) -> float:
    """Growth rate to count from: zero, or without any damping a small share of a typical frequency."""
    relaxes = pencil.relaxation is not None and pencil.relaxation.strengths.any()
    undamped = abs(pencil.C + pencil.C.T).max() <= 1e-12 * abs(pencil.C).max() and not relaxes
    return 1e-3 * scale if undamped else 0.0
