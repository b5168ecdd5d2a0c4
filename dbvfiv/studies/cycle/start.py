"""Start of a branch of cycles from an onset (Hopf bifurcation) of a scan."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...case.parameters import PARAMETERS, Mu
from ...errors import SolveError
from ...observer import Observer
from ..case import Case
from ..orbits.onset import Onset, onset_at
from ..stability.correction import OnsetCorrection
from ..stability.crossings import Crossing, Scan, locate
from ..stability.place import condition_of, is_surrounding
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
    axis, base = case.cycle.axis, Mu.of(case)
    values = [axis.values[i] for i in np.unique(np.linspace(0, len(axis.values) - 1, SCANNED).astype(int))]

    def place(value: float) -> Mu:
        return base.at(**{axis.parameter: value})

    def spectrum(value: float) -> np.ndarray:
        observer.progress(f"steady state at {axis.parameter} = {value:.6g}")
        return np.asarray(walk.spectrum(place(value)).eigenvalues)

    column = _column(case, walk, [place(v) for v in values])
    scan = Scan(spectrum, axis.log) if column is None else _scan_of(column, axis, place)
    crossings = scan.run(values)
    for crossing in crossings[::-1] if case.cycle.start == "last" else crossings:
        value, expected = _located(scan, crossing)
        if column is not None:
            value, expected = _corrected(column, place, spectrum, crossing, value, expected)
        onset = onset_at(walk, place(value), value, expected)
        if onset is not None:
            return onset
    raise SolveError(_without(case, scan))


def _column(case: Case, walk: StabilityWalk, places: list[Mu]):
    """Cells at places with a small model of theirs; None where the steady state does not stay the same."""
    if not is_surrounding(case, case.cycle.axis.parameter):
        return None
    column = walk.column(places, len(places))
    return None if column.cell is None or column.eigenvalues is None else column


def _scan_of(column, axis, place: Callable[[float], Mu]) -> Scan:
    """Cells of a column, and inside a bracket what its small model says."""

    def leading(value: float) -> np.ndarray:
        return np.asarray(column.cell(condition_of(place(value))).leading[0])

    return Scan(leading, axis.log, inside=lambda value: np.asarray(column.eigenvalues(condition_of(place(value)))))


def _located(scan: Scan, crossing: Crossing) -> tuple[float, complex]:
    """Value and eigenvalue of a crossing."""
    value = locate(scan, crossing, LOCATED)
    return value, complex(scan.within(value).eigenvalues[crossing.index])


def _corrected(column, place, spectrum, crossing: Crossing, value: float, expected: complex) -> tuple[float, complex]:
    """An onset of a small model where the full matrices have it; searched for by these where corrections fail."""
    correct = OnsetCorrection(column, lambda other: condition_of(place(other)), spectrum)
    found, frequency, left = correct(value, abs(expected.imag) / (2 * np.pi))
    if np.isfinite(left):
        return found, 2j * np.pi * frequency
    full = Scan(spectrum)
    full.samples.update({sample.value: sample for sample in (crossing.low, crossing.high)})
    return _located(full, crossing)


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
