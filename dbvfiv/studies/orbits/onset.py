"""An onset with an oscillation, at which a branch of cycles starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...case.parameters import Mu
from ..stability.walk import StabilityWalk

#: Leading modes of which the basis of the corrections is made at the start.
MODES = 6


@dataclass(frozen=True, eq=False)
class Onset:
    """An onset with an oscillation.

    Attributes
    ----------
    value : float
        Of the parameter.
    place : Mu
    spectrum : eigen.Spectrum
        Leading modes there.
    index : int
        Of the neutral one among them.
    """

    value: float
    place: Mu
    spectrum: object
    index: int

    @property
    def eigenvalue(self) -> complex:
        return complex(self.spectrum.eigenvalues[self.index])

    @property
    def mode(self):
        return self.spectrum.mode(self.index)


def onset_at(walk: StabilityWalk, place: Mu, value: float, expected: complex) -> Onset | None:
    """The onset at a place where an eigenvalue is known to be neutral; None if that does not oscillate.

    Raises
    ------
    SolveError
    """
    spectrum = walk.spectrum(place, MODES)
    index = int(np.argmin(np.abs(spectrum.eigenvalues - expected)))
    onset = Onset(value, place, spectrum, index)
    return onset if onset.eigenvalue.imag > 1e-3 * abs(onset.eigenvalue) else None
