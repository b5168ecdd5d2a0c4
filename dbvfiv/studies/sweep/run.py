"""Modes tracked along one parameter: fluid density, damping, or inlet pressure."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from eigen import Branches, SearchOptions, Spectrum, TrackOptions, track

from ...case.axis import Axis
from ...case.parameters import Mu
from ...errors import CaseError, SolveError
from ...fit import outside_band
from ...model import ValveModel
from ...model.equilibria import require_equilibrium
from ...model.leading import growth_floor
from ...model.state import SteadyState
from ...model.symmetry import EQUILIBRIA, chosen_symmetries, symmetry_named
from ...observer import Observer
from ..stability.family import name_state_in_failures
from ..stability.verdict import Verdict, not_valid_at
from ..stability.walk import StabilityWalk
from .spectra import Check, SpectraAlong

#: Writing what is done may take this share of the time; a sweep of small cost is written once.
_KEEPING = 0.05
_KEEP_AFTER = 2.0
_UNKNOWN = Verdict.undecided("The sweep ended before a verdict was made.")


@dataclass(frozen=True)
class SweepOptions:
    """Options of `run_sweep`.

    Attributes
    ----------
    count : int
        Leading modes to follow.
    margin : int
        Further modes computed, so that a mode that changes its rank is not lost.
    checks : int
        Values at which eigenvalues are compared with the full matrices and both counts of unstable ones.
    tolerance : float
        Accepted relative error of eigenvalues of the reduced-order model.
    least_confidence : float
        A step is halved while the match of a leading mode is less certain.
    search : SearchOptions
        For full solves.
    symmetry : str
        Class of the motions, see `dbvfiv.model.symmetry`.
    """

    count: int = 6
    margin: int = 4
    checks: int = 3
    tolerance: float = 1e-6
    least_confidence: float = 0.6
    search: SearchOptions = field(default_factory=SearchOptions)
    symmetry: str = EQUILIBRIA

    @classmethod
    def of(cls, case) -> SweepOptions:
        """Options of a case file."""
        sweep, modes = case.sweep, case.modes
        search = SearchOptions(modes.max_frequency, tolerance=modes.tolerance)
        return cls(
            sweep.count,
            checks=sweep.checks,
            tolerance=sweep.tolerance,
            least_confidence=sweep.least_confidence,
            search=search,
            symmetry=chosen_symmetries(sweep.symmetry, case.part)[0].name,
        )


@dataclass(frozen=True)
class SweepPoint:
    """Eigenvalues, 1/s, and unstable count at one value, as soon as it is solved."""

    value: float
    eigenvalues: np.ndarray
    unstable_count: int


@dataclass(frozen=True)
class FoundBranches:
    """Branches of modes along a parameter.

    Attributes
    ----------
    model : ValveModel
    axis : Axis
    values : (p,) array
        Values done, in SI units; fewer than asked for after an interrupt or a failure.
    branches : Branches
        Eigenvalues (k, p), NaN where a branch does not exist, and the confidence of each match.
    unstable_count : (p,) int
        Eigenvalues with positive growth rate among those found, both of a pair counted.
    checks : tuple of Check
    certified : bool
        All checks held.
    verdicts : (p,) tuple of Verdict
        On each value.
    states : tuple of SteadyState
        One for each value over pressure, a single one otherwise.
    notes, failures : tuple of str
    interrupted : bool
    """

    model: ValveModel
    axis: Axis
    values: np.ndarray
    branches: Branches
    unstable_count: np.ndarray
    checks: tuple[Check, ...]
    certified: bool
    verdicts: tuple[Verdict, ...]
    states: tuple[SteadyState, ...]
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    interrupted: bool = False


def run_sweep(
    model: ValveModel,
    axis: Axis,
    mu: Mu | None = None,
    options: SweepOptions | None = None,
    observer: Observer | None = None,
    state: SteadyState | None = None,
    keep: Callable[[FoundBranches], None] | None = None,
) -> FoundBranches:
    """Follow the leading modes along a parameter.

    Over density and damping the steady state stays as a rule, so modes are those of one reduced-order model, checked
    with the full matrices; over pressure, and wherever else the parameter moves the steady state, every value has its
    own, found from the nearest one known, and its own full solve. An interrupt, or a value that has no steady state,
    ends the sweep and keeps what was found.

    Parameters
    ----------
    model : ValveModel
    axis : Axis
        Parameter and values.
    mu : Mu, optional
        Density and damping where they are not swept; those of the case otherwise.
    options : SweepOptions, optional
    observer : Observer, optional
        Gets a `SweepPoint` for every value.
    state : SteadyState, optional
        Steady state at the pressure of the sweep, where it is known.
    keep : callable, optional
        Gets what is done so far, marked as interrupted, every few seconds, so that a sweep that is killed is not lost.

    Raises
    ------
    CaseError
        If the case has no flow and density is swept.
    SolveError
        If not even the first value was solved.
    """
    mu = Mu.of(model.case) if mu is None else mu
    options = SweepOptions.of(model.case) if options is None else options
    observer = Observer() if observer is None else observer
    if axis.parameter == "density" and not model.flow.has_fluid:
        raise CaseError(
            "sweep.over ranges over density, but drive.kind is 'uniform' and there is no fluid; choose "
            "pressure, alpha or beta."
        )
    symmetry = symmetry_named(options.symmetry)
    walk = StabilityWalk(model.case, observer, model, symmetry)
    start = Mu.of(model.case).at(**mu)
    if state is not None:
        require_equilibrium(model, state)
        start = start.at(pressure=state.pressure)
        walk.give(start, state)
    line = SpectraAlong(walk, start, axis.parameter, options)
    observer.begin(f"sweep over {axis.parameter}", len(axis.values))
    run = _Run(model, line, axis, options, observer, keep)
    interrupted, failures = False, ()
    try:
        with name_state_in_failures(start.pressure):
            run.follow(axis.values)
    except KeyboardInterrupt:
        interrupted = True
    except SolveError as error:
        if not run.points:
            observer.end(False)
            raise
        failures = (str(error),)
        observer.warn(str(error))
    result = run.result(interrupted, failures)
    for note in (*result.notes, *_outside(model, result)):
        observer.warn(note)
    observer.end(interrupted)
    return result


def _outside(model: ValveModel, result: FoundBranches) -> tuple[str, ...]:
    """A sentence where leading modes leave the frequencies at which loss factors hold."""
    growth = np.where(np.isfinite(result.branches.growth_rate), result.branches.growth_rate, -np.inf)
    if not growth.size:
        return ()
    leading = result.branches.frequency[np.argmax(growth, axis=0), np.arange(growth.shape[1])]
    leading = leading[np.isfinite(leading)]
    sentence = outside_band(model.case, leading)
    return () if sentence is None else (sentence,)


class _Run:
    """A walk along the values; spectra are kept, so that an interrupted one can be followed as far as it came."""

    def __init__(self, model, line: SpectraAlong, axis: Axis, options: SweepOptions, observer: Observer, keep):
        self.model, self.line, self.axis, self.observer, self.keep = model, line, axis, observer, keep
        self.keep_at = time.monotonic() + _KEEP_AFTER
        self.track = TrackOptions(options.count, options.margin, least_confidence=options.least_confidence)
        self.pencils: dict[float, object] = {}
        self.spectra: dict[int, Spectrum] = {}
        self.points: list[SweepPoint] = []
        self.refused: dict[float, str] = {}
        self.branches: Branches | None = None

    def follow(self, values) -> None:
        """Track the modes over the values at which the constants of the rubber hold."""
        sound, failure = [], None
        for value in values:
            try:
                refusal = self.line.refusal(float(value))
            except SolveError as error:  # what lies before it is followed
                failure = error
                break
            if refusal:
                self.refused[float(value)] = refusal
                self._keep_point(SweepPoint(float(value), np.zeros(0, complex), -1))
            else:
                sound.append(float(value))
        if sound:
            self.observer.progress("reduced-order model")
            self.line.prepare(sound)
            self.branches = track(self._pencil, sound, self.track, solver=self._solve, observer=self._done)
        if failure is not None:
            raise failure

    def _pencil(self, value: float):
        value = float(value)
        if value not in self.pencils:
            self.pencils[value] = self.line.pencil(value)
        return self.pencils[value]

    def _solve(self, pencil) -> Spectrum:
        if id(pencil) not in self.spectra:
            self.spectra[id(pencil)] = self.line.solve(pencil, self.track.count + self.track.margin)
        return self.spectra[id(pencil)]

    def _done(self, value: float, _solves: int) -> None:
        spectrum = self._solve(self._pencil(value))
        self._keep_point(SweepPoint(value, spectrum.eigenvalues, spectrum.unstable_count))

    def _keep_point(self, point: SweepPoint) -> None:
        self.points.append(point)
        self.observer.item(point)
        start = time.monotonic()
        if self.keep is not None and start >= self.keep_at:
            self.keep(self.result(True, ()))
            now = time.monotonic()
            self.keep_at = now + max(_KEEP_AFTER, (now - start) / _KEEPING)

    def result(self, interrupted: bool, failures) -> FoundBranches:
        sound = np.array([point.value for point in self.points if point.value not in self.refused])
        solves, found = len(self.spectra), self.branches
        if found is None and len(sound):  # as far as it came, from the spectra kept
            found = track(self._pencil, sound, self.track, solver=self._solve)
        branches = (
            _shown(found, self.line, sound)
            if len(sound)
            else Branches(np.zeros(0, int), sound, *np.zeros((2, 0, 0)), 0)
        )
        checks, notes, known = (), (), {}
        if len(sound) and not interrupted:
            spectra = {float(value): self._solve(self._pencil(value)) for value in sound}
            self.observer.progress("verdicts")
            checks = [self.line.check(value, spectra[value]) for value in self.line.checked(sound)]
            notes = self.line.notes(sound)
            known = {value: self.line.verdict(value, spectrum) for value, spectrum in spectra.items()}
        known |= {value: Verdict.not_valid(sentence) for value, sentence in self.refused.items()}
        if self.refused:
            notes = (*notes, not_valid_at(self.axis.parameter, self.refused))
        points = sorted(self.points, key=lambda point: list(self.axis.values).index(point.value))
        values = np.array([point.value for point in points])
        branches = _with_gaps(branches, sound, values)
        certified = bool(checks) and not interrupted and all(check.holds for check in checks)
        counts = np.array([point.unstable_count for point in points], int)
        return FoundBranches(
            self.model,
            self.axis,
            values,
            Branches(branches.ids, values, branches.eigenvalues, branches.confidence, solves),
            counts,
            tuple(checks),
            certified,
            tuple(known.get(value, _UNKNOWN) for value in values),
            self.line.states(values),
            tuple(notes),
            tuple(failures),
            interrupted,
        )


def _with_gaps(branches: Branches, sound: np.ndarray, values: np.ndarray) -> Branches:
    """Branches over more values, with NaN at values that were left out."""
    eigenvalues = np.full((len(branches.ids), len(values)), complex(np.nan, np.nan))
    confidence = np.full(eigenvalues.shape, np.nan)
    at = np.flatnonzero(np.isin(values, sound))
    eigenvalues[:, at], confidence[:, at] = branches.eigenvalues, branches.confidence
    return Branches(branches.ids, values, eigenvalues, confidence, branches.solves)


def _shown(branches: Branches, line: SpectraAlong, values: np.ndarray) -> Branches:
    """Branches clearly right of the limit point -1/beta, numbered from 1 by their largest growth rate."""
    eigenvalues, confidence = branches.eigenvalues.copy(), branches.confidence.copy()
    for column, value in enumerate(values):
        beyond = eigenvalues[:, column].real <= growth_floor(line.place(value).beta)
        eigenvalues[beyond, column] = np.nan
        confidence[beyond, column] = np.nan
    there = np.isfinite(eigenvalues.real)
    kept = np.flatnonzero(there.any(axis=1))
    highest = np.where(there[kept], eigenvalues[kept].real, -np.inf).max(axis=1, initial=-np.inf)
    order = kept[np.argsort(-highest, kind="stable")]
    return Branches(1 + np.arange(len(order)), values, eigenvalues[order], confidence[order], branches.solves)
