"""Contracts between a model of the valve and the numerics.

Each of the three asks for no more than its users need:

- `EquilibriumModel` serves Newton's method and load steps: residual, exact tangent and its factors at rest. -
`MotionForms` serves normal forms and sensitivities: the residual in motion and its multilinear forms. -
`continuation.System` serves branches, bifurcations and orbits. `dbvfiv.model.system.ValveSystem` makes it from the two
above; a test problem with two unknowns implements it by hand. Parameters may hold `loss_factor`, a factor on the loss
factors of all materials. Spectra depend on it, equilibria do not. Methods that would need the internal variables of a
viscoelastic wall refuse it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np

from .linear import CoupledFactor
from .valve import Tangent


@runtime_checkable
class EquilibriumModel(Protocol):
    """Equilibria r(q; P) = 0 of n unknowns under a pressure P, Pa."""

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        ...

    def rest(self) -> np.ndarray:
        """Unknowns (n,) without load."""
        ...

    def residual(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Unbalanced force (n,), N and N m."""
        ...

    def tangent(self, q: np.ndarray, pressure: float) -> Tangent:
        """Residual and exact linearisation."""
        ...

    def factor(self) -> CoupledFactor:
        """An object that factors tangents of this model."""
        ...

    def refactor(self, factor: CoupledFactor, tangent: Tangent) -> None:
        """Factor a tangent."""
        ...

    def apply(self, tangent: Tangent, direction: np.ndarray) -> np.ndarray:
        """Product (n,) of a tangent with a direction (n,)."""
        ...

    def pressure_derivative(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Derivative (n,) of the residual by the pressure."""
        ...

    def rounding(self, q: np.ndarray, tangent: Tangent) -> float:
        """Norm of the residual that rounding alone can leave, N."""
        ...

    def force_scale(self, q: np.ndarray, pressure: float) -> float:
        """Force to which residuals are relative, N."""
        ...


@runtime_checkable
class MotionForms(Protocol):
    """Residual (n + l,) of the equations of motion with l unknowns of the flow, and its derivatives.

    A motion is a tuple (q, v, a, inner, inner_rate): unknowns (n,), their rates and accelerations, the flow's unknowns
    (l,) and their rates. Mass, damping and stiffness are the derivatives by a, v and q. Forms of second and higher
    order are taken at rest, v = 0.
    """

    parameters: tuple[str, ...]

    def value(self, motion: tuple, parameters: Mapping[str, float]) -> np.ndarray:
        """Residual (n + l,)."""
        ...

    def second(self, motion: tuple, parameters: Mapping[str, float], a: tuple, b: tuple) -> np.ndarray:
        """Second directional derivative (n + l,) along two motions."""
        ...

    def third(self, motion: tuple, parameters: Mapping[str, float], a: tuple, b: tuple, c: tuple) -> np.ndarray:
        """Third directional derivative (n + l,) along three motions."""
        ...

    def parameter_slope(self, motion: tuple, parameters: Mapping[str, float], name: str) -> np.ndarray:
        """Derivative (n + l,) by a parameter."""
        ...

    def mixed(self, motion: tuple, parameters: Mapping[str, float], a: tuple, name: str) -> np.ndarray:
        """Derivative (n + l,) along a motion and by a parameter."""
        ...
