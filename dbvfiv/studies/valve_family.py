"""A steady state of the valve as a family of pencils: any fluid density, damping and continuity law."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from eigen import Condition, CoupledPencil, PencilFamily, SearchOptions, TransferBasis
from eigen.reduction import POWERS

from ..flow import Channel
from ..model.dynamics import Conditions, LinearisedState, fluid_parts
from .modes_search import suited

#: Structural frequencies to know, at least, where a band is made of them.
_FREQUENCIES = 24
#: Blends of the continuity laws whose fluid is kept.
_KEPT = 256


class ValveFamily(PencilFamily):
    """Conditions are (density, alpha, beta, storage); at unit density the fluid's unknown is the inlet velocity, at
    others that times the root of the density.

    Parameters
    ----------
    linear : LinearisedState
    max_frequency : float, optional
        Hz; only modes up to it are searched for. Without it and without stiffness damping the band follows from the
        structural frequencies of the state.
    modes : int
        Structural frequencies that such a band holds.
    """

    def __init__(self, linear: LinearisedState, max_frequency: float | None = None, modes: int = 10):
        self.linear, self.max_frequency, self.modes = linear, max_frequency, modes
        self.mass, self.damping, self.stiffness = linear.mass, linear.structure, linear.stiffness
        self.forces, self.slope = linear.forces, linear.slope
        self._parts: dict[float, dict[str, np.ndarray]] = {}
        self._bands: dict[bool, SearchOptions] = {}

    @cached_property
    def _frequencies(self) -> TransferBasis:
        return TransferBasis(CoupledPencil(self.mass, 0.0 * self.mass, self.stiffness), modes=self._wanted)

    @property
    def _wanted(self) -> int:
        return max(_FREQUENCIES, self.modes)

    def search(self, condition: Condition) -> SearchOptions:
        """What is searched in the spectrum: the rule that `modes` follows."""
        conditions = Conditions(condition.inertia, condition.alpha, condition.beta)
        asked = SearchOptions(max_frequency=self.max_frequency)
        if self.max_frequency is None and condition.beta == 0:
            if True not in self._bands:
                self._bands[True] = suited(asked, conditions, self._frequencies, self.modes)[0]
            return self._bands[True]
        return suited(asked, conditions, _NO_BASIS, self.modes)[0]

    def parts(self, law: float) -> dict[str, np.ndarray]:
        """A0 to S1 at density 1."""
        law = float(law)
        if law not in self._parts:
            if len(self._parts) > _KEPT:
                self._parts.clear()
            self._parts[law] = self._computed(law)
        return self._parts[law]

    def _computed(self, storage: float) -> dict[str, np.ndarray]:
        linear, flow, m = self.linear, self.linear.model.flow, len(self.linear.area)
        if isinstance(flow, Channel) and flow.unsteady:
            return fluid_parts(flow, linear.area, linear.inlet, 1.0, storage)
        zero = {"A": (m, m), "B": (m, 0), "R": (0, m), "S": (0, 0)}
        parts = {name: np.zeros(zero[name[0]]) for name in POWERS}
        if isinstance(flow, Channel):
            parts["A0"] = flow.steady_operator(linear.area, linear.inlet)[1]
        return parts

    def pencil(self, condition: Condition) -> CoupledPencil:
        """The full pencil, with the inlet velocity itself as unknown."""
        density, alpha, beta, storage = condition
        return self.linear.pencil(Conditions(density, alpha, beta), storage=storage)


class _NoBasis:
    """Stands where the rule needs no structural frequencies."""

    structural_frequencies = np.full(1, np.inf)


_NO_BASIS = _NoBasis()
