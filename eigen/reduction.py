"""Reduced-order models of a family of pencils, for any of its conditions.

Two stages. The first space holds the static responses K^-1 G and K^-T J^T, and what their own inertia does, K^-1 M X.
The second holds the leading eigenvectors of the first at a few conditions, corrected once with the full matrices, so
that forty vectors carry seven digits of the eigenvalues; where they do not, its own are corrected once more.
"""

from __future__ import annotations

import weakref
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .basis import lowest_modes, orthonormal
from .factor import Workspace
from .family import Pairs, PencilFamily, ReducedFamily
from .operator import CoupledPencil, Relaxation


@dataclass(frozen=True)
class ReductionOptions:
    """Sizes of reduced spaces, and how far they are trusted; found by trying on valves with few and many modes."""

    #: Estimated relative error of an eigenvalue above which a space is enriched, and cells use the full operator.
    tolerance: float = 1e-6
    held: int = 2  #: Leading modes whose error a space is held to.
    compression: float = 1e-4  #: Share of the largest below which static corrections are left out of the first space.
    inertia_modes: int = 20  #: Low motions that inertia corrections are made for.
    band_modes: int = 24  #: Lowest motions of the structure in the first space where a band is searched.
    #: vectors and band_vectors: leading vectors taken at each point: where damping orders the modes, and for a band.
    vectors: int = 4
    band_vectors: int = 12
    snapshot: float = 0.75  #: Share of the floor of growth rates down to which vectors are taken.
    #: weak and deeper: shares of a vector that the second space lacks, below which it is left out: at first, and
    #: corrected again.
    weak: float = 3e-7
    deeper: float = 1e-5
    #: Corrections of a vector where parts of the stiffness relax: one leaves 1e-6 of an eigenvalue, two 1e-8, and more
    #: do not converge, since the inertia is left out of them.
    corrections: int = 2
    typical_modes: int = 8  #: Lowest motions of which a typical frequency is taken.
    losses: int = 4  #: Points at least at which vectors are taken where the relaxations differ.
    #: joint and close: directions weaker than these are left out of the space of a count: at first, and where counts
    #: disagree.
    joint: float = 3e-3
    close: float = 1e-5
    beside: int = 6  #: Leading modes that are found and corrected beside another operator.
    #: searched and kept: leading modes searched for with the full operator, and kept of a cell.
    searched: int = 6
    kept: int = 8


OPTIONS = ReductionOptions()


class FamilyReduction:
    """Small models of a family, and what the full matrices say about them.

    Parameters
    ----------
    family : PencilFamily
    static, stiffened : Workspace, optional
        Keep the symbolic factorisation between families of one pattern: of the stiffness, and of that which a typical
        motion sees where parts of it relax.

    Raises
    ------
    SingularShiftError
        If the stiffness is singular.
    """

    def __init__(self, family: PencilFamily, static: Workspace | None = None, stiffened: Workspace | None = None):
        self.family = family
        self.solver = (static or Workspace()).factor_stiffness(self._elastic(family.stiffness))
        self._workspace, self._stiffened = stiffened or Workspace(), (None, None)
        #: Of a family next to another one: frequency, shares and solver of that.
        self._beside: tuple | None = None
        family.model = weakref.ref(self)

    def _elastic(self, stiffness) -> CoupledPencil:
        """Undamped structure with a stiffness."""
        mass = self.family.mass
        return CoupledPencil(mass, sp.csr_matrix(mass.shape), stiffness)

    @cached_property
    def coarse(self) -> ReducedFamily:
        """First stage."""
        family = self.family
        still = [
            self.solver.solve(family.forces.toarray()),
            self.solver.solve_transposed(family.slope.toarray().T.copy()),
        ]
        first, inertia = orthonormal(family.mass, np.hstack(still), OPTIONS.compression, passes=1)
        # one step of subspace iteration on the lowest motions found there
        stiffness = first.T @ (family.stiffness @ first)
        lowest = la.eigh(
            0.5 * (stiffness + stiffness.T), subset_by_index=(0, min(OPTIONS.inertia_modes, first.shape[1]) - 1)
        )[1]
        moving = self.solver.solve(inertia @ lowest)
        return ReducedFamily(family, np.hstack([first, moving]), OPTIONS.compression)

    @cached_property
    def wide(self) -> ReducedFamily:
        """First stage with the lowest motions of the structure itself, for bands that damping does not end."""
        lowest = lowest_modes(self._elastic(self.family.stiffness), OPTIONS.band_modes)[1]
        return ReducedFamily(self.family, np.hstack([lowest, self.coarse.V]), OPTIONS.compression)

    def first(self, points) -> ReducedFamily:
        """First stage for some parameter points: with the lowest motions where all modes of a band are close to
        neutral, as they are where only it makes modes leading.
        """
        family = self.family
        banded = any(family.relaxation(mu) is None and np.isfinite(family.reach(mu).band) for mu in points)
        return self.wide if banded else self.coarse

    def beside(self, family: PencilFamily, space: np.ndarray, mu: Hashable) -> FamilyReduction:
        """Reduced model of an operator next to this one, on a space (n, k) that serves both, without a factorisation;
        `mu` is a parameter point of this one whose relaxation is that of both by and large.
        """
        other = object.__new__(FamilyReduction)
        other.family, other.solver = family, self.solver
        other.coarse = other.wide = ReducedFamily(family, space, OPTIONS.compression)
        relaxation = self.family.relaxation(mu)
        other._beside = () if relaxation is None else (*self._typical(mu), self._stiffened_by(relaxation, mu))
        family.model = weakref.ref(other)
        return other

    def lowest_frequencies(self, count: int) -> np.ndarray:
        """Lowest frequencies of the undamped symmetric structure, Hz, ascending, as the function of that name has them;
        none where the first stage does not lead to them.
        """
        family, coarse, guard = self.family, self.coarse, 6
        squares, turn = la.eigh(0.5 * (coarse.stiffness + coarse.stiffness.T))
        order = np.argsort(np.abs(squares))[: count + guard]  # those next to zero, as shift and invert finds them
        if self._beside is not None:
            return np.sqrt(np.maximum(np.sort(squares[order][:count]), 0.0)) / (2 * np.pi)
        X, squares = coarse.V @ turn[:, order], squares[order]
        symmetric = ((family.stiffness + family.stiffness.T) * 0.5).tocsr()
        KX, MX = symmetric @ X, family.mass @ X
        for _ in range(8):
            known = squares[:count]
            X = np.hstack([X, self.solver.solve((KX - MX * squares)[:, :count])])
            X, MX = orthonormal(family.mass, X, 1e-10)
            KX = symmetric @ X
            squares, turn = la.eigh(X.T @ KX)
            order = np.argsort(np.abs(squares))[: count + guard]
            squares, turn = squares[order], turn[:, order]
            X, KX, MX = X @ turn, KX @ turn, MX @ turn
            found = squares[:count]
            # their change is a hundred times their error
            if known.size == found.size and (np.abs(found - known) <= 1e-6 * np.abs(found)).all():
                return np.sort(np.sqrt(np.maximum(found, 0.0))) / (2 * np.pi)
        return np.zeros(0)

    @property
    def slow(self) -> float:
        """Size of eigenvalues, 1/s, below which their errors are relative to it."""
        return 1e-2 * self.coarse.lowest_frequency

    def operator(self, mu: Hashable) -> CoupledPencil:
        """Full operator at a parameter point, with the scale of inner unknowns that reduced ones have."""
        return PencilFamily.at(self.family, mu)

    def _corrected(self, several: list[Pairs], points) -> list[tuple[np.ndarray, np.ndarray]]:
        """Right and left structural vectors corrected with the full matrices, (n, k) each, those of one relaxation in
        one block.
        """
        found, relaxations = {}, [self.family.relaxation(mu) for mu in points]
        for relaxation in {id(own): own for own in relaxations}.values():
            members = [i for i, own in enumerate(relaxations) if own is relaxation]
            alike = [several[i] for i in members], [points[i] for i in members]
            found |= zip(members, self._corrected_alike(*alike, relaxation))
        return [found[i] for i in range(len(points))]

    def _corrected_alike(self, several, points, relaxation) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Right and left vectors, as `_corrected` gives them, at points of one relaxation.

        Far from the leading modes T is nearly (1 + lambda beta) K. Where parts relax, K is the stiffness that a typical
        motion sees, and corrections are repeated for what that differs from one mode and one part to another.
        """
        operators, sizes = [self.operator(mu) for mu in points], np.cumsum([len(pairs.values) for pairs in several])
        solver, passes, scales = self.solver, 1, []
        if relaxation is not None:
            frequency, share = self._typical(points[0])
            typical = 1.0 + share @ relaxation.factors(1j * frequency).real
            solver, passes = self._stiffened_by(relaxation, points[0]), OPTIONS.corrections
        for pairs, mu in zip(several, points):
            below = 1.0 + pairs.values * self.family.rayleigh(mu)[1]
            relaxed = 0.0 if relaxation is None else share @ relaxation.factors(pairs.values)
            scales.append((1.0 if relaxation is None else typical) / (below + relaxed))
        scale = np.concatenate(scales)
        right, left = [pairs.q for pairs in several], [pairs.w for pairs in several]
        for _ in range(passes):
            each = list(zip(operators, several, right, left))
            force = np.hstack([T.apply(pairs.values, q, pairs.u)[0] for T, pairs, q, _ in each])
            back = np.hstack([T.apply(pairs.values.conj(), w, pairs.c, True)[0] for T, pairs, _, w in each])
            force, back = solver.solve(force) * scale, solver.solve_transposed(back) * scale.conj()
            right, left = (
                [x - step for x, step in zip(vectors, np.hsplit(steps, sizes))]
                for vectors, steps in ((right, force), (left, back))
            )
        return zip(right, left)

    def _typical(self, mu) -> tuple[float, np.ndarray]:
        """Angular frequency of typical motions, rad/s, and shares of the relaxing parts in the stiffness, (g,)."""
        if self._beside:
            return self._beside[:2]
        coarse = self.coarse
        squares = la.eigvalsh(0.5 * (coarse.stiffness + coarse.stiffness.T))
        low = squares[squares > 0][: OPTIONS.typical_modes]
        frequency = float(np.exp(0.5 * np.log(low).mean())) if low.size else 1.0
        return frequency, np.array([m.diagonal().sum() for m in coarse.relaxation(mu).matrices]) / squares.sum()

    def _stiffened_by(self, relaxation: Relaxation, mu: Hashable):
        """Factor of the stiffness as a typical motion sees it; that of the last relaxation is kept."""
        if self._beside:
            return self._beside[2]
        if self._stiffened[0] is not relaxation:
            factors = relaxation.factors(1j * self._typical(mu)[0]).real
            stiffness = self.family.stiffness + sum(x * m for x, m in zip(factors, relaxation.matrices))
            self._stiffened = relaxation, self._workspace.factor_stiffness(self._elastic(stiffness))
        return self._stiffened[1]

    def fine(self, first: ReducedFamily, points, most: int) -> ReducedFamily:
        """Second stage: a space made of the corrected leading vectors of a first one at some parameter points."""
        columns = self._corrected_leading(first, points, most)
        # where nothing leads anywhere there is nothing to be found better
        return ReducedFamily(self.family, columns, OPTIONS.weak) if columns.shape[1] else first

    def deeper(self, fine: ReducedFamily, points, most: int) -> ReducedFamily:
        """A second stage made wider by its own leading vectors, corrected once more.

        What the first space has by too little is corrected by too little at once: an error of 1e-2 of its vectors
        leaves 1e-5 of an eigenvalue however many points they come from.
        """
        columns = self._corrected_leading(fine, points, most)
        return ReducedFamily(self.family, columns, OPTIONS.deeper, base=fine) if columns.shape[1] else fine

    def leading_vectors(self, mu: Hashable, most: int) -> np.ndarray:
        """Right and left leading vectors at a parameter point, corrected with the full matrices, real and imaginary
        parts apart, (n, 4 k); each vector has length one in the mass.
        """
        columns = self._corrected_leading(self.fine(self.coarse, [mu], most), [mu], most)
        squares = np.einsum("ij,ij->j", columns, self.family.mass @ columns).reshape(2, 2, -1)  # side, part, mode
        return columns / np.sqrt(np.tile(squares.sum(axis=1, keepdims=True), (1, 2, 1))).ravel()

    def _corrected_leading(self, model: ReducedFamily, points, most: int) -> np.ndarray:
        """Right and left leading vectors of a reduced model at some points, corrected with the full matrices, real and
        imaginary parts side by side.
        """
        several = [model.pairs(mu, most, OPTIONS.snapshot) for mu in points]
        corrected = self._corrected(several, points)
        return np.hstack([part for both in corrected for x in both for part in (x.real, x.imag)])

    def correction(self, pairs: Pairs, mu, corrected: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
        """Corrections of eigenvalues by the full matrices, complex (k,): those of the projection on each pair of
        vectors and what a correction with the full matrices adds to it.

        What the space lacks shows in it. Of the vectors' corrections only the directions count, so that motions faster
        than those left out of the space, whose inertia the corrections lack, are not made worse.
        """
        right, left = self._corrected([pairs], [mu])[0] if corrected is None else corrected
        added, T = (right - pairs.q, left - pairs.w), self.operator(mu)
        own, none = (pairs.w, pairs.c), np.zeros_like(pairs.c)
        here = T.apply(pairs.values, pairs.q, pairs.u)
        there = T.apply(pairs.values, added[0], np.zeros_like(pairs.u))

        def times(left, inner, right):
            return np.einsum("ij,ij->j", left.conj(), right[0]) + np.einsum("ij,ij->j", inner.conj(), right[1])

        both = times(added[1], none, there)
        both[both == 0.0] = np.inf  # vectors that are exact are not corrected
        top = times(*own, here) - times(*own, there) * times(added[1], none, here) / both
        return -top / times(*own, T.apply_derivative(pairs.values, pairs.q, pairs.u))

    def bound(self, model: ReducedFamily, mu: Hashable) -> float:
        """Relative error of leading eigenvalues at one point, at most: their change, as in `error`, or the product of
        the shares by which right and left vectors change, which is large where corrections do not converge.
        """
        pairs, mass = model.pairs(mu, OPTIONS.held), self.family.mass
        corrected = self._corrected([pairs], [mu])[0]

        def size(x: np.ndarray) -> np.ndarray:
            return np.sqrt(np.abs(np.einsum("ij,ij->j", x.conj(), mass @ x)))

        right, left = (size(new - old) / size(old) for new, old in zip(corrected, (pairs.q, pairs.w)))
        return max(self._change(pairs, mu, corrected), float((right * left).max(initial=0.0)))

    def error(self, model: ReducedFamily, points) -> float:
        """Largest relative change of leading eigenvalues of a reduced model under a correction with the full matrices,
        at some points.
        """
        pairs = ((model.pairs(mu, OPTIONS.held), mu) for mu in points)
        return max((self._change(*own) for own in pairs), default=0.0)

    def _change(self, pairs: Pairs, mu: Hashable, corrected: tuple[np.ndarray, np.ndarray] | None = None) -> float:
        change = np.abs(self.correction(pairs, mu, corrected)) / np.maximum(np.abs(pairs.values), self.slow)
        return float(change.max(initial=0.0))
