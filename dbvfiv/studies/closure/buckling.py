"""Loss of uniqueness along equilibria of a pressed shell: stiffness eigenvalues of symmetry classes, where the lowest
passes zero, and limit points.

The eigenvalues are those of K x = mu M x with the mass matrix M, in 1/s2, which do not depend on the mesh as those of K
alone would; K is singular where one vanishes. A follower pressure on a surface with a free edge makes K unsymmetric, so
two answers are given: eigenvalues of K itself, of which a real one passes zero where the equilibrium stops being
unique, and those of its symmetric part, whose smallest is a lower bound (Bromwich) and which alone decide where the
load has a potential.

Paths stay in the class of the equilibria. In the other classes contact acts on motions in which the lips move against
each other; lips that move together slide without friction and turn their contact forces with them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse.linalg as spla

from eigen.factor import DirectFactor

from ...errors import SolveError
from ...model.load_curve import LoadCurve
from ...model.load_steps import LoadStepOptions, LoadSteps

#: The eigenvalue at a located buckling state over that at the stable end of its bracket.
TOLERANCE = 1e-7
#: Bracket of the pressure, over it, in which a buckling state is located whatever its eigenvalue.
NARROW = 1e-8
#: Eigenvalues nearest to zero among which the lowest are looked for, at least.
_FEWEST = 4
#: Shift next to which lower eigenvalues are looked for, over the largest one known in magnitude.
BELOW = 16.0
#: How often a state that is not of the path is done without before the search for a nearer one ends.
_REFUSALS = 6


@dataclass(frozen=True, eq=False)
class StiffnessSpectrum:
    """Lowest eigenvalues at one state, ascending."""

    values: np.ndarray  #: (k,), 1/s2; of the whole tangent, by real part.
    vectors: np.ndarray  #: (n, k).
    #: stiffness and mass: (n, n) sparse matrices.
    stiffness: Any
    mass: Any

    @cached_property
    def symmetric_values(self) -> np.ndarray:
        """(k,) those of the symmetric part, 1/s2."""
        symmetric = (0.5 * (self.stiffness + self.stiffness.T)).tocsr()
        symmetric.sort_indices()

        def nearest(count: int, shift: float) -> tuple[np.ndarray]:
            look = {"sigma": shift, "OPinv": _inverse(symmetric - shift * self.mass), "v0": _start(symmetric)}
            return (np.sort(spla.eigsh(symmetric, count, self.mass, return_eigenvectors=False, tol=1e-12, **look)),)

        try:
            found = _with_those_below(nearest(_among(len(self.values), symmetric), 0.0), nearest)
            return found[0][: len(self.values)]
        except (spla.ArpackError, ArithmeticError) as error:
            raise SolveError(f"The lowest eigenvalues of the symmetric stiffness were not found ({error}).") from error

    @property
    def asymmetry(self) -> float:
        """Largest entry of K - K' over that of K."""
        return float(abs(self.stiffness - self.stiffness.T).max() / abs(self.stiffness).max())

    @property
    def lowest(self) -> float:
        """Lowest real eigenvalue of the whole tangent, 1/s2; of complex ones the real part if there are no others."""
        real = np.abs(self.values.imag) <= 1e-8 * np.abs(self.values)
        return float((self.values[real] if real.any() else self.values).real.min())

    @property
    def shape(self) -> np.ndarray:
        """Eigenvector (n,) of the lowest eigenvalue, its largest entry positive and one."""
        vector = self.vectors[:, int(np.argmin(np.abs(self.values - self.lowest)))].real
        return vector / vector[np.argmax(np.abs(vector))]


def stiffness_spectrum(model: Any, q: np.ndarray, pressure: float, count: int = 4) -> StiffnessSpectrum:
    """Lowest eigenvalues of a state (n,) at a pressure, Pa; see `spectrum_of`."""
    return spectrum_of(*_matrices(model, q, pressure), pressure, count)


def _matrices(model: Any, q: np.ndarray, pressure: float):
    """Tangent stiffness and mass, sparse, of a state (n,) at a pressure, Pa."""
    matrix = model.shell.dofs.matrix
    return matrix(model.tangent(q, pressure).stiffness), matrix(model.mass(q))


def spectrum_of(stiffness, mass, pressure: float, count: int = 4, tolerance: float = 1e-8) -> StiffnessSpectrum:
    """Lowest eigenvalues of two sparse matrices (n, n) by shift-and-invert Arnoldi (ARPACK) with sparse LU factors.
    Raises SolveError if the eigenvalues did not converge, or did not to the accuracy asked for.

    Those nearest to zero are found, and what lies below them is looked for until nothing more is found: negative ones
    may be farther from zero than many positive ones. It is a search and no proof: next to a shift, what lies below it
    by more than the others above is not seen.
    """
    nearest = partial(_nearest, stiffness, mass)
    try:
        found = _about_zero(nearest, _among(count, stiffness), tolerance)
        values, vectors, residuals = _with_those_below(found, nearest)
    except (spla.ArpackError, ArithmeticError) as error:
        raise SolveError(f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were not found ({error}).") from error
    if residuals.max() > tolerance:
        raise SolveError(
            f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were found to a relative residual of "
            f"{residuals.max():.2g} only, not to {tolerance:.2g}."
        )
    return StiffnessSpectrum(values[:count], vectors[:, :count], stiffness, mass)


def _about_zero(nearest: Callable[[int, float], Sequence[np.ndarray]], count: int, tolerance: float = 1e-8):
    """Eigenvalues nearest to zero with vectors and residuals."""
    found = nearest(count, 0.0)
    if found[2].max() > tolerance:
        # An eigenvalue next to the shift drowns the others; stand off by a fraction of their distance.
        found = nearest(count, -0.1 * float(np.abs(found[0]).max()))
    return found


def _among(count: int, matrix) -> int:
    """Number of eigenvalues of a matrix (n, n) that are found to take the lowest of."""
    return min(max(count, _FEWEST), matrix.shape[0] - 2)


def _with_those_below(found: Sequence[np.ndarray], nearest: Callable[[int, float], Sequence[np.ndarray]]):
    """Eigenvalues (k,), ascending, and what else is found of them along last axes, with those below them that a search
    next to shifts farther down finds.
    """
    while True:
        shift = -BELOW * float(np.abs(found[0]).max())
        below = nearest(1, shift)
        if not below[0].real[0] < found[0].real[0] + 1e-6 * shift:
            return found
        found = [np.concatenate(pair, axis=-1) for pair in zip(below, found)]


def _nearest(stiffness, mass, count, shift):
    """Eigenvalues next to a shift with vectors and residuals, by real part."""
    inverse, start = _inverse(stiffness - shift * mass), _start(stiffness)
    values, vectors = spla.eigs(stiffness, count, mass, sigma=shift, OPinv=inverse, v0=start, tol=1e-13)
    order = np.argsort(values.real)
    values, vectors = values[order], vectors[:, order]
    # Measured against the size of the terms that cancel, for an eigenvalue may be zero.
    size = np.linalg.norm(abs(stiffness) @ np.abs(vectors), axis=0)
    return values, vectors, np.linalg.norm(stiffness @ vectors - mass @ vectors * values, axis=0) / size


def _start(matrix) -> np.ndarray:
    """A fixed generic vector: the same answer in every run."""
    return np.cos(np.arange(1.0, matrix.shape[0] + 1.0))


def _inverse(matrix) -> spla.LinearOperator:
    matrix = matrix.tocsr()
    matrix.sort_indices()
    factor = DirectFactor(matrix.indptr, matrix.indices)
    factor.values[:] = matrix.data
    factor.refactor()
    return spla.LinearOperator(matrix.shape, matvec=lambda x: factor.solve(np.asarray(x, float).ravel()), dtype=float)


class Buckling(NamedTuple):
    """A state in which the tangent stiffness is singular."""

    kind: str  #: "limit point": the pressure can rise no further on this path; "bifurcation": another path crosses.
    pressure: float  #: Pa; critical pressure.
    #: q and shape: (n,); the state, and the shape it buckles into, largest entry one; the shape in the unknowns of its
    #: class of motion.
    q: np.ndarray
    shape: np.ndarray
    eigenvalue: float  #: 1/s2; lowest stiffness eigenvalue in magnitude there.


@dataclass
class BucklingWatch:
    """Looks at the equilibria of a path one after the other.

    A path that is walked by rising pressure turns back at a limit point, so that an eigenvalue which passes zero on the
    way belongs to a bifurcation.

    Parameters
    ----------
    model : ClosedValve or alike
    steps : LoadStepOptions
    spectrum : callable
        From unknowns (n,) and pressure, Pa, to the eigenvalues of the class that is watched.
    """

    model: Any
    steps: LoadStepOptions
    spectrum: Callable[[np.ndarray, float], StiffnessSpectrum]
    found: list[Buckling] = field(default_factory=list)
    #: (pressure, unknowns) or None; last equilibrium, of those seen, before the first that was found by this watch.
    before: tuple[float, np.ndarray] | None = None
    _stable: _Known | None = field(default=None, repr=False)

    def see(self, pressure: float, q: np.ndarray) -> StiffnessSpectrum:
        """Stiffness eigenvalues of the next equilibrium; locates where the lowest has passed zero since the last."""
        spectrum = self.spectrum(q, pressure)
        known = _Known(pressure, q, spectrum.lowest, spectrum.shape)
        if known.lowest > 0:
            self._stable = known
        elif self._stable is not None:
            if not self.found:
                self.before = (self._stable.pressure, self._stable.q)
            self.found.append(self._locate(self._stable, known))
            self._stable = None
        return spectrum

    def forget(self) -> None:
        """The path has jumped: the next equilibrium does not follow from the last."""
        self._stable = None

    def _locate(self, stable: _Known, unstable: _Known) -> Buckling:
        """State between two equilibria where the lowest eigenvalue vanishes, by a bracketed secant rule. Where that
        twice does not halve the bracket it is halved: faces that part let the eigenvalue fall on next to no way.

        States between them are corrected from a straight line through both. Where paths cross, the tangent is singular
        and Newton's method may end on the other path; such a state is not used. When no nearer state is found, the zero
        is that of the line through the eigenvalues on both sides, with the state of the nearer one.
        """
        low, high, refused, slow = stable, unstable, 0, 0
        while True:
            place = 0.5 if slow == 2 else min(max(low.lowest / (low.lowest - high.lowest), 0.02), 0.98)
            aim = low.between(high, place if refused == 0 else 0.5 * (place + refused % 2))
            state = self._on_path(low, high, aim)
            if state is None:
                refused += 1
                if refused > _REFUSALS:
                    nearer = min((low, high), key=lambda known: abs(known.lowest))
                    return Buckling("bifurcation", low.between(high, place), nearer.q, nearer.shape, nearer.lowest)
                continue
            refused = 0
            width = abs(high.pressure - low.pressure)
            if abs(state.lowest) <= TOLERANCE * stable.lowest or width <= NARROW * abs(aim):
                return Buckling("bifurcation", state.pressure, state.q, state.shape, state.lowest)
            low, high = (state, high) if state.lowest > 0 else (low, state)
            slow = slow + 1 if abs(high.pressure - low.pressure) > 0.51 * width and slow < 2 else 0

    def _on_path(self, low: _Known, high: _Known, pressure: float) -> _Known | None:
        """The equilibrium at a pressure between two others of a path; None if another path was found."""
        part = (pressure - low.pressure) / (high.pressure - low.pressure)
        guess = low.q + part * (high.q - low.q)
        steps = LoadSteps(self.model, self.steps, pressure, guess)
        try:
            steps.settle()
        except SolveError:
            return None
        off, apart = (np.abs(self.model.nodal(way)[:, :3]).max() for way in (steps.q - guess, high.q - low.q))
        if off > 0.5 * apart:
            return None
        spectrum = self.spectrum(steps.q, pressure)
        return _Known(float(pressure), steps.q, spectrum.lowest, spectrum.shape)


class _Known(NamedTuple):
    """A state of the path with its lowest eigenvalue, 1/s2, and the shape that belongs to it."""

    pressure: float
    q: np.ndarray
    lowest: float
    shape: np.ndarray

    def between(self, other: _Known, part: float) -> float:
        """A pressure on the way to another state, Pa."""
        return float(self.pressure + part * (other.pressure - self.pressure))


class LimitPath(NamedTuple):
    """Equilibria followed by arc length."""

    #: (pressure, unknowns); from the start on; the last one is where the path ended.
    points: list[tuple[float, np.ndarray]]
    limits: list[Buckling]  #: Limit points on it.
    reached: bool  #: The path came to the target pressure.
    reason: str  #: Why it ended.


def follow_past_limits(curve: LoadCurve, target: float) -> LimitPath:
    """Follow a curve of equilibria until the pressure is `target`, Pa, or falls to zero; one that stops at limit points
    to the last point before the first. Of one without limit points those points are told that go on towards the target.
    Raises SolveError if no curve leaves its start.
    """
    curve.extend(target)
    found, limits = curve.limit_states(), []
    points = list(zip(map(float, curve.pressures), curve.states))
    if curve.stops_at_limit or not found:
        found = found[:1]
        points = [points[i] for i in curve.towards(found[0].before if found else len(points) - 1)]
    for pressure, q, shape, _ in found:
        vanishing = _least_in_magnitude(curve.model, q, pressure)
        limits.append(Buckling("limit point", pressure, q, shape / shape[np.argmax(np.abs(shape))], vanishing))
    return LimitPath(points, limits, abs(points[-1][0] - target) <= 1e-9 * target, curve.reason)


def _least_in_magnitude(model: Any, q: np.ndarray, pressure: float) -> float:
    """Stiffness eigenvalue nearest to zero, 1/s2, of a state (n,) at a pressure, Pa. Raises SolveError."""
    stiffness, mass = _matrices(model, q, pressure)
    try:
        values = _about_zero(partial(_nearest, stiffness, mass), _among(1, stiffness))[0]
    except (spla.ArpackError, ArithmeticError) as error:
        raise SolveError(f"The stiffness eigenvalue that vanishes at {pressure:.6g} Pa was not found.") from error
    return float(values[np.argmin(np.abs(values))].real)
