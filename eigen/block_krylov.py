"""Largest eigenpairs of a symmetric A relative to a positive K, A x = mu K x, by a block Krylov space of K^-1 A.

Factors solve for several right-hand sides in a fraction of the time that these take one by one, and so do dense
products: where both are what costs, a block of vectors is worth more steps than the single one of ARPACK saves.
The basis V is orthonormal in K and kept whole (Golub and Underwood 1977; Musco and Musco 2015).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

#: Share of a vector's squared length below which what is left of it is rounding.
ROUNDING = 1e-16
#: Least eigenvalue of the products of a block's vectors of unit length that are made orthonormal together.
ALIKE = 1e-8
#: Blocks after which the search is given up.
MOST_BLOCKS = 60


class NotPositiveError(ArithmeticError):
    """K is not positive definite."""


class NotConvergedError(ArithmeticError):
    """Fewer pairs converged than were asked for."""


@dataclass(frozen=True)
class LargestPairs:
    """Eigenpairs of largest mu first.

    Attributes
    ----------
    values : (k,) array
    vectors : (n, k) array
        Orthonormal in K.
    images : (n, k) array
        A times the vectors.
    """

    values: np.ndarray
    vectors: np.ndarray
    images: np.ndarray


def largest_pairs(
    apply: Callable[[np.ndarray], np.ndarray],
    stiffness,
    solve: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    count: int,
    tolerance: float = 1e-6,
) -> LargestPairs:
    """The eigenpairs of largest mu.

    Parameters
    ----------
    apply : callable
        Products of A with blocks (n, b).
    stiffness : sparse or dense, shape (n, n)
        K.
    solve : callable
        Products of its inverse.
    start : (n, b) array
        In the range of A. As many vectors at most can share an eigenvalue.
    count : int
        Number of pairs; fewer are given where the whole range of A holds no more.
    tolerance : float
        Norm of the residual A x - mu K x in K^-1, relative to mu.

    Raises
    ------
    NotPositiveError
        If a vector of negative or no length in K is met.
    NotConvergedError
        After `MOST_BLOCKS` blocks.

    Examples
    --------
    >>> import numpy as np
    >>> a, k = np.diag([9.0, 4.0, 1.0]), np.diag([1.0, 2.0, 1.0])
    >>> found = largest_pairs(lambda x: a @ x, k, lambda x: np.linalg.solve(k, x), np.ones((3, 1)), 2)
    >>> np.round(found.values, 12)
    array([9., 2.])
    """
    space, newest = _Space(stiffness, start.shape[1]), start
    for _ in range(MOST_BLOCKS):
        raw = solve(newest)
        share, fresh, loads = space.orthonormal(raw, newest)
        if space.size:
            values, turns = space.extremes(share, count)
            # A V = K V T + K fresh (fresh' A V_last) E_last'
            missed = np.linalg.norm((fresh.T @ newest) @ turns[-newest.shape[1] :], axis=0)
            if not fresh.shape[1] or (len(values) == count and np.all(missed <= tolerance * np.abs(values))):
                return LargestPairs(values, space.basis @ turns, space.images @ turns)
        newest = apply(fresh)
        space.extend(fresh, loads, newest)
    raise NotConvergedError(f"Fewer than {count} eigenpairs converged in a Krylov space of {space.size} vectors.")


class _Space:
    """A basis (n, size) orthonormal in K, K times it, A times it, and A projected on all of it but the last block."""

    def __init__(self, stiffness, block: int):
        self.size, self._stiffness, self._block = 0, stiffness, block
        self._arrays = np.empty((3, 0, stiffness.shape[0]))
        self._projected = np.zeros((0, 0))

    def _part(self, which: int) -> np.ndarray:
        return self._arrays[which, : self.size].T

    @property
    def basis(self) -> np.ndarray:
        return self._part(0)

    @property
    def images(self) -> np.ndarray:
        return self._part(2)

    def extend(self, basis, loads, images) -> None:
        more = basis.shape[1]
        if self.size + more > self._arrays.shape[1]:
            wider = np.empty((3, 2 * self._arrays.shape[1] + 6 * self._block, self._arrays.shape[2]))
            wider[:, : self.size] = self._arrays[:, : self.size]
            self._arrays = wider
        for array, block in zip(self._arrays, (basis, loads, images), strict=True):
            array[self.size : self.size + more] = block.T
        self.size += more

    def extremes(self, share: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Largest values of the projected A and their vectors, for the products (size, b) of the basis with A times
        its last block.
        """
        old = self._projected.shape[0]
        self._projected = np.block([[self._projected, share[:old]], [share[:old].T, share[old:]]])
        values, turns = np.linalg.eigh(0.5 * (self._projected + self._projected.T))
        return values[::-1][:count], turns[:, ::-1][:, :count]

    def orthonormal(self, vectors, loads) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Products (size, b) of the basis with loads (n, b), of which vectors are the solutions; and these made
        orthonormal in K to the basis and to each other, with their loads. What is left of a vector that the others
        hold already goes.
        """
        size = _squares(vectors, loads)
        share = self._part(1).T @ vectors
        # loads anew: those that were solved for drift from the vectors by what the solutions are inexact
        vectors = vectors - self.basis @ share
        loads = self._stiffness @ vectors
        left = _squares(vectors, loads)
        if np.any(size < 0.0) or np.any(left < -ROUNDING * size):
            raise NotPositiveError("The matrix is not positive definite.")
        kept = left > ROUNDING * size
        vectors, loads = _among_each_other(vectors[:, kept] / np.sqrt(left[kept]), loads[:, kept] / np.sqrt(left[kept]))
        # twice is enough; what loses much once more was rounding
        vectors = vectors - self.basis @ (self._part(1).T @ vectors)
        loads = self._stiffness @ vectors
        kept = _squares(vectors, loads) > 0.5
        return share, *_among_each_other(vectors[:, kept], loads[:, kept])


def _among_each_other(vectors, loads):
    """Vectors of about unit length made orthonormal to each other in K, with their loads."""
    if not vectors.shape[1]:
        return vectors, loads
    lengths, turn = np.linalg.eigh(vectors.T @ loads)
    if lengths[0] < -ALIKE:
        raise NotPositiveError("The matrix is not positive definite.")
    if lengths[0] < ALIKE:
        return _one_by_one(vectors, loads)
    turn = turn / np.sqrt(lengths)
    return vectors @ turn, loads @ turn


def _squares(vectors, loads):
    return np.einsum("ij,ij->j", vectors, loads)


def _one_by_one(vectors, loads):
    """Vectors of unit length made orthonormal in their order (Gram and Schmidt, twice), without those that the ones
    before them hold.
    """
    kept, pushed = [], []
    for vector, load in zip(vectors.T, loads.T, strict=True):
        for _ in range(2):
            for other, its_load in zip(kept, pushed, strict=True):
                part = its_load @ vector
                vector, load = vector - part * other, load - part * its_load
        square = vector @ load
        if square > ROUNDING:
            kept.append(vector / np.sqrt(square))
            pushed.append(load / np.sqrt(square))
    n = len(vectors)
    return np.array(kept).reshape(-1, n).T, np.array(pushed).reshape(-1, n).T
