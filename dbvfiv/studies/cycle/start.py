"""Where a branch of cycles starts: the onset of a scan."""

from __future__ import annotations

import numpy as np

from ...case.parameters import PARAMETERS
from ...errors import SolveError
from ...observer import Observer
from ..case import Case
from ..orbits.onset import MODES, Onset, onset_at
from ..stability.crossings import Crossing, Scan, locate
from ..stability.place import Place, is_surrounding
from ..stability.walk import StabilityWalk

#: Values of the range that are asked whether the steady state is stable.
SCANNED = 13
#: Relative accuracy of an onset.
LOCATED = 1e-5


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

    spectra = {}  # the last one is that of the onset

    def inside(value: float) -> np.ndarray:
        spectra[value] = walk.spectrum(base.at(**{axis.parameter: value}), MODES)
        return np.asarray(spectra[value].eigenvalues)

    scan = Scan(sample, axis.log, inside=inside)
    crossings = scan.run(values)
    for crossing in crossings[::-1] if case.cycle.start == "last" else crossings:
        onset = _onset_at(case, walk, scan, crossing, spectra)
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


def _onset_at(case: Case, walk: StabilityWalk, scan: Scan, crossing: Crossing, spectra: dict) -> Onset | None:
    value = locate(scan, crossing, LOCATED)
    expected = complex(scan.within(value).eigenvalues[crossing.index])
    place = Place.of(case).at(**{case.cycle.axis.parameter: value})
    return onset_at(walk, place, value, expected, spectra.get(value))


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
