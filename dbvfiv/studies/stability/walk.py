"""Steady states and leading eigenvalues anywhere in the space of parameters, each state found from the nearest one
known, each with the family of its pencils at any fluid density, damping and continuity law.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import root_scalar

from eigen.basis import lowest_frequencies
from eigen.columns import Cell, Column, ColumnSolver
from eigen.factor import Workspace
from eigen.family import PencilFamily, Reach
from eigen.operator import CoupledPencil, Relaxation, edge_of
from eigen.spectrum import Mode, SearchOptions, Spectrum

from ...case.parameters import Mu
from ...case.quantity import GRAVITY
from ...errors import CaseError, NotValidError, SolveError
from ...materials.laws import MaterialError
from ...model.classes import linearise_class
from ...model.dynamics import LinearisedState
from ...model.equilibria import LoadPath, SteadyOptions, state_warnings
from ...model.leading import LEAST_MODES, LeadingSearch, select_search
from ...model.material_stability import beyond_levels, material_stability
from ...model.state import SteadyState
from ...model.symmetry import Symmetry, equilibria_of
from ...model.valve import ValveModel
from ...observer import Observer
from ..case import Case
from .place import flow_law, moving_surroundings, rebuilder
from .samples import Sample
from .verdict import Verdict

#: Blends of the continuity laws whose fluid is kept, and factors whose relaxation is.
_KEPT = 256
#: Steady states of a model that are kept.
_STATES = 400
#: Relative accuracy of the pressure at which valve and pump meet.
MET = 1e-10


class ValveFamily(PencilFamily):
    """Operator of a steady state over fluid, damping and pipes.

    Parameters
    ----------
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

    def search(self, mu: Mu) -> SearchOptions:
        """Search options for the spectrum, by the rule that every study follows."""
        return self.leading(mu).options

    def rayleigh(self, mu: Mu) -> tuple[float, float]:
        """Damping parameters."""
        return mu.alpha, mu.beta

    def leading(self, mu: Mu, in_vacuo: bool = False) -> LeadingSearch:
        """Search for the leading modes, with the frequency up to which it is a verdict on the state."""
        key = mu.beta, mu.loss_factor, mu.storage, in_vacuo, *mu.pipes.values()  # nothing else decides
        if key not in self._searches:
            asked = SearchOptions(max_frequency=self.max_frequency)
            resolved = np.inf if in_vacuo else self.linear.resolved(mu)
            self._searches[key] = select_search(asked, mu, self._lowest, self.modes, resolved)
        return self._searches[key]

    def is_searched(self, values: np.ndarray, mu: Mu, search: LeadingSearch) -> np.ndarray:
        """Eigenvalues in the region that every study searches, (k,) bool: beside it lie relaxations of the wall, and
        modes of it that are slow and strongly damped.
        """
        if not mu.loss_factor:
            return np.ones(len(values), bool)
        reach = Reach(-np.inf, 2 * np.pi * search.band, edge_of(self.relaxation(mu)), search.options.slowest)
        return reach.is_mode(values)

    def relaxation(self, mu: Mu) -> Relaxation | None:
        """Viscoelastic part of the stiffness, with the factor on all loss factors; None for an elastic wall."""
        loss = mu.loss_factor
        if loss not in self._relaxations:
            if len(self._relaxations) > _KEPT:
                self._relaxations.clear()
            self._relaxations[loss] = self.linear.relaxation(loss)
        return self._relaxations[loss]

    def coupling(self, mu: Mu) -> dict[str, np.ndarray]:
        """A0 to S1, with the inlet velocity times the root of the density as unknown."""
        law = flow_law(mu)
        if law not in self._parts:
            if len(self._parts) > _KEPT:
                self._parts.clear()
            self._parts[law] = self._computed(law)
        root = np.sqrt(mu.density)
        return {name: value * root ** int(name[1]) for name, value in self._parts[law].items()}

    def _computed(self, law: Mu) -> dict[str, np.ndarray]:
        """A0 to S1 at density 1, from which those at others follow with powers of its root."""
        linear, flow = self.linear, self.linear.model.flow
        line = law.pipes
        if "wave_speed" in line:  # so that the compressibility is that of the fluid
            line["wave_speed"] *= np.sqrt(law.density)
        line |= flow.at_unit_density()
        unit = {"density": 1.0, "storage": law.storage} | line
        parts = linear.flow_parts(unit) if flow.has_fluid else linear.no_flow()
        if linear.added is None:
            return parts
        return linear.added.parts(parts, law.outside / law.density if law.outside else 1.0)

    def at(self, mu: Mu) -> CoupledPencil:
        """The full operator, with the inlet velocity itself as unknown."""
        return self.linear.pencil(mu)


@contextmanager
def name_state_in_failures(pressure: float) -> Iterator[None]:
    """Turn what an eigenvalue search refuses into a sentence with the pressure, Pa, of the state. Raises SolveError."""
    try:
        yield
    except CaseError:
        raise
    except (ArithmeticError, ValueError) as error:
        raise SolveError(f"The modes at {pressure:.6g} Pa were not found: {str(error).rstrip('.')}.") from error


#: Steps over the last one up to which a cubic is trusted ahead of it.
REACH = 2.0


@dataclass
class _Built:
    """A model of one design with its load path and the states found so far."""

    model: ValveModel
    path: LoadPath
    solver: ColumnSolver
    known: dict[float, np.ndarray]
    described: dict[float, SteadyState] = field(default_factory=dict)
    trail: list[tuple[float, np.ndarray, np.ndarray]] = field(
        default_factory=list
    )  # pressure, state and slope of the last two

    def aim(self, target: float) -> None:
        """Predict the next state by the cubic through the last two and their slopes; along the tangent alone where it
        reaches too far ahead.
        """
        if len(self.trail) < 2 or self.path.slope is None or self.trail[-1][0] != self.path.pressure:
            return
        (p0, q0, s0), (p1, q1, s1) = self.trail
        width, ahead = p1 - p0, target - p1
        if not 0 < ahead / width <= REACH:
            return
        secant = (q1 - q0) / width
        square, cube = (2 * s1 + s0 - 3 * secant) / width, (s0 + s1 - 2 * secant) / width**2
        self.path.slope = s1 + ahead * (square + ahead * cube)

    def passed(self) -> None:
        """Remember where the path has arrived."""
        if self.path.slope is not None:
            self.trail = [*self.trail[-1:], (self.path.pressure, self.path.q, self.path.slope)]


class StabilityWalk:
    """Answers for places of the parameter space.

    Parameters
    ----------
    observer : Observer, optional
    model : ValveModel, optional
        Of the case, where it is at hand.
    symmetry : Symmetry, optional
        Class of the motions; that of the equilibria by default.
    solver : ColumnSolver, optional
        Of another walk on the same mesh, whose symbolic factorisations it keeps.
    """

    def __init__(
        self,
        case: Case,
        observer: Observer | None = None,
        model: ValveModel | None = None,
        symmetry: Symmetry | None = None,
        solver: ColumnSolver | None = None,
    ):
        self.case, self.symmetry, self._solver = case, symmetry or equilibria_of(case.part), solver
        self._recalled: list[Mu] = []
        self._validity: dict[tuple, str] = {}
        self._workspace = Workspace()  # for structural frequencies
        self.observer = observer or Observer()
        self._rebuild = rebuilder(case)
        own = Mu.of(case)
        self._moving = {name: own[name] for name in moving_surroundings(case)}
        self._built: dict[tuple, _Built] = {}
        self._last: tuple[tuple, ValveFamily] | None = None
        self._classes: dict[str, StabilityWalk] = {}
        if model is not None:
            self._built[()] = self._new(model)

    def _new(self, model: ValveModel) -> _Built:
        path = LoadPath(model, SteadyOptions.of(self.case))
        return _Built(model, path, self._solver or ColumnSolver(), {})

    def _key(self, place: Mu) -> tuple:
        """Key of the model of a parameter point: the design, and those conditions that move the steady state."""
        design = dict(place.design)
        design |= {name: place[name] for name, own in self._moving.items() if place[name] != own}
        return tuple(sorted(design.items()))

    def built(self, place: Mu) -> _Built:
        """Model and path of the design of a place."""
        key = self._key(place)
        if key not in self._built:
            if len(self._built) > 4:
                self._built = dict(list(self._built.items())[-2:])
            self._built[key] = self._new(self._rebuild(dict(key)))
        return self._built[key]

    def equilibrium(self, place: Mu) -> np.ndarray:
        """Displacements q (n,) of the steady state. Raises SolveError."""
        self._recollect()
        return self._reach(place)

    def _recollect(self) -> None:
        """Find the states that were recalled again."""
        while self._recalled:
            with suppress(SolveError):  # that run went on without it too
                self._reach(self._recalled[0])
            del self._recalled[0]

    def about_rubbers(self, place: Mu | None = None) -> list[str]:
        """Sentences on the rubbers in the steady state of a place, or in all that are known, by an earlier run too: of
        many designs, of the last ones. Where rubbers have loss factors, verdicts say that constants do not hold.
        """
        self._recollect()
        asks = beyond_levels if Mu.of(self.case).loss_factor else state_warnings
        if place is not None:
            return [*asks(self.built(place).model, [self.state(place)])]
        known = [(own.model, [own.described[each] for each in sorted(own.described)]) for own in self._built.values()]
        return [said for model, states in known if states for said in asks(model, states)]

    def recall(self, place: Mu) -> None:
        """Say that a state was found at a place by an earlier run.

        The next new state is reached from where that run stood, with the same digits: states that were recalled are
        found again before it, or at last for `about_rubbers`.
        """
        if not self._key(place):  # states of other designs are found from rest each
            self._recalled.append(place)

    def give(self, place: Mu, state: SteadyState | np.ndarray) -> None:
        """Hand over the steady state of a place that was found elsewhere, or its displacements q (n,) alone."""
        built = self.built(place)
        if isinstance(state, SteadyState):
            built.described[place.pressure], state = state, state.q
        built.known[place.pressure] = state

    def settle(self, place: Mu, q: np.ndarray | None) -> None:
        """Find the steady state of a place from displacements q (n,) next to it; by load steps where these are not
        known, or Newton's method does not lead from them or leads to lips that touch where they did not. Raises
        SolveError.
        """
        built, path = self.built(place), self.built(place).path
        before = path.pressure, path.q, path.slope
        if q is not None and place.pressure not in built.known:
            path.pressure, path.q, path.slope = place.pressure, q, None
            with suppress(SolveError):
                path.settle()
                state = path.go_to(place.pressure)
                # a valve that opens may have a shut state besides, into which Newton's method falls from far away
                if state.stops <= built.model.touching(q):
                    return self.give(place, state)
            path.pressure, path.q, path.slope = before
        self.equilibrium(place)

    def lift(self, place: Mu) -> float:
        """Pressure, Pa, at a place beyond that of the pump at its flow: a static lift; 0 without a pump. Raises
        SolveError if there is no steady state.
        """
        pump = self.built(place).model.pump
        if pump is None:
            return 0.0
        return place.pressure - pump.density * GRAVITY * float(pump.curve(self.state(place).volume_flow))

    def meet_pump(self, place: Mu, lift: float, q: np.ndarray | None = None) -> Mu:
        """Parameter point at the pressure at which a pump with a lift delivers what the valve takes; the same without a
        pump. Raises SolveError if the curves do not meet near it within the pump's table.

        Parameters
        ----------
        place : Mu
            With a pressure next to it.
        lift : float, Pa
        q : (n,) array, optional
            Displacements next to those of its steady state.
        """
        pump = self.built(place).model.pump
        if pump is None:
            return place
        self.settle(place, q)

        def beyond(pressure: float) -> float:
            return self.lift(place.at(pressure=pressure)) - lift

        first, apart = place.pressure, beyond(place.pressure)
        if abs(apart) <= MET * first:
            return place
        found = root_scalar(beyond, x0=first, x1=first - 0.5 * apart, rtol=MET, maxiter=20)
        there = place.at(pressure=float(found.root))
        if not found.converged or not pump.holds(self.state(there).volume_flow):
            raise SolveError(f"Pump and valve do not meet within the pump's table near {first:.6g} Pa.")
        return there

    def state(self, place: Mu) -> SteadyState:
        """Steady state of a place with what is read off it. Raises SolveError."""
        self.equilibrium(place)
        return self.built(place).described[place.pressure]

    def apart(self) -> StabilityWalk:
        """A walk that knows no states yet, on the model of this one."""
        model = self._built[()].model if () in self._built else None
        return StabilityWalk(self.case, self.observer, model, self.symmetry)

    def in_class(self, symmetry: Symmetry) -> StabilityWalk:
        """The walk for the motions of a class about the steady states of this one."""
        if symmetry == self.symmetry:
            return self
        if symmetry.name not in self._classes:
            self._classes[symmetry.name] = StabilityWalk(self.case, self.observer, symmetry=symmetry)
        other = self._classes[symmetry.name]
        new = {key: replace(built, solver=ColumnSolver()) for key, built in self._built.items()}
        other._built = new | {key: built for key, built in other._built.items() if key in new}
        return other

    def _reach(self, place: Mu) -> np.ndarray:
        built = self.built(place)
        if place.pressure in built.known:
            return built.known[place.pressure]
        path = built.path
        before = path.pressure, path.q, path.slope
        rest = built.model.flow.back
        nearest = min([rest, *built.known], key=lambda p: abs(p - place.pressure))
        if nearest != rest and abs(nearest - place.pressure) < abs(path.pressure - place.pressure):
            path.pressure, path.q, path.slope = nearest, built.known[nearest], None
        built.aim(place.pressure)
        try:
            found = path.go_to(place.pressure)
        except SolveError:
            path.pressure, path.q, path.slope = before  # where a run that goes on without this place stands too
            raise
        built.passed()
        if len(built.known) > _STATES:
            built.known.clear()
            built.described.clear()
        built.known[place.pressure], built.described[place.pressure] = path.q, found
        return path.q

    def family(self, place: Mu) -> ValveFamily:
        """The linearised state for any density, damping and continuity law; the last one is kept. Raises SolveError."""
        key = (place.pressure, self._key(place))
        if self._last is None or self._last[0] != key:
            model = self.built(place).model
            linear = linearise_class(model, self.equilibrium(place), place.pressure, self.symmetry)
            modes = self.case.modes
            self._last = (key, ValveFamily(linear, modes.max_frequency, modes.count, self._workspace))
        return self._last[1]

    def search(self, place: Mu) -> LeadingSearch:
        """Search for the leading modes at a parameter point, with the frequency up to which it is a verdict. Raises
        SolveError.
        """
        return self.family(place).leading(place)

    def holding(self, place: Mu, factors: np.ndarray) -> np.ndarray:
        """Factors on the loss factors from 1 on, as many of them up to where the constants of a rubber hold."""

        def holds(factor: float) -> bool:
            return not self.refusal(place.at(loss_factor=place.loss_factor * factor))

        first = next((i for i, factor in enumerate(factors.tolist()) if not holds(factor)), 0)
        if not first:
            return factors
        inside, beyond = factors[first - 1 : first + 1].tolist()
        for _ in range(6):
            middle = float(np.sqrt(inside * beyond))
            inside, beyond = (middle, beyond) if holds(middle) else (inside, middle)
        return np.geomspace(factors[0], inside, len(factors)) if inside != factors[0] else factors[:1]

    def refusal(self, place: Mu) -> str:
        """Reason why the constants of a rubber with loss factors are unstable at a place, or its branches do not reach
        such loss factors; empty where all holds. Raises SolveError if there is no steady state.
        """
        loss = place.loss_factor
        if not loss:
            return ""
        key = place.pressure, self._key(place), loss
        if key not in self._validity:
            if len(self._validity) > 4000:
                self._validity.clear()
            model, q = self.built(place).model, self.equilibrium(place)
            try:
                found = material_stability(model, q, place.pressure, loss)
                model.relaxation.branches(loss)  # of plies too
                self._validity[key] = "" if found.holds else found.sentence
            except MaterialError as error:
                self._validity[key] = str(error)
        return self._validity[key]

    def require_valid(self, place: Mu) -> None:
        """Refuse a place at which the constants of a rubber are unstable. Raises NotValidError with the `refusal` as
        its sentence. Raises SolveError if there is no steady state.
        """
        if refusal := self.refusal(place):
            raise NotValidError(refusal)

    def spectrum(self, place: Mu, count: int = 6):
        """Leading modes of the full pencil, an `eigen.Spectrum`. Raises NotValidError. Raises SolveError."""
        self.require_valid(place)
        family = self.family(place)
        with name_state_in_failures(place.pressure):
            return self.built(place).solver.direct(family, place, count)

    def unknowns(self, place: Mu, mode: Mode) -> np.ndarray:
        """Displacements and the flow's unknowns (n + l,) of a mode at a place; those of a flow without inertia, which
        modes do not hold, follow from the areas.
        """
        u = mode.u
        if not self.built(place).model.flow.unsteady:
            linear = self.family(place).linear
            parts = linear.model.flow.linearise_still(linear.area, place.for_system())
            u = -np.linalg.solve(parts["S0"], parts["R0"] @ (linear.slope @ mode.q))
        return np.concatenate([mode.q, u])

    def column(self, places: list[Mu], snapshots: int = 3, edges: bool = False, spectra=None, count: int = 2) -> Column:
        """Cells that share a steady state; those whose rubber has lost stability are left blank. Raises NotValidError
        if that is so at all of them. Raises SolveError.

        Parameters
        ----------
        places : list of Mu
        snapshots : int
            Of them, at which the vectors of the small model are made.
        edges : bool
            Certify only the places between which the number of unstable modes changes.
        spectra : sequence of Spectrum, optional
            Of one or two places, where they are known.
        count : int
            Leading modes of each place that the small model is made for.
        """
        sound = [i for i, place in enumerate(places) if not self.refusal(place)]
        if not sound:
            self.require_valid(places[-1])
        family = self.family(places[0])
        with name_state_in_failures(places[0].pressure):
            points = [places[i] for i in sound]
            column = self.built(places[0]).solver.solve(family, points, snapshots, edges, spectra, count)

        def cells() -> list[Cell]:
            with name_state_in_failures(places[0].pressure):
                found = dict(zip(sound, column.cells))
            return [found.get(i, Cell()) for i in range(len(places))]

        return replace(column, find=cells)

    def cell(self, place: Mu, spectrum: Spectrum | None = None) -> Cell:
        """Cell of one place by the full operator; its leading modes may be known. Raises NotValidError, SolveError."""
        return self.column([place], spectra=None if spectrum is None else [spectrum]).cells[0]

    def sample(self, place: Mu, cell: Cell, value: float = np.nan) -> Sample:
        """Sample of a place from its cell; `value` is that of the parameter of a line. One that is stable up to the end
        of a band above which more is counted is left open.
        """
        if refusal := self.refusal(place):
            return Sample(value, refusal=refusal)
        family = self.family(place)
        with name_state_in_failures(place.pressure):
            cell = self.built(place).solver.counted_whole(family, place, cell)
        return Sample.of(value, cell, family.leading(place), family.linear.seal is not None)

    def verdict(self, place: Mu, spectrum=None) -> Verdict:
        """Verdict on one place; its leading modes with the full pencil may be known. Raises SolveError if there is no
        steady state, or its spectrum was not found.
        """
        try:
            return self.sample(place, self.cell(place, spectrum)).verdict
        except NotValidError as error:
            return Verdict.not_valid(str(error))
