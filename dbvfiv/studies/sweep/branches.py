"""Modes tracked along one parameter: fluid density, damping, inlet pressure or any other."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from eigen import Branches, CoupledPencil, SearchOptions, Spectrum, TrackOptions, Workspace, leading_modes, track

from ...case.parameters import Mu
from ...errors import SolveError
from ...model.leading import growth_floor
from ...record.record import GrowingRecord
from ...record.states import SUMMARY
from ..case import Case
from ..stability.line import ParameterLine
from ..stability.samples import Sample, SampleKey, keep_samples
from ..stability.verdict import not_valid_at
from ..stability.walk import StabilityWalk

#: Writing branches so far may take this share of the time; a sweep of small cost is written once.
_KEEPING = 0.05
_KEEP_AFTER = 2.0
#: Values at which the vectors of a reduced-order model are made.
SNAPSHOTS = 6
#: Modes computed besides those to follow, so that a mode that changes its rank is not lost.
MARGIN = 4

BRANCHES, STATES = "branches", "states"


class Tracking:
    """A walk along `sweep.over` of a case; spectra are kept, so that an interrupted one is followed as far as it came.

    Where the steady state stays, spectra come from one reduced-order model, as long as its error, estimated with the
    full matrices, is within the tolerance; everywhere else each value has its own steady state, found from the nearest
    one known, and its own full solve.

    Parameters
    ----------
    case : Case
    walk : StabilityWalk
        In the class of the motions.
    record : GrowingRecord
        Samples are kept as they are found; branches and states so far every few seconds, as notes "kept".

    Attributes
    ----------
    samples : list of Sample
        In the order found.
    """

    def __init__(self, case: Case, walk: StabilityWalk, record: GrowingRecord):
        self.options, self.axis, self.walk, self.record = case.sweep, case.sweep.axis, walk, record
        self.tolerance = case.modes.tolerance
        self.keep_at = time.monotonic() + _KEEP_AFTER
        self.track = TrackOptions(self.options.count, MARGIN, least_confidence=self.options.least_confidence)
        start, values = Mu.of(case), tuple(map(float, self.axis.values))
        most = {"snapshots": min(len(values), SNAPSHOTS), "count": self.options.count + MARGIN}
        key = SampleKey(start.storage, walk.symmetry.name)
        self.line = ParameterLine(walk, start, self.axis.parameter, values, self.axis.log, key=key, **most)
        #: Relative errors of the reduced-order model at the values where it was checked.
        self.errors: dict[float, float] = {}
        self.pencils: dict[float, CoupledPencil] = {}
        self.values: dict[CoupledPencil, float] = {}
        self.spectra: dict[CoupledPencil, Spectrum] = {}
        self.samples: list[Sample] = []
        self.branches: Branches | None = None
        self._workspace = Workspace()

    def follow(self) -> None:
        """Track the modes over the values at which the constants of the rubber hold.

        Raises
        ------
        SolveError
            If a value has no steady state; what lies before it is followed.
        """
        sound, failure = [], None
        for value in self.line.values:
            try:
                self.walk.equilibrium(self.line.place(value))
                refusal = self.walk.refusal(self.line.place(value))
            except SolveError as error:
                failure = error
                break
            if refusal:
                self._keep(Sample(value, refusal=refusal, key=self.line.key))
            else:
                sound.append(value)
        if sound:
            if self.line.stays:
                self.record.progress("reduced-order model")
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
        mu, model = self.line.place(value), self.line.column.model
        leading = model.eigenvalues(mu)[: self.options.count]
        return max((abs(model.corrected(mu, x)) / max(abs(x), 1.0) for x in leading), default=0.0)

    @property
    def is_reduced(self) -> bool:
        """True where spectra come from a reduced-order model that is accurate enough."""
        return bool(self.errors) and max(self.errors.values()) <= self.options.tolerance

    def _pencil(self, value: float) -> CoupledPencil:
        """Pencil at a value, of the reduced-order model or in full."""
        value = float(value)
        if value not in self.pencils:
            mu = self.line.place(value)
            family = self.line.column.model if self.is_reduced else self.walk.family(mu)
            self.pencils[value] = family.at(mu)
            self.values[self.pencils[value]] = value
        return self.pencils[value]

    def _solve(self, pencil: CoupledPencil) -> Spectrum:
        """Leading modes of a pencil, with left vectors."""
        if pencil not in self.spectra:
            place, count = self.line.place(self.values[pencil]), self.options.count + MARGIN
            options = replace(self.walk.search(place).options, tolerance=self.tolerance)
            self.spectra[pencil] = self._leading(pencil, count, options)
        return self.spectra[pencil]

    def _leading(self, pencil: CoupledPencil, count: int, options: SearchOptions) -> Spectrum:
        if not self.is_reduced:
            return leading_modes(pencil, count, replace(options, left=True), workspace=self._workspace)
        # the linear form of a viscoelastic wall is several times as large
        method = "auto" if pencil.relaxation is not None and count < pencil.n else "dense"
        asked = SearchOptions(options.max_frequency, tolerance=options.tolerance, left=True, method=method)
        return leading_modes(pencil, count, asked)

    def _done(self, value: float, _solves: int) -> None:
        self._keep(self.line.sample(value, self._solve(self._pencil(value))))

    def _keep(self, sample: Sample) -> None:
        self.samples.append(sample)
        keep_samples(self.record, [sample])
        self.record.item(sample)
        start = time.monotonic()
        if start >= self.keep_at:
            self.record.note("kept", **self.tables())
            now = time.monotonic()
            self.keep_at = now + max(_KEEP_AFTER, (now - start) / _KEEPING)

    def _ordered(self) -> list[Sample]:
        return sorted(self.samples, key=lambda sample: self.line.values.index(sample.value))

    def tables(self) -> dict[str, list[dict[str, Any]]]:
        """Rows of the tables of branches and states, as far as they came."""
        samples, found = self._ordered(), self.branches
        sound = [sample.value for sample in samples if not sample.refusal]
        if found is None and sound:  # from the spectra kept
            found = track(self._pencil, sound, self.track, solver=self._solve)
        states = [self.walk.state(self.line.place(s.value)) for s in (samples[:1] if self.line.stays else samples)]
        return {
            BRANCHES: self._rows(found, np.array(sound), [sample.value for sample in samples]) if sound else [],
            STATES: [{c.name: getattr(state, c.name) for c in SUMMARY} for state in states],
        }

    def _rows(self, branches: Branches, sound: np.ndarray, values: Sequence[float]) -> list[dict[str, Any]]:
        """Rows of branches clearly right of the limit point -1/beta, numbered from 1 by their largest growth rate; NaN
        at values that were left out.
        """
        floor = [growth_floor(self.line.place(value).beta) for value in sound]
        there = branches.eigenvalues.real > floor
        highest = np.where(there, branches.eigenvalues.real, -np.inf).max(axis=1)
        order = [i for i in np.argsort(-highest, kind="stable") if np.isfinite(highest[i])]
        rows = []
        for number, i in enumerate(order, 1):
            for value in values:
                at = int(np.searchsorted(sound, value)) if value in sound else -1
                known = at >= 0 and there[i, at]
                eigenvalue = complex(branches.eigenvalues[i, at]) if known else complex(np.nan, np.nan)
                confidence = float(branches.confidence[i, at]) if known else np.nan
                numbers = {"growth_rate": eigenvalue.real, "angular_frequency": eigenvalue.imag}
                rows.append({"id": number, "value": value, "confidence": confidence} | numbers)
        return rows

    def checks(self) -> list[dict[str, Any]]:
        """Verification of eigenvalues and their counts at some values: the largest relative correction of the leading
        eigenvalues by the full matrices, or the largest residual where the value was solved in full; both counts.
        """
        found, samples = [], {sample.value: sample for sample in self._ordered() if not sample.refusal}
        for value in self._checked(list(samples)) if samples else ():
            sample = samples[value]
            if self.is_reduced:
                error, allowed = self.errors[value], self.options.tolerance
            else:
                error, allowed = float(self._solve(self._pencil(value)).residual.max(initial=0.0)), self.tolerance
            counts = {"unstable_count": sample.unstable, "unstable_count_independent": sample.counted}
            judged = {"agrees": bool(sample.certified), "accurate": bool(error <= allowed)}
            found.append({"value": value, "error": error} | counts | judged)
        return found

    def notes(self) -> list[str]:
        """Sentences on the region searched, of the widest one, and on values that are not valid."""
        samples, notes = self._ordered(), []
        sound = [self.line.place(sample.value) for sample in samples if not sample.refusal]
        if sound:
            searches = [self.walk.search(place) for place in (sound[:1] if self.line.stays else sound)]
            notes += max(searches, key=lambda search: search.band).notes
        if refused := {sample.value: sample.refusal for sample in samples if sample.refusal}:
            notes.append(not_valid_at(self.axis.parameter, refused))
        return notes
