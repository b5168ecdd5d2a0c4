"""A valve that is loaded from rest by all that loads it at once: pressure, levels of the fluid, weight."""

from __future__ import annotations

import numpy as np

from .linear import CoupledFactor
from .valve import Tangent, ValveModel


class Loading:
    """The contract of equilibria with a share of the whole load in the place of the pressure.

    With gravity the valve without load is no equilibrium at any pressure; it is one without weight.

    Parameters
    ----------
    model : ValveModel
    pressure : float
        That belongs to the whole load, Pa.
    """

    def __init__(self, model: ValveModel, pressure: float):
        self.model, self.whole = model, float(pressure)
        self.mesh, self.nodal, self.rest = model.mesh, model.nodal, model.rest
        self.apply, self.rounding = model.apply, model.rounding

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return self.model.size

    def residual(self, q: np.ndarray, share: float) -> np.ndarray:
        """Unbalanced force (n,) under a share of the load."""
        return self.model.residual(q, self.whole, share)

    def tangent(self, q: np.ndarray, share: float) -> Tangent:
        """Residual and linearisation there."""
        return self.model.tangent(q, self.whole, share)

    def factor(self) -> CoupledFactor:
        """A new factorisation object."""
        return self.model.factor()

    def refactor(self, factor: CoupledFactor, tangent: Tangent) -> None:
        """Factor a tangent."""
        self.model.refactor(factor, tangent)

    def pressure_derivative(self, q: np.ndarray, share: float) -> np.ndarray:
        """Derivative (n,) of the residual by the share."""
        return self.model.residual(q, self.whole, 1.0) - self.model.residual(q, self.whole, 0.0)

    def force_scale(self, q: np.ndarray, share: float) -> float:
        """Force to which residuals are relative, N: that of the whole load."""
        return self.model.force_scale(q, self.whole)
