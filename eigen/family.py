"""Operators over a parameter point: T(lambda; mu) of one state, and its projection on a space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg as la

from .basis import orthonormal, outside
from .count import Count, counted_line, unstable_count
from .determinant import Structure
from .factor import StructureMatrices
from .operator import CoupledPencil, Relaxation, edge_of, real_apply
from .pairs import all_eigenvalues
from .spectrum import CLEAR, SLOPE, SearchOptions

#: Structures kept of a family, and parameter points whose eigenvalues are.
KEPT = 8
#: Patterns of motion and force weaker than this are left out of a count.
PATTERNS = 1e-6
#: Multiples of the lowest frequency at which patterns of the response are taken.
SAMPLED = (0.0, 0.9, 2.0, 5.0, 20.0, 100.0, 1e3)


class Reach(NamedTuple):
    """Region in which leading modes lie: growth rates above `floor` (1/s), angular frequencies up to `band` (rad/s).

    Left of `creep` (1/s), which is minus infinity for an elastic wall, strongly damped eigenvalues do not count, nor do
    those slower than `slowest` (rad/s).
    """

    floor: float
    band: float
    creep: float = -np.inf
    slowest: float = 0.0

    def is_mode(self, values: np.ndarray) -> np.ndarray:
        """Mask of eigenvalues that are modes and no relaxation."""
        values = np.asarray(values)
        high = np.abs(values.imag)
        return (values.real > self.creep) | ((-values.real <= SLOPE * high) & (high >= self.slowest))

    def leading(self, values: np.ndarray) -> np.ndarray:
        """Eigenvalues of the upper half-plane in reach, sorted by growth rate.

        Where none lies above the floor the largest of all is given, which then is close to the limit point.
        """
        upper = values[(values.imag >= 0) & (values.imag <= self.band)]
        upper = upper[self.is_mode(upper)]
        kept = upper[upper.real > self.floor]
        if not kept.size and upper.size:
            kept = upper[[int(np.argmax(upper.real))]]
        return kept[np.argsort(-kept.real)]


class PencilFamily(ABC):
    """Operator of one state at any parameter point mu, a hashable value that the family alone reads.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) real sparse or dense matrices
        M, D and K; C = alpha M + beta D.
    forces, slope : (n, m) and (m, n) real matrices
        G and J.
    model : callable
        The `FamilyReduction` made last of it, None when nobody holds that any more.
    """

    model: Callable[[], Any | None] = staticmethod(lambda: None)
    mass: Any
    damping: Any
    stiffness: Any
    forces: Any
    slope: Any

    @abstractmethod
    def rayleigh(self, mu: Hashable) -> tuple[float, float]:
        """Damping parameters alpha (1/s) and beta (s)."""

    @abstractmethod
    def coupling(self, mu: Hashable) -> dict[str, np.ndarray]:
        """A0 to S1 of `CoupledPencil`; the scale of the inner unknowns is free."""

    @abstractmethod
    def search(self, mu: Hashable) -> SearchOptions:
        """Limit point and band of a search."""

    def relaxation(self, mu: Hashable) -> Relaxation | None:
        """Viscoelastic part of the stiffness: the same matrices for every mu, and one object for equal values."""
        return None

    def structure(self, mu: Hashable) -> tuple[float, float, Relaxation | None]:
        """Key of the structure alone: the damping parameters and the relaxation, by its identity; whoever keeps the key
        keeps the object, so that no other one can have it.
        """
        return (*self.rayleigh(mu), self.relaxation(mu))

    def at(self, mu: Hashable) -> CoupledPencil:
        """Operator at a parameter point; those of one structure share its matrices."""
        known, key = self.__dict__.setdefault("_structures", {}), self.structure(mu)
        if key not in known:
            if len(known) >= KEPT:
                known.clear()
            alpha, beta = self.rayleigh(mu)
            known[key] = CoupledPencil(
                self.mass,
                alpha * self.mass + beta * self.damping,
                self.stiffness,
                self.forces,
                self.slope,
                relaxation=self.relaxation(mu),
            )
        return known[key].replace(**self.coupling(mu))

    def lowest(self, count: int) -> np.ndarray:
        """Lowest frequencies of the undamped structure, Hz, ascending; none without a reduced model that has them."""
        model = self.model()
        return np.zeros(0) if model is None else model.lowest_frequencies(count)

    def reach(self, mu: Hashable) -> Reach:
        """Region in which leading modes lie."""
        options = self.search(mu)
        floor = -np.inf if options.limit_point is None else CLEAR * options.limit_point
        band = np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency
        return Reach(floor, band, edge_of(self.relaxation(mu)), options.slowest)


class Pairs(NamedTuple):
    """Eigenvalues (k,) with right vectors q (n, k), u (b, k) and left vectors w (n, k), c (b, k)."""

    values: np.ndarray
    q: np.ndarray
    u: np.ndarray
    w: np.ndarray
    c: np.ndarray


class ReducedFamily(PencilFamily):
    """A family on a space: a family itself.

    Parameters
    ----------
    family : PencilFamily
    space : (n, k) array
        Made orthonormal in the mass here; directions below `compression` of the largest are left out.
    base : ReducedFamily, optional
        Of the same family: its space is kept, and made wider by directions of `space` outside it that are longer than
        `compression` of a vector.
    """

    def __init__(self, family: PencilFamily, space: np.ndarray, compression=1e-9, base: ReducedFamily | None = None):
        self.family, self._base = family, base
        if base is None:
            self.V = self._own = orthonormal(family.mass, space, compression)[0]
        else:
            self._own = outside(base.V, family.mass, space, compression)
            self.V = np.hstack([base.V, self._own])
        self.mass, self.damping, self.stiffness = (
            self._projected(getattr(family, name), None if base is None else getattr(base, name))
            for name in ("mass", "damping", "stiffness")
        )
        self.forces, self.slope = (family.forces.T @ self.V).T, family.slope @ self.V
        self._relaxations: dict[Relaxation, Relaxation] = {}
        self._condensed: dict[tuple, tuple] = {}
        self._known: dict[Hashable, np.ndarray] = {}

    def _projected(self, matrix, known: np.ndarray | None) -> np.ndarray:
        """V^T A V, of which the part on the base may be known."""
        image = matrix @ self._own
        if known is None:
            return self._own.T @ image
        first = self._base.V
        return np.block([[known, first.T @ image], [(first.T @ (matrix.T @ self._own)).T, self._own.T @ image]])

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return self.V.shape[1]

    def rayleigh(self, mu):
        """Damping parameters of the family."""
        return self.family.rayleigh(mu)

    def coupling(self, mu):
        """Coupling of the family."""
        return self.family.coupling(mu)

    def search(self, mu):
        """Search of the family."""
        return self.family.search(mu)

    def reach(self, mu) -> Reach:
        """Region in which leading modes lie."""
        return self.family.reach(mu)

    def relaxation(self, mu):
        """Relaxation on the space."""
        full = self.family.relaxation(mu)
        if full is None:
            return None
        if full not in self._relaxations:
            self._relaxations[full] = Relaxation(self._relaxing(full), full.strengths, full.times)
        return self._relaxations[full]

    def _relaxing(self, full: Relaxation) -> tuple:
        """V^T K_g V, the same for every parameter point."""
        if "_parts" not in self.__dict__:
            known = [None] * len(full.matrices) if self._base is None else self._base._relaxing(full)
            self._parts = tuple(self._projected(*pair) for pair in zip(full.matrices, known))
        return self._parts

    @cached_property
    def lowest_frequency(self) -> float:
        """Lowest angular frequency of the symmetric structure, rad/s; 1 where all are unstable."""
        squares = la.eigvalsh(0.5 * (self.stiffness + self.stiffness.T), self.mass)
        return float(np.sqrt(squares[squares > 0].min())) if (squares > 0).any() else 1.0

    def eigenvalues(self, mu: Hashable) -> np.ndarray:
        """All finite eigenvalues in the upper half-plane; those of the points asked last are kept."""
        if mu not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            self._known[mu] = all_eigenvalues(self.at(mu))
        return self._known[mu]

    def leading(self, mu: Hashable) -> np.ndarray:
        """Leading eigenvalues, sorted by growth rate."""
        return self.reach(mu).leading(self.eigenvalues(mu))

    def count(self, mu: Hashable, hints=(), band: float = np.inf) -> Count:
        """Count of unstable eigenvalues, up to a band in Hz; its coupling is condensed to the patterns that matter."""
        key = self.structure(mu)
        if key not in self._condensed:
            if len(self._condensed) >= KEPT:
                self._condensed.clear()
            self._condensed[key] = self._condense(self.at(mu))
        P, Q, pencil, structure = self._condensed[key]
        parts = {}
        for name, value in self.coupling(mu).items():
            value = Q.T @ value if name[0] in "AB" else value
            parts[name] = value @ P if name[0] in "AR" else value
        scale = self.lowest_frequency
        return unstable_count(pencil.replace(**parts), scale=scale, hints=hints, band=band, structure=structure)

    def _condense(self, pencil: CoupledPencil) -> tuple:
        """Patterns of motion and of force, equally many, the structure between them, and what a count knows of it."""
        G, J, samples = self.forces, self.slope, []
        matrices = StructureMatrices(pencil)
        for s in 1j * self.lowest_frequency * np.array(SAMPLED):
            H = J @ np.linalg.solve(matrices.matrix(s).toarray(), G)
            samples += [part / np.abs(H).max() for part in (H.real, H.imag)]
        P, Q = _patterns(samples), _patterns([part.T for part in samples])
        rank = min(P.shape[1], Q.shape[1])
        P, Q = P[:, :rank], Q[:, :rank]
        small = CoupledPencil(pencil.M, pencil.C, pencil.K, G @ Q, P.T @ J, relaxation=pencil.relaxation)
        structure = Structure(small, counted_line(pencil, self.lowest_frequency))
        return P, Q, small, structure

    def pairs(self, mu: Hashable, most: int = 8, share: float = 1.0) -> Pairs:
        """Leading eigenpairs, lifted to the full unknowns; down to a share of the floor."""
        reach = self.reach(mu)
        reach = reach._replace(floor=share * reach.floor)
        found = reach.leading(self.eigenvalues(mu))
        return self.near(mu, found[found.real > reach.floor][:most])

    def near(self, mu: Hashable, places, steps: int = 3) -> Pairs:
        """Eigenpairs nearest to places close to them, by two-sided Rayleigh quotient iteration (Schreiber 2008)."""
        dense, k, rng = DenseOperator(self.at(mu)), self.size, np.random.default_rng(7)
        values, right, left = np.array(places, complex), [], []
        factor, solve = la.get_lapack_funcs(("getrf", "getrs"), dtype=complex)
        for i, s in enumerate(values):
            x, y = rng.standard_normal((2, k + dense.inner)) + 0j
            T, slope = dense(s * (1.0 + 1e-7) or 1e-7)  # beside the place, where T has an inverse
            for step in range(steps + 1):
                lu, pivots, singular = factor(T)
                if singular > 0:
                    break  # an eigenvalue to the last bit
                new, back = solve(lu, pivots, slope @ x)[0], solve(lu, pivots, slope.conj().T @ y, trans=2)[0]
                if not (np.isfinite(new).all() and np.isfinite(back).all()):
                    break  # nearly so
                x, y = new / np.linalg.norm(new), back / np.linalg.norm(back)
                if not step:
                    T, slope = dense(s)
                change = (y.conj() @ T @ x) / (y.conj() @ slope @ x)
                s = s - (change if np.isfinite(change) else 0.0)
                if step and abs(change) <= 1e-13 * abs(s):
                    break
                T, slope = dense(s)
            values[i] = s
            right.append(x)
            left.append(y)
        right, left = (np.array(part).reshape(-1, k + dense.inner).T for part in (right, left))
        lift = self.V
        return Pairs(values, real_apply(lift, right[:k]), right[k:], real_apply(lift, left[:k]), left[k:])


def _patterns(parts) -> np.ndarray:
    """Orthonormal directions of columns, without weak ones."""
    vectors, weight, _ = np.linalg.svd(np.hstack(parts), full_matrices=False)
    return vectors[:, weight > PATTERNS * weight[0]]


class DenseOperator:
    """T(s) and T'(s) of a small pencil as bordered matrices, shape (n + b, n + b)."""

    def __init__(self, pencil: CoupledPencil):
        self.inner, self._relaxation, self._powers = pencil.b, pencil.relaxation, pencil.dense
        self._relaxing = [m.toarray() for m in pencil.relaxing]

    def __call__(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """Both matrices at a place."""
        first, second, third = self._powers
        T, slope = first + s * (second + s * third), second + (2 * s) * third
        n = len(first) - self.inner
        if self._relaxation is not None:
            for x, dx, m in zip(self._relaxation.factors(s), self._relaxation.slopes(s), self._relaxing):
                T[:n, :n] += x * m
                slope[:n, :n] = slope[:n, :n] + dx * m
        return T, slope
