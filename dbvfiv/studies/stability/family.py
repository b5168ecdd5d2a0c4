"""A steady state of the valve as a family of pencils: any fluid density, damping and continuity law."""

from __future__ import annotations

from functools import partial

import numpy as np

from eigen import Condition, CoupledPencil, PencilFamily, Relaxation, SearchOptions, Workspace, lowest_frequencies
from eigen.reduction import POWERS

from ...model.dynamics import Conditions, LinearisedState
from ...model.leading import select_search

#: Blends of the continuity laws whose fluid is kept, and factors whose relaxation is.
_KEPT = 256


class ValveFamily(PencilFamily):
    """Conditions are (density, alpha, beta, law, loss factor); the law is the blend of the continuity laws, and with a
    line in front (blend, length of the line in m); with a pipe behind its length comes third.

    At unit density the fluid's unknown is the inlet velocity, at others that times the root of the density.

    Parameters
    ----------
    linear : LinearisedState
    max_frequency : float, optional
        Hz; only modes up to it are searched for. Without it and without stiffness damping the band follows from the
        structural frequencies of the state.
    modes : int
        Structural frequencies that such a band holds.
    workspace : Workspace, optional
        Keeps the symbolic factorisation for those between states.
    """

    def __init__(
        self,
        linear: LinearisedState,
        max_frequency: float | None = None,
        modes: int = 10,
        workspace: Workspace | None = None,
    ):
        self.linear, self.max_frequency, self.modes, self._workspace = linear, max_frequency, modes, workspace
        self.mass, self.damping, self.stiffness = linear.mass, linear.structure, linear.stiffness
        self.forces, self.slope = linear.forces, linear.slope
        self._parts: dict[object, dict[str, np.ndarray]] = {}
        self._relaxations: dict[float, Relaxation | None] = {}
        self._searches: dict[tuple[float, float], SearchOptions] = {}
        self._frequencies = np.zeros(0)

    def _lowest(self, count: int, workspace: Workspace | None = None) -> np.ndarray:
        """Structural frequencies of the state."""
        if len(self._frequencies) < count:
            structure = CoupledPencil(self.mass, 0.0 * self.mass, self.stiffness)
            self._frequencies = lowest_frequencies(structure, count, workspace)
        return self._frequencies[:count]

    def search(self, condition: Condition) -> SearchOptions:
        """What is searched in the spectrum: the rule that every study follows."""
        key = condition.beta, condition.loss  # nothing else decides
        if key not in self._searches:
            conditions = Conditions(condition.inertia, condition.alpha, condition.beta, condition.loss)
            asked = SearchOptions(max_frequency=self.max_frequency)
            lowest = partial(self._lowest, workspace=self._workspace) if condition.loss else self._lowest
            self._searches[key] = select_search(asked, conditions, lowest, self.modes).options
        return self._searches[key]

    def relaxation(self, loss: float) -> Relaxation | None:
        """What relaxes with a factor on the loss factors of all materials."""
        loss = float(loss)
        if loss not in self._relaxations:
            if len(self._relaxations) > _KEPT:
                self._relaxations.clear()
            self._relaxations[loss] = self.linear.relaxation(loss)
        return self._relaxations[loss]

    def parts(self, law: Law) -> dict[str, np.ndarray]:
        """A0 to S1 at density 1."""
        if law not in self._parts:
            if len(self._parts) > _KEPT:
                self._parts.clear()
            self._parts[law] = self._computed(law)
        return self._parts[law]

    def _computed(self, law: Law) -> dict[str, np.ndarray]:
        linear, flow, m = self.linear, self.linear.model.flow, self.linear.forces.shape[1]
        found = {}
        if flow.has_fluid:
            found = linear.fluid_parts(1.0, *law_parts(law)) if flow.unsteady else linear.steady_parts()
        if len(found) == len(POWERS):
            return found
        zero = {"A": (m, m), "B": (m, 0), "R": (0, m), "S": (0, 0)}
        return {name: np.zeros(zero[name[0]]) for name in POWERS} | found

    def pencil(self, condition: Condition) -> CoupledPencil:
        """The full pencil, with the inlet velocity itself as unknown."""
        density, alpha, beta, law, loss_factor = condition
        storage, line = law_parts(law)
        return self.linear.pencil(Conditions(density, alpha, beta, loss_factor, **line), storage=storage)


#: Blend of the continuity laws; with the length of a line in front, m, and that of a pipe behind.
Law = float | tuple[float, float] | tuple[float, float, float]


def law_of(storage: float, pipe_length: float, tail_length: float) -> Law:
    """The law of a condition; a length of 0 m is none, or that of the case."""
    if tail_length:
        return storage, pipe_length, tail_length
    return (storage, pipe_length) if pipe_length else storage


def law_parts(law: Law) -> tuple[float, dict[str, float]]:
    """Blend of the continuity laws, and parameters of the line as `Conditions.of_line` has them, of a law."""
    if not isinstance(law, tuple):
        return float(law), {}
    return law[0], {name: value for name, value in zip(("pipe_length", "tail_length"), law[1:]) if value}
