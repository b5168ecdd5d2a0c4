"""Largest eigenpairs of a symmetric A relative to a positive K, A x = mu K x, by a block Krylov space of K^-1 A.

Factors solve for several right-hand sides in a fraction of the time that these take one by one, and so do dense
products: where both are what costs, a block of vectors is worth more steps than the single one of ARPACK saves.
The basis V is orthonormal in K and kept whole (Golub and Underwood 1977; Musco and Musco 2015).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .basis import beside

#: Blocks after which the search is given up.
MOST_BLOCKS = 60


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
    space, newest = _Space(*start.shape), start
    for _ in range(MOST_BLOCKS):
        share, fresh, loads = beside(space.basis, space.loads, stiffness, solve(newest))
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

    def __init__(self, n: int, block: int):
        self.size, self._block = 0, block
        self._arrays = np.empty((3, 0, n))
        self._projected = np.zeros((0, 0))

    def _part(self, which: int) -> np.ndarray:
        return self._arrays[which, : self.size].T

    @property
    def basis(self) -> np.ndarray:
        return self._part(0)

    @property
    def loads(self) -> np.ndarray:
        return self._part(1)

    @property
    def images(self) -> np.ndarray:
        return self._part(2)

    def extend(self, basis, loads, images) -> None:
        more = basis.shape[1]
        if self.size + more > self._arrays.shape[1]:
            wider = np.empty((3, 2 * self._arrays.shape[1] + 10 * self._block, self._arrays.shape[2]))
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
        # columns that run forwards in memory: products with a reversed view leave BLAS aside
        return values[::-1][:count], np.ascontiguousarray(turns[:, ::-1][:, :count])
