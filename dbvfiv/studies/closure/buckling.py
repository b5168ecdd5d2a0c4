"""The watch for buckling along a path of equilibria: where the lowest stiffness eigenvalue passes zero, and with which
shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...errors import SolveError
from ...model.load_steps import LoadStepOptions, LoadSteps
from ...model.pressed_shell import PressedShell
from .stiffness import StiffnessSpectrum, stiffness_spectrum

#: The eigenvalue at a located buckling state over that at the stable end of its bracket.
TOLERANCE = 1e-7
#: How often a state that is not of the path is done without before the search for a nearer one ends.
_REFUSALS = 6


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
    _stable: _Known | None = field(default=None, repr=False)

    def see(self, pressure: float, q: np.ndarray) -> StiffnessSpectrum:
        """Stiffness eigenvalues of the next equilibrium; locates where the lowest has passed zero since the last."""
        spectrum = self._spectrum(q, pressure)
        if spectrum.lowest > 0:
            self._stable = _Known(pressure, q, spectrum.lowest, spectrum.shape)
        elif self._stable is not None:
            if not self.found:
                self.before = (self._stable.pressure, self._stable.q)
            self.found.append(self._locate(self._stable, _Known(pressure, q, spectrum.lowest, spectrum.shape)))
            self._stable = None
        return spectrum

    def resume(self, pressure: float, q: np.ndarray, lowest: float, found: tuple[Buckling, ...]) -> None:
        """Go on from a state with its lowest eigenvalue and what was found before it."""
        self.found[:] = found
        self._stable = _Known(pressure, q, lowest, None) if lowest > 0 else None

    def forget(self) -> None:
        """The path has jumped: the next equilibrium does not follow from the last."""
        self._stable = None

    def _spectrum(self, q: np.ndarray, pressure: float) -> StiffnessSpectrum:
        if self.spectrum is not None:
            return self.spectrum(q, pressure)
        return stiffness_spectrum(self.pressed, q, pressure, self.eigenvalues)

    def _locate(self, stable: _Known, unstable: _Known) -> Buckling:
        """State between two equilibria where the lowest eigenvalue vanishes, by a bracketed secant rule.

        States between them are corrected from a straight line through both. Where paths cross, the tangent is singular
        and Newton's method may end on the other path; such a state is not used. When no nearer state is found, the zero
        is that of the line through the eigenvalues on both sides, with the state of the nearer one.
        """
        low, high, refused = stable, unstable, 0
        while True:
            place = min(max(low.lowest / (low.lowest - high.lowest), 0.02), 0.98)
            aim = low.between(high, place if refused == 0 else 0.5 * (place + refused % 2))
            state = self._on_path(low, high, aim)
            if state is None:
                refused += 1
                if refused > _REFUSALS:
                    nearer = min((low, high), key=lambda known: (known.shape is None, abs(known.lowest)))
                    return Buckling("bifurcation", low.between(high, place), nearer.q, nearer.shape, nearer.lowest)
                continue
            refused = 0
            if abs(state.lowest) <= TOLERANCE * stable.lowest or abs(high.pressure - low.pressure) <= 1e-11 * abs(aim):
                return Buckling("bifurcation", state.pressure, state.q, state.shape, state.lowest)
            low, high = (state, high) if state.lowest > 0 else (low, state)

    def _on_path(self, low: _Known, high: _Known, pressure: float) -> _Known | None:
        """The equilibrium at a pressure between two others of a path; None if another path was found."""
        part = (pressure - low.pressure) / (high.pressure - low.pressure)
        guess = low.q + part * (high.q - low.q)
        steps = LoadSteps(self.pressed, self.steps, pressure, guess)
        try:
            steps.settle()
        except SolveError:
            return None
        size = lambda q: np.abs(self.pressed.nodal(q)[:, :3]).max()  # noqa: E731
        if size(steps.q - guess) > 0.5 * size(high.q - low.q):
            return None
        spectrum = self._spectrum(steps.q, pressure)
        return _Known(float(pressure), steps.q, spectrum.lowest, spectrum.shape)


@dataclass(frozen=True)
class _Known:
    """A state of the path with its lowest eigenvalue, 1/s2, and the shape that belongs to it."""

    pressure: float
    q: np.ndarray
    lowest: float
    shape: np.ndarray | None

    def between(self, other: _Known, part: float) -> float:
        """A pressure on the way to another state, Pa."""
        return float(self.pressure + part * (other.pressure - self.pressure))
