"""Search for the onsets at which a valve loses or regains stability along one parameter: scan, location, confirmation
on both sides, kind, and the uncertainty that the mesh leaves, from a second, coarser one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from continuation.normal_form import hopf_normal_form_of
from continuation.options import ContinuationError

from ...case.parameters import DESIGN, PARAMETERS, Mu
from ...errors import SolveError
from ...fit.cards import outside_band
from ...geometry.divisions import least_rows
from ...geometry.surface import surface_of
from ...model.forms import ValveForms
from ...model.leading import other_end
from ...observer import Observer
from ...texts import digits
from ..case import Case
from ..stability.dimensions import Variant, own_variant
from ..stability.line import ParameterLine
from ..stability.place import is_surrounding, models_of
from ..stability.samples import Sample, SampleKey
from ..stability.scan import Crossing, locate
from ..stability.verdict import not_valid_at
from ..stability.walk import StabilityWalk
from .line import FoundOnsets, OnsetPoint, Side, joined_stretches

#: Meshes of a run: that of the case, and the coarser one for the uncertainty.
FINE, COARSE = 0, 1
#: Relative distance from an onset, of a pressure from that behind the valve, at which it is confirmed on both sides.
ASIDE = 2e-3
#: Largest relative difference of a mode on the small model and with the full matrices.
SAME = 1e-3
#: Values of a scan at which leading vectors are taken.
SNAPSHOTS = 6
#: What the note of a point begins with where its normal form was not found.
MISSING = "No normal form:"


class OnsetSearch:
    """Onsets along `onset.over` of a case.

    The order in which values are asked for follows from their eigenvalues alone, so a search that is given what an
    interrupted one had found repeats its steps without solving anything, and goes on where it ended.

    Parameters
    ----------
    variant : Variant, optional
        Flow model and symmetry class; those of the case's equilibria by default. Cycles that leave the symmetry have
        normal forms of their own, not looked for.
    observer : Observer, optional
        `item` is told of every `Sample` and `OnsetPoint`; of a point again when more is known about it.
    walk : StabilityWalk, optional
    place : Mu, optional
        The other parameters; those of the case by default.
    known : iterable of Sample and OnsetPoint
        What is not to be solved again; a later point takes the place of an earlier one. Samples of other meshes are
        left aside.
    mesh : int
        `FINE` or `COARSE`, for the samples.
    """

    def __init__(
        self,
        case: Case,
        variant: Variant | None = None,
        observer: Observer | None = None,
        walk: StabilityWalk | None = None,
        place: Mu | None = None,
        known: Iterable[Sample | OnsetPoint] = (),
        mesh: int = FINE,
    ):
        self.case, self.axis, self.observer = case, case.onset.axis, observer or Observer()
        base, known = place or Mu.of(case), list(known)
        if variant is not None and self.axis.parameter != "storage":
            base = base.at(storage=variant.storage)
        self.variant = variant or own_variant(case)
        self.walk = walk or StabilityWalk(case, self.observer, symmetry=self.variant.motion)
        ends = np.array(self.axis.values)
        taken = ends[np.unique(np.linspace(0, len(ends) - 1, SNAPSHOTS).astype(int))]
        key = SampleKey(self.variant.storage, self.variant.symmetry, mesh)
        samples = [item for item in known if isinstance(item, Sample)]
        asked = self.axis.parameter, taken, self.axis.log
        self.line = ParameterLine(
            self.walk, base, *asked, snapshots=len(taken), key=key, known=samples, tell=self._found
        )
        self.scan = self.line.scan
        self._known = {item.key: item for item in known if isinstance(item, OnsetPoint)}
        self.points: dict[tuple, OnsetPoint] = {}

    def place(self, value: float) -> Mu:
        """Parameter point at a value."""
        return self.line.place(value)

    def _found(self, sample: Sample) -> None:
        self.observer.item(sample)
        if len(sample.eigenvalues):
            said = "" if sample.verdict.certain else ", uncertain"
            rate = sample.eigenvalues[0].real
            self.observer.progress(f"{self.axis.parameter} = {sample.value:.6g}: {rate:.4g} 1/s{said}")

    def uncertainties(self) -> list[str]:
        """Sentences about what is not known: stretches of the scan without a certificate, and a band that was searched
        instead of all frequencies.
        """
        row, said = PARAMETERS[self.axis.parameter], []
        for low, high in joined_stretches([self.scan.uncertain]):
            within = [s.left_open or s.failure or s.refusal for s in self._scanned if low <= s.value <= high]
            why = next(filter(None, within), "Spectrum and independent count do not agree everywhere.")
            said.append(f"Between {row.named(low)} and {row.amount(high)} nothing is claimed. {why}")
        bands = [s.verdict.band for s in self.line.samples.values() if np.isfinite(s.verdict.band)]
        if bands:
            said.append(f"Verdicts hold for modes up to {digits(min(bands), 4)} Hz; {other_end(self.walk.case)}.")
        return said

    @property
    def asked(self) -> list[Sample]:
        """Samples of the scan in ascending order, with those at which the constants of the rubber do not hold."""
        return [sample for sample in self._scanned if not sample.failure]

    @property
    def missed(self) -> list[float]:
        """Values of the scan at which no state was found."""
        return [sample.value for sample in self._scanned if sample.failure]

    @property
    def _scanned(self) -> list[Sample]:
        known = self.line.samples
        return [known[value] for value in sorted({*self.scan.samples, *self.scan.failures}) if value in known]

    def point(self, crossing: Crossing) -> OnsetPoint:
        """Locate, confirm and describe one crossing. Raises SolveError."""
        key = (crossing.low.value, crossing.high.value, crossing.index)
        point, mode = self._known.get(key), None
        if point is None:
            point, mode = self._located(crossing)
            if twin := self._twin(point):  # lists above the band of the verdict may lack a mode at one of the ends
                return twin
            self._keep(point)
        else:
            locate(self.scan, crossing, self.case.onset.tolerance)  # repeats known samples, which belong to the scan
            for value in (point.value, point.below.value, point.above.value):
                self.walk.recall(self.place(value))
        asked = self.case.onset.normal_form and self.variant.motion.of_equilibria
        if asked and point.frequency > 0 and point.criticality is None and MISSING not in point.note:
            self.observer.progress(f"normal form at {point.value:.6g}")
            self.points[key] = point  # an interruption does not take away what is known
            place = self.place(point.value)
            mode = self.critical(place, 2j * np.pi * point.frequency) if mode is None else mode
            point = self._classified(point, place, mode)
            self._keep(point)
        self.points[key] = point
        return point

    def _twin(self, point: OnsetPoint) -> OnsetPoint | None:
        """Onset that was located from another growth rate before; None without one."""
        value, frequency = ASIDE * abs(point.value), SAME * point.frequency  # no further apart than its two sides
        alike = (p for p in self.points.values() if p.key != point.key and p.gains == point.gains)
        near = (p for p in alike if abs(p.value - point.value) <= value)
        return next((p for p in near if abs(p.frequency - point.frequency) <= frequency), None)

    def _keep(self, point: OnsetPoint) -> None:
        self.points[point.key] = point
        self.observer.item(point)

    def _classified(self, point: OnsetPoint, place: Mu, mode) -> OnsetPoint:
        """A point with its criticality; with the reason in its note where there is none."""
        try:
            form = normal_form(self.case, self.walk, place, mode, point.parameter)
        except (ContinuationError, SolveError, ArithmeticError, ValueError) as error:
            return replace(point, note=f"{point.note} {MISSING} {error}".strip())
        speed = form.crossing.real if form.crossing is not None else None
        return replace(point, criticality=form.criticality, first_lyapunov_coefficient=form.l1, crossing_speed=speed)

    def _located(self, crossing: Crossing):
        values = self.axis.values
        found = self.line.locate(crossing, self.case.onset.tolerance)
        mode = self.critical(self.place(found.value), found.eigenvalue)
        eigenvalue, value = complex(mode.eigenvalue), found.value
        row, back = PARAMETERS[self.axis.parameter], 0.0
        if row.name == "pressure":  # the wall sees what is beyond that behind the valve
            back = self.walk.built(self.place(value)).model.flow.back
        width = ASIDE * (abs(value - back) or values[-1] - values[0])
        sides = [self._beside(min(max(v, row.low), row.high)) for v in (value - width, value + width)]
        below, above = (Side.of(sample, eigenvalue) for sample in sides)
        certified, line = all(s.certified for s in sides), max(s.line for s in sides)
        confirmed, note = _confirmed(below, above, crossing.gains, certified, line)
        return OnsetPoint(
            self.axis.parameter,
            value,
            abs(eigenvalue.imag) / (2 * np.pi),
            eigenvalue.real,
            crossing.gains,
            crossing.index == 0 and min(below.unstable_count, above.unstable_count) == 0,
            below,
            above,
            confirmed,
            (crossing.low.value, crossing.high.value),
            crossing.index,
            note=note,
        ), mode

    def _beside(self, value: float) -> Sample:
        """Sample of the full model."""
        return Sample.of(value, self.walk.cell(self.place(value)))

    def critical(self, place: Mu, eigenvalue: complex):
        """The mode of the full pencil at a place that an eigenvalue found otherwise belongs to. Raises SolveError if
        the full pencil has no such mode.
        """
        spectrum = self.walk.spectrum(place)
        apart = np.abs(spectrum.eigenvalues - eigenvalue)
        if not len(spectrum) or apart.min() > SAME * abs(eigenvalue):
            raise SolveError(
                f"At {PARAMETERS[self.axis.parameter].named(place[self.axis.parameter])} the full pencil has no mode "
                f"near {abs(eigenvalue.imag) / (2 * np.pi):.4g} Hz that is neutral, so no onset is claimed there."
            )
        return spectrum.mode(int(np.argmin(apart)))


def _confirmed(below: Side, above: Side, gains: bool, certified: bool, line: float) -> tuple[bool, str]:
    for where, side in (("below", below), ("above", above)):
        if side.unstable_count != side.unstable_count_independent:
            return (
                False,
                (
                    f"{where} it the spectrum lists {side.unstable_count} unstable eigenvalues and the "
                    f"independent count finds {side.unstable_count_independent}."
                ),
            )
    if not certified:
        return False, "the independent count beside it is uncertain."
    first, second = (below, above) if gains else (above, below)
    if (
        first.eigenvalue.real < 0 < second.eigenvalue.real
        and first.unstable_count == second.unstable_count
        and line > 0
    ):
        return False, f"the independent count looks right of {line:.4g} 1/s only, where an undamped wall ends."
    if not (first.eigenvalue.real < 0 < second.eigenvalue.real and first.unstable_count < second.unstable_count):
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
#: What a second mesh is said to lack, up to a comma.
NO_ONSET = "has no onset like it"


def coarse_mesh(case: Case, share: float, least: int = 6) -> dict[str, int]:
    """Keys of a mesh with a share of the elements each way, `least` around, and a row for each piece of the surface."""
    mesh, rows = case.mesh, max(6, least_rows(surface_of(case.valve, case.part)))
    ways = {"mesh.around": (mesh.around, least), "mesh.along": (mesh.along, rows)}
    return {key: min(number, max(fewest, round(share * number))) for key, (number, fewest) in ways.items()}


def coarse_case(case: Case, share: float) -> tuple[Case, float]:
    """The case on fewer elements, see `coarse_mesh`, and the ratio of mesh widths; that is 1 where either way stays all
    but as fine, so that the difference says nothing of it.
    """
    coarse = case.replace(coarse_mesh(case, share))
    ratios = case.mesh.around / coarse.mesh.around, case.mesh.along / coarse.mesh.along
    return coarse, float(np.sqrt(np.prod(ratios))) if min(ratios) >= LEAST_RATIO else 1.0


def with_uncertainty(
    case: Case, variant: Variant | None, points: list[OnsetPoint], observer: Observer, warnings: list[str], known=()
) -> list[OnsetPoint]:
    """Onsets again on a coarser mesh, matched by frequency and direction; Richardson's rule with the order of the
    element.

    Parameters
    ----------
    observer : Observer
        Told of the samples on that mesh, and again of each point.
    known : iterable of Sample and OnsetPoint
        Of an interrupted run.
    """
    coarse, ratio = coarse_case(case, case.onset.coarse_mesh)
    if ratio < LEAST_RATIO:
        why = "The mesh is too coarse for a second one"
        if coarse_case(case, 0.5)[1] >= LEAST_RATIO:
            why = f"The second mesh is all but as fine with onset.coarse_mesh = {case.onset.coarse_mesh:g}"
        warnings.append(f"{why}, so onsets carry no uncertainty.")
        return points
    size = f"{coarse.mesh.around} x {coarse.mesh.along}"
    observer.progress(f"second mesh, {size}")
    search = OnsetSearch(coarse, variant, observer, known=known, mesh=COARSE)
    found, lost = [], set()
    for crossing in search.scan.run(search.axis.values):
        try:
            value, expected = locate(search.scan, crossing, LOCATED)
            eigenvalue = search.critical(search.place(value), expected).eigenvalue
        except SolveError:
            lost.add(crossing.gains)
            continue
        found.append((value, abs(eigenvalue.imag) / (2 * np.pi), crossing.gains))
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
            solved = " that was solved" if point.gains in lost else ""
            sentence = f"The mesh of {size} {NO_ONSET}{solved}, so its uncertainty is unknown."
            point = replace(point, note=point.note if sentence in point.note else f"{point.note} {sentence}".strip())
        observer.item(point)
        done.append(point)
    return done


def run_onset(
    case: Case,
    variant: Variant | None = None,
    observer: Observer | None = None,
    known: Iterable[Sample | OnsetPoint] = (),
    walk: StabilityWalk | None = None,
) -> FoundOnsets:
    """All onsets of a case along `onset.over`. Raises SolveError if no state of the scan was found.

    Parameters
    ----------
    variant : Variant, optional
        Flow model and symmetry class; those of the case's equilibria by default.
    observer : Observer, optional
        `item` is told of every `Sample` and `OnsetPoint` as it is found, and of a point again when more is known about
        it.
    known : iterable of Sample and OnsetPoint
        What an interrupted run had found, in its order; it is not solved again.
    walk : StabilityWalk, optional
        Of a case that differs in load, surroundings and `onset` alone, for steady states it knows.
    """
    observer, known, parameter = observer or Observer(), list(known), case.onset.axis.parameter
    search = OnsetSearch(case, variant, observer, walk, known=known)
    crossings = search.scan.run(search.axis.values)
    unsound = {s.value: s.refusal for s in search.asked if s.refusal}
    failures = [why for value, why in search.scan.failures.items() if value not in unsound]
    warnings = [not_valid_at(parameter, unsound)] if unsound else []
    if not (search.scan.samples or unsound):
        raise SolveError(
            f"No state of the scan over {parameter} was found: {failures[0] if failures else 'the range is empty.'}"
        )
    for crossing in crossings:
        observer.progress(f"onset between {crossing.low.value:.6g} and {crossing.high.value:.6g}")
        try:
            search.point(crossing)
        except SolveError as error:
            failures.append(str(error))
    warnings += search.uncertainties()
    points = list(search.points.values())
    if points and case.onset.coarse_mesh > 0:
        points = with_uncertainty(case, variant, points, observer, warnings, known)
    for p in points:
        if not p.confirmed:
            warnings.append(f"The onset at {PARAMETERS[parameter].named(p.value)} is not confirmed: {p.note}")
    warnings += filter(None, [outside_band(case, [p.frequency for p in points])])
    points = tuple(sorted(points, key=lambda p: p.value))
    samples, said = tuple(search.asked), (tuple(failures), tuple(warnings))
    return FoundOnsets(search.variant, samples, points, *said, tuple(search.missed))


def normal_form(case: Case, walk: StabilityWalk, place: Mu, mode, parameter: str | None = None):
    """Hopf normal form at a located onset, a `continuation.HopfNormalForm`. Raises ContinuationError if the eigenvalue
    is not simple.
    """
    mu = place.for_system()
    # the levels of a fluid with gravity would be left out, and how the lift of a pump follows a moving steady state
    left_out = parameter and (
        (parameter == "density" and case.gravity.is_there) or (case.has_pump and not is_surrounding(case, parameter))
    )
    name = PARAMETERS[parameter].system_name or None if parameter and not left_out else None
    own = walk.built(place.only(*(name for name in place if name not in DESIGN))).model
    forms = ValveForms(models_of(own.case, own)(mu), walk.equilibrium(place), mu)
    return hopf_normal_form_of(forms, abs(complex(mode.eigenvalue).imag), walk.unknowns(place, mode), name)
