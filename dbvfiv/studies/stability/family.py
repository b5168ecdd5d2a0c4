"""A steady state of the valve as a family of pencils: any fluid density, damping and continuity law."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from eigen import Condition, CoupledPencil, PencilFamily, Relaxation, SearchOptions, Workspace, lowest_frequencies
from eigen.creep import edge_of
from eigen.family import Reach

from ...model.dynamics import Conditions, LinearisedState
from ...model.leading import LeadingSearch, select_search

#: Blends of the continuity laws whose fluid is kept, and factors whose relaxation is.
_KEPT = 256
#: Structural frequencies in vacuo that a band holds at least.
LEAST_MODES = 10


class ValveFamily(PencilFamily):
    """Conditions are (density, alpha, beta, law, loss factor); the law as `law_of` makes it.

    At unit density the fluid's unknown is the inlet velocity, at others that times the root of the density.

    Parameters
    ----------
    linear : LinearisedState
    max_frequency : float, optional
        Hz; only modes up to it are searched for. Without it and without stiffness damping the band follows from the
        structural frequencies of the state.
    modes : int
        Modes wanted; a band holds as many structural frequencies, ten at least, so that studies that list few modes
        search where those do that list many.
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
        self.linear, self.max_frequency, self._workspace = linear, max_frequency, workspace
        self.modes = max(modes, LEAST_MODES)
        self.mass, self.damping, self.stiffness = linear.mass, linear.structure, linear.stiffness
        self.forces, self.slope = linear.coupling
        self.added = 0 if linear.added is None else linear.added.rank
        self._parts: dict[object, dict[str, np.ndarray]] = {}
        self._relaxations: dict[float, Relaxation | None] = {}
        self._searches: dict[tuple[float, float], LeadingSearch] = {}
        self._frequencies = np.zeros(0)

    def _lowest(self, count: int) -> np.ndarray:
        """Structural frequencies of the state."""
        if len(self._frequencies) < count:
            self._frequencies = self.lowest(count)
        if len(self._frequencies) < count:
            structure = CoupledPencil(self.mass, 0.0 * self.mass, self.stiffness)
            self._frequencies = lowest_frequencies(structure, count, self._workspace)
        return self._frequencies[:count]

    def search(self, condition: Condition) -> SearchOptions:
        """Search options for the spectrum, by the rule that every study follows."""
        return self.leading(condition).options

    def leading(self, condition: Condition) -> LeadingSearch:
        """Search for the leading modes, with the frequency up to which it is a verdict on the state."""
        line = law_parts(condition.law)[1]
        return self.leading_under(
            Conditions(condition.inertia, condition.alpha, condition.beta, condition.loss, **line)
        )

    def leading_under(self, conditions: Conditions, in_vacuo: bool = False) -> LeadingSearch:
        """Search for the leading modes under conditions given by their names, with the fluid or in vacuo."""
        line = conditions.of_line
        key = conditions.beta, conditions.loss_factor, in_vacuo, *line.values()  # nothing else decides
        if key not in self._searches:
            asked = SearchOptions(max_frequency=self.max_frequency)
            resolved = np.inf if in_vacuo else self.linear.model.flow.resolved(line)
            self._searches[key] = select_search(asked, conditions, self._lowest, self.modes, resolved)
        return self._searches[key]

    def is_searched(self, values: np.ndarray, conditions: Conditions, band: float) -> np.ndarray:
        """Eigenvalues in the region that every study searches, (k,) bool: beside it lie relaxations of the wall, and
        modes of it that are slow and strongly damped; `band` is in Hz.
        """
        if not conditions.loss_factor:
            return np.ones(len(values), bool)
        return Reach(-np.inf, 2 * np.pi * band, edge_of(self.relaxation(conditions.loss_factor))).is_mode(values)

    def relaxation(self, loss: float) -> Relaxation | None:
        """Viscoelastic part of the stiffness, with a factor on all loss factors; None for an elastic wall."""
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
        linear, flow = self.linear, self.linear.model.flow
        storage, line = law_parts(law)
        if "wave_speed" in line:  # so that the compressibility is that of the fluid
            line["wave_speed"] *= np.sqrt(law.density)
        line |= flow.at_unit_density()
        parts = linear.flow_parts(1.0, storage, line) if flow.has_fluid else linear.no_flow()
        if linear.added is None:
            return parts
        return linear.added.parts(parts, outside_of(law) or 1.0)

    def pencil(self, condition: Condition) -> CoupledPencil:
        """The full pencil, with the inlet velocity itself as unknown."""
        density, alpha, beta, law, loss_factor = condition
        storage, line = law_parts(law)
        return self.linear.pencil(Conditions(density, alpha, beta, loss_factor, **line), storage=storage)


class FluidLaw(NamedTuple):
    """The law of a condition where more than the blend of the continuity laws decides; 0 for what there is not.

    Attributes
    ----------
    storage : float
        Blend of the continuity laws.
    pipe_length, tail_length : float, m
        Of the lines in front and behind.
    wave_speed, density : float, m/s, kg/m3
        Of an elastic line in front. Waves tell fluids of different densities apart by more than their inertia, so the
        density is a part of the law with them.
    outside : float
        Density outside over that inside where it does not follow it.
    """

    storage: float
    pipe_length: float = 0.0
    tail_length: float = 0.0
    wave_speed: float = 0.0
    density: float = 0.0
    outside: float = 0.0


#: Blend of the continuity laws alone, or with what else decides.
Law = float | FluidLaw

#: What of it belongs to the lines.
OF_LINE = ("pipe_length", "tail_length", "wave_speed")


def law_of(storage: float, density: float, **others: float) -> Law:
    """The law of a condition; what else decides by the names of `FluidLaw`, 0 for what there is not."""
    if others.get("wave_speed"):
        others["density"] = density
    return FluidLaw(storage, **others) if any(others.values()) else storage


def law_parts(law: Law) -> tuple[float, dict[str, float]]:
    """Blend of the continuity laws, and parameters of the line as `Conditions.of_line` has them, of a law."""
    if not isinstance(law, FluidLaw):
        return float(law), {}
    return law.storage, {name: getattr(law, name) for name in OF_LINE if getattr(law, name)}


def outside_of(law: Law) -> float:
    """Density outside over that inside of a law; 0 where it follows it."""
    return law.outside if isinstance(law, FluidLaw) else 0.0
