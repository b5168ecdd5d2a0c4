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

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from continuation import ContinuationOptions, MatrixLinearisation, Reason, System, continue_branch
from continuation import NewtonOptions as ContinuationNewton

from ...contact import class_stiffness, contact_form
from ...errors import SolveError
from ...model.classes import shell_of_class
from ...model.linear import DirectFactor
from ...model.load_steps import LoadStepOptions, LoadSteps
from ...model.pressed_shell import PressedShell
from ...observer import Observer
from ...shell.pressure import pressure_stiffness

#: The eigenvalue at a located buckling state over that at the stable end of its bracket.
TOLERANCE = 1e-7
#: How often a state that is not of the path is done without before the search for a nearer one ends.
_REFUSALS = 6
#: Parameter of arclength; first and largest step, in wall thicknesses of mean displacement, and most points.
PARAMETER, STEP, LARGEST_STEP, MOST_POINTS = "pressure", 0.05, 0.25, 400


class StiffnessSpectrum(NamedTuple):
    """Eigenvalues nearest to zero at one state, ascending.

    Attributes
    ----------
    values : (k,) complex array, 1/s2
        Of the whole tangent, by real part.
    vectors : (n, k) complex array
    residuals : (k,) array
        Norm of K x - mu M x over that of |K| |x|.
    symmetric_values : (k,) array, 1/s2
        Of the symmetric part.
    asymmetry : float
        Largest entry of K - K' over that of K.
    """

    values: np.ndarray
    vectors: np.ndarray
    residuals: np.ndarray
    symmetric_values: np.ndarray
    asymmetry: float

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


def stiffness_spectrum(
    pressed: PressedShell, q: np.ndarray, pressure: float, count: int = 4, tolerance: float = 1e-8
) -> StiffnessSpectrum:
    """Eigenvalues nearest to zero of a state (n,) at a pressure, Pa; see `spectrum_of`."""
    matrix = pressed.shell.dofs.matrix
    return spectrum_of(
        matrix(pressed.tangent(q, pressure).stiffness), matrix(pressed.mass(q)), pressure, count, tolerance
    )


def spectrum_of(stiffness, mass, pressure: float, count: int = 4, tolerance: float = 1e-8) -> StiffnessSpectrum:
    """Eigenvalues nearest to zero of two sparse matrices (n, n) by shift-and-invert Arnoldi (ARPACK) with sparse LU
    factors.

    Raises
    ------
    SolveError
        If the eigenvalues did not converge, or did not to the accuracy asked for.
    """
    symmetric = (0.5 * (stiffness + stiffness.T)).tocsr()
    symmetric.sort_indices()
    try:
        values, vectors, residuals = _nearest(stiffness, mass, count, 0.0)
        if residuals.max() > tolerance:
            # An eigenvalue next to the shift drowns the others; stand off by a fraction of their distance.
            values, vectors, residuals = _nearest(stiffness, mass, count, -0.1 * float(np.abs(values).max()))
        lower = _symmetric(symmetric, mass, count)
    except (spla.ArpackError, ArithmeticError) as error:
        raise SolveError(f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were not found ({error}).") from error
    if residuals.max() > tolerance:
        raise SolveError(
            f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were found to a relative residual of "
            f"{residuals.max():.2g} only, not to {tolerance:.2g}."
        )
    skew = abs(stiffness - stiffness.T).max() / abs(stiffness).max()
    return StiffnessSpectrum(values, vectors, residuals, lower, float(skew))


def _nearest(stiffness, mass, count, shift):
    """Eigenvalues next to a shift with vectors and residuals, by real part."""
    inverse, start = _inverse(stiffness - shift * mass), _start(stiffness)
    values, vectors = spla.eigs(stiffness, count, mass, sigma=shift, OPinv=inverse, v0=start, tol=1e-13)
    order = np.argsort(values.real)
    values, vectors = values[order], vectors[:, order]
    # Measured against the size of the terms that cancel, for an eigenvalue may be zero.
    size = np.linalg.norm(abs(stiffness) @ np.abs(vectors), axis=0)
    return values, vectors, np.linalg.norm(stiffness @ vectors - mass @ vectors * values, axis=0) / size


def _symmetric(symmetric, mass, count):
    look = {"sigma": 0.0, "OPinv": _inverse(symmetric), "v0": _start(symmetric), "tol": 1e-12}
    return np.sort(spla.eigsh(symmetric, count, mass, return_eigenvectors=False, **look))


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


def class_matrices(
    pressed: PressedShell, free: np.ndarray, apart: bool, q: np.ndarray, pressure: float
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness and mass (k, k) in a class of motion at a state (n,) and a pressure, Pa.

    Parameters
    ----------
    pressed : PressedShell
    free : (nn, 5) bool array
        Unknowns of the class.
    apart : bool
        True where the two walls move against each other, so that contact resists.
    """
    nodal = pressed.nodal(q)
    shell = shell_of_class(pressed.shell, free, nodal)
    surface, dofs, still = shell.mesh, shell.dofs, np.zeros(shell.size)
    _, values = shell.force_and_tangent(still)
    pressures = np.full(surface.node_count, pressed.sign * pressure)
    pressure_stiffness(surface.quads, surface.nodes, nodal, pressures, pressed.loaded, dofs.slots, -1.0, values)
    stiffness = dofs.matrix(values)
    if pressed.contact is not None:
        stiffness = stiffness + class_stiffness(pressed.contact, nodal, pressed.multiplier, shell, apart)
    return stiffness.tocsr(), dofs.matrix(shell.mass(still))


class Buckling(NamedTuple):
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

    Parameters
    ----------
    pressed : PressedShell
    steps : LoadStepOptions
    spectrum : callable
        From unknowns (n,) and pressure, Pa, to the eigenvalues of the class that is watched.

    Attributes
    ----------
    found : list of Buckling
    before : (pressure, unknowns) or None
        Last equilibrium, of those seen, before the first that was found by this watch.
    """

    pressed: PressedShell
    steps: LoadStepOptions
    spectrum: Callable[[np.ndarray, float], StiffnessSpectrum]
    found: list[Buckling] = field(default_factory=list)
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
                    nearer = min((low, high), key=lambda known: abs(known.lowest))
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
        off, apart = (np.abs(self.pressed.nodal(way)[:, :3]).max() for way in (steps.q - guess, high.q - low.q))
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


class PressedSystem(System):
    """M u' = -r(u; P): motion so slow that only resistance counts, with the mass matrix for the resistance.

    Its equilibria are those of the shell, and the stiffness eigenvalues with the sign turned are those of its
    linearisation, so that a positive one means an unstable equilibrium. The contact
    multipliers stay as they are.

    Parameters
    ----------
    pressed : PressedShell
    pressure_scale : float, Pa
        The residual is measured against the force of this pressure.
    """

    def __init__(self, pressed: PressedShell, pressure_scale: float):
        self.pressed = pressed
        self.size = pressed.size
        self._scale = pressed.force_scale(pressed.rest(), pressure_scale)
        self._mass = pressed.shell.dofs.matrix(pressed.mass(pressed.rest()))
        # One unit of the state is a mean displacement of one wall thickness, or a mean rotation of one radian.
        weights = np.ones(pressed.shell.dofs.free.shape) / pressed.mesh.node_count
        weights[:, :3] /= np.mean(pressed.mesh.thickness) ** 2
        self.state_weights = pressed.shell.dofs.restrict(weights)

    def residual_norm(self, residual: np.ndarray) -> float:
        return float(np.linalg.norm(residual) / self._scale)

    def residual(self, u, mu):
        return -self.pressed.residual(u, mu[PARAMETER])

    def linear(self, u, mu):
        tangent = self.pressed.tangent(u, mu[PARAMETER])
        return MatrixLinearisation(-self.pressed.shell.dofs.matrix(tangent.stiffness), self._mass)

    def d_parameter(self, u, mu, name):
        return -self.pressed.pressure_derivative(u, mu[PARAMETER])

    def d2(self, u, mu, a, b):
        pressed = self.pressed
        a_nodal, b_nodal = pressed.nodal(a), pressed.nodal(b)
        second = pressed.shell.second(u, a, b)
        if pressed.contact is not None:
            form = contact_form(pressed.contact, pressed.nodal(u), pressed.multiplier, a_nodal, b_nodal)
            second += pressed.shell.dofs.restrict(form)
        return mu[PARAMETER] * pressed.pressure_force_second(a_nodal, b_nodal) - second

    def d2_parameter(self, u, mu, name, a):
        tangent = self.pressed.tangent(u, 0.0)
        loaded = self.pressed.tangent(u, 1.0)
        return -(self.pressed.shell.dofs.matrix(loaded.stiffness - tangent.stiffness) @ a)


class LimitPath(NamedTuple):
    """Equilibria followed by arc length.

    Attributes
    ----------
    points : list of (pressure, unknowns)
        From the start on; the last one is where the path ended.
    limits : list of Buckling
        Limit points on it.
    reached : bool
        The path came to the target pressure.
    reason : str
        Why it ended.
    """

    points: list[tuple[float, np.ndarray]]
    limits: list[Buckling]
    reached: bool
    reason: str


def follow_past_limits(
    pressed: PressedShell,
    q: np.ndarray,
    pressure: float,
    target: float,
    tolerance: float = 1e-8,
    observer: Observer | None = None,
    past_limits: bool = True,
) -> LimitPath:
    """Follow equilibria from a state by pseudo-arclength until the pressure is `target`, or falls to zero, or to the
    first limit point alone.

    Raises
    ------
    NotConverged
        If the start is no equilibrium.
    """
    observer = Observer() if observer is None else observer
    system = PressedSystem(pressed, max(target, pressure))
    options = ContinuationOptions(
        step=STEP,
        min_step=1e-6,
        max_step=LARGEST_STEP,
        max_points=MOST_POINTS,
        limits={PARAMETER: (0.0, target)},
        parameter_scales={PARAMETER: max(target, pressure)},
        branch_points=False,
        newton=ContinuationNewton(tolerance=tolerance),
        max_angle=0.5,
        stop_at=frozenset() if past_limits else frozenset({"fold"}),
    )

    def report(branch, *rest):
        observer.progress(f"arclength point {len(branch)} at {branch.points[-1].z[-1]:.6g} Pa")

    branch = continue_branch(system, q, {PARAMETER: pressure}, PARAMETER, options, observers=report)
    if branch.reason.kind is Reason.INTERRUPTED:  # no end of the path: whoever goes on follows it anew
        raise KeyboardInterrupt
    limits = []
    for special in branch.of_kind("fold"):
        at = float(special.mu[PARAMETER])
        shape = special.vectors["right"]
        values = stiffness_spectrum(pressed, special.u, at, 2).values
        nearest = float(values[np.argmin(np.abs(values))].real)
        limits.append(Buckling("limit point", at, special.u, shape / shape[np.argmax(np.abs(shape))], nearest))
    points = [(float(point.z[-1]), point.z[:-1]) for point in branch.points]
    return LimitPath(points, limits, abs(points[-1][0] - target) <= 1e-9 * target, branch.reason)
