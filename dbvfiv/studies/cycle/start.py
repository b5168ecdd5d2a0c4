"""Where a branch of cycles starts: the onset of a scan."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from ...case.parameters import PARAMETERS
from ...errors import SolveError
from ...observer import Observer
from ..case import Case
from ..orbits.onset import MODES, Onset, onset_at
from ..stability.crossings import Crossing, Sample, Scan, locate
from ..stability.place import Place, is_surrounding
from ..stability.walk import StabilityWalk

#: Values of the range that are asked whether the steady state is stable.
SCANNED = 13
#: Relative accuracy of an onset.
LOCATED = 1e-5
#: Part of the value over which a small model tells how fast a growth rate changes, and corrections by that at most.
NEAR, CORRECTED = 1e-3, 6


def find_onset(case: Case, walk: StabilityWalk, observer: Observer) -> Onset:
    """The onset of `cycle.over` that the branch starts at.

    Raises
    ------
    SolveError
        If the range holds none with an oscillation.
    """
    axis, base = case.cycle.axis, Place.of(case)
    values = [axis.values[i] for i in np.unique(np.linspace(0, len(axis.values) - 1, SCANNED).astype(int))]
    column = _column(case, walk, [base.at(**{axis.parameter: v}) for v in values])

    def sample(value: float) -> np.ndarray:
        observer.progress(f"steady state at {axis.parameter} = {value:.6g}")
        place = base.at(**{axis.parameter: value})
        if column is None:
            return np.asarray(walk.spectrum(place).eigenvalues)
        return np.asarray(column.cell(place.condition).leading[0])

    def rough(value: float) -> np.ndarray:
        return np.asarray(column.eigenvalues(base.at(**{axis.parameter: value}).condition))

    spectra = {}  # the last one is that of the onset

    def inside(value: float) -> np.ndarray:
        spectra[value] = walk.spectrum(base.at(**{axis.parameter: value}), MODES)
        return np.asarray(spectra[value].eigenvalues)

    scan = Scan(sample, axis.log, inside=inside)
    crossings = scan.run(values)
    for crossing in crossings[::-1] if case.cycle.start == "last" else crossings:
        value = locate(scan, crossing, LOCATED) if column is None else _located(scan, crossing, rough)
        expected = complex(scan.within(value).eigenvalues[crossing.index])
        onset = onset_at(walk, base.at(**{axis.parameter: value}), value, expected, spectra.get(value))
        if onset is not None:
            return onset
    raise SolveError(_without(case, scan))


def _column(case: Case, walk: StabilityWalk, places: list[Place]):
    """Cells at places with a small model of theirs; None where the steady state does not stay the same."""
    if not is_surrounding(case, case.cycle.axis.parameter):
        return None
    column = walk.column(places, len(places))
    return None if column.cell is None else column


def _located(scan: Scan, crossing: Crossing, rough) -> float:
    """The value of a crossing by the full matrices: from where a small model has it, along the slope it has there."""

    def growth(value: float) -> float:
        return float(Sample(value, rough(value)).growth[crossing.index])

    low, high = crossing.low.value, crossing.high.value
    if growth(low) * growth(high) >= 0:
        return locate(scan, crossing, LOCATED)
    value = float(brentq(growth, low, high, xtol=LOCATED * max(abs(low), abs(high))))
    beside = value * (1.0 + NEAR * np.array([-1.0, 1.0]))
    slope = (growth(beside[1]) - growth(beside[0])) / (beside[1] - beside[0])
    for _ in range(CORRECTED):
        found = scan.within(value)
        step = np.inf if found is None or slope == 0.0 else float(found.growth[crossing.index]) / slope
        if abs(step) <= LOCATED * abs(value):
            return value
        value -= step
        if not low <= value <= high:
            break
    return locate(scan, crossing, LOCATED)


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
