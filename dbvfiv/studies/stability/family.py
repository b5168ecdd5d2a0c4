"""A steady state of the valve as a family of pencils: any fluid density, damping and continuity law."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from eigen import (
    Condition,
    CoupledPencil,
    PencilFamily,
    Relaxation,
    SearchOptions,
    Workspace,
    lowest_frequencies,
)
from eigen.operator import Reach, edge_of

from ...case.parameters import OUTSIDE, PIPES, Mu
from ...errors import CaseError, SolveError
from ...model.dynamics import LinearisedState
from ...model.leading import LeadingSearch, select_search

#: Blends of the continuity laws whose fluid is kept, and factors whose relaxation is.
_KEPT = 256
#: Structural frequencies in vacuo that a band holds at least.
LEAST_MODES = 10


class ValveFamily(PencilFamily):
    """Conditions are (density, alpha, beta, law, loss factor); the law as `flow_law` makes it.

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
        return self.leading_under(condition_point(condition))

    def leading_under(self, mu: Mu, in_vacuo: bool = False) -> LeadingSearch:
        """Search for the leading modes under conditions given by their names, with the fluid or in vacuo."""
        key = mu.beta, mu.loss_factor, in_vacuo, *mu.pipes.values()  # nothing else decides
        if key not in self._searches:
            asked = SearchOptions(max_frequency=self.max_frequency)
            resolved = np.inf if in_vacuo else self.linear.model.flow.resolved(mu.pipes)
            self._searches[key] = select_search(asked, mu, self._lowest, self.modes, resolved)
        return self._searches[key]

    def is_searched(self, values: np.ndarray, mu: Mu, band: float) -> np.ndarray:
        """Eigenvalues in the region that every study searches, (k,) bool: beside it lie relaxations of the wall, and
        modes of it that are slow and strongly damped; `band` is in Hz.
        """
        if not mu.loss_factor:
            return np.ones(len(values), bool)
        return Reach(-np.inf, 2 * np.pi * band, edge_of(self.relaxation(mu.loss_factor))).is_mode(values)

    def relaxation(self, loss: float) -> Relaxation | None:
        """Viscoelastic part of the stiffness, with a factor on all loss factors; None for an elastic wall."""
        loss = float(loss)
        if loss not in self._relaxations:
            if len(self._relaxations) > _KEPT:
                self._relaxations.clear()
            self._relaxations[loss] = self.linear.relaxation(loss)
        return self._relaxations[loss]

    def parts(self, law: Mu) -> dict[str, np.ndarray]:
        """A0 to S1 at density 1."""
        if law not in self._parts:
            if len(self._parts) > _KEPT:
                self._parts.clear()
            self._parts[law] = self._computed(law)
        return self._parts[law]

    def _computed(self, law: Mu) -> dict[str, np.ndarray]:
        linear, flow = self.linear, self.linear.model.flow
        line = law.pipes
        if "wave_speed" in line:  # so that the compressibility is that of the fluid
            line["wave_speed"] *= np.sqrt(law.density)
        line |= flow.at_unit_density()
        parts = linear.flow_parts(1.0, law.storage, line) if flow.has_fluid else linear.no_flow()
        if linear.added is None:
            return parts
        return linear.added.parts(parts, law.outside / law.density if law.outside else 1.0)

    def pencil(self, condition: Condition) -> CoupledPencil:
        """The full pencil, with the inlet velocity itself as unknown."""
        return self.linear.pencil(condition_point(condition))


def flow_law(mu: Mu) -> Mu:
    """Part of a parameter point that the flow's matrices at unit density depend on.

    The flow model and the pipes; the density where waves or a fixed fluid outside tell fluids apart by more than their
    inertia.
    """
    outside = (OUTSIDE,) if mu.outside else ()
    return mu.only("storage", *PIPES, *(("density",) if mu.wave_speed or outside else ()), *outside)


def condition_point(condition: Condition) -> Mu:
    """Parameter point of a condition."""
    density, alpha, beta, law, loss_factor = condition
    return Mu(law, density=density, alpha=alpha, beta=beta, loss_factor=loss_factor)


@contextmanager
def name_state_in_failures(pressure: float) -> Iterator[None]:
    """Turn what an eigenvalue search refuses into a sentence with the pressure, Pa, of the state.

    Raises
    ------
    SolveError
    """
    try:
        yield
    except CaseError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise SolveError(f"The modes at {pressure:.6g} Pa were not found: {str(error).rstrip('.')}.") from error
