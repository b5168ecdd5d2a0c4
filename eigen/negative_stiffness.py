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

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .factorization import SymmetricLU
from .mass_basis import orthonormal
from .pencil import CoupledPencil

#: Motions kept of one stiffness at most, those of the most negative.
MOST = 40
#: Accuracy of their squares.
TOLERANCE = 1e-4
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
    structure = _Structure(pencil)
    found = [_lowest(stiffness, structure.mass) for stiffness in structure.partial_sums()]
    motions = np.hstack([motions for _, motions in found])
    if not motions.shape[1]:
        return motions
    fastest = float(np.sqrt(-min(squares.min(initial=0.0) for squares, _ in found)))
    return _completed(structure, motions, fastest)


class _Structure:
    """Symmetric parts of a structure that relaxes."""

    def __init__(self, pencil: CoupledPencil):
        self.relaxation = pencil.relaxation
        self.mass, self.damping, self.slow, *self.parts = (
            ((part + part.T) * 0.5).tocsc() for part in (pencil.M, pencil.C, pencil.K, *pencil.relaxing)
        )

    def partial_sums(self) -> list[sp.csc_matrix]:
        """K, K + N_1, K + N_1 + N_2, ..., slowest branch first."""
        order = np.argsort(-self.relaxation.times)
        sums = np.cumsum(self.relaxation.strengths[:, order], axis=1).T
        return [self.slow, *(self._with(factors) for factors in sums)]

    def stiffness(self, s: float) -> sp.csc_matrix:
        """D(s) - s^2 M."""
        return self._with(self.relaxation.factors(s)) + s * self.damping

    def _with(self, factors) -> sp.csc_matrix:
        return self.slow + sum(x * part for x, part in zip(factors, self.parts))


def _completed(structure: _Structure, motions: np.ndarray, fastest: float) -> np.ndarray:
    """Motions of unit mass, with those that D has where the ones given look weakest."""
    slowest = 1e-3 / structure.relaxation.times.max()
    places = np.geomspace(slowest, fastest, max(20, int(PER_DECADE * np.log10(fastest / slowest))))
    weakest = np.inf
    for _ in range(ROUNDS):
        motions = orthonormal(structure.mass, motions, SAME)[0]
        size = _weakness(structure, motions, places)
        at = int(np.argmin(size))
        if size[at] > weakest - SETTLED * abs(weakest):
            break
        weakest = size[at]
        _, further = _lowest(structure.stiffness(places[at]), structure.mass)
        motions = np.hstack([motions, further])
    return orthonormal(structure.mass, motions, SAME)[0]


def _weakness(structure: _Structure, motions: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Lowest eigenvalue of D(s)/s^2 on a space, at each place."""
    slow, damping, *parts = (
        motions.T @ (part @ motions) for part in (structure.slow, structure.damping, *structure.parts)
    )
    found = []
    for s in places:
        on_space = slow + s * damping + sum(x * part for x, part in zip(structure.relaxation.factors(s), parts))
        found.append(1.0 + np.linalg.eigvalsh(on_space)[0] / s**2)
    return np.array(found)


def _lowest(stiffness: sp.csc_matrix, mass: sp.csc_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Negative squares of a stiffness, the lowest ones, and their motions (n, k); k = 0 where it is positive."""
    number = SymmetricLU(stiffness).negative
    n = stiffness.shape[0]
    if not number:
        return np.zeros(0), np.zeros((n, 0))
    shift, factor = _below(stiffness, mass)
    number = min(number, MOST, n - 1)
    inverse = spla.LinearOperator((n, n), matvec=lambda x: factor.solve(np.ravel(x)))
    start = np.random.default_rng(5).standard_normal(n)
    return spla.eigsh(stiffness, number, mass, sigma=shift, OPinv=inverse, v0=start, tol=TOLERANCE)


def _below(stiffness, mass) -> tuple[float, SymmetricLU]:
    """A place a little below all squares, and the stiffness shifted there, factored."""
    high = 1e-6 * float(np.median(np.abs(stiffness.diagonal())) / np.median(mass.diagonal()))
    factor = SymmetricLU(stiffness + high * mass)
    step = 8.0 if factor.negative else 0.125
    while step > 1.0 and factor.negative:
        high *= step
        factor = SymmetricLU(stiffness + high * mass)
    while step < 1.0:
        trial = SymmetricLU(stiffness + step * high * mass)
        if trial.negative:
            break
        high, factor = step * high, trial
    for _ in range(2):
        trial = SymmetricLU(stiffness + 0.5 * high * mass)
        if trial.negative:
            break
        high, factor = 0.5 * high, trial
    return -high, factor
