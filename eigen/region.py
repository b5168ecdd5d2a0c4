"""The part of the complex plane in which a search found every eigenvalue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Oval:
    """Where a Krylov search at one shift has found every eigenvalue.

    A real shift gives a disc; of a pencil that relaxes one that touches the real axis at the shift, given with its
    centre shift + i reach in place of the shift, and its mirror image. A complex shift in real arithmetic gives the
    Cassini oval |lambda - shift| |lambda - conj(shift)| <= reach^2; in complex arithmetic a disc and its mirror image.

    Attributes
    ----------
    shift : complex
    reach : float
        1/s.
    paired : bool
        True for a Cassini oval.
    """

    shift: complex
    reach: float
    paired: bool

    def interval(self, omega: np.ndarray) -> np.ndarray:
        """Growth rates covered at angular frequencies, shape (k, 2); empty ones are NaN."""
        a, b = self.shift.real, abs(self.shift.imag)
        y = np.abs(np.asarray(omega, float))
        if self.paired:
            square = np.sqrt(4 * (y * b) ** 2 + self.reach**4) - (y**2 + b**2)
        else:
            square = self.reach**2 - (y - b) ** 2
        half = np.sqrt(np.where(square >= 0, square, np.nan))
        return np.stack([a - half, a + half], axis=-1)

    def contains(self, eigenvalue: complex) -> bool:
        """Whether a point (or its conjugate) lies in the oval."""
        low, high = self.interval(np.array([complex(eigenvalue).imag]))[0]
        return bool(low <= complex(eigenvalue).real <= high)


@dataclass(frozen=True)
class SearchedRegion:
    """Union of ovals, or the whole plane.

    Attributes
    ----------
    ovals : tuple of Oval
    everything : bool
        True if all eigenvalues of the pencil were found.
    lowest : float
        Angular frequency, rad/s, below which `complete_between` does not look: real eigenvalues crowd there where the
        stiffness relaxes.
    slope : float
        Decay over angular frequency beyond which it does not look either.
    """

    ovals: tuple[Oval, ...] = ()
    everything: bool = False
    lowest: float = 0.0
    slope: float = np.inf

    def contains(self, eigenvalue: complex) -> bool:
        """Whether every eigenvalue at this place would have been found."""
        return self.everything or any(o.contains(eigenvalue) for o in self.ovals)

    def complete_between(self, band: float, samples: int = 400) -> tuple[float, float]:
        """Growth rates between which the search is complete up to a frequency.

        Parameters
        ----------
        band : float
            Angular frequency, rad/s.

        Returns
        -------
        low, high : float
            Every eigenvalue with low <= growth rate <= high and |frequency| <= band, within what
            `lowest` and `slope` leave, was found. (inf, -inf) if there is no such strip. To the right of `high` only
            an independent count can tell.
        """
        if self.everything:
            return -np.inf, np.inf
        if not self.ovals:
            return np.inf, -np.inf
        omega = np.linspace(self.lowest, max(band, self.lowest), samples)
        pieces = np.stack([o.interval(omega) for o in self.ovals])  # (ovals, samples, 2)
        seed = max(o.shift.real for o in self.ovals)
        low, high = np.full(samples, seed), np.full(samples, seed)
        inside = np.zeros(samples, bool)
        for _ in self.ovals:  # chains of overlapping intervals, starting at the shift
            for start, end in np.moveaxis(pieces, 2, 1):
                joins = (start <= high) & (end >= low)
                inside |= joins
                low = np.where(joins, np.minimum(low, start), low)
                high = np.where(joins, np.maximum(high, end), high)
        if not inside.all():
            return np.inf, -np.inf
        if np.isfinite(self.slope):
            low = np.where(low <= -self.slope * omega, -np.inf, low)
        return float(low.max()), float(high.min())
