"""Search for the onsets at which a valve loses or regains stability along one parameter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...errors import SolveError
from ...materials import outside_band
from ...observer import Observer
from ..case import Case
from ..stability.place import check_scan
from ..stability.verdict import Verdict, not_valid_at
from ..stability.walk import StabilityWalk
from .intervals import Interval, known_intervals
from .point import OnsetPoint, OnsetSample
from .search import OnsetOptions, OnsetSearch
from .second_mesh import with_uncertainty


@dataclass(frozen=True)
class FoundOnsets:
    """Onsets along one parameter, and the scan that found them.

    Attributes
    ----------
    case : Case
    options : OnsetOptions
    points : tuple of OnsetPoint
        In ascending order of the parameter.
    values : (s,) array
        All values of the scan, those of narrow tongues included.
    growth_rates, frequencies : (s, 4) arrays, 1/s, Hz
        Of the leading modes there; NaN where there are fewer.
    certified : (s,) bool array
        Whether an independent count of the unstable modes agrees there; nothing is claimed beside a value where it does
        not.
    failures, warnings : tuples of str
    interrupted : bool
    verdicts : (s,) tuple of Verdict
    """

    case: Case
    options: OnsetOptions
    points: tuple[OnsetPoint, ...]
    values: np.ndarray
    growth_rates: np.ndarray
    frequencies: np.ndarray
    certified: np.ndarray
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    interrupted: bool = False
    verdicts: tuple[Verdict, ...] = ()

    @cached_property
    def unstable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be unstable."""
        return self._intervals(True)

    @cached_property
    def stable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be stable.

        Values in neither list of intervals are uncertain.
        """
        return self._intervals(False)

    def _intervals(self, unstable: bool) -> list[Interval]:
        edges = [p.value for p in self.points if p.edge]
        return known_intervals(self.values, self.growth_rates[:, 0], self.certified, edges, unstable)


def run_onset(
    case: Case,
    options: OnsetOptions | None = None,
    observer: Observer | None = None,
    known: Iterable[OnsetSample | OnsetPoint] = (),
    walk: StabilityWalk | None = None,
) -> FoundOnsets:
    """All onsets of a case along one parameter.

    Parameters
    ----------
    case : Case
    options : OnsetOptions, optional
        Those of the case by default.
    observer : Observer, optional
        `item` is told of every `OnsetSample` and `OnsetPoint` as it is found, and of a point again when more is known
        about it.
    known : iterable of OnsetSample and OnsetPoint
        What an interrupted run had found, in its order; it is not solved again.
    walk : StabilityWalk, optional
        Of a case that differs in load, surroundings and `onset` alone, for steady states it knows.

    Raises
    ------
    CaseError
        If the case has nothing that the parameter could change.
    SolveError
        If the case has no flow, or no state of the scan was found.
    """
    options = options or OnsetOptions.of(case)
    check_scan(case, options.parameter)
    observer = observer or Observer()
    known = list(known)
    observer.begin("onset", None)
    failures: list[str] = []
    warnings: list[str] = []
    search = OnsetSearch(case, options, observer, walk, known=known)
    points: list[OnsetPoint] = []
    interrupted = False
    try:
        crossings = search.scan.run(options.values)
        unsound = {s.value: s.failure for s in search.asked if not s.verdict.holds}
        failures += [why for value, why in search.scan.failures.items() if value not in unsound]
        if unsound:
            warnings.append(not_valid_at(options.parameter, unsound))
        if not (search.scan.samples or unsound):
            raise SolveError(
                f"No state of the scan over {options.parameter} was found: "
                f"{failures[0] if failures else 'the range is empty.'}"
            )
        for crossing in crossings:
            observer.progress(f"onset between {crossing.low.value:.6g} and {crossing.high.value:.6g}")
            try:
                search.point(crossing)
            except SolveError as error:
                failures.append(str(error))
        warnings += search.uncertainties()
        points = list(search.points.values())
        if points and options.coarse_mesh > 0:
            points = with_uncertainty(case, options, points, observer, warnings, known)
    except KeyboardInterrupt:
        interrupted = True
        points = points or list(search.points.values())
    for p in points:
        if not p.confirmed:
            warnings.append(f"The onset at {options.parameter} = {p.value:.6g} is not confirmed: {p.note}")
    outside = outside_band(case, [p.frequency for p in points])
    warnings += [] if outside is None else [outside]
    for sentence in warnings:
        observer.warn(sentence)
    observer.end(interrupted)
    samples = search.asked
    table = np.full((len(samples), 4), complex(np.nan, np.nan))
    for row, sample in zip(table, samples):
        row[: len(sample.eigenvalues)] = sample.eigenvalues
    return FoundOnsets(
        case,
        options,
        tuple(sorted(points, key=lambda p: p.value)),
        np.array([s.value for s in samples]),
        table.real,
        table.imag / (2 * np.pi),
        np.array([s.certified for s in samples], bool),
        tuple(failures),
        tuple(warnings),
        interrupted,
        tuple(sample.verdict for sample in samples),
    )
