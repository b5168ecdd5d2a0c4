"""What a system gives so that its periodic motions can be found as Fourier series, and its linearisation about one.

A motion x(t) of n unknowns is periodic with angular frequency omega; a system answers with its residual at N samples of
one period, and is free to use rates, and filters in time for what it remembers, see `continuation.harmonics.Rates`. It
is linearised as a sum of terms

    S_outer L_i sum_j M_ji S_j R_i dx,

with matrices at each sample i and functions S of d/dt, so that a motion exp(sigma t) dx of a perturbation needs the
functions at another argument alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp

from continuation.blocks import SparseBlocks
from continuation.harmonics import Harmonics, Rates

Filter = Callable[[np.ndarray], np.ndarray] | int


@dataclass(frozen=True, eq=False)
class PeriodicMotion:
    """A periodic motion.

    Attributes
    ----------
    harmonics : Harmonics
    coefficients : (2 H + 1, n) array
    omega : float
    """

    harmonics: Harmonics
    coefficients: np.ndarray
    omega: float

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

    def rate(self, phases) -> np.ndarray:
        """Rates (len, n) at phases, rad."""
        return self.omega * (self.harmonics.basis_at(phases) @ self.harmonics.rate(self.coefficients))

    def resized(self, count: int) -> PeriodicMotion:
        """With another number of harmonics."""
        other = Harmonics(count)
        return PeriodicMotion(other, other.resized(self.coefficients), self.omega)

    @property
    def tail(self) -> float:
        """Share that the last two harmonics have in the motion about its mean: what a longer series would change."""
        c = self.coefficients
        whole = np.linalg.norm(c[1:])
        return float(np.linalg.norm(c[-4:] if len(c) > 5 else c[-2:]) / whole) if whole else 0.0


@dataclass(frozen=True, eq=False)
class Term:
    """One term of a linearisation; blocks are N matrices, a `SparseBlocks`, one stack (N, a, b), or None for the
    identity.

    Attributes
    ----------
    middle : sequence of (filter, blocks)
    left, right : blocks
    outer : filter
    """

    middle: Sequence[tuple[Filter, Any]]
    left: Any = None
    right: Any = None
    outer: Filter = 0

    def apply(self, samples: np.ndarray, rates: Rates) -> np.ndarray:
        """Samples (N, n) or (N, n, k) of what it makes of samples of a motion."""
        inner = _times(self.right, samples)
        total = sum(_times(blocks, rates.apply(function, inner)) for function, blocks in self.middle)
        return rates.apply(self.outer, _times(self.left, total))

    def apply_each(self, samples: Sequence[np.ndarray], rates: Sequence[Rates]) -> list[np.ndarray]:
        """`apply` to samples (N, n) of several motions with rates of their own, the blocks taken up once."""
        inner = [_times(self.right, one) for one in samples]
        total = sum(
            _times(blocks, np.stack([by.apply(function, one) for one, by in zip(inner, rates)], axis=-1))
            for function, blocks in self.middle
        )
        total = _times(self.left, total)
        return [by.apply(self.outer, total[..., i]) for i, by in enumerate(rates)]

    @property
    def polynomial(self) -> bool:
        """Whether d/dt enters by powers up to the second."""
        used = [self.outer, *(function for function, _ in self.middle)]
        return all(isinstance(f, int) or getattr(f, "polynomial", False) for f in used)

    def reduced(self, basis: np.ndarray, known: Term | None = None) -> Term:
        """Its projection on a basis (n, r), dense at each sample; `known` is that on the first columns of the basis."""
        if self.left is None and self.right is None:
            before = [None] * len(self.middle) if known is None else [blocks for _, blocks in known.middle]
            middle = [(f, _projected(blocks, basis, old)) for (f, blocks), old in zip(self.middle, before)]
            return Term(middle, outer=self.outer)
        left = np.stack([(block.T @ basis).T for block in self.left])
        right = np.stack([block @ basis for block in self.right])
        return Term([(f, left @ blocks) for f, blocks in self.middle], right=right, outer=self.outer)


def _projected(blocks, basis: np.ndarray, known: np.ndarray | None) -> np.ndarray:
    """V^T A V (N, r, r) of matrices A at each sample; `known` holds the part of the first columns of V."""
    if isinstance(blocks, SparseBlocks):
        return blocks.projected(basis, known)
    return np.stack([basis.T @ (block @ basis) for block in blocks])


def _times(blocks, samples: np.ndarray) -> np.ndarray:
    if blocks is None:
        return samples
    if isinstance(blocks, SparseBlocks):
        return blocks.times(samples)
    if isinstance(blocks, np.ndarray):
        if samples.ndim == 2:
            return np.matmul(blocks, samples[:, :, None])[:, :, 0]
        return np.matmul(blocks, samples)
    return np.stack([_product(block, x) for block, x in zip(blocks, samples)])


def _product(block, x: np.ndarray) -> np.ndarray:
    """Product of a real block with a real or complex array, without making the block complex."""
    if not np.iscomplexobj(x) or not sp.issparse(block):
        return block @ x
    flat = np.ascontiguousarray(x).reshape(len(x), -1)
    out = block @ flat.view(float)
    return np.ascontiguousarray(out).view(complex).reshape((block.shape[0], *x.shape[1:]))


class PeriodicOperator:
    """Linearisation about a periodic motion.

    Parameters
    ----------
    motion : PeriodicMotion
    terms : sequence of Term
    coarse : sequence of Term, optional
        Terms that stand for these in projections, where some have none or a dear one.
    """

    def __init__(self, motion: PeriodicMotion, terms: Sequence[Term], coarse: Sequence[Term] | None = None):
        self.motion, self.terms = motion, tuple(terms)
        #: Whether projections are those of the operator itself.
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
        h, rates = self.motion.harmonics, self.rates(shift)
        samples = h.evaluate(coefficients)
        return h.project(sum(term.apply(samples, rates) for term in self.terms))

    def apply_each(self, vectors: Sequence[np.ndarray], shifts: Sequence[complex]) -> list[np.ndarray]:
        """`apply` to several changes, each with an exponent of its own; cheaper than one by one."""
        h, rates = self.motion.harmonics, [Rates(self.motion.harmonics, self.motion.omega, s) for s in shifts]
        samples = [h.evaluate(vector) for vector in vectors]
        parts = [
            term.apply_each(samples, rates)
            if isinstance(term, Term)
            else [term.apply(one, by) for one, by in zip(samples, rates)]
            for term in self.terms
        ]
        return [h.project(sum(part)) for part in zip(*parts)]

    def reduced(self, basis: np.ndarray, known: ReducedOperator | None = None) -> ReducedOperator:
        """Projection on a basis (n, r) at every sample; `known` is that on the first columns of the basis."""
        before = [None] * len(self._coarse) if known is None else known.terms
        terms = [term.reduced(basis, old) for term, old in zip(self._coarse, before)]
        return ReducedOperator(self.motion, terms, basis.shape[1])


class ReducedOperator(PeriodicOperator):
    """A linearisation in r unknowns, small enough to be a dense matrix.

    Parameters
    ----------
    motion : PeriodicMotion
        Of the full system.
    terms : sequence of Term
        With dense blocks, and nothing on their left.
    size : int
        r.
    """

    def __init__(self, motion: PeriodicMotion, terms: Sequence[Term], size: int):
        super().__init__(motion, terms)
        self.size = size
        #: Whether exponents enter as powers up to the second.
        self.polynomial = all(term.polynomial for term in terms)
        self._sums: dict[tuple[Filter, Filter], np.ndarray] = {}
        for term in (term for term in terms if term.right is None):
            for function, blocks in term.middle:
                key = term.outer, function
                self._sums[key] = self._sums[key] + blocks if key in self._sums else blocks

    def matrix(self, shift: complex = 0.0) -> np.ndarray:
        """Dense matrix ((2 H + 1) r, (2 H + 1) r); coefficients are ordered by harmonics, unknowns within."""
        h, r, rates = self.motion.harmonics, self.size, self.rates(shift)
        total = np.zeros((h.size**2, r * r))
        for (outer, function), blocks in self._sums.items():
            inner = rates.apply(function, h.basis)
            weights = np.einsum("ti,is->tsi", self._projection(outer, rates), inner).reshape(h.size**2, h.samples)
            total = total + _by_parts(weights, blocks.reshape(h.samples, r * r))
        total = total.reshape(h.size, h.size, r, r).transpose(0, 2, 1, 3).reshape(h.size * r, h.size * r)
        for term in (term for term in self.terms if term.right is not None):
            inner = (term.right[:, :, None, :] * h.basis[:, None, :, None]).reshape(h.samples, -1, h.size * r)
            sums = sum(_by_parts(blocks, rates.apply(f, inner)) for f, blocks in term.middle)
            total = total + np.tensordot(self._projection(term.outer, rates), sums, 1).reshape(total.shape)
        return total

    def _projection(self, outer: Filter, rates: Rates) -> np.ndarray:
        """(2 H + 1, N): coefficients of samples that a filter is applied to."""
        h = self.motion.harmonics
        plain = h.basis.T / h.samples
        return plain if isinstance(outer, int) and outer == 0 else plain @ rates.filter(outer)


def _by_parts(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Product of two matrices, or stacks, one of which may be complex; the other stays real."""
    if np.iscomplexobj(left):
        return left.real @ right + 1j * (left.imag @ right)
    if np.iscomplexobj(right):
        return left @ right.real + 1j * (left @ right.imag)
    return left @ right


class PeriodicSystem(Protocol):
    """A system whose periodic motions are sought.

    Attributes
    ----------
    size : int
        n.
    autonomous : bool
        Whether time shifts of a motion are motions as well; of a forced one the phase of the forcing is the phase.
    """

    size: int
    autonomous: bool

    def residual(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> np.ndarray:
        """Residual (N, n) at the samples."""
        ...

    def linearise(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> PeriodicOperator:
        """Linearisation about a motion that need not solve the equations."""
        ...

    def coarse_basis(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> np.ndarray:
        """(n, r) directions in which the equations are coupled in time; all of them for a small system."""
        ...

    def smoother(
        self, operator: PeriodicOperator, mu: Mapping[str, float]
    ) -> Callable[[np.ndarray], np.ndarray] | None:
        """Approximate solves, coefficients (2 H + 1, n) to coefficients, good in all other directions; None where there
        are none.
        """
        ...

    @property
    def scales(self) -> np.ndarray:
        """(n,) sizes that changes of the unknowns are measured in."""
        ...
