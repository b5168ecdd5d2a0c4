"""The pressed shell as a System for `continuation`: equilibrium paths past limit points in pressure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation import ContinuationOptions, MatrixLinearisation, SystemBase, continue_branch
from continuation import NewtonOptions as ContinuationNewton
from continuation.branch import Branch

from ...contact import contact_form
from ...model.pressed_shell import PressedShell
from ...observer import Observer
from .stiffness import stiffness_spectrum

PARAMETER = "pressure"
#: First and largest step, in wall thicknesses of mean displacement, and most points.
STEP, LARGEST_STEP, MOST_POINTS = 0.05, 0.25, 400


class PressedSystem(SystemBase):
    """M u' = -r(u; P): motion so slow that only resistance counts, with the mass matrix for the resistance.

    Its equilibria are those of the shell, and the eigenvalues of its linearisation are the stiffness eigenvalues of
    `stiffness` with the sign turned, so that a positive one means an unstable equilibrium. The contact
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
        expand, restrict = pressed.nodal, pressed.shell.dofs.restrict
        second = pressed.shell.second(u, a, b)
        if pressed.contact is not None:
            second += restrict(contact_form(pressed.contact, expand(u), pressed.multiplier, expand(a), expand(b)))
        return mu[PARAMETER] * pressed.pressure_force_second(expand(a), expand(b)) - second

    def d2_parameter(self, u, mu, name, a):
        tangent = self.pressed.tangent(u, 0.0)
        loaded = self.pressed.tangent(u, 1.0)
        return -(self.pressed.shell.dofs.matrix(loaded.stiffness - tangent.stiffness) @ a)


@dataclass(frozen=True)
class LimitPoint:
    """A turning point of the equilibrium path.

    Attributes
    ----------
    pressure : float, Pa
    q : (n,) array
    shape : (n,) array
        Null vector of the tangent stiffness, its largest entry positive and one.
    eigenvalue : float, 1/s2
        Lowest stiffness eigenvalue in magnitude there; zero but for rounding.
    """

    pressure: float
    q: np.ndarray
    shape: np.ndarray
    eigenvalue: float


@dataclass(frozen=True)
class ArclengthPath:
    """Equilibrium path beyond a limit point, followed by arc length.

    Attributes
    ----------
    branch : Branch
    limits : tuple of LimitPoint
    q : (n,) array
        Last state.
    pressure : float, Pa
        Its pressure.
    reached : bool
        The path came to the target pressure.
    """

    branch: Branch
    limits: tuple[LimitPoint, ...]
    q: np.ndarray
    pressure: float
    reached: bool


def arclength_path(
    pressed: PressedShell,
    q: np.ndarray,
    pressure: float,
    target: float,
    tolerance: float = 1e-8,
    observer: Observer | None = None,
) -> ArclengthPath:
    """Follow equilibria from a state by pseudo-arclength until the pressure is `target`, or falls to zero.

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
    )

    def tell(branch, *rest):
        point = branch.points[-1]
        observer.progress(f"arclength point {len(branch)} at {point.z[-1]:.6g} Pa")

    branch = continue_branch(system, q, {PARAMETER: pressure}, PARAMETER, options, observers=tell)
    if branch.reason == "interrupted":  # no end of the path: whoever goes on follows it anew
        raise KeyboardInterrupt
    limits = []
    for special in branch.of_kind("fold"):
        at = float(special.mu[PARAMETER])
        vector = special.vectors["right"]
        spectrum = stiffness_spectrum(pressed, special.u, at, 2)
        nearest = spectrum.values[np.argmin(np.abs(spectrum.values))]
        limits.append(LimitPoint(at, special.u, vector / vector[np.argmax(np.abs(vector))], float(nearest.real)))
    last = branch.points[-1].z
    at = float(last[-1])
    return ArclengthPath(branch, tuple(limits), last[:-1], at, abs(at - target) <= 1e-9 * target)
