"""Where a valve loses or regains stability along one parameter."""
from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from continuation import ContinuationError
from continuation.hopf import hopf_borders
from continuation.normal_form import hopf_normal_form

from ..case.model import Case
from ..errors import CaseError, SolveError
from ..model.system import ValveSystem
from .crossings import Crossing, Scan, locate
from .observer import Observer
from .parameters import DESIGN, SYSTEM_NAMES, Place, check_flow, is_surrounding, rebuilder
from .column import floor_of, search_options
from .reduction import StateFamily
from .stability_walk import StabilityWalk

#: Relative distance from an onset at which it is confirmed on both sides.
ASIDE = 2e-3
#: Order at which results of the four-node shell converge with the mesh size.
ORDER = 2.0


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
    """

    parameter: str
    values: tuple[float, ...]
    log: bool = False
    tolerance: float = 1e-9
    normal_form: bool = True
    coarse_mesh: float = 0.5

    @classmethod
    def of(cls, case: Case) -> "OnsetOptions":
        """Options of a case file."""
        axis = case.onset.axis
        return cls(axis.parameter, axis.values, axis.log, case.onset.tolerance, case.onset.normal_form, case.onset.coarse_mesh)


@dataclass(frozen=True)
class Side:
    """What the full pencil says a little beside an onset: leading and crossing eigenvalue, and two counts of unstable ones."""

    value: float
    eigenvalue: complex
    leading: complex
    unstable: int
    counted: int


@dataclass(frozen=True)
class OnsetPoint:
    """One crossing of the imaginary axis.

    Attributes
    ----------
    parameter : str
    value : float
    frequency : float, Hz
        0 for a real eigenvalue (divergence).
    growth_rate : float, 1/s
        Left over at the value: how well it is located.
    gains : bool
        True if the mode becomes unstable as the parameter grows.
    edge : bool
        True if no other mode is unstable there, so that the state itself changes between stable and unstable.
    below, above : Side
        Direct eigenvalues on both sides.
    confirmed : bool
        Both sides agree with the crossing, and both counts agree on each side.
    criticality : str or None
        "super", "sub" or "degenerate"; None for a real eigenvalue or where it was not asked for.
    first_lyapunov_coefficient : float or None
        Scaled for eigenvectors of unit norm in (q, v, U), 1/s; only its sign carries over to other scalings.
    crossing_speed : float or None
        Derivative of the growth rate with respect to the parameter.
    uncertainty : float or None
        By Richardson's rule from a second mesh, in units of the parameter.
    coarse_value : float or None
        The onset on the second mesh.
    note : str
    place : Place
    """

    parameter: str
    value: float
    frequency: float
    growth_rate: float
    gains: bool
    edge: bool
    below: Side
    above: Side
    confirmed: bool
    place: Place
    criticality: str | None = None
    first_lyapunov_coefficient: float | None = None
    crossing_speed: float | None = None
    uncertainty: float | None = None
    coarse_value: float | None = None
    note: str = ""

    @property
    def kind(self) -> str:
        """"Hopf" or "divergence"."""
        return "Hopf" if self.frequency > 0 else "divergence"

    def summary(self) -> dict:
        """Plain SI numbers for JSON."""
        return {
            "parameter": self.parameter, "value": self.value, "frequency": self.frequency, "growth_rate": self.growth_rate,
            "criticality": self.criticality, "first_lyapunov_coefficient": self.first_lyapunov_coefficient, "uncertainty": self.uncertainty,
            "kind": self.kind, "gains": self.gains, "edge": self.edge, "confirmed": self.confirmed, "crossing_speed": self.crossing_speed,
            "coarse_value": self.coarse_value, "below": _side(self.below), "above": _side(self.above), "note": self.note,
        }  # fmt: skip


@dataclass(frozen=True)
class OnsetResult:
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
    failures, warnings : tuples of str
    interrupted : bool
    """

    case: Case
    options: OnsetOptions
    points: tuple[OnsetPoint, ...]
    values: np.ndarray
    growth_rates: np.ndarray
    frequencies: np.ndarray
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    interrupted: bool = False

    @cached_property
    def unstable_intervals(self) -> list[tuple[float, float]]:
        """Where the state is unstable within the range scanned."""
        marks = [self.values[0], *(p.value for p in self.points if p.edge), self.values[-1]] if len(self.values) else []
        unstable = bool(len(self.values)) and bool(self.growth_rates[0, 0] > 0)
        found = []
        for a, b in zip(marks[:-1], marks[1:]):
            if unstable:
                found.append((float(a), float(b)))
            unstable = not unstable
        return found


def run_onset(case: Case, options: OnsetOptions | None = None, observer: Observer | None = None) -> OnsetResult:
    """All onsets of a case along one parameter.

    Raises
    ------
    SolveError
        If the case has no flow, or no state of the scan was found.
    """
    check_flow(case)
    options = options or OnsetOptions.of(case)
    observer = observer or Observer()
    observer.begin("onset", len(options.values))
    failures: list[str] = []
    warnings: list[str] = []
    points: list[OnsetPoint] = []
    search = OnsetSearch(case, options, observer)
    interrupted = False
    try:
        crossings = search.scan.run(options.values)
        failures += search.scan.failures.values()
        if not search.scan.samples:
            raise SolveError(f"No state of the scan over {options.parameter} was found: {failures[0] if failures else 'the range is empty.'}")
        for crossing in crossings:
            observer.progress(f"onset between {crossing.low.value:.6g} and {crossing.high.value:.6g}")
            try:
                point = search.point(crossing)
            except SolveError as error:
                failures.append(str(error))
                continue
            observer.item(point)
            points.append(point)
        if points and options.coarse_mesh > 0:
            points = _with_uncertainty(case, options, points, observer, warnings)
    except KeyboardInterrupt:
        interrupted = True
    for sentence in (*failures, *warnings):
        observer.warn(sentence)
    for p in points:
        if not p.confirmed:
            warnings.append(f"The onset at {options.parameter} = {p.value:.6g} is not confirmed: {p.note}")
            observer.warn(warnings[-1])
    observer.end(interrupted)
    samples = [search.scan.samples[v] for v in sorted(search.scan.samples)]
    table = np.full((len(samples), 4), np.nan + 0j)
    for row, sample in zip(table, samples):
        kept = sample.eigenvalues[:4]
        row[: len(kept)] = kept
    return OnsetResult(
        case, options, tuple(sorted(points, key=lambda p: p.value)), np.array([s.value for s in samples]), table.real,
        table.imag / (2 * np.pi), tuple(failures), tuple(warnings), interrupted,
    )  # fmt: skip


class OnsetSearch:
    """Scan, location, confirmation and normal form of onsets along one parameter of a case."""

    def __init__(self, case: Case, options: OnsetOptions, observer: Observer | None = None, walk: StabilityWalk | None = None, place: Place | None = None):
        self.case, self.options = case, options
        self.walk = walk or StabilityWalk(case, observer)
        self.base = place or Place.of(case)
        observer = observer or Observer()
        self.scan = Scan(self._eigenvalues, options.log, told=lambda s: observer.progress(f"{options.parameter} = {s.value:.6g}: {s.growth[0]:.4g} 1/s"))
        self._fine = None

    def place(self, value: float) -> Place:
        return self.base.at(**{self.options.parameter: value})

    def _eigenvalues(self, value: float) -> np.ndarray:
        place = self.place(value)
        try:
            if is_surrounding(self.options.parameter):
                return self._reduced(place)
            return self.walk.spectrum(place).eigenvalues
        except CaseError as error:
            raise SolveError(str(error)) from error

    def _reduced(self, place: Place) -> np.ndarray:
        """Where the steady state stays the same a small model answers; what it says is confirmed by the full one."""
        if self._fine is None:
            family = StateFamily(self.walk.linear(place))
            ends = np.array(self.options.values)
            taken = ends[np.unique(np.linspace(0, len(ends) - 1, 6).astype(int))]
            conditions = [self.place(v).condition for v in taken]
            floors = [floor_of(c[2]) for c in conditions]
            self._fine = family.fine(conditions, 0.75 * min(floors) if np.isfinite(floors).all() else -np.inf)
        values = self._fine.eigenvalues([place.condition])[0]
        upper = values[(values.imag >= 0) & (values.real > floor_of(place.beta))]
        return upper[np.argsort(-upper.real)][:8]

    def point(self, crossing: Crossing) -> OnsetPoint:
        """Locate, confirm and describe one crossing.

        Raises
        ------
        SolveError
        """
        parameter, tolerance = self.options.parameter, self.options.tolerance
        value = locate(self.scan, crossing, tolerance)
        mode = None
        if is_surrounding(parameter):
            value = self._polished(value, crossing)
        place = self.place(value)
        mode = self._critical(place, crossing.index)
        eigenvalue = complex(mode.eigenvalue)
        gains = crossing.high.unstable > crossing.low.unstable
        width = ASIDE * abs(value) if value else ASIDE * (self.options.values[-1] - self.options.values[0])
        # stay between the neighbouring samples that bracket this crossing alone
        below, above = (self._side(v, eigenvalue) for v in (value - width, value + width))
        confirmed, note = _confirmed(below, above, gains)
        edge = min(below.unstable, above.unstable) == 0
        point = OnsetPoint(
            parameter, value, abs(eigenvalue.imag) / (2 * np.pi), eigenvalue.real, gains, edge, below, above, confirmed, place, note=note
        )
        if self.options.normal_form and point.frequency > 0:
            point = self._with_normal_form(point, mode)
        return point

    def _polished(self, value: float, crossing: Crossing) -> float:
        """Secant steps with the full pencil from the root on the small model."""
        scale = max(abs(crossing.low.value), abs(crossing.high.value))
        parameter = self.options.parameter

        def growth(v):
            return float(self._critical(self.place(v), crossing.index).eigenvalue.real)

        step = 1e-6 * scale
        a, fa = value, growth(value)
        b = value + step
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
        return float(b if parameter and crossing.low.value <= b <= crossing.high.value else value)

    def _critical(self, place: Place, index: int):
        spectrum = self.walk.spectrum(place)
        near = int(np.argmin(np.abs(spectrum.eigenvalues.real)))
        chosen = index if index < len(spectrum) and abs(spectrum.eigenvalues[index].real) < 2 * abs(spectrum.eigenvalues[near].real) + 1e-3 else near
        return spectrum.mode(chosen)

    def _side(self, value: float, eigenvalue: complex) -> Side:
        place = self.place(value)
        spectrum = self.walk.spectrum(place)
        column = self.walk.column([place])
        nearest = int(np.argmin(np.abs(spectrum.eigenvalues - eigenvalue)))
        return Side(value, complex(spectrum.eigenvalues[nearest]), complex(spectrum.eigenvalues[0]), spectrum.unstable_count, int(column.counted[0]))

    def _with_normal_form(self, point: OnsetPoint, mode) -> OnsetPoint:
        """Criticality by the multilinear forms of the coupled residual."""
        place, omega = point.place, abs(mode.eigenvalue.imag)
        try:
            form = normal_form(self.case, self.walk, place, mode, point.parameter)
        except (ContinuationError, SolveError, ArithmeticError, ValueError) as error:
            return replace(point, note=f"{point.note} No normal form: {error}".strip())
        speed = form.crossing.real if form.crossing is not None else None
        del omega
        return replace(point, criticality=form.criticality, first_lyapunov_coefficient=form.l1, crossing_speed=speed)


def system_of(case: Case, walk: StabilityWalk, place: Place) -> ValveSystem:
    """The valve as a System of `continuation` at a place."""
    return ValveSystem(walk.built(place.at()).model if not place.design else walk.built(replace(place, design={})).model, rebuilder(case), search_options(place.beta))


def normal_form(case: Case, walk: StabilityWalk, place: Place, mode, parameter: str | None = None):
    """Hopf normal form at a located onset, a `continuation.HopfNormalForm`.

    Raises
    ------
    ContinuationError
        If the eigenvalue is not simple.
    """
    system = system_of(case, walk, place)
    mu = place.mu()
    u = system.state(walk.equilibrium(place), mu)
    omega = abs(complex(mode.eigenvalue).imag)
    vector = np.concatenate([mode.q, 1j * omega * mode.q, mode.u])
    left, right = hopf_borders(system.linear(u, mu), omega, vector / np.linalg.norm(vector))
    name = None if parameter in DESIGN else SYSTEM_NAMES.get(parameter, parameter)
    return hopf_normal_form(system, u, mu, omega, right, left, name)


def _confirmed(below: Side, above: Side, gains: bool) -> tuple[bool, str]:
    for side in (below, above):
        if side.unstable != side.counted:
            return False, f"at {side.value:.6g} the spectrum lists {side.unstable} unstable eigenvalues and the independent count finds {side.counted}."
    first, second = (below, above) if gains else (above, below)
    if not (first.eigenvalue.real < 0 < second.eigenvalue.real and first.unstable < second.unstable):
        return False, f"the eigenvalues {below.eigenvalue:.5g} and {above.eigenvalue:.5g} 1/s on both sides do not show it."
    return True, ""


def _with_uncertainty(case, options, points, observer, warnings) -> list[OnsetPoint]:
    """Onsets again on a coarser mesh, matched by frequency and direction; Richardson's rule with the order of the element."""
    mesh = case.mesh
    around, along = (max(6, int(round(options.coarse_mesh * n))) for n in (mesh.around, mesh.along))
    ratio = np.sqrt(mesh.around * mesh.along / (around * along))
    if ratio < 1.15:
        warnings.append("The mesh is too coarse for a second one, so onsets carry no uncertainty.")
        return points
    observer.progress(f"second mesh, {around} x {along}")
    coarse = case.replace({"mesh.around": around, "mesh.along": along})
    search = OnsetSearch(coarse, replace(options, normal_form=False), observer)
    found = []
    for crossing in search.scan.run(options.values):
        try:
            value = locate(search.scan, crossing, 1e-6)
            eigenvalue = search._critical(search.place(value), crossing.index).eigenvalue
        except SolveError:
            continue
        found.append((value, abs(eigenvalue.imag) / (2 * np.pi), crossing.high.unstable > crossing.low.unstable))
    done = []
    for point in points:
        alike = [c for c in found if c[2] == point.gains and abs(c[1] - point.frequency) <= 0.25 * max(point.frequency, 1.0)]
        if not alike:
            note = f"{point.note} The mesh of {around} x {along} has no onset like it, so its uncertainty is unknown.".strip()
            done.append(replace(point, note=note))
            continue
        value = min(alike, key=lambda c: abs(c[0] - point.value))[0]
        found = [c for c in found if c[0] != value]
        done.append(replace(point, coarse_value=value, uncertainty=abs(point.value - value) / (ratio**ORDER - 1.0)))
    return done


def _side(side: Side) -> dict:
    value, leading = side.eigenvalue, side.leading
    return {
        "value": side.value, "growth_rate": value.real, "frequency": value.imag / (2 * np.pi), "leading_growth_rate": leading.real,
        "unstable_count": side.unstable, "unstable_count_independent": side.counted,
    }  # fmt: skip
