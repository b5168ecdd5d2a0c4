"""Scan, location and confirmation of onsets along one parameter of a case."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from ..errors import CaseError, SolveError
from ..observer import Observer
from .column import floor_of
from .crossings import WATCHED, Crossing, Scan, locate
from .onset_normal_form import MISSING, described
from .onset_point import FINE, OnsetPoint, OnsetSample, Side
from .parameters import Place, is_surrounding
from .reduction import StateFamily
from .stability_walk import StabilityWalk

#: Relative distance from an onset at which it is confirmed on both sides.
ASIDE = 2e-3


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
    place : Place, optional
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
        place: Place | None = None,
        known: Iterable[OnsetSample | OnsetPoint] = (),
        mesh: int = FINE,
    ):
        self.case, self.options, self.mesh = case, options, mesh
        self.observer = observer or Observer()
        self.walk = walk or StabilityWalk(case, self.observer)
        self.base = place or Place.of(case)
        known = list(known)
        self._samples = {item.value: item for item in known if isinstance(item, OnsetSample) and item.mesh == mesh}
        self._known = {item.key: item for item in known if isinstance(item, OnsetPoint)}
        self.points: dict[tuple, OnsetPoint] = {}
        self.scan = Scan(self._eigenvalues, options.log)
        self._fine = None

    def place(self, value: float) -> Place:
        return self.base.at(**{self.options.parameter: value})

    # -- samples
    # ----

    def _eigenvalues(self, value: float) -> np.ndarray:
        known = self._samples.get(value)
        if known is None:
            known = self._solved(value)
            self.observer.item(known)
        if known.failure:
            raise SolveError(known.failure)
        return known.eigenvalues

    def _solved(self, value: float) -> OnsetSample:
        place = self.place(value)
        try:
            found = (
                self._reduced(place)
                if is_surrounding(self.options.parameter)
                else self.walk.spectrum(place).eigenvalues
            )
        except (SolveError, CaseError) as error:
            return OnsetSample(value, np.zeros(0, complex), self.mesh, str(error))
        if len(found):
            self.observer.progress(f"{self.options.parameter} = {value:.6g}: {found[0].real:.4g} 1/s")
        # as many as the scan looks at, so that a file holds all that matters
        return OnsetSample(value, np.asarray(found)[:WATCHED], self.mesh)

    def _reduced(self, place: Place) -> np.ndarray:
        """Where the steady state stays the same a small model answers; what it says is confirmed by the full one."""
        if self._fine is None:
            family = StateFamily(self.walk.linear(place))
            ends = np.array(self.options.values)
            taken = ends[np.unique(np.linspace(0, len(ends) - 1, 6).astype(int))]
            conditions = [self.place(v).condition for v in taken]
            floors = [floor_of(c[2]) for c in conditions]
            self._fine = family.fine(conditions, 0.75 * min(floors) if np.isfinite(floors).all() else -np.inf, most=5)
        values = self._fine.eigenvalues([place.condition])[0]
        upper = values[(values.imag >= 0) & (values.real > floor_of(place.beta))]
        return upper[np.argsort(-upper.real)][:8]

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
        if self.options.normal_form and point.frequency > 0 and point.criticality is None and MISSING not in point.note:
            self.observer.progress(f"normal form at {point.value:.6g}")
            self.points[key] = point  # an interruption does not take away what is known
            mode = self.critical(point.place, point.ahead) if mode is None else mode
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
        if is_surrounding(parameter):
            value = self._polished(value, crossing)
        place = self.place(value)
        mode = self.critical(place, crossing.index)
        eigenvalue = complex(mode.eigenvalue)
        gains = crossing.high.unstable > crossing.low.unstable
        width = ASIDE * abs(value) if value else ASIDE * (self.options.values[-1] - self.options.values[0])
        below, above = (self._side(v, eigenvalue) for v in (value - width, value + width))
        confirmed, note = _confirmed(below, above, gains)
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

    def _polished(self, value: float, crossing: Crossing) -> float:
        """Secant steps with the full pencil from the root on the small model."""
        scale = max(abs(crossing.low.value), abs(crossing.high.value))

        def growth(v):
            return float(self.critical(self.place(v), crossing.index).eigenvalue.real)

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

    def critical(self, place: Place, index: int):
        """The mode of a place that is neutral, the one with `index` faster ones if that one is."""
        spectrum = self.walk.spectrum(place)
        near = int(np.argmin(np.abs(spectrum.eigenvalues.real)))
        chosen = (
            index
            if index < len(spectrum)
            and abs(spectrum.eigenvalues[index].real) < 2 * abs(spectrum.eigenvalues[near].real) + 1e-3
            else near
        )
        return spectrum.mode(chosen)

    def _side(self, value: float, eigenvalue: complex) -> Side:
        place = self.place(value)
        spectrum = self.walk.spectrum(place)
        column = self.walk.column([place])
        nearest = int(np.argmin(np.abs(spectrum.eigenvalues - eigenvalue)))
        crossing, leading = complex(spectrum.eigenvalues[nearest]), float(spectrum.eigenvalues[0].real)
        return Side(value, crossing, leading, spectrum.unstable_count, int(column.counted[0]))


def _confirmed(below: Side, above: Side, gains: bool) -> tuple[bool, str]:
    for side in (below, above):
        if side.unstable != side.counted:
            return (
                False,
                (
                    f"at {side.value:.6g} the spectrum lists {side.unstable} unstable eigenvalues and the "
                    f"independent count finds {side.counted}."
                ),
            )
    first, second = (below, above) if gains else (above, below)
    if not (first.eigenvalue.real < 0 < second.eigenvalue.real and first.unstable < second.unstable):
        return (
            False,
            f"the eigenvalues {below.eigenvalue:.5g} and {above.eigenvalue:.5g} 1/s on both sides do not show it.",
        )
    return True, ""
