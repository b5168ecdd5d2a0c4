"""A structure that relaxes as a row of oscillators that know nothing of each other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from .relaxation import Relaxation


class Oscillators(NamedTuple):
    """A symmetric structure that relaxes, one equation s^2 + s c + k + sum phi_g(s) k_g = 0 for each mode.

    The modes are those of the stiffness that nothing has relaxed of; what couples them besides is left out.

    Attributes
    ----------
    squares : (k,) array
        Of their angular frequencies, rad2/s2.
    damping, slow : (k,) arrays, 1/s, 1/s2
    relaxing : (g, k) array, 1/s2
    """

    squares: np.ndarray
    damping: np.ndarray
    slow: np.ndarray
    relaxing: np.ndarray

    @classmethod
    def of(cls, M, C, K, relaxing, relaxation: Relaxation | None) -> Oscillators:
        """From symmetric matrices; relaxing (g, n, n), g = 0 where nothing does."""
        fast = 0.0 if relaxation is None else np.tensordot(relaxation.strengths.sum(axis=1), relaxing, 1)
        squares, X = la.eigh(K + fast, M)
        damping, slow = (np.einsum("ik,ij,jk->k", X, part, X, optimize=True) for part in (C, K))
        relaxing = np.einsum("ik,gij,jk->gk", X, relaxing, X, optimize=True)
        return cls(squares, damping, slow, np.maximum(relaxing, 0.0))  # but for rounding they are

    def values(self, relaxation: Relaxation | None, places: np.ndarray) -> np.ndarray:
        """The left sides at places s, (len(places), k)."""
        s = np.asarray(places, complex)[:, None]
        elastic = self.slow + s * (s + self.damping)
        return elastic if relaxation is None else elastic + relaxation.factors(s[:, 0]).T @ self.relaxing

    def zeros(self, relaxation: Relaxation | None, steps: int = 12) -> np.ndarray:
        """Estimates of the oscillating zeros."""
        found = 1j * np.sqrt(np.maximum(self.squares, 0.0))
        for _ in range(steps):
            stiffness = self.slow + 0j
            if relaxation is not None:
                stiffness += (relaxation.factors(found) * self.relaxing).sum(axis=0)
            found = (
                -0.5 * self.damping
                + 1j * np.sqrt(np.maximum((stiffness - 0.25 * self.damping**2).real, 0.0))
                - 0.5 * (stiffness.imag / np.where(found.imag > 0, found.imag, 1.0))
            )
        return found[found.imag > 0]
