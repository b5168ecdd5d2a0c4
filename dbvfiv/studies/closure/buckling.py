"""The watch for buckling along a path of equilibria: where the lowest stiffness eigenvalue passes zero, and with which
shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...model.load_steps import LoadStepOptions, LoadSteps
from ...model.pressed_shell import PressedShell
from .stiffness import StiffnessSpectrum, stiffness_spectrum

#: The eigenvalue at a located buckling state over that at the stable end of its bracket.
TOLERANCE = 1e-7


@dataclass(frozen=True)
class Buckling:
    """A state in which the tangent stiffness is singular.

    Attributes
    ----------
    kind : str
        "limit point": the pressure can rise no further on this path; "bifurcation": another path crosses.
    pressure : float, Pa
        Critical pressure.
    q, shape : (n,) arrays
        The state, and the shape it buckles into, largest entry one; the shape in the unknowns of its class of motion.
    eigenvalue : float, 1/s2
        Lowest stiffness eigenvalue in magnitude there.
    """

    kind: str
    pressure: float
    q: np.ndarray
    shape: np.ndarray
    eigenvalue: float


@dataclass
class BucklingWatch:
    """Looks at the equilibria of a path one after the other.

    A path that is walked by rising pressure turns back at a limit point, so that an eigenvalue which passes zero on the
    way belongs to a bifurcation.

    Attributes
    ----------
    found : list of Buckling
    before : (pressure, unknowns) or None
        Last equilibrium, of those seen, before the first that was found by this watch.
    spectrum : callable, optional
        From unknowns and pressure to the eigenvalues that are watched; those within the model's symmetry by default.
    """

    pressed: PressedShell
    steps: LoadStepOptions
    eigenvalues: int = 4
    found: list[Buckling] = field(default_factory=list)
    before: tuple[float, np.ndarray] | None = None
    spectrum: Callable[[np.ndarray, float], StiffnessSpectrum] | None = None
    _stable: tuple[float, np.ndarray, float] | None = field(default=None, repr=False)

    def see(self, pressure: float, q: np.ndarray) -> StiffnessSpectrum:
        """Stiffness eigenvalues of the next equilibrium; locates where the lowest has passed zero since the last."""
        spectrum = self._spectrum(q, pressure)
        if spectrum.lowest > 0:
            self._stable = (pressure, q, spectrum.lowest)
        elif self._stable is not None:
            if not self.found:
                self.before = self._stable[:2]
            self.found.append(self._locate(*self._stable, pressure, spectrum.lowest))
            self._stable = None
        return spectrum

    def resume(self, pressure: float, q: np.ndarray, lowest: float, found: tuple[Buckling, ...]) -> None:
        """Go on from a state with its lowest eigenvalue and what was found before it."""
        self.found[:] = found
        self._stable = (pressure, q, lowest) if lowest > 0 else None

    def forget(self) -> None:
        """The path has jumped: the next equilibrium does not follow from the last."""
        self._stable = None

    def _spectrum(self, q: np.ndarray, pressure: float) -> StiffnessSpectrum:
        if self.spectrum is not None:
            return self.spectrum(q, pressure)
        return stiffness_spectrum(self.pressed, q, pressure, self.eigenvalues)

    def _locate(self, low: float, start: np.ndarray, at_low: float, high: float, at_high: float) -> Buckling:
        """The state between two pressures where the lowest eigenvalue vanishes, by the secant rule kept within its
        bracket.
        """
        scale, steps = at_low, LoadSteps(self.pressed, self.steps, low, start)
        while True:
            aim = low + (high - low) * min(max(at_low / (at_low - at_high), 0.02), 0.98)
            steps.reach(aim)
            spectrum = self._spectrum(steps.q, aim)
            if abs(spectrum.lowest) <= TOLERANCE * scale or abs(high - low) <= 1e-11 * abs(high):
                return Buckling("bifurcation", float(aim), steps.q, spectrum.shape, spectrum.lowest)
            if spectrum.lowest > 0:
                low, at_low = aim, spectrum.lowest
            else:
                high, at_high = aim, spectrum.lowest
