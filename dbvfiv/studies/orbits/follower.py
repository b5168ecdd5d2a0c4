"""A branch of cycles along one parameter of a case: its first two cycles, and what follows it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from continuation import ContinuationError
from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import CycleBranchOptions, CyclePoint
from continuation.cycles import Cycle, CycleOptions, CycleSolver, cycles_beside_onset
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion

from ...case.parameters import PARAMETERS, Mu
from ...errors import SolveError
from ...model.system import ValveSystem
from ...motion.periodic import PeriodicValve
from ..case import Case
from ..stability.place import rebuilder
from ..stability.walk import StabilityWalk
from .onset import Onset
from .orbit import Orbit

#: Displacement of the lip, m, that a step of one along the branch stands for.
UNIT = 10e-3
#: First step along a branch.
STEP = 0.2
#: Harmonics of the first cycles.
HARMONICS = 4
#: Amplitude of the second cycle over that of the first.
SECOND = 2.0
#: The lips just touch at their middle.
TOUCHING = "lips touch"


class Follower:
    """Follows cycles of a case along one parameter.

    Parameters
    ----------
    case : Case
        Its section `cycle` says how.
    walk : StabilityWalk
    place : Mu
        Parameters at the start.
    parameter : str
        The one to move.
    spectrum : eigen.Spectrum
        Leading modes of a steady state near the start, of which the basis of the corrections is made.

    Raises
    ------
    SolveError
        If the equations of periodic motions do not cover the case.
    """

    def __init__(self, case: Case, walk: StabilityWalk, place: Mu, parameter: str, spectrum):
        self.case, self.walk, self.place, self.parameter = case, walk, place, parameter
        system = ValveSystem(walk.built(Mu.of(case)).model, rebuilder(case))
        self.system = PeriodicValve(system.model, place.for_system())
        self.solver = CycleSolver(self.system, _basis(self.system, spectrum), CycleOptions())
        self.name = PARAMETERS[parameter].system_name or parameter
        model = self.system.model(place.for_system())
        #: Number of the displacement in y of the lip at x = z = 0 among the unknowns.
        self.lip = int(model.shell.dofs.index[model.mesh.centre_line[0], 1])

    def from_onset(self, onset: Onset) -> tuple[Cycle, Cycle, Cycle]:
        """The steady state at an onset, as a cycle at rest, and two small cycles beside it, of the amplitude asked for
        and somewhat more.

        Raises
        ------
        SolveError
        """
        mu, h, mode = onset.place.for_system(), Harmonics(HARMONICS), onset.mode
        model = self.system.model(mu)
        q, amplitude = self.walk.equilibrium(onset.place), self.case.cycle.amplitude
        inner = model.flow.steady_inner(model.rows.areas(model.nodal(q)), mu)
        shape = np.concatenate([mode.q, mode.u])
        if abs(shape[self.lip]) < 1e-6 * np.abs(mode.q).max():
            raise SolveError(
                "The mode that becomes unstable does not move the middle of the lips, by which cycles are told."
            )
        wave = np.zeros((HARMONICS + 1, self.system.size), complex)
        wave[0], wave[1] = np.concatenate([q, inner]), 0.5 * amplitude * shape / shape[self.lip]
        small = PeriodicMotion(h, h.real(wave), abs(onset.eigenvalue.imag))
        row = np.zeros_like(small.coefficients)
        row[1, self.lip] = 1.0
        try:
            return cycles_beside_onset(self.solver, small, mu, self.name, row, SECOND)
        except ContinuationError as error:
            raise SolveError(
                f"The oscillation that starts at {self.parameter} = {onset.value:.6g} was not found with an amplitude "
                f"of {amplitude * 1e3:.3g} mm (cycle.amplitude): {error}"
            ) from error

    def beside(self, onset: Onset, first: Cycle, value: float) -> Cycle:
        """The cycle at a value between an onset and the first cycle of its branch, guessed by the root of the distance
        from the onset.

        Raises
        ------
        SolveError
        """
        share = np.sqrt((value - onset.value) / (first.mu[self.name] - onset.value))
        coefficients = first.motion.coefficients.copy()
        coefficients[1:] *= share
        return self.near(PeriodicMotion(first.motion.harmonics, coefficients, first.motion.omega), value)

    def near(self, guess: PeriodicMotion, value: float) -> Cycle:
        """The cycle near a motion, at a value of the parameter.

        Raises
        ------
        SolveError
        """
        try:
            found = self.solver.solve(guess, self.place.for_system() | {self.name: value})
        except ContinuationError as error:
            raise SolveError(f"No cycle was found at {self.parameter} = {value:.6g}: {error}") from error
        if np.linalg.norm(found.motion.coefficients[1:]) < 0.2 * np.linalg.norm(guess.coefficients[1:]):
            raise SolveError(f"No cycle was found at {self.parameter} = {value:.6g}, but the steady state.")
        return found

    def begin(
        self, onset: Onset, values: Sequence[float], tell: Callable[[CyclePoint], None]
    ) -> tuple[CycleTracer, list[str]]:
        """Tracer of the branch of an onset through ascending values, with its first cycles found and reported.

        The first cycles are two small ones, and those at the values nearer to the onset. The second value returned is
        why some of the latter were not found.
        """
        rest, first, second = self.from_onset(onset)
        ends, cycles, missed = sorted((onset.value, second.mu[self.name])), [first, second], []
        for value in (v for v in values if ends[0] < v < ends[1]):
            try:
                cycles.append(self.beside(onset, first, value))
            except SolveError as error:
                missed.append(str(error))
        cycles.sort(key=lambda cycle: abs(cycle.mu[self.name] - onset.value))
        tracer = self.tracer(values, first.motion)
        asked = [cycle.mu[self.name] in values for cycle in cycles]
        tracer.begin(cycles[0], asked[0], tell, rest)
        for cycle, is_asked in zip(cycles[1:], asked[1:]):
            tracer.extend(cycle, is_asked, tell)
        return tracer, missed

    def tracer(self, values: Sequence[float], first: PeriodicMotion) -> CycleTracer:
        """Tracer of a branch through ascending values of the parameter; `first` is a motion on the branch."""
        asked = self.case.cycle
        swing = np.sqrt(2.0) * np.linalg.norm(first.coefficients[1:3, self.lip])
        whole = np.linalg.norm(first.coefficients[1:] / self.system.scales)
        options = CycleBranchOptions(
            step=min(STEP, asked.max_step),
            min_step=min(1e-4, asked.max_step),
            max_step=asked.max_step,
            scale=values[-1] - values[0],
            motion_scale=UNIT * whole / swing,
            limits=(values[0], values[-1]),
            values=tuple(values),
            max_points=asked.max_points,
            exponents=asked.exponents,
            tail=asked.tolerance,
            max_harmonics=asked.max_harmonics,
        )
        events = {TOUCHING: lambda cycle: self.orbit(cycle).lip_extremes[0]}
        return CycleTracer(self.solver, self.name, options, events)

    def orbit(self, cycle: Cycle) -> Orbit:
        """Orbit of a cycle, from which its results are taken."""
        return Orbit(self.system.model(cycle.mu), cycle.mu, cycle.motion)


def _basis(system: PeriodicValve, spectrum) -> np.ndarray:
    """(n + l, r) leading modes, and each of the flow's unknowns, over their sizes."""
    columns = []
    for i in range(len(spectrum.eigenvalues)):
        mode = spectrum.mode(i)
        vector = np.concatenate([mode.q, mode.u])
        columns += [vector.real, vector.imag]
    columns += list(np.eye(system.size)[system.size - system.inner :])
    sizes = [np.linalg.norm(x / system.scales) for x in columns]
    return np.array([x / s for x, s in zip(columns, sizes) if s > 0]).T
