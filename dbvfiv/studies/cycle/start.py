"""Where a branch of cycles starts: the onset of a scan, and two small cycles beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation import ContinuationError
from continuation.bordered_cycle import Condition
from continuation.cycles import Cycle, CycleOptions, CycleSolver
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion

from ...case.parameters import PARAMETERS
from ...errors import SolveError
from ...model.system import ValveSystem
from ...motion.periodic import PeriodicValve
from ...observer import Observer
from ..case import Case
from ..stability.crossings import Crossing, Scan, locate
from ..stability.place import Place, is_surrounding, rebuilder
from ..stability.walk import StabilityWalk

#: Values of the range that are asked whether the steady state is stable.
SCANNED = 13
#: Relative accuracy of an onset.
LOCATED = 1e-5
#: Harmonics of the first cycles.
HARMONICS = 4
#: Leading modes of which the basis of the corrections is made at the start.
MODES = 6
#: Amplitude of the second cycle over that of the first.
SECOND = 1.3


@dataclass(frozen=True, eq=False)
class Onset:
    """An onset with an oscillation.

    Attributes
    ----------
    value : float
    place : Place
    spectrum : eigen.Spectrum
        Leading modes there.
    index : int
        Of the neutral one among them.
    """

    value: float
    place: Place
    spectrum: object
    index: int

    @property
    def eigenvalue(self) -> complex:
        return complex(self.spectrum.eigenvalues[self.index])


def find_onset(case: Case, walk: StabilityWalk, observer: Observer) -> Onset:
    """The onset of `cycle.over` that the branch starts at.

    Raises
    ------
    SolveError
        If the range holds none with an oscillation.
    """
    axis, base = case.cycle.axis, Place.of(case)
    values = [axis.values[i] for i in np.unique(np.linspace(0, len(axis.values) - 1, SCANNED).astype(int))]
    cell = _cells(case, walk, [base.at(**{axis.parameter: v}) for v in values])

    def sample(value: float) -> np.ndarray:
        observer.progress(f"steady state at {axis.parameter} = {value:.6g}")
        return cell(base.at(**{axis.parameter: value}))

    def inside(value: float) -> np.ndarray:
        return np.asarray(walk.spectrum(base.at(**{axis.parameter: value}), MODES).eigenvalues)

    scan = Scan(sample, axis.log, inside=inside)
    crossings = scan.run(values)
    for crossing in crossings[::-1] if case.cycle.start == "last" else crossings:
        onset = _onset_at(case, walk, scan, crossing)
        if onset is not None:
            return onset
    raise SolveError(_without(case, scan))


def _cells(case: Case, walk: StabilityWalk, places: list[Place]):
    """Leading eigenvalues at a place: of a small model where the steady state stays the same."""
    if is_surrounding(case, case.cycle.axis.parameter):
        column = walk.column(places, len(places))
        if column.cell is not None:
            return lambda place: np.asarray(column.cell(place.condition).leading[0])
    return lambda place: np.asarray(walk.spectrum(place).eigenvalues)


def _onset_at(case: Case, walk: StabilityWalk, scan: Scan, crossing: Crossing) -> Onset | None:
    value = locate(scan, crossing, LOCATED)
    expected = complex(scan.within(value).eigenvalues[crossing.index])
    place = Place.of(case).at(**{case.cycle.axis.parameter: value})
    spectrum = walk.spectrum(place, MODES)
    index = int(np.argmin(np.abs(spectrum.eigenvalues - expected)))
    onset = Onset(value, place, spectrum, index)
    return onset if onset.eigenvalue.imag > 1e-3 * abs(onset.eigenvalue) else None


def _without(case: Case, scan: Scan) -> str:
    axis = case.cycle.axis
    if not scan.samples:
        return f"No steady state was found over {axis.parameter}: {next(iter(scan.failures.values()), 'empty range')}"
    row = PARAMETERS[axis.parameter]
    low, high = (f"{v / row.scale:.6g}" for v in (axis.values[0], axis.values[-1]))
    unstable = {sample.unstable > 0 for sample in scan.samples.values()}
    state = "stable" if unstable == {False} else "unstable" if unstable == {True} else "never neutral with a frequency"
    return (
        f"No oscillation starts between {axis.parameter} = {low} and {high} {row.shown_unit}: the steady state is "
        f"{state} there, and a branch of cycles starts where it loses stability. `dbvfiv onset` looks over a wider "
        "range."
    )


def periodic_system(case: Case, walk: StabilityWalk) -> PeriodicValve:
    """The valve's equations of periodic motions.

    Raises
    ------
    SolveError
    """
    system = ValveSystem(walk.built(Place.of(case)).model, rebuilder(case))
    return PeriodicValve(system.model, Place.of(case).mu())


def cycle_solver(system: PeriodicValve, onset: Onset) -> CycleSolver:
    """A solver whose basis is made of the leading modes at an onset."""
    columns = []
    for i in range(len(onset.spectrum.eigenvalues)):
        mode = onset.spectrum.mode(i)
        vector = np.concatenate([mode.q, mode.u])
        columns += [vector.real, vector.imag]
    columns += list(np.eye(system.size)[system.size - system.inner :])
    sizes = [np.linalg.norm(x / system.scales) for x in columns]
    largest = [x / s for x, s in zip(columns, sizes) if s > 0]
    return CycleSolver(system, np.array(largest).T, CycleOptions())


def first_cycles(solver: CycleSolver, onset: Onset, parameter: str, lip: int, case: Case, q: np.ndarray):
    """Two small cycles beside an onset, of the amplitudes asked for and somewhat more.

    Parameters
    ----------
    solver : CycleSolver
    onset : Onset
    parameter : str
        Its name among the parameters of the system.
    lip : int
        The unknown whose amplitude is meant.
    case : Case
    q : (n,) array
        The steady state.

    Returns
    -------
    tuple of Cycle

    Raises
    ------
    SolveError
    """
    system, mu = solver.system, onset.place.mu()
    mode, h = onset.spectrum.mode(onset.index), Harmonics(HARMONICS)
    model = system.model(mu)
    inner = model.flow.steady_inner(model.rows.areas(model.nodal(q)), mu)
    shape = np.concatenate([mode.q, mode.u])
    if abs(shape[lip]) < 1e-6 * np.abs(mode.q).max():
        raise SolveError(
            "The mode that becomes unstable does not move the middle of the lips, by which cycles are told."
        )
    wave = np.zeros((HARMONICS + 1, system.size), complex)
    wave[0], wave[1] = np.concatenate([q, inner]), 0.5 * case.cycle.amplitude * shape / shape[lip]
    motion = PeriodicMotion(h, h.real(wave), abs(onset.eigenvalue.imag))
    found: list[Cycle] = []
    for factor in (1.0, SECOND):
        coefficients = motion.coefficients.copy()
        coefficients[1:] *= factor
        row = np.zeros_like(coefficients)
        row[1, lip] = 1.0
        condition = Condition(row, np.zeros(2), float(coefficients[1, lip]))
        guess = PeriodicMotion(h, coefficients, motion.omega)
        try:
            found.append(solver.solve(guess, mu, (parameter,), (condition,)))
        except ContinuationError as error:
            raise SolveError(
                f"The oscillation that starts at {case.cycle.axis.parameter} = {onset.value:.6g} was not found with an "
                f"amplitude of {factor * case.cycle.amplitude * 1e3:.3g} mm (cycle.amplitude): {error}"
            ) from error
        motion, mu = found[-1].motion, found[-1].mu
    return tuple(found)
