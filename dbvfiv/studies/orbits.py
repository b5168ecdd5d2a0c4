"""Limit cycles of a valve: the onset at which a branch starts, its first two cycles, and what is read off a cycle."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from continuation.amplitude import AmplitudeEquation, amplitude_equation
from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import CyclePoint, SpecialCycle
from continuation.cycles import Cycle, CycleSolver, cycles_beside_onset
from continuation.options import ContinuationError, ContinuationOptions, OrbitOptions, OutOfDomain
from continuation.periodic import PeriodicMotion, peak

from ..case.parameters import PARAMETERS, Mu
from ..errors import CaseError, SolveError
from ..flow.law import FlowLaw
from ..flow.terms.pump import with_static_lift
from ..model.forms import ValveForms
from ..model.valve import ValveModel
from ..motion.periodic import PeriodicValve
from .case import Case
from .stability.place import models_of
from .stability.walk import StabilityWalk

#: Leading modes of which the basis of the corrections is made at the start.
MODES = 6


@dataclass(frozen=True, eq=False)
class Onset:
    """An onset with an oscillation."""

    value: float  #: Of the parameter.
    place: Mu
    spectrum: object  #: Leading modes there.
    index: int  #: Of the neutral one among them.

    @property
    def eigenvalue(self) -> complex:
        return complex(self.spectrum.eigenvalues[self.index])

    @property
    def mode(self):
        return self.spectrum.mode(self.index)


def onset_at(walk: StabilityWalk, place: Mu, value: float, expected: complex) -> Onset | None:
    """The onset at a place where an eigenvalue is known to be neutral; None if that does not oscillate. Raises
    SolveError.
    """
    spectrum = walk.spectrum(place, MODES)
    index = int(np.argmin(np.abs(spectrum.eigenvalues - expected)))
    onset = Onset(value, place, spectrum, index)
    return onset if onset.eigenvalue.imag > 1e-3 * abs(onset.eigenvalue) else None


#: Instants of a period at which a cycle is looked at, and those at which its full states are; a peak between two of
#: the latter is missed by 0.1 %.
INSTANTS, FULL = 240, 64


@dataclass(frozen=True, eq=False)
class Orbit:
    """A cycle of a valve, looked at over one period."""

    model: ValveModel
    mu: dict  #: Parameters by the names of `Mu.for_system`.
    motion: PeriodicMotion

    @cached_property
    def phases(self) -> np.ndarray:
        """(k,) rad."""
        return 2 * np.pi * np.arange(INSTANTS) / INSTANTS

    @property
    def time(self) -> np.ndarray:
        """(k,) s."""
        return self.phases / self.motion.omega

    @cached_property
    def states(self) -> np.ndarray:
        """(k, n) full states over a period."""
        return self.motion.at(2 * np.pi * np.arange(FULL) / FULL)[:, : self.model.size]

    @cached_property
    def lip(self) -> np.ndarray:
        """(k,) displacement in y of the mid-surface of one lip at x = z = 0, m."""
        return self._of_node(self.model.mesh.centre_line[0], self.motion.coefficients)

    @cached_property
    def lip_rate(self) -> np.ndarray:
        """(k,) its rate, m/s."""
        rate = self.motion.omega * self.motion.harmonics.rate(self.motion.coefficients)
        return self._of_node(self.model.mesh.centre_line[0], rate)

    @cached_property
    def centre_line(self) -> np.ndarray:
        """(k, m) displacement in y of the line x = 0 at each row, m."""
        rows = self.model.mesh.centre_line
        return np.stack([self._of_node(node, self.motion.coefficients) for node in rows], axis=1)

    def _of_node(self, node: int, coefficients: np.ndarray) -> np.ndarray:
        number = self.model.shell.dofs.index[node, 1]
        if number < 0:
            return np.zeros(INSTANTS)
        return self.motion.harmonics.basis_at(self.phases) @ coefficients[:, number]

    @cached_property
    def lip_extremes(self) -> tuple[float, float]:
        """Least and largest displacement of the lip, m, between instants too."""
        return -float(peak(-self.lip)), float(peak(self.lip))

    @property
    def clearance(self) -> float:
        """Least height of the middle of the lip over where it touches the other, m."""
        return self.lip_extremes[0] + self.model.room

    @property
    def lip_harmonics(self) -> np.ndarray:
        """(H + 1,) amplitudes of the harmonics of the lip's displacement, m; the mean first."""
        parts = np.abs(np.fft.rfft(self.lip))[: self.motion.harmonics.count + 1] / INSTANTS
        return parts * np.append(1.0, np.full(len(parts) - 1, 2.0))

    @cached_property
    def flow(self) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mass flow at the lip, kg/s of the whole valve, and least speed at any row, m/s."""
        model, density, n = self.model, self.mu["density"], self.model.size
        samples, rates, _ = self.motion.with_rates(self.phases)
        nodal = [model.nodal(x) for x in samples[:, :n]]
        area = np.stack([model.rows.areas(x) for x in nodal])
        opening = np.stack([model.rows.jacobian(x) @ v for x, v in zip(nodal, rates[:, :n])])
        speeds = model.flow.moving_velocities(area, opening, samples[:, n:], self.mu)
        out = model.mesh.part.copies * density * speeds[:, 0] * model.flow.open_area(area[:, 0])
        return out, speeds.min(axis=1)

    @property
    def flow_extremes(self) -> tuple[float, float]:
        """Least and largest mass flow at the lip, kg/s, between instants too."""
        flow, _ = self.flow
        return -float(peak(-flow)), float(peak(flow))


#: Displacement of the lip, m, that a step of one along the branch stands for.
UNIT = 10e-3
#: First step along a branch.
STEP = 0.2
#: Harmonics of the first cycles.
HARMONICS = 4
#: Amplitude of the second cycle over that of the first, and where a fold lies between these two.
SECOND, NEARER = 2.0, 1.25
#: Amplitudes tried, each half the one before, until the first cycles lie within the range.
HALVINGS = 6
#: The lips just touch at their middle.
TOUCHING = "lips touch"


class _Refused(OutOfDomain):
    """A value that the case does not allow."""


def _refusing(models: Callable[[Mapping[str, float]], ValveModel]) -> Callable[[Mapping[str, float]], ValveModel]:
    """Models for parameters that say to a branch where there is none."""

    def model(mu: Mapping[str, float]) -> ValveModel:
        try:
            return models(mu)
        except CaseError as error:
            raise _Refused(str(error)) from error

    return model


class Follower:
    """Follows cycles of a case along one parameter. Raises SolveError if the equations of periodic motions do not cover
    the case.

    Parameters
    ----------
    case : Case
        Its section `cycle` says how.
    place : Mu
        Parameters at the start.
    parameter : str
        The one to move.
    spectrum : eigen.Spectrum
        Leading modes of a steady state near the start, of which the basis of the corrections is made.
    """

    def __init__(self, case: Case, walk: StabilityWalk, place: Mu, parameter: str, spectrum):
        self.case, self.walk, self.place, self.parameter = case, walk, place, parameter
        self._flows: dict[float, FlowLaw] = {}
        models = models_of(case, walk.built(Mu.of(case)).model)
        flow = self._flow if models(place.for_system()).pump is not None else None
        self.system = PeriodicValve(_refusing(models), place.for_system(), flow)
        modes = (spectrum.mode(i) for i in range(len(spectrum.eigenvalues)))
        basis = _basis(self.system, [walk.unknowns(place, mode) for mode in modes])
        self.solver = CycleSolver(self.system, basis)
        self.name = PARAMETERS[parameter].system_name or parameter
        model = self.system.model(place.for_system())
        #: Number of the displacement in y of the lip at x = z = 0 among the unknowns.
        self.lip = int(model.shell.dofs.index[model.mesh.centre_line[0], 1])
        self.room = model.room

    def _flow(self, mu: Mapping[str, float]) -> FlowLaw:
        """Flow law behind a pump, with the static lift that makes the pressure that of the steady state, as spectra
        have it. Raises OutOfDomain if there is no steady state.
        """
        value, model = float(mu[self.name]), self.system.model(mu)
        if value not in self._flows:
            if len(self._flows) > 8:
                self._flows.clear()
            try:
                q = self.walk.equilibrium(self.place.at(**{self.parameter: value}))
            except SolveError as error:
                raise OutOfDomain(f"Behind a pump cycles need the steady state: {error}") from error
            area = model.rows.areas(model.nodal(q))
            self._flows[value] = with_static_lift(model.flow, area, model.flow.steady_inner(area, mu), mu)
        return self._flows[value]

    @property
    def _first_harmonics(self) -> int:
        return min(HARMONICS, self.case.cycle.max_harmonics)

    def at_rest(self, onset: Onset) -> Cycle:
        """The steady state at an onset, as a cycle at rest. Raises SolveError."""
        mu, q = onset.place.for_system(), self.walk.equilibrium(onset.place)
        model = self.system.model(mu)
        rest = np.concatenate([q, model.flow.steady_inner(model.rows.areas(model.nodal(q)), mu)])
        motion = PeriodicMotion.of_waves((rest, np.zeros_like(rest)), self._first_harmonics, abs(onset.eigenvalue.imag))
        return Cycle(motion, mu, 0.0, 0, 0)

    def from_onset(self, onset: Onset, values: Sequence[float]) -> tuple[Cycle, Cycle, Cycle, bool]:
        """The steady state at an onset, as a cycle at rest, and two small cycles beside it, of the amplitude asked for
        and somewhat more, or of as much less as it takes that they lie within ascending values; and whether the branch
        goes on from the onset without a fold up to the second one. Raises SolveError.
        """
        for amplitude in self.case.cycle.amplitude * 0.5 ** np.arange(HALVINGS):
            why = "cycles lie beyond the range"
            try:
                found = self._beside_rest(onset, amplitude)
                if all(values[0] <= cycle.mu[self.name] <= values[-1] for cycle in found[1:3]):
                    return found
            except _Refused as error:
                why = str(error)
            except ContinuationError as error:
                why = str(error)
                break
        raise SolveError(
            f"The oscillation that starts at {self.parameter} = {onset.value:.6g} was not found with an amplitude "
            f"of {amplitude * 1e3:.3g} mm (cycle.amplitude): {why.rstrip('.')}."
        )

    def _beside_rest(self, onset: Onset, amplitude: float) -> tuple[Cycle, Cycle, Cycle, bool]:
        """As `from_onset`, with the amplitude, m, of the first cycle, wherever cycles lie. Raises SolveError. Raises
        ContinuationError.
        """
        mu, mode = onset.place.for_system(), onset.mode
        still = self.at_rest(onset).motion.coefficients[0]
        shape = self.walk.unknowns(onset.place, mode)
        if abs(shape[self.lip]) < 1e-6 * np.abs(mode.q).max():
            raise SolveError(
                "The mode that becomes unstable does not move the middle of the lips, by which cycles are told."
            )
        waves = still, 0.5 * amplitude * shape / shape[self.lip]
        small = PeriodicMotion.of_waves(waves, self._first_harmonics, abs(onset.eigenvalue.imag))
        row = np.zeros_like(small.coefficients)
        row[1, self.lip] = 1.0
        for ratio in (SECOND, NEARER):
            rest, first, second = cycles_beside_onset(self.solver, small, mu, self.name, row, ratio)
            if rises := _goes_on(*(cycle.mu[self.name] for cycle in (rest, first, second)), ratio):
                break
        return rest, first, second, rises

    def amplitude(self, onset: Onset) -> tuple[AmplitudeEquation, float]:
        """Amplitude equation of the mode of an onset, or of a nearly neutral one beside it, for the displacement of the
        lip, m; and that displacement at rest. Raises SolveError if the mode does not move the middle of the lips.
        """
        mu, n = onset.place.for_system(), self.system.size - self.system.inner
        forms = ValveForms(self.system.model(mu), self.walk.equilibrium(onset.place), mu)
        # velocities are none of the unknowns of periodic motions
        steady = np.concatenate([forms.q, forms.rest[2 * len(forms.q) :]])
        forms = SimpleNamespace(pencil=forms.pencil, slope=forms.slope, rest=steady)
        weight = np.append(np.ones(n), np.full(self.system.inner, self.system.flow_weight))
        row, rest = np.zeros(self.system.size), forms.rest[self.lip]
        row[self.lip] = 1.0
        mode = self.walk.unknowns(onset.place, onset.mode)
        try:
            found = amplitude_equation(
                forms, lambda motion: self.system.residual(motion, mu) / weight, onset.eigenvalue, mode, row, abs(rest)
            )
        except ContinuationError as error:
            raise SolveError(f"At {self.parameter} = {onset.value:.6g} no amplitude follows: {error}") from error
        return found, float(rest)

    def beside(self, onset: Onset, first: Cycle, value: float) -> Cycle:
        """The cycle at a value between an onset and the first cycle of its branch, guessed by the root of the distance
        from the onset. Raises SolveError.
        """
        share = np.sqrt((value - onset.value) / (first.mu[self.name] - onset.value))
        coefficients = first.motion.coefficients.copy()
        coefficients[1:] *= share
        return self.near(PeriodicMotion(first.motion.harmonics, coefficients, first.motion.omega), value)

    def near(self, guess: PeriodicMotion, value: float) -> Cycle:
        """The cycle near a motion, at a value of the parameter. Raises SolveError."""
        try:
            found = self.solver.solve(guess, self.place.for_system() | {self.name: value})
        except ContinuationError as error:
            raise SolveError(f"No cycle was found at {self.parameter} = {value:.6g}: {error}") from error
        if np.linalg.norm(found.motion.coefficients[1:]) < 0.2 * np.linalg.norm(guess.coefficients[1:]):
            raise SolveError(f"No cycle was found at {self.parameter} = {value:.6g}, but the steady state.")
        return found

    def begin(
        self,
        onset: Onset,
        values: Sequence[float],
        tell: Callable[[CyclePoint | SpecialCycle], None],
        known: Iterable[tuple[str, float]] = (),
    ) -> tuple[CycleTracer, list[str]]:
        """Tracer of the branch of an onset through ascending values, with its first cycles found and reported.

        The first cycles are two small ones, and those at the values nearer to the onset. The second value returned is
        why some of the latter were not found. `known` are special points as `CycleTracer` has them.
        """
        rest, first, second, rises = self.from_onset(onset, values)
        last, cycles, missed = second if rises else first, [first, second], []
        if not rises:
            missed.append(
                f"The branch turns round beside the onset at {self.parameter} = {onset.value:.6g}, so cycles between "
                "there and its fold may be passed over; a smaller cycle.amplitude begins nearer to the onset."
            )
        ends = sorted((onset.value, last.mu[self.name]))
        for value in (v for v in values if ends[0] < v < ends[1]):
            try:
                cycles.append(self.beside(onset, first, value))
            except SolveError as error:
                missed.append(str(error))
        cycles.sort(key=lambda cycle: np.linalg.norm(cycle.motion.coefficients[1:3, self.lip]))
        tracer = self.tracer(values, first.motion, tell)
        tracer.known = list(known)
        tracer.extend(cycles[0], rest)
        for cycle in cycles[1:]:
            tracer.extend(cycle)
        return tracer, missed

    def tracer(
        self, values: Sequence[float], first: PeriodicMotion, tell: Callable[[CyclePoint | SpecialCycle], None]
    ) -> CycleTracer:
        """Tracer of a branch through ascending values of the parameter; `first` is a motion on the branch."""
        asked = self.case.cycle
        swing = np.sqrt(2.0) * np.linalg.norm(first.coefficients[1:3, self.lip])
        whole = np.linalg.norm(first.coefficients[1:] / self.system.scales)
        options = ContinuationOptions(
            step=min(STEP, asked.max_step),
            min_step=min(1e-4, asked.max_step),
            max_step=asked.max_step,
            max_angle=1.5,
            parameter_scales={self.name: values[-1] - values[0]},
            state_scale=UNIT * whole / swing,
            limits={self.name: (values[0], values[-1])},
            max_points=asked.max_points,
            location_tolerance=1e-2,
        )
        shape = OrbitOptions(
            harmonics=1, max_harmonics=asked.max_harmonics, tail=asked.tolerance, exponents=asked.exponents
        )
        events = {TOUCHING: lambda cycle: self.orbit(cycle).clearance}
        return CycleTracer(self.solver, self.name, options, shape, values, events, tell)

    def orbit(self, cycle: Cycle) -> Orbit:
        """Orbit of a cycle, from which its results are taken."""
        return Orbit(self.system.model(cycle.mu), cycle.mu, cycle.motion)


def _goes_on(rest: float, first: float, second: float, ratio: float) -> bool:
    """True where values a r^2 + b r^4 over those at rest, of cycles with amplitudes of a ratio, have no extreme up to
    the second one.
    """
    square, first, second = ratio**2, first - rest, second - rest
    # slopes by r^2 at rest and at the second cycle, over a factor: of one sign, and so are those between
    at_rest, at_second = square**2 * first - second, (2 * square - 1) * second - square**2 * first
    return at_rest * at_second > 0


def _basis(system: PeriodicValve, modes: Sequence[np.ndarray]) -> np.ndarray:
    """(n + l, r) leading modes, complex (n + l,), and each of the flow's unknowns, over their sizes."""
    columns = [part for mode in modes for part in (mode.real, mode.imag)]
    columns += list(np.eye(system.inner, system.size, system.size - system.inner))
    sizes = [np.linalg.norm(x / system.scales) for x in columns]
    return np.array([x / s for x, s in zip(columns, sizes) if s > 0]).T
