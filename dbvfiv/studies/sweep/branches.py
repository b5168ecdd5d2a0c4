"""Modes tracked along one parameter, such as fluid density, damping, or inlet pressure."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from eigen import Branches, CoupledPencil, SearchOptions, Spectrum, TrackOptions, Workspace, leading_modes, track
from eigen.pairs import with_left_vectors

from ...case.axis import Axis
from ...case.parameters import Mu
from ...errors import CaseError, SolveError
from ...fit import outside_band
from ...model import ValveModel
from ...model.equilibria import require_equilibrium
from ...model.leading import growth_floor
from ...model.state import SteadyState
from ...observer import Observer
from ..stability.dimensions import Variant, own_variant, variants
from ..stability.family import name_state_in_failures
from ..stability.line import ParameterLine
from ..stability.samples import Sample, SampleKey
from ..stability.verdict import Verdict, not_valid_at
from ..stability.walk import StabilityWalk

#: Writing what is done may take this share of the time; a sweep of small cost is written once.
_KEEPING = 0.05
_KEEP_AFTER = 2.0
#: Values at which the vectors of a reduced-order model are made.
SNAPSHOTS = 6


@dataclass(frozen=True)
class Check:
    """Verification of eigenvalues and their count at one value of the parameter.

    Attributes
    ----------
    value : float
    error : float
        Largest relative correction of the leading eigenvalues by the full matrices; largest residual where the value is
        solved in full.
    unstable_count, unstable_count_independent : int
        Both eigenvalues of a pair count.
    agrees : bool
        The counts are equal and the independent one is certain.
    accurate : bool
        The error is within the tolerance.
    """

    value: float
    error: float
    unstable_count: int
    unstable_count_independent: int
    agrees: bool
    accurate: bool

    @property
    def holds(self) -> bool:
        return self.agrees and self.accurate


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
    variant : Variant, optional
        Flow model and symmetry class; those of the case's equilibria by default.
    """

    count: int = 6
    margin: int = 4
    checks: int = 3
    tolerance: float = 1e-6
    least_confidence: float = 0.6
    search: SearchOptions = field(default_factory=SearchOptions)
    variant: Variant | None = None

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
            variant=variants(case, "sweep")[0],
        )


@dataclass(frozen=True)
class FoundBranches:
    """Branches of modes along a parameter.

    Attributes
    ----------
    samples : (p,) tuple of Sample
        At the values done; fewer than asked for after an interrupt or a failure.
    branches : Branches
        Eigenvalues (k, p), NaN where a branch does not exist, and the confidence of each match.
    checks : tuple of Check
    states : tuple of SteadyState
        One for each value over pressure, a single one otherwise.
    notes, failures : tuple of str
    interrupted : bool
    """

    samples: tuple[Sample, ...]
    branches: Branches
    checks: tuple[Check, ...]
    states: tuple[SteadyState, ...]
    notes: tuple[str, ...] = ()
    failures: tuple[str, ...] = ()
    interrupted: bool = False

    @property
    def values(self) -> np.ndarray:
        """(p,) values done, SI."""
        return np.array([sample.value for sample in self.samples])

    @property
    def unstable_count(self) -> np.ndarray:
        """(p,) unstable eigenvalues, both of a pair counted; -1 where the constants of the rubber do not hold."""
        return np.array([sample.unstable for sample in self.samples], int)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """(p,) verdict on each value."""
        return tuple(sample.verdict for sample in self.samples)

    @property
    def certified(self) -> bool:
        """True where all checks held."""
        return bool(self.checks) and not self.interrupted and all(check.holds for check in self.checks)


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
        Gets a `Sample` for every value.
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
    options = SweepOptions.of(model.case) if options is None else options
    observer = Observer() if observer is None else observer
    if axis.parameter == "density" and not model.flow.has_fluid:
        raise CaseError(
            "sweep.over ranges over density, but drive.kind is 'uniform' and there is no fluid; choose "
            "pressure, alpha or beta."
        )
    variant = options.variant or own_variant(model.case)
    walk = StabilityWalk(model.case, observer, model, variant.motion)
    start = Mu.of(model.case).at(**(mu or {}))
    if state is not None:
        require_equilibrium(model, state)
        start = start.at(pressure=state.pressure)
        walk.give(start, state)
    observer.begin(f"sweep over {axis.parameter}", len(axis.values))
    run = _Run(walk, start, axis, options, observer, keep)
    interrupted, failures = False, ()
    try:
        with name_state_in_failures(start.pressure):
            run.follow()
    except KeyboardInterrupt:
        interrupted = True
    except SolveError as error:
        if not run.done:
            observer.end(False)
            raise
        failures = (str(error),)
        observer.warn(str(error))
    result = run.result(interrupted, failures)
    leading = [sample.verdict.frequency for sample in result.samples if sample.verdict.holds]
    outside = outside_band(model.case, [f for f in leading if np.isfinite(f)])
    for note in (*result.notes, *([] if outside is None else [outside])):
        observer.warn(note)
    observer.end(interrupted)
    return result


class _Run:
    """A walk along the values; spectra are kept, so that an interrupted one can be followed as far as it came.

    Where the steady state stays, spectra come from one reduced-order model, as long as its error, estimated with the
    full matrices, is within the tolerance; everywhere else each value has its own full solve.
    """

    def __init__(self, walk: StabilityWalk, start: Mu, axis: Axis, options: SweepOptions, observer: Observer, keep):
        self.walk, self.axis, self.options, self.observer, self.keep = walk, axis, options, observer, keep
        self.keep_at = time.monotonic() + _KEEP_AFTER
        self.track = TrackOptions(options.count, options.margin, least_confidence=options.least_confidence)
        key = SampleKey(start.storage, walk.symmetry.name)
        most = {"snapshots": min(len(axis.values), SNAPSHOTS), "count": options.count + options.margin}
        self.line = ParameterLine(walk, start, axis.parameter, axis.values, axis.log, key=key, **most)
        #: Relative errors of the reduced-order model at the values where it was checked.
        self.errors: dict[float, float] = {}
        self.pencils: dict[float, CoupledPencil] = {}
        self.values: dict[CoupledPencil, float] = {}
        self.spectra: dict[CoupledPencil, Spectrum] = {}
        self.done: list[Sample] = []
        self.branches: Branches | None = None
        self._workspace = Workspace()

    def follow(self) -> None:
        """Track the modes over the values at which the constants of the rubber hold."""
        sound, failure = [], None
        for value in map(float, self.axis.values):
            try:
                self.walk.equilibrium(self.line.place(value))
                refusal = self.walk.refusal(self.line.place(value))
            except SolveError as error:  # what lies before it is followed
                failure = error
                break
            if refusal:
                self._keep_sample(Sample(value, refusal=refusal, key=self.line.key))
            else:
                sound.append(value)
        if sound:
            if self.line.stays:
                self.observer.progress("reduced-order model")
                self.line.cells()
                self.errors = {v: self._error(v) for v in self._checked(sound)} if self.line.is_reduced else {}
            self.branches = track(self._pencil, sound, self.track, solver=self._solve, observer=self._done)
        if failure is not None:
            raise failure

    def _checked(self, values: Sequence[float]) -> list[float]:
        """Values at which a sweep is checked: both ends and between."""
        places = np.linspace(0, len(values) - 1, min(self.options.checks, len(values)))
        return [float(values[i]) for i in np.unique(places.astype(int))]

    def _error(self, value: float) -> float:
        """Largest relative correction, by the full matrices, of the leading eigenvalues of the reduced-order model."""
        condition, column = self.line.condition(value), self.line.column
        leading = column.eigenvalues(condition)[: self.options.count]
        return max((abs(column.corrected(condition, x)) / max(abs(x), 1.0) for x in leading), default=0.0)

    @property
    def is_reduced(self) -> bool:
        """True where spectra come from a reduced-order model that is accurate enough."""
        return bool(self.errors) and max(self.errors.values()) <= self.options.tolerance

    def _pencil(self, value: float) -> CoupledPencil:
        """Pencil at a value, of the reduced-order model or in full."""
        value = float(value)
        if value not in self.pencils:
            condition = self.line.condition(value)
            family = self.line.column if self.is_reduced else self.walk.family(self.line.place(value))
            self.pencils[value] = family.pencil(condition)
            self.values[self.pencils[value]] = value
        return self.pencils[value]

    def _solve(self, pencil: CoupledPencil) -> Spectrum:
        """Leading modes of a pencil, with left vectors."""
        if pencil not in self.spectra:
            place, count = self.line.place(self.values[pencil]), self.track.count + self.track.margin
            options = replace(self.walk.search(place).options, tolerance=self.options.search.tolerance)
            self.spectra[pencil] = self._leading(pencil, count, options)
        return self.spectra[pencil]

    def _leading(self, pencil: CoupledPencil, count: int, options: SearchOptions) -> Spectrum:
        if not self.is_reduced:
            return leading_modes(pencil, count, replace(options, left=True), workspace=self._workspace)
        # the linear form of a viscoelastic wall is several times as large
        krylov = pencil.relaxation is not None and count < pencil.n
        asked = SearchOptions(options.max_frequency, tolerance=options.tolerance, method="auto" if krylov else "dense")
        if krylov:
            return with_left_vectors(pencil, leading_modes(pencil, count, asked))
        return leading_modes(pencil, count, replace(asked, left=True))

    def _done(self, value: float, _solves: int) -> None:
        self._keep_sample(self.line.sample(value, self._solve(self._pencil(value))))

    def _keep_sample(self, sample: Sample) -> None:
        self.done.append(sample)
        self.observer.item(sample)
        start = time.monotonic()
        if self.keep is not None and start >= self.keep_at:
            self.keep(self.result(True, ()))
            now = time.monotonic()
            self.keep_at = now + max(_KEEP_AFTER, (now - start) / _KEEPING)

    def _check(self, sample: Sample) -> Check:
        if self.is_reduced:
            error, allowed = self.errors[sample.value], self.options.tolerance
        else:
            residual = self._solve(self._pencil(sample.value)).residual
            error, allowed = float(residual.max(initial=0.0)), self.options.search.tolerance
        return Check(
            sample.value, error, sample.unstable, sample.counted, bool(sample.certified), bool(error <= allowed)
        )

    def result(self, interrupted: bool, failures: Sequence[str]) -> FoundBranches:
        """Branches as far as they came."""
        order = {float(value): i for i, value in enumerate(self.axis.values)}
        samples = sorted(self.done, key=lambda sample: order[sample.value])
        sound = [sample.value for sample in samples if not sample.refusal]
        found, checks, notes = self.branches, (), ()
        if found is None and sound:  # from the spectra kept
            found = track(self._pencil, sound, self.track, solver=self._solve)
        if sound and not interrupted:
            checked = self._checked(sound)
            checks = tuple(self._check(sample) for sample in samples if sample.value in checked)
            searches = [self.walk.search(self.line.place(value)) for value in (sound[:1] if self.line.stays else sound)]
            notes = max(searches, key=lambda search: search.band).notes
        if refused := {sample.value: sample.refusal for sample in samples if sample.refusal}:
            notes = (*notes, not_valid_at(self.axis.parameter, refused))
        branches = self._shown(found, np.array(sound), np.array([sample.value for sample in samples]))
        places = [self.line.place(sample.value) for sample in (samples[:1] if self.line.stays else samples)]
        states = tuple(self.walk.state(place) for place in places)
        return FoundBranches(tuple(samples), branches, checks, states, tuple(notes), tuple(failures), interrupted)

    def _shown(self, branches: Branches | None, sound: np.ndarray, values: np.ndarray) -> Branches:
        """Branches clearly right of the limit point -1/beta, numbered from 1 by their largest growth rate; NaN at
        values that were left out.
        """
        if branches is None:
            return Branches(np.zeros(0, int), values, *np.zeros((2, 0, len(values))), 0)
        at = np.flatnonzero(np.isin(values, sound))
        eigenvalues = np.full((len(branches.ids), len(values)), complex(np.nan, np.nan))
        confidence = np.full(eigenvalues.shape, np.nan)
        floor = [growth_floor(self.line.place(value).beta) for value in sound]
        there = branches.eigenvalues.real > floor
        eigenvalues[:, at] = np.where(there, branches.eigenvalues, complex(np.nan, np.nan))
        confidence[:, at] = np.where(there, branches.confidence, np.nan)
        highest = np.where(np.isfinite(eigenvalues.real), eigenvalues.real, -np.inf).max(axis=1, initial=-np.inf)
        order = np.argsort(-highest, kind="stable")
        order = order[np.isfinite(highest[order])]
        ids = 1 + np.arange(len(order))
        return Branches(ids, values, eigenvalues[order], confidence[order], len(self.spectra))
