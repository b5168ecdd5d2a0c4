"""The energy balance of a path of equilibria: work of the pressure against what shell and contact have stored."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Gauss points of a stretch, exact for the work of a load that is quadratic in the positions along a cubic path while
#: the pressure rises linearly.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass
class EnergyLedger:
    """Adds up the work along a path of equilibria and compares it with the energies gained.

    On every stretch between two equilibria

        int P f(q) dq = gain of strain energy + gain of the contact's energy,

    for the path is one of equilibria under a pressure P that changes linearly. The path in between is taken as a cubic
    through both ends with the tangents dq/dP where these are known, else as straight. A follower pressure on a surface
    with a free edge has no potential, so that its work is one along the path and not a function of its ends.

    Parameters
    ----------
    model : ValveModel or alike

    Attributes
    ----------
    work, stored, defect : float, J
        Work of the pressure, energies gained, and the sum of the sizes of what is missing on each stretch.
    """

    model: Any
    work: float = 0.0
    stored: float = 0.0
    defect: float = 0.0
    _last: tuple | None = field(default=None, repr=False)

    @property
    def error(self) -> float:
        """Defect of the energy balance, absolute values summed over all stretches, over the work of the pressure."""
        return self.defect / abs(self.work) if self.work else 0.0

    @property
    def totals(self) -> tuple[float, ...]:
        """All sums, to go on with elsewhere."""
        return self.work, self.stored, self.defect

    @totals.setter
    def totals(self, values: tuple[float, ...]) -> None:
        self.work, self.stored, self.defect = (float(value) for value in values)

    def begin(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Start the ledger at the first state of the path, with dq/dP if that is known."""
        self._last = pressure, q, slope, self._energy(q)

    def add(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Take the next equilibrium, with dq/dP if that is known."""
        before, start, slope0, energy = self._last
        self.begin(q, pressure, slope)
        rise, step, work = pressure - before, q - start, 0.0
        curved = slope0 is not None and slope is not None
        for x, weight in zip(0.5 * (1 + _POINTS), 0.5 * _WEIGHTS):
            place, rate = _hermite(x, start, step, rise * slope0, rise * slope) if curved else (start + x * step, step)
            force = -(before + x * rise) * self.model.pressure_derivative(place, 1.0)
            work += weight * float(force @ rate)
        gained = self._last[-1] - energy
        self.work += work
        self.stored += gained
        self.defect += abs(work - gained)

    def _energy(self, q: np.ndarray) -> float:
        return self.model.shell.energy(q) + self.model.support_energy(q)


def _hermite(x, start, step, m0, m1):
    """Cubic through two states and its derivative with respect to x in 0..1."""
    h = x * x * (3 - 2 * x)
    place = start + h * step + x * (1 - x) ** 2 * m0 + x * x * (x - 1) * m1
    rate = 6 * x * (1 - x) * step + (1 - x) * (1 - 3 * x) * m0 + x * (3 * x - 2) * m1
    return place, rate
