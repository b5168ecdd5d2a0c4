"""Periodic motions as Fourier series, and linearisations about one.

A motion x(t) of n unknowns is periodic with angular frequency omega; a system answers with its residual at N samples of
one period, and is free to use rates, and filters in time for what it remembers, see `continuation.harmonics.Rates`. It
is linearised as a sum of terms

    S_outer L_i sum_j M_ji S_j R_i dx,

with matrices at each sample i and functions S of d/dt, so that a motion exp(sigma t) dx of a perturbation needs the
functions at another argument alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Any

import numpy as np

from continuation.blocks import DenseBlocks, SparseBlocks, sum_of_products
from continuation.harmonics import Harmonics, Rates
from continuation.linear import product

#: Least size over the largest of parts that projections of terms through few numbers are sums of.
TAKEN = 1e-8

Filter = Callable[[np.ndarray], np.ndarray] | int


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic motion."""

    harmonics: Harmonics
    coefficients: np.ndarray  #: (2 H + 1, n).
    omega: float

    @classmethod
    def of_waves(cls, waves: Sequence[np.ndarray], count: int, omega: float) -> PeriodicMotion:
        """Motion of H harmonics, c_0 + 2 Re sum c_k exp(i k omega t) with the first few c_k (n,)."""
        few = Harmonics(len(waves) - 1)
        return cls(few, few.real(np.array(waves, complex)), omega).resized(count)

    @classmethod
    def of_samples(cls, samples: np.ndarray, count: int, omega: float) -> PeriodicMotion:
        """Motion of H harmonics from equally spaced samples (N, n) of a period, the end not repeated."""
        waves = np.fft.rfft(samples, axis=0)[: min(count, (len(samples) - 1) // 2) + 1] / len(samples)
        return cls.of_waves(waves, count, omega)

    @cached_property
    def samples(self) -> np.ndarray:
        """(N, n)."""
        return self.harmonics.evaluate(self.coefficients)

    @cached_property
    def rates(self) -> Rates:
        return Rates(self.harmonics, self.omega)

    @property
    def period(self) -> float:
        return 2 * np.pi / self.omega

    def at(self, phases) -> np.ndarray:
        """Values (len, n) at phases, rad."""
        return self.harmonics.basis_at(phases) @ self.coefficients

    def with_rates(self, phases) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Values, rates and second rates (len, n) at phases, rad."""
        h, basis = self.harmonics, self.harmonics.basis_at(phases)
        rate = self.omega * h.rate(self.coefficients)
        return basis @ self.coefficients, basis @ rate, basis @ (self.omega * h.rate(rate))

    def resized(self, count: int) -> PeriodicMotion:
        """Copy with another number of harmonics."""
        other = Harmonics(count)
        return PeriodicMotion(other, other.resized(self.coefficients), self.omega)

    @property
    def tail(self) -> float:
        """Share that the last two harmonics have in the motion about its mean: what a longer series would change."""
        c = self.coefficients
        whole = np.linalg.norm(c[1:])
        return float(np.linalg.norm(c[-4:] if len(c) > 5 else c[-2:]) / whole) if whole else 0.0

    def harmonics_for(self, tail: float, now: float) -> int:
        """Harmonics with which the last two are expected to have a share, by the mean decay; at least two more."""
        count = self.harmonics.count
        wanted = count * np.log(tail) / np.log(min(max(now, 1e-300), 0.5))
        return int(min(max(np.ceil(wanted), count + 2), count + max(count // 2, 2)))


@dataclass(frozen=True, eq=False)
class Term:
    """One term of a linearisation; blocks are N matrices, a `SparseBlocks`, `DenseBlocks`, one stack (N, a, b), or None
    for the identity.
    """

    middle: Sequence[tuple[Filter, Any]]  #: sequence of (filter, blocks).
    left: Any = None
    right: Any = None
    outer: Filter = 0

    @property
    def narrow(self) -> bool:
        """True where the term goes through few numbers."""
        return self.left is not None or self.right is not None

    def apply(self, samples: np.ndarray, rates: Rates) -> np.ndarray:
        """Samples (N, n) or (N, n, k) of what it makes of samples of a motion."""
        inner = _times(self.right, samples)
        total = sum(_times(blocks, rates.apply(function, inner)) for function, blocks in self.middle)
        return rates.apply(self.outer, _times(self.left, total))

    def on_series(self, motions: Sequence[np.ndarray], rates: Sequence[Rates]) -> list[np.ndarray]:
        """Coefficients (2 H + 1, n) of what it makes of those of several motions, with rates of their own."""
        h = rates[0].harmonics
        if self.narrow or not all(isinstance(blocks, SparseBlocks) for _, blocks in self.middle):
            return [h.project(self.apply(h.evaluate(one), by)) for one, by in zip(motions, rates)]
        is_complex = [np.iscomplexobj(one) or np.iscomplexobj(by.shift) for one, by in zip(motions, rates)]
        real = {}
        for function in {f for f, _ in self.middle}:
            filtered = [by.act(function, one) for one, by in zip(motions, rates)]
            real[function] = [p for x, both in zip(filtered, is_complex) for p in (_parts(x) if both else (x,))]
        found = iter(sum_of_products(h, [b for _, b in self.middle], [real[f] for f, _ in self.middle]))
        whole = [next(found) + 1j * next(found) if both else next(found) for both in is_complex]
        return [by.act(self.outer, one) for one, by in zip(whole, rates)]

    @property
    def polynomial(self) -> bool:
        """True where d/dt enters by powers up to the second."""
        used = [self.outer, *(function for function, _ in self.middle)]
        return all(isinstance(f, int) or getattr(f, "polynomial", False) for f in used)

    def reduced(self, basis: np.ndarray, known: Term | None = None, rough: bool = False) -> Term:
        """Projection on a basis (n, r), dense at each sample; `known` is that on the first columns of the basis,
        `rough` asks for what `continuation.cycle_linearisation` needs.
        """
        if not self.narrow:
            before = [None] * len(self.middle) if known is None else [blocks for _, blocks in known.middle]
            middle = [(f, _projected(blocks, basis, old, rough)) for (f, blocks), old in zip(self.middle, before)]
            return Term(middle, outer=self.outer)
        added = basis if known is None else np.ascontiguousarray(basis[:, known.right.shape[2] :])
        left = np.stack([(block.T @ added).T for block in self.left])
        right = np.stack([block @ added for block in self.right])
        if known is not None:
            left, right = np.concatenate([known.left, left], axis=1), np.concatenate([known.right, right], axis=2)
        return Term(self.middle, left, right, self.outer)

    def widened(self, rates: Rates) -> list[tuple[Filter, DenseBlocks]]:
        """Filters and blocks that a projection through few numbers comes to, with powers of d/dt of products taken by
        the rule for these; that differs by what products have in harmonics beyond those of the samples.
        """
        if not self.narrow:
            return list(self.middle)
        sums: dict[int, np.ndarray] = {}
        for power, blocks in self.middle:
            before = self.left @ blocks
            for taken in range(power + 1):
                part = comb(power, taken) * (before @ rates.apply(taken, self.right))
                sums[power - taken] = sums[power - taken] + part if power - taken in sums else part
        return [(power, DenseBlocks.of_stack(stack, tolerance=TAKEN)) for power, stack in sums.items()]


def _parts(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Real and imaginary part, each of its own memory: products with parts of a complex array are slow."""
    return np.ascontiguousarray(x.real), np.ascontiguousarray(x.imag)


def by_parts(linear_map: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    """A real linear map of an array that may be complex, whose matrices stay real."""
    if not np.iscomplexobj(x):
        return linear_map(x)
    real, imaginary = _parts(x)
    return linear_map(real) + 1j * linear_map(imaginary)


def _projected(blocks, basis: np.ndarray, known: DenseBlocks | None, rough: bool) -> DenseBlocks:
    """V^T A V of matrices A at each sample; `known` holds the part of the first columns of V."""
    if isinstance(blocks, SparseBlocks):
        return blocks.projected(basis, known, rough)
    rows = np.stack([basis.T @ block for block in blocks])
    return DenseBlocks.of_stack(rows @ basis, rows.astype(np.float32) if rough else None)


def _times(blocks, samples: np.ndarray) -> np.ndarray:
    if blocks is None:
        return samples
    if isinstance(blocks, SparseBlocks):
        return blocks.times(samples)
    if isinstance(blocks, DenseBlocks):
        blocks = blocks.stack
    if isinstance(blocks, np.ndarray):
        if samples.ndim == 2:
            return np.matmul(blocks, samples[:, :, None])[:, :, 0]
        return np.matmul(blocks, samples)
    return np.stack([product(block, x) for block, x in zip(blocks, samples)])


def peak(values: np.ndarray) -> np.ndarray:
    """Largest values of periodic signals (samples, ...), by the parabola through largest sample and neighbours."""
    top = np.asarray(np.argmax(values, axis=0))
    a, b, c = (np.take_along_axis(values, (top + k)[None] % len(values), axis=0)[0] for k in (-1, 0, 1))
    bend = a - 2 * b + c
    return np.where(bend < 0, b - 0.125 * (c - a) ** 2 / np.where(bend == 0, 1.0, bend), b)


class PeriodicOperator:
    """Linearisation about a periodic motion.

    Parameters
    ----------
    terms : sequence of Term
    coarse : sequence of Term, optional
        Terms that stand for these in projections, where some have none or a dear one.
    """

    def __init__(self, motion: PeriodicMotion, terms: Sequence[Term], coarse: Sequence[Term] | None = None):
        self.motion, self.terms = motion, tuple(terms)
        #: True where projections are those of the operator itself.
        self.exact = coarse is None
        self._coarse = self.terms if coarse is None else tuple(coarse)
        self._rates = {0.0: motion.rates}

    def rates(self, shift: complex = 0.0) -> Rates:
        """Functions of d/dt for perturbations exp(shift t); the last few are kept."""
        if shift not in self._rates:
            if len(self._rates) > 4:
                self._rates = {0.0: self.motion.rates}
            self._rates[shift] = Rates(self.motion.harmonics, self.motion.omega, shift)
        return self._rates[shift]

    def apply(self, coefficients: np.ndarray, shift: complex = 0.0) -> np.ndarray:
        """Coefficients (2 H + 1, n) of the change of the residual for those of a change exp(shift t) of the motion."""
        return self.apply_each([coefficients], [shift])[0]

    def on_samples(self, samples: np.ndarray, shift: complex) -> np.ndarray:
        """Change (N, n) of the residual for samples (N, n) of a change exp(shift t) of the motion."""
        return sum(term.apply(samples, self.rates(shift)) for term in self.terms)

    def apply_each(self, vectors: Sequence[np.ndarray], shifts: Sequence[complex]) -> list[np.ndarray]:
        """`apply` to several changes, each with an exponent of its own; cheaper than one by one."""
        h, rates = self.motion.harmonics, [self.rates(s) for s in shifts]
        parts = [
            term.on_series(vectors, rates)
            if isinstance(term, Term)
            else [h.project(term.apply(h.evaluate(one), by)) for one, by in zip(vectors, rates)]
            for term in self.terms
        ]
        return [sum(part) for part in zip(*parts)]

    def reduced(self, basis: np.ndarray, known: ReducedOperator | None = None, rough: bool = False) -> ReducedOperator:
        """Projection on a basis (n, r) at every sample; `known` is that on the first columns of the basis, `rough` asks
        for what `continuation.cycle_linearisation` needs.
        """
        before = [None] * len(self._coarse) if known is None else known.terms
        terms = [term.reduced(basis, old, rough) for term, old in zip(self._coarse, before)]
        return ReducedOperator(self.motion, terms, basis.shape[1])


class ReducedOperator(PeriodicOperator):
    """A linearisation in r unknowns, small enough to be a dense matrix.

    Parameters
    ----------
    motion : PeriodicMotion
        Of the full system.
    terms : sequence of Term
        With dense blocks; of those through few numbers filters are powers of d/dt.
    size : int
        r.
    """

    def __init__(self, motion: PeriodicMotion, terms: Sequence[Term], size: int):
        super().__init__(motion, terms)
        self.size = size
        #: True where exponents enter as powers up to the second.
        self.polynomial = all(term.polynomial for term in terms)
        #: Outer filter, inner filter and blocks of all of it.
        self.parts = [(t.outer, *some) for t in terms for some in t.widened(motion.rates)]

    @cached_property
    def between_harmonics(self) -> list[np.ndarray]:
        """Matrices by which the weights of each part act on coefficients; see `DenseBlocks`."""
        return [blocks.between_harmonics(self.motion.harmonics) for *_, blocks in self.parts]

    @cached_property
    def _all_parts(self) -> np.ndarray:
        return np.concatenate([blocks.parts.reshape(len(blocks.parts), -1) for *_, blocks in self.parts])

    def matrix(self, shift: complex = 0.0) -> np.ndarray:
        """Dense matrix ((2 H + 1) r, (2 H + 1) r); coefficients are ordered by harmonics, unknowns within."""
        h, r, rates = self.motion.harmonics, self.size, self.rates(shift)
        pairs = zip(self.parts, self.between_harmonics)
        weights = [rates.matrix(outer) @ (each @ rates.matrix(f)) for (outer, f, _), each in pairs]
        total = by_parts(lambda x: x @ self._all_parts, np.concatenate(weights).reshape(-1, h.size**2).T)
        return total.reshape(h.size, h.size, r, r).transpose(0, 2, 1, 3).reshape(h.size * r, h.size * r)

    def quadratic(self, middle: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """l0, l1, l2 of the matrix as l0 + sigma l1 + sigma^2 l2, exact or about a shift."""
        step = 0.25 * self.motion.omega
        here, ahead, behind = (self.matrix(middle + d) for d in (0.0, step, -step))
        first, second = (ahead - behind) / (2 * step), (ahead + behind - 2 * here) / (2 * step**2)
        return here - middle * first + middle**2 * second, first - 2 * middle * second, second

    def shaped(self, vector: np.ndarray) -> np.ndarray:
        """Coefficients (S, r) in a vector of the matrix."""
        return vector.reshape(self.motion.harmonics.size, -1)
