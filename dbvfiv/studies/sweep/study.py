"""Modes tracked along one parameter: run, storage, and what can be read off a run or its file."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from eigen.factor import Workspace
from eigen.operator import CoupledPencil
from eigen.search import leading_modes
from eigen.spectrum import SearchOptions, Spectrum
from eigen.tracking import Branches, TrackOptions, track

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, SolveError
from ...fit.cards import outside_band
from ...model.equilibria import require_equilibrium
from ...model.leading import growth_floor
from ...model.state import SteadyState
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.states import SUMMARY
from ...record.table import Column, Shown, TableSpec, printed_head, printed_row
from ...texts import json_value
from ..case import Case
from ..result import RangeResult
from ..session import Session, Study, describe_surroundings, print_rows, show_parameter
from ..stability.dimensions import variants
from ..stability.line import ParameterLine
from ..stability.place import is_surrounding, require_kept_head, require_parameter
from ..stability.samples import SAMPLE_TABLE, SAMPLES, Sample, SampleKey, keep_samples, read_samples
from ..stability.verdict import NEUTRAL, Verdict, not_valid_at
from ..stability.walk import StabilityWalk, name_state_in_failures

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
        """Track the modes over the values at which the constants of the rubber hold. Raises SolveError if a value has
        no steady state; what lies before it is followed.
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
        leading = model.fine.leading(mu)[: self.options.count]
        return max((abs(model.corrected(mu, [x])[0]) / max(abs(x), 1.0) for x in leading), default=0.0)

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
            with name_state_in_failures(place.pressure):
                self.spectra[pencil] = self._leading(pencil, count, options)
        return self.spectra[pencil]

    def _leading(self, pencil: CoupledPencil, count: int, options: SearchOptions) -> Spectrum:
        if not self.is_reduced:
            return leading_modes(pencil, count, replace(options, left=True), workspace=self._workspace)
        # the linear form of a viscoelastic wall is several times as large
        method = "auto" if pencil.relaxation is not None and count < pencil.n else "dense"
        return leading_modes(pencil, count, replace(options, limit_point=None, left=True, method=method))

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
        if left_open := [sample.left_open for sample in samples if sample.left_open]:
            notes.append(f"{len(left_open)} of {len(samples)} values are left open. {left_open[0]}")
        if refused := {sample.value: sample.refusal for sample in samples if sample.refusal}:
            notes.append(not_valid_at(self.axis.parameter, refused))
        return notes


_BRANCHES = (
    Column("id", "", "Number of the branch, by falling largest growth rate", "i8"),
    Column("value", "SI", "Value of the parameter"),
    Column("growth_rate", "1/s", "NaN where the branch does not exist"),
    Column(
        "angular_frequency",
        "rad/s",
        "Imaginary part of the eigenvalue; negative for the second of two real modes that have merged",
    ),
    Column("confidence", "", "0 to 1, of the match with the value before"),
)


def tables_of(_mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a sweep; checks are notes."""
    states = TableSpec(STATES, SUMMARY, {"max_displacement_position": (3,)})
    return SAMPLE_TABLE, TableSpec(BRANCHES, _BRANCHES), states


def check(case: Case) -> None:
    """Refuse a range of what the case does not have."""
    require_parameter(case, case.sweep.axis.parameter)
    require_kept_head(case, case.sweep.axis.parameter)
    if case.sweep.axis.parameter == "density" and case.drive.kind != "flow" and case.outside.fluid != "same":
        raise CaseError(
            "sweep.over ranges over density, but drive.kind is 'uniform' and there is no fluid; choose "
            "pressure, alpha, beta or loss_factor."
        )


def run(session: Session, record: GrowingRecord) -> None:
    """Modes along `sweep.over` of the case. An interrupt, or a value that has no steady state, ends the sweep and keeps
    what was found. Raises SolveError if not even the first value was solved.
    """
    case, model, axis = session.case, session.model, session.case.sweep.axis
    (variant,) = variants(case, "sweep")
    walk = StabilityWalk(case, record, model, variant.motion)
    if is_surrounding(case, axis.parameter):
        state = session.equilibrium(record)
        require_equilibrium(model, state)
        walk.give(Mu.of(case), state)
    record.begin(f"sweep over {axis.parameter}", len(axis.values))
    tracking, interrupted = Tracking(case, walk, record), False
    try:
        with name_state_in_failures(case.drive.pressure):
            tracking.follow()
    except KeyboardInterrupt:
        interrupted = True
    except SolveError as error:
        if not tracking.samples:
            raise
        record.fail(str(error))
    tables = tracking.tables()
    record.note("kept", **tables)  # read while the rows are written
    for table, rows in tables.items():
        if rows:
            record.extend(table, {name: [row[name] for row in rows] for name in rows[0]})
    checks, notes = ([], []) if interrupted else (tracking.checks(), tracking.notes())
    record.note("over", remarks=notes, checks=checks)
    leading = [sample.verdict.frequency for sample in tracking.samples if sample.verdict.holds]
    outside = outside_band(case, [frequency for frequency in leading if np.isfinite(frequency)])
    record.warn(*filter(None, (*notes, outside, *walk.about_rubbers())))
    if interrupted:
        raise KeyboardInterrupt


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """No rows: a sweep that was ended starts anew."""
    return dict.fromkeys((SAMPLES, BRANCHES, STATES), 0)


@dataclass(frozen=True, eq=False)
class Branch:
    """A mode followed along the parameter."""

    id: int
    growth_rate: np.ndarray  #: (p,) 1/s; NaN where the branch does not exist.
    angular_frequency: np.ndarray  #: (p,) rad/s.
    confidence: np.ndarray  #: (p,).

    @property
    def frequency(self) -> np.ndarray:
        """(p,) Hz, not negative."""
        return np.abs(self.angular_frequency) / (2 * np.pi)

    @property
    def growth_beyond_rounding(self) -> np.ndarray:
        """(p,) 1/s; growth rates, 0 where they are rounding, as of an undamped wall."""
        growth = self.growth_rate
        return np.where(np.abs(growth) <= NEUTRAL * np.hypot(growth, self.angular_frequency), 0.0, growth)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON; None where the branch does not exist."""
        columns = {"growth_rate": self.growth_rate, "frequency": self.frequency, "confidence": self.confidence}
        return {"id": self.id} | json_value(columns)


@dataclass(frozen=True)
class Crossing:
    """Crossing of zero growth by a branch, interpolated between two values of the parameter."""

    branch: int
    value: float
    frequency: float  #: Hz.
    to_unstable: bool  #: True where the branch becomes unstable as the parameter grows.


class SweepResult(RangeResult):
    """Modes tracked along one parameter.

    Attributes
    ----------
    parameter : str
        As the range names it, "density".
    values : (p,) SI
        Those done.
    branches : tuple of Branch
    unstable_count : (p,) int
        Both eigenvalues of a pair count.
    checks : tuple of dict
        See `dbvfiv.studies.sweep.study.Tracking.checks`.
    certified : bool
    points : tuple of dict
        States, see `dbvfiv.record.states.SUMMARY`: one for each value over pressure, a single one otherwise.
    notes : tuple of str
    """

    kind = "sweep"

    @cached_property
    def _over(self) -> dict[str, Any]:
        """Closing note of a sweep that is over; empty for one that goes on or was killed."""
        return next(reversed(self.record.latest("over")), {})

    def _rows(self, name: str) -> list[dict[str, Any]]:
        """Rows of a table; of a sweep that goes on or was killed, what was kept on the way."""
        if not self._over:
            return next(reversed(self.record.latest("kept")), {}).get(name, [])
        return self.record.table_rows(next(spec for spec in tables_of(self.mesh) if spec.name == name))

    @cached_property
    def samples(self) -> tuple[Sample, ...]:
        """Leading modes and counts at the values done, in the order of these."""
        order = {float(value): i for i, value in enumerate(self.axis.values)}
        return tuple(sorted(read_samples(self.record), key=lambda sample: order[sample.value]))

    @cached_property
    def values(self) -> np.ndarray:
        return np.array([sample.value for sample in self.samples], float)

    @cached_property
    def unstable_count(self) -> np.ndarray:
        return np.array([sample.unstable for sample in self.samples], int)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdict on each value."""
        return tuple(sample.verdict for sample in self.samples)

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        names, found = ("growth_rate", "angular_frequency", "confidence"), {}
        for row in self._rows(BRANCHES):
            table = found.setdefault(int(row["id"]), np.full((3, len(self.values)), np.nan))
            table[:, self.values == row["value"]] = np.array([[row[name]] for name in names], float)
        return tuple(Branch(number, *table) for number, table in found.items())

    @property
    def checks(self) -> tuple[dict[str, Any], ...]:
        """See `dbvfiv.studies.sweep.study.Tracking.checks`."""
        return tuple(self._over.get("checks", ()))

    @cached_property
    def points(self) -> tuple[dict[str, Any], ...]:
        rows = self._rows(STATES)
        return tuple({name: list(v) if isinstance(v, tuple) else v for name, v in row.items()} for row in rows)

    @property
    def certified(self) -> bool:
        """True where all checks held."""
        return bool(self.checks) and all(check["agrees"] and check["accurate"] for check in self.checks)

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(self._over.get("remarks", ()))

    @property
    def units(self) -> str:
        """SI unit of the parameter."""
        return PARAMETERS[self.parameter].quantity.si

    def crossings(self) -> tuple[Crossing, ...]:
        """Crossings of zero growth by the branches, interpolated between neighbouring values.

        Two real branches that have merged count once.
        """
        scale = np.log if self.axis.log else np.asarray
        place = scale(self.values)
        found = []
        for branch in self.branches:
            growth = branch.growth_beyond_rounding
            for i in np.flatnonzero(growth[:-1] * growth[1:] < 0):
                share = growth[i] / (growth[i] - growth[i + 1])
                at = place[i] + share * (place[i + 1] - place[i])
                frequency = branch.frequency[i] + share * (branch.frequency[i + 1] - branch.frequency[i])
                if branch.angular_frequency[i] >= 0:
                    found.append(
                        Crossing(
                            branch.id, float(np.exp(at) if self.axis.log else at), float(frequency), bool(growth[i] < 0)
                        )
                    )
        return tuple(sorted(found, key=lambda c: c.value))

    def summary(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "symmetry": variants(self.case, "sweep")[0].symmetry,
            "values": self.values.tolist(),
            "branches": [branch.summary() for branch in self.branches],
            "unstable_count": self.unstable_count.tolist(),
            "verdict": [verdict.summary() for verdict in self.verdicts],
            "crossings": [vars(crossing) for crossing in self.crossings()],
            "certificate": {"certified": self.certified, "checks": list(self.checks)},
            "surroundings": {name: v for name, v in describe_surroundings(self.case).items() if name != self.parameter},
            "states": list(self.points),
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "failures": list(self.failures),
            "interrupted": not (self.complete or bool(self.failures)),
        }

    def _missed(self, lost: int) -> str:
        kept = f"; they are kept in {self.path}" if self.path else ""
        return f"{len(self.values)} of {len(self.axis.values)} values were reached{kept}"

    def remarks(self) -> list[str]:
        return self.lines()[2 + len(self.values) :]

    def lines(self) -> list[str]:
        crossings = [crossing_line(self, crossing) for crossing in self.crossings()]
        row = self._row
        unit, places = row.shown_unit, ", ".join(f"{check['value'] / row.scale:.4g}" for check in self.checks)
        word = "Certified" if self.certified else "Not certified"
        checked = (
            [f"{word}: checked at {self.parameter} {places} {unit}".rstrip() + "."]
            if self.checks
            else ["Not certified: no value was checked."]
        )
        return [
            *printed_head(_columns(self.case)),
            *rows_of_sweep(self),
            "",
            *crossings,
            *checked,
            f"Modes are of {variants(self.case, 'sweep')[0].motion.alone}.",
            *(f"Note: {note}" for note in self.notes),
        ]


def _columns(case: Case) -> tuple[Column, ...]:
    """Columns of the printed table: a value of the parameter, the leading mode, unstable eigenvalues."""
    value = show_parameter(case.units.parameter(case.sweep.axis.parameter))
    others = Shown("growth rate", "1/s", 12, ".4f"), Shown("frequency", "Hz", 11, ".4f"), Shown("unstable", "", 9, "d")
    names = ("value", "growth_rate", "frequency", "unstable")
    return tuple(Column(name, "", "", shown=shown) for name, shown in zip(names, (value, *others)))


def print_live(case: Case) -> Callable[[Any], str]:
    """Lines of the table as values are solved."""
    write = print_rows(_columns(case))

    def tell(item: Sample | SteadyState) -> str:
        if isinstance(item, SteadyState):
            return f"Steady state at {item.pressure:.6g} Pa."
        found = {name: item.number(name) for name in ("value", "growth_rate", "frequency", "unstable")}
        return write(found | {"frequency": abs(found["frequency"])})

    return tell


def rows_of_sweep(result: SweepResult) -> list[str]:
    """One line for each value: the leading branch."""
    rows, columns = [], _columns(result.case)
    for i, value in enumerate(result.values):
        there = [b for b in result.branches if np.isfinite(b.growth_rate[i])]
        leading = max(there, key=lambda b: b.growth_rate[i], default=None)
        growth, frequency = (leading.growth_rate[i], leading.frequency[i]) if leading else (np.nan, np.nan)
        outcome = result.verdicts[i].outcome if result.verdicts else ""
        row = {"value": value, "growth_rate": growth, "frequency": frequency, "unstable": result.unstable_count[i]}
        rows.append(f"{printed_row(columns, row)}  {outcome}".rstrip())
    return rows


def crossing_line(result: SweepResult, crossing: Crossing) -> str:
    """One sentence on a crossing of zero growth."""
    becomes = "unstable" if crossing.to_unstable else "stable"
    how = f"at {crossing.frequency:.4g} Hz" if crossing.frequency > 0 else "without oscillation"
    place = result.case.units.parameter(result.parameter).amount(crossing.value, 4)
    under = f" under {result.case.continuity}" if result.case.continuity else ""
    return f"Branch {crossing.branch} becomes {becomes} near {result.parameter} {place} {how}{under} (interpolated)."


STUDY = Study("sweep", tables_of, run, SweepResult, check, rows_to_keep=rows_to_keep, live=print_live)
