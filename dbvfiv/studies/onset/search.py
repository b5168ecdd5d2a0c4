"""Search for the onsets at which a valve loses or regains stability along one parameter: scan, location, confirmation
on both sides, and the uncertainty that the mesh leaves, from a second, coarser one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from eigen import Certificate

from ...case.parameters import Mu
from ...errors import CaseError, NotValidError, SolveError
from ...fit import outside_band
from ...model.symmetry import EQUILIBRIA, symmetry_named
from ...observer import Observer
from ..case import Case
from ..stability.crossings import WATCHED, Crossing, Sample, Scan, locate
from ..stability.place import check_scan, condition_of, is_surrounding
from ..stability.verdict import Verdict, not_valid_at
from ..stability.walk import StabilityWalk
from .line import FoundOnsets
from .normal_form import MISSING, described
from .point import COARSE, FINE, OnsetPoint, OnsetSample, Side

#: Relative distance from an onset at which it is confirmed on both sides.
ASIDE = 2e-3
#: Largest relative difference of a mode on the small model and with the full matrices.
SAME = 1e-3
#: Values of a scan at which leading vectors are taken.
SNAPSHOTS = 6


@dataclass(frozen=True)
class OnsetOptions:
    """Options of `run_onset`.

    Attributes
    ----------
    parameter : str
    values : tuple of float
        Values of the scan; crossings are looked for between the first and the last.
    log : bool
        Whether they are spaced logarithmically.
    tolerance : float
        Relative accuracy of an onset on its mesh.
    normal_form : bool
    coarse_mesh : float
        Elements of the second mesh over those of the first; 0 for no uncertainty.
    symmetry : str
        Class of the motions, see `dbvfiv.model.symmetry`.
    """

    parameter: str
    values: tuple[float, ...]
    log: bool = False
    tolerance: float = 1e-9
    normal_form: bool = True
    coarse_mesh: float = 0.5
    symmetry: str = EQUILIBRIA

    @classmethod
    def of(cls, case: Case) -> OnsetOptions:
        """Options of a case file."""
        axis = case.onset.axis
        return cls(
            axis.parameter, axis.values, axis.log, case.onset.tolerance, case.onset.normal_form, case.onset.coarse_mesh
        )


class OnsetSearch:
    """Onsets along one parameter.

    The order in which values are asked for follows from their eigenvalues alone, so a search that is given what an
    interrupted one had found repeats its steps without solving anything, and goes on where it ended.

    Parameters
    ----------
    case : Case
    options : OnsetOptions
    observer : Observer, optional
        `item` is told of every `OnsetSample` and `OnsetPoint`; of a point again when more is known about it.
    walk : StabilityWalk, optional
    place : Mu, optional
        The other parameters; those of the case by default.
    known : iterable of OnsetSample and OnsetPoint
        What is not to be solved again; a later point takes the place of an earlier one. Samples of other meshes are
        left aside.
    mesh : int
        `FINE` or `COARSE`, for the samples.
    """

    def __init__(
        self,
        case: Case,
        options: OnsetOptions,
        observer: Observer | None = None,
        walk: StabilityWalk | None = None,
        place: Mu | None = None,
        known: Iterable[OnsetSample | OnsetPoint] = (),
        mesh: int = FINE,
    ):
        self.case, self.options, self.mesh = case, options, mesh
        self.observer = observer or Observer()
        self.walk = walk or StabilityWalk(case, self.observer, symmetry=symmetry_named(options.symmetry))
        self.base = place or Mu.of(case)
        known = list(known)
        self._samples = {item.value: item for item in known if isinstance(item, OnsetSample) and item.mesh == mesh}
        self._known = {item.key: item for item in known if isinstance(item, OnsetPoint)}
        self.points: dict[tuple, OnsetPoint] = {}
        self.scan = Scan(self._scanned, options.log, inside=self._inside)
        self._column = None

    def place(self, value: float) -> Mu:
        return self.base.at(**{self.options.parameter: value})

    # -- samples
    # ----

    def _sample(self, value: float) -> OnsetSample:
        if value not in self._samples:
            self._samples[value] = self._solved(value)
            self.observer.item(self._samples[value])
        elif not self._samples[value].failure:
            self.walk.recall(self.place(value))
        return self._samples[value]

    def _scanned(self, value: float) -> Sample:
        known = self._sample(value)
        if known.failure:
            raise SolveError(known.failure)
        return Sample(value, known.eigenvalues, known.certified)

    def _inside(self, value: float) -> Sample:
        """A sample on the way to a crossing. Where the wall relaxes the count costs most by far, and next to a neutral
        mode it is of no use, so it is left out there and the sample is not kept.
        """
        eigenvalues = None if self._column is None else self._column.eigenvalues
        if eigenvalues is None or value in self._samples or not condition_of(self.place(value)).loss:
            return self._scanned(value)
        return Sample(value, eigenvalues(condition_of(self.place(value)))[:WATCHED])

    def _solved(self, value: float) -> OnsetSample:
        place = self.place(value)
        try:
            cell = self._cell(place)
            verdict = self.walk.verdicts([place], cell)[0]
        except NotValidError as error:
            refused = Verdict.not_valid(str(error))
            return OnsetSample(value, np.zeros(0, complex), self.mesh, str(error), verdict=refused)
        except (SolveError, CaseError) as error:
            return OnsetSample(value, np.zeros(0, complex), self.mesh, str(error))
        found = cell.leading[0]
        if len(found):
            said = "" if verdict.certain else ", uncertain"
            self.observer.progress(f"{self.options.parameter} = {value:.6g}: {found[0].real:.4g} 1/s{said}")
        # as many as the scan looks at, so that a file holds all that matters
        certified = cell.certificate(0).agrees
        return OnsetSample(value, np.asarray(found)[:WATCHED], self.mesh, certified=certified, verdict=verdict)

    def _cell(self, place: Mu):
        """Leading eigenvalues and their certificate: on a small model where the steady state stays the same, with the
        full pencil elsewhere.
        """
        if not is_surrounding(self.case, self.options.parameter):
            return self.walk.column([place])
        self.walk.require_valid(place)
        if self._column is None:
            ends = np.array(self.options.values)
            taken = ends[np.unique(np.linspace(0, len(ends) - 1, SNAPSHOTS).astype(int))]
            self._column = self.walk.column([self.place(v) for v in taken], len(taken))
        if self._column.cell is None:
            return self.walk.column([place])
        return self._column.cell(condition_of(place))

    def uncertainties(self) -> list[str]:
        """Sentences about what is not known: stretches of the scan without a certificate, and a band that was searched
        instead of all frequencies.
        """
        name, said, joined = self.options.parameter, [], []
        for low, high in self.scan.uncertain:
            if joined and joined[-1][1] == low:
                joined[-1][1] = high
            else:
                joined.append([low, high])
        for low, high in joined:
            said.append(
                f"Between {name} = {low:.6g} and {high:.6g} spectrum and independent count do not agree everywhere, so "
                "nothing is claimed there."
            )
        bands = [s.verdict.band for s in self._samples.values() if np.isfinite(s.verdict.band)]
        if bands:
            said.append(f"Verdicts hold for modes up to {min(bands):.4g} Hz; modes.max_frequency chooses another end.")
        return said

    @property
    def asked(self) -> list[OnsetSample]:
        """Samples of the scan in ascending order, with those at which the constants of the rubber do not hold."""
        known = {s.value: s for s in self._samples.values() if not s.failure or not s.verdict.holds}
        known = {value: s for value, s in known.items() if value in self.scan.samples or value in self.scan.failures}
        return [known[value] for value in sorted(known)]

    # -- points
    # ----

    def point(self, crossing: Crossing) -> OnsetPoint:
        """Locate, confirm and describe one crossing.

        Raises
        ------
        SolveError
        """
        key = (crossing.low.value, crossing.high.value, crossing.index)
        point, mode = self._known.get(key), None
        if point is None:
            point, mode = self._located(crossing)
            self._keep(point)
        else:
            locate(self.scan, crossing, self.options.tolerance)  # only repeats known samples, which belong to the scan
            for value in (point.value, point.below.value, point.above.value):
                self.walk.recall(self.place(value))
        if self.options.normal_form and point.frequency > 0 and point.criticality is None and MISSING not in point.note:
            self.observer.progress(f"normal form at {point.value:.6g}")
            self.points[key] = point  # an interruption does not take away what is known
            mode = self.critical(point.place, 2j * np.pi * point.frequency) if mode is None else mode
            point = described(point, self.case, self.walk, mode)
            self._keep(point)
        self.points[key] = point
        return point

    def _keep(self, point: OnsetPoint) -> None:
        self.points[point.key] = point
        self.observer.item(point)

    def _located(self, crossing: Crossing):
        parameter = self.options.parameter
        value = locate(self.scan, crossing, self.options.tolerance)
        expected = complex(self.scan.within(value).eigenvalues[crossing.index])
        if is_surrounding(self.case, parameter):
            value = self._polished(value, crossing, expected)
        place = self.place(value)
        mode = self.critical(place, expected)
        eigenvalue = complex(mode.eigenvalue)
        gains = crossing.high.unstable > crossing.low.unstable
        width = ASIDE * abs(value) if value else ASIDE * (self.options.values[-1] - self.options.values[0])
        (below, one), (above, two) = (self._side(v, eigenvalue) for v in (value - width, value + width))
        confirmed, note = _confirmed(below, above, gains, one.agrees and two.agrees, max(one.line, two.line))
        edge = min(below.unstable, above.unstable) == 0
        bracket = (crossing.low.value, crossing.high.value)
        frequency = abs(eigenvalue.imag) / (2 * np.pi)
        return OnsetPoint(
            parameter,
            value,
            frequency,
            eigenvalue.real,
            gains,
            edge,
            below,
            above,
            confirmed,
            place,
            bracket,
            crossing.index,
            note=note,
        ), mode

    def _polished(self, value: float, crossing: Crossing, expected: complex) -> float:
        """Secant steps with the full pencil from the root on the small model."""
        scale = max(abs(crossing.low.value), abs(crossing.high.value))

        def growth(v):
            return float(self.critical(self.place(v), expected).eigenvalue.real)

        a, fa = value, growth(value)
        b = value + 1e-6 * scale
        for _ in range(6):
            fb = growth(b)
            if fb == fa or abs(b - a) <= 0.1 * self.options.tolerance * scale:
                break
            c = b - fb * (b - a) / (fb - fa)
            if not crossing.low.value <= c <= crossing.high.value:
                break
            a, fa, b = b, fb, c
            if abs(b - a) <= self.options.tolerance * scale:
                break
        return float(b if crossing.low.value <= b <= crossing.high.value else value)

    def critical(self, place: Mu, eigenvalue: complex):
        """The mode of the full pencil at a place that an eigenvalue found otherwise belongs to.

        Raises
        ------
        SolveError
            If the full pencil has no such mode.
        """
        spectrum = self.walk.spectrum(place)
        apart = np.abs(spectrum.eigenvalues - eigenvalue)
        if not len(spectrum) or apart.min() > SAME * abs(eigenvalue):
            raise SolveError(
                f"At {self.options.parameter} = {place[self.options.parameter]:.6g} the full pencil has no mode "
                f"near {abs(eigenvalue.imag) / (2 * np.pi):.4g} Hz that is neutral, so no onset is claimed there."
            )
        return spectrum.mode(int(np.argmin(apart)))

    def _side(self, value: float, eigenvalue: complex) -> tuple[Side, Certificate]:
        """Stability at a value by the full model, and the certificate of its eigenvalue count."""
        cell = self.walk.column([self.place(value)])
        values, certificate = cell.leading[0], cell.certificate(0)
        crossing = complex(values[int(np.argmin(np.abs(values - eigenvalue)))])
        frequency = crossing.imag / (2 * np.pi)
        leading = float(values[0].real)
        side = Side(value, crossing.real, frequency, leading, certificate.unstable, certificate.counted)
        return side, certificate


def _confirmed(below: Side, above: Side, gains: bool, certified: bool, line: float) -> tuple[bool, str]:
    for side in (below, above):
        if side.unstable != side.counted:
            return (
                False,
                (
                    f"at {side.value:.6g} the spectrum lists {side.unstable} unstable eigenvalues and the "
                    f"independent count finds {side.counted}."
                ),
            )
    if not certified:
        return False, "the independent count beside it is uncertain."
    first, second = (below, above) if gains else (above, below)
    if first.eigenvalue.real < 0 < second.eigenvalue.real and first.unstable == second.unstable and line > 0:
        return False, f"the independent count looks right of {line:.4g} 1/s only, where an undamped wall ends."
    if not (first.eigenvalue.real < 0 < second.eigenvalue.real and first.unstable < second.unstable):
        return (
            False,
            f"the eigenvalues {below.eigenvalue:.5g} and {above.eigenvalue:.5g} 1/s on both sides do not show it.",
        )
    return True, ""


#: Order at which results of the four-node shell converge with the mesh size.
ORDER = 2.0
#: Ratio of mesh widths below which a second mesh says nothing.
LEAST_RATIO = 1.15
#: Relative accuracy of onsets on the second mesh.
LOCATED = 1e-6
#: Largest relative difference of frequencies of one onset on two meshes.
ALIKE = 0.25


def coarse_case(case: Case, share: float) -> tuple[Case, float]:
    """The case on fewer elements, and the ratio of mesh widths."""
    mesh = case.mesh
    around, along = (max(6, int(round(share * n))) for n in (mesh.around, mesh.along))
    return case.replace({"mesh.around": around, "mesh.along": along}), float(
        np.sqrt(mesh.around * mesh.along / (around * along))
    )


def with_uncertainty(
    case: Case, options: OnsetOptions, points: list[OnsetPoint], observer: Observer, warnings: list[str], known=()
) -> list[OnsetPoint]:
    """Onsets again on a coarser mesh, matched by frequency and direction; Richardson's rule with the order of the
    element.

    Parameters
    ----------
    observer : Observer
        Told of the samples on that mesh, and again of each point.
    known : iterable of OnsetSample and OnsetPoint
        Of an interrupted run.
    """
    coarse, ratio = coarse_case(case, options.coarse_mesh)
    if ratio < LEAST_RATIO:
        warnings.append("The mesh is too coarse for a second one, so onsets carry no uncertainty.")
        return points
    size = f"{coarse.mesh.around} x {coarse.mesh.along}"
    observer.progress(f"second mesh, {size}")
    search = OnsetSearch(coarse, replace(options, normal_form=False), observer, known=known, mesh=COARSE)
    found = []
    for crossing in search.scan.run(options.values):
        try:
            value = locate(search.scan, crossing, LOCATED)
            expected = complex(search.scan.within(value).eigenvalues[crossing.index])
            eigenvalue = search.critical(search.place(value), expected).eigenvalue
        except SolveError:
            continue
        found.append((value, abs(eigenvalue.imag) / (2 * np.pi), crossing.high.unstable > crossing.low.unstable))
    done = []
    for point in points:
        alike = [
            c for c in found if c[2] == point.gains and abs(c[1] - point.frequency) <= ALIKE * max(point.frequency, 1.0)
        ]
        if alike:
            value = min(alike, key=lambda c: abs(c[0] - point.value))[0]
            found = [c for c in found if c[0] != value]
            point = replace(point, coarse_value=value, uncertainty=abs(point.value - value) / (ratio**ORDER - 1.0))
        else:
            sentence = f"The mesh of {size} has no onset like it, so its uncertainty is unknown."
            point = replace(point, note=point.note if sentence in point.note else f"{point.note} {sentence}".strip())
        observer.item(point)
        done.append(point)
    return done


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
    points = sorted(points, key=lambda p: p.value)
    return FoundOnsets(
        case, options.symmetry, tuple(search.asked), tuple(points), tuple(failures), tuple(warnings), interrupted
    )
