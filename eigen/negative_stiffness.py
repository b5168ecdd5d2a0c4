r"""Motions whose stiffness turns negative as it stiffens: a structure that relaxes and loses stability by itself.

A part of a stiffness that relaxes may be negative in some motions, which other parts hold. Branches multiply it more
the faster a motion is, so that a structure that stands still may run away,

.. math:: D(s) = s^2 M + s C + K + \sum_g \varphi_g(s) K_g, \qquad D(s) x = 0, \quad s > 0.

Such motions are those of single elements: no space of low modes and static responses holds them, and a search for
modes passes them by. On the positive real axis D is real and, up to the little that follows a load, symmetric, so that
signs of pivots count its negative eigenvalues (Sylvester) at any place without computing any.

With the branches in order of their times, slowest first, and N_j their stiffnesses, K + sum phi_g K_g is a weighted
mean of the partial sums K + N_1 + ... + N_j: where all of these are positive definite, nothing of the kind exists.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla

from .factorization import StructureMatrices
from .inertia import SymmetricStructure
from .mass_basis import orthonormal
from .pencil import CoupledPencil

#: Motions kept of one stiffness at most, those of the most negative.
MOST = 40
#: Accuracies of them, one after another until their space has as many negative motions as the stiffness.
TOLERANCES = (1e-2, 1e-4, 1e-8)
#: Unknowns up to which all motions are computed.
DENSE = 100
#: Places on the real axis, per decade, where the motions kept are looked at.
PER_DECADE = 40
#: Length in the mass below which a motion has nothing that others lack.
SAME = 1e-5
#: Rounds in which further motions are taken in where they look weakest, and relative change of the weakest that ends
#: them.
ROUNDS, SETTLED = 4, 1e-3


def negative_motions(pencil: CoupledPencil) -> np.ndarray:
    """Structural motions that may run away by themselves, for a space on which their eigenvalues are to be found.

    Neither the fluid nor any eigenvalue of the pencil enters.

    Parameters
    ----------
    pencil : CoupledPencil

    Returns
    -------
    ndarray, shape (n, k)
        Of unit mass; none (k = 0) where nothing relaxes or the stiffness stays positive.

    Examples
    --------
    >>> from eigen import Relaxation
    >>> soft = Relaxation([np.diag([1.0, -2.0])], [[1.0]], [0.1])
    >>> pencil = CoupledPencil(M=np.eye(2), C=np.zeros((2, 2)), K=np.eye(2), relaxation=soft)
    >>> np.abs(negative_motions(pencil)).round(6).T
    array([[0., 1.]])
    """
    if pencil.relaxation is None:
        return np.zeros((pencil.n, 0))
    return motions_of(SymmetricStructure(StructureMatrices(pencil)))


def motions_of(structure: SymmetricStructure, rough: bool = False) -> np.ndarray:
    """The same of a structure that relaxes; of a rough space only the number of negative motions is right where they
    look weakest.
    """
    search = _Search(structure)
    motions = np.hstack([search.lowest(weights) for weights in partial_sums(structure)])
    return _completed(search, motions, rough) if motions.shape[1] else motions


def partial_sums(structure: SymmetricStructure) -> list[np.ndarray]:
    """Weights of K, K + N_1, K + N_1 + N_2, ..., slowest branch first."""
    relaxation = structure.relaxation
    sums = np.cumsum(relaxation.strengths[:, np.argsort(-relaxation.times)], axis=1).T
    return [structure.stiffness(factors) for factors in (np.zeros(len(relaxation.matrices)), *sums)]


class _Search:
    """Negative motions of sums, found relative to a positive one."""

    def __init__(self, structure: SymmetricStructure):
        self.structure, self._added = structure, 0.0

    def negative(self, weights: np.ndarray) -> int:
        """Number of negative eigenvalues of a sum."""
        with self.structure.factored(weights) as factor:
            return factor.negative

    def lowest(self, weights: np.ndarray, known: int = 0) -> np.ndarray:
        """Motions (n, k) in which a sum is negative, the lowest ones; k = 0 where there are no more than are known."""
        structure = self.structure
        n = structure.size
        number = self.negative(weights)
        if number <= known:
            return np.zeros((n, 0))
        if n <= DENSE:
            full, mass = (structure.times(w, np.eye(n)) for w in (weights, structure.mass))
            return la.eigh(full, mass, subset_by_index=(0, min(number, MOST) - 1))[1]
        number = min(number, MOST, n - 1)
        start = np.random.default_rng(5).standard_normal(n)
        with self._positive(weights) as (positive, factor):
            product, other, inverse = (
                spla.LinearOperator((n, n), matvec=lambda x, act=act: act(np.ravel(x)))
                for act in (structure.acting(weights), structure.acting(positive), factor.solve)
            )
            for tolerance in TOLERANCES:
                size = min(n, max(2 * number + 1, 10))
                _, motions = spla.eigsh(
                    product, number, other, Minv=inverse, which="SA", v0=start, tol=tolerance, ncv=size
                )
                if (np.linalg.eigvalsh(motions.T @ structure.times(weights, motions)) < 0).all():
                    break
        return motions

    @contextmanager
    def _positive(self, weights: np.ndarray) -> Iterator[tuple]:
        """A positive sum close to one that is not, and its factor: inertia and damping of that one, the slow stiffness,
        and inertia as much as it takes beyond.
        """
        mass, positive = self.structure.mass, self.structure.slow.copy()
        positive[:2] = weights[:2]
        while True:
            total = positive + self._added * mass
            with self.structure.factored(total) as factor:
                if not factor.negative:
                    yield total, factor
                    return
            diagonal = (abs(self.structure.upper(w).diagonal()) for w in (positive, mass))
            self._added = 8.0 * self._added or 1e-6 * float(np.divide(*(np.median(d) for d in diagonal)))


def _completed(search: _Search, motions: np.ndarray, rough: bool) -> np.ndarray:
    """Motions of unit mass, with those that D has where the ones given look weakest."""
    structure, mass = search.structure, search.structure.full(search.structure.mass)
    weakest = np.inf
    for _ in range(ROUNDS):
        motions = orthonormal(mass, motions, SAME)[0]
        on_space = structure.on_space(motions)
        places = places_of(structure, on_space)
        squares = np.array([np.linalg.eigvalsh(np.tensordot(structure.at(s), on_space, 1)) / s**2 for s in places])
        at = int(np.argmin(squares[:, 0]))
        if squares[at, 0] > weakest - SETTLED * abs(weakest):
            break
        weakest = squares[at, 0]
        known = int((squares[at] < 0).sum()) if rough else 0
        motions = np.hstack([motions, search.lowest(structure.at(places[at]), known)])
    return orthonormal(mass, motions, SAME)[0]


def places_of(structure: SymmetricStructure, on_space: np.ndarray) -> np.ndarray:
    """Places on the real axis between which the motions of a space may run away."""
    lowest = min(_lowest_on(on_space, weights) for weights in partial_sums(structure))
    slowest = 1e-3 / structure.relaxation.times.max()
    fastest = 1.1 * max(float(np.sqrt(max(-lowest, 0.0))), 2.0 * slowest)
    return np.geomspace(slowest, fastest, max(20, int(PER_DECADE * np.log10(fastest / slowest))))


def _lowest_on(on_space: np.ndarray, weights: np.ndarray) -> float:
    """Lowest eigenvalue of a sum on a space."""
    return float(np.linalg.eigvalsh(np.tensordot(weights, on_space, 1))[0])
