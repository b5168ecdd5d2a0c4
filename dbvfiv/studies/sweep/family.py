"""Pencils along a parameter: on one reduced basis where the state stays, in full where it moves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol
from weakref import WeakKeyDictionary

import numpy as np

from eigen import (
    CoupledPencil,
    SearchOptions,
    Spectrum,
    TransferBasis,
    Workspace,
    certified_spectrum,
    leading_modes,
    listed_unstable,
    unstable_count,
)
from eigen.dense import all_eigenvalues
from eigen.left import biorthogonalise, left_by_inverse_iteration

from ...case.axis import Axis
from ...case.parameters import Mu
from ...errors import NotValidError
from ...model import ValveModel
from ...model.classes import linearise_class
from ...model.equilibria import LoadPath, SteadyOptions
from ...model.leading import LeadingSearch
from ...model.state import SteadyState
from ...model.symmetry import symmetry_named
from ...observer import Observer
from ..case import Case
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk

#: Static corrections below this share of the largest are left to the eigenvectors of the check points, which gives a
#: smaller basis.
_COMPRESSION = 1e-3
#: Values at which the vectors of the small model of the verdicts are made.
_SNAPSHOTS = 6
#: Further places at most at which an enlarged basis is checked.
_FRESH = 4
#: Share of a band in which unstable eigenvalues are counted: its end must not cut through a mode.
COUNTED = 0.999


@dataclass(frozen=True)
class Check:
    """Verification of eigenvalues and their count at one value of the parameter.

    Attributes
    ----------
    value : float
    error : float
        Largest relative difference of the leading eigenvalues between reduced-order and full model; largest residual
        where every value is solved in full.
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


class Family(Protocol):
    """Pencils along a parameter."""

    done: tuple[Check, ...]
    pressure: float

    def prepare(self, axis: Axis) -> None: ...

    def mu_at(self, value: float) -> Mu: ...

    def pencil(self, value: float) -> CoupledPencil: ...

    def solve(self, pencil: CoupledPencil, count: int) -> Spectrum: ...

    def checks(self, values: np.ndarray) -> tuple[tuple[Check, ...], tuple[str, ...]]: ...

    def states(self, values: np.ndarray) -> tuple[SteadyState, ...]: ...

    def refusal(self, value: float) -> str: ...

    def verdicts(self, values: np.ndarray, spectra: list[Spectrum]) -> dict[float, Verdict]: ...


def _complete(case: Case, mu: Mu, pressure: float) -> Mu:
    """Parameter point of a case at a pressure, Pa, with the values of another one."""
    return Mu.of(case).at(**{**mu, "pressure": pressure})


class FluidFamily:
    """One state; density, alpha, beta or the factor on the loss factors moves."""

    def __init__(self, model: ValveModel, state: SteadyState, axis: Axis, mu: Mu, options, observer: Observer):
        self.state, self.axis, self.mu, self.options, self.observer = state, axis, mu, options, observer
        self.walk = StabilityWalk(model.case, observer, model, symmetry_named(options.symmetry))
        self.walk.give(_complete(model.case, mu, state.pressure), state.q)
        self.linear = linearise_class(model, state.q, state.pressure, symmetry_named(options.symmetry))
        self.pressure = state.pressure
        self.done: tuple[Check, ...] = ()
        self.notes: tuple[str, ...] = ()
        self.small = self.linear
        self._searches: WeakKeyDictionary[CoupledPencil, LeadingSearch] = WeakKeyDictionary()
        self.errors: dict[float, float] = {}
        self.workspace = Workspace()

    def mu_at(self, value: float) -> Mu:
        return self.mu.at(**{self.axis.parameter: float(value)})

    def prepare(self, axis: Axis) -> None:
        """Make the basis and enlarge it until full solves at some of the values confirm it."""
        values = np.array(axis.values)
        basis = TransferBasis(self._full(values[0]), compression=_COMPRESSION)
        checked = min(self.options.checks, len(values))
        places = [float(values[i]) for i in np.unique(np.linspace(0, len(values) - 1, checked).astype(int))]
        fresh = 0
        while places:
            value = places.pop(0)
            self.observer.progress(f"checking the basis at {self.axis.parameter} {value:.6g}")
            if self._confirmed(value, basis) or fresh == _FRESH or len(self.errors) == len(values):
                continue
            # what was enlarged has to hold at a place it was not made for
            places.append(_farthest(values, [*self.errors, *places]))
            fresh += 1
        linear = self.linear
        self.small = replace(
            linear,
            mass=basis.project(linear.mass),
            structure=basis.project(linear.structure),
            stiffness=basis.project(linear.stiffness),
            forces=basis.V.T @ linear.forces,
            slope=linear.slope @ basis.V,
            added=None if linear.added is None else linear.added.projected(basis.V),
            _damped={},
        )
        # what relaxes would be computed on the elements otherwise
        vars(self.small)["relaxing"] = tuple(basis.project(part) for part in linear.relaxing)

    def _confirmed(self, value: float, basis: TransferBasis) -> bool:
        """Compare with a full solve, and enlarge the basis where it misses the tolerance; whether it was good enough
        before.
        """
        mu, count = self.mu_at(value), self.options.count
        search = self._selected(value)
        self.notes = self.notes or search.notes
        pencil = self._full(value)

        def error(full: Spectrum) -> float:
            damping = mu.alpha * basis.project(pencil.M) + mu.beta * basis.project(self.linear.structure)
            reduced = basis.reduced(pencil, damping=damping)
            found = self._reduced(reduced, search, count + 4, left=False).eigenvalues
            worst = _largest_gap(full.eigenvalues, found)
            if worst > self.options.tolerance and pencil.relaxation is not None:
                # what one search lists at the edge of where it looks another need not list
                worst = _largest_gap(full.eigenvalues, all_eigenvalues(reduced))
            return worst

        # a basis of structural modes alone misses at the first place, and is enlarged by vectors of both sides
        full = leading_modes(pencil, count, replace(search.options, left=not self.errors), workspace=self.workspace)
        self.errors[value] = error(full)
        if self.errors[value] <= self.options.tolerance:
            return True
        if full.left_q is None:
            full = leading_modes(pencil, count, replace(search.options, left=True), workspace=self.workspace)
        basis.enlarge(full.q, full.left_q)
        self.errors[value] = error(full)
        return False

    def _reduced(self, pencil: CoupledPencil, search: LeadingSearch, count: int, left: bool) -> Spectrum:
        options = search.options
        # the linear form of what relaxes is several times as large
        relaxing = pencil.relaxation is not None and count < pencil.n
        asked = SearchOptions(
            options.max_frequency, tolerance=options.tolerance, method="auto" if relaxing else "dense"
        )
        if relaxing and left:
            return _with_left(pencil, leading_modes(pencil, count, asked))
        return leading_modes(pencil, count, replace(asked, left=left))

    def _selected(self, value: float) -> LeadingSearch:
        found = self.walk.search(self._place(value))
        return replace(found, options=replace(found.options, tolerance=self.options.search.tolerance))

    def _place(self, value: float) -> Mu:
        return _complete(self.linear.model.case, self.mu_at(value), self.pressure)

    def refusal(self, value: float) -> str:
        """Why the constants of the rubber do not hold at a value; empty where they do."""
        return _refusal(self.walk, self._place(value))

    def verdicts(self, values: np.ndarray, spectra: list[Spectrum]) -> dict[float, Verdict]:
        """Verdict on each value, from cells of one column."""
        places = [self._place(float(value)) for value in values]
        if not places:
            return {}
        self.observer.progress("verdicts")
        found = self.walk.verdicts(places, self.walk.column(places, min(len(places), _SNAPSHOTS)))
        return dict(zip(map(float, values), found))

    def _full(self, value: float) -> CoupledPencil:
        return self.linear.pencil(self.mu_at(value))

    def pencil(self, value: float) -> CoupledPencil:
        """On the basis."""
        pencil = self.small.pencil(self.mu_at(value))
        self._searches[pencil] = self._selected(value)
        return pencil

    def solve(self, pencil: CoupledPencil, count: int) -> Spectrum:
        return self._reduced(pencil, self._searches[pencil], count, left=True)

    def checks(self, values: np.ndarray) -> tuple[tuple[Check, ...], tuple[str, ...]]:
        checks = []
        for value, error in sorted(self.errors.items()):
            pencil = self.pencil(value)
            spectrum = self.solve(pencil, self.options.count)
            band = COUNTED * self._searches[pencil].band
            count = unstable_count(pencil, hints=spectrum.eigenvalues, band=band if np.isfinite(band) else None)
            listed = listed_unstable(spectrum, count)
            if listed < count.number:
                listed = listed_unstable(self.solve(pencil, pencil.n), count)
            checks.append(
                Check(
                    value,
                    error,
                    listed,
                    count.number,
                    count.certain and listed == count.number,
                    error <= self.options.tolerance,
                )
            )
        self.done = tuple(checks)
        return self.done, self.notes

    def states(self, values: np.ndarray) -> tuple[SteadyState, ...]:
        return (self.state,)


class PressureFamily:
    """A state for every pressure, found from the nearest one known."""

    def __init__(self, model: ValveModel, mu: Mu, options, observer: Observer):
        self.model, self.mu, self.options, self.observer = model, mu, options, observer
        self.path = LoadPath(model, SteadyOptions.of(model.case), observer=observer)
        self.known: dict[float, SteadyState] = {}
        self.workspace = Workspace()
        self.walk = StabilityWalk(model.case, observer, model, symmetry_named(options.symmetry))
        self.done: tuple[Check, ...] = ()
        self.notes: tuple[str, ...] = ()
        self.pressure = 0.0
        self._searches: WeakKeyDictionary[CoupledPencil, LeadingSearch] = WeakKeyDictionary()
        self._bands: dict[float, LeadingSearch] = {}

    def mu_at(self, value: float) -> Mu:
        return self.mu

    def prepare(self, axis: Axis) -> None:
        self.pressure = axis.values[0]

    def _place(self, value: float) -> Mu:
        """The place of a pressure, its state known to the walk."""
        self.pressure = value
        if value not in self.known:
            if self.known:
                near = self.known[min(self.known, key=lambda p: abs(p - value))]
                if near.pressure != self.path.pressure:
                    self.path.q, self.path.pressure, self.path.slope = near.q, near.pressure, None
            self.known[value] = self.path.go_to(value)
        place = _complete(self.model.case, self.mu, value)
        self.walk.give(place, self.known[value].q)
        return place

    def refusal(self, value: float) -> str:
        """Why the constants of the rubber do not hold at a pressure; empty where they do."""
        return _refusal(self.walk, self._place(value)) if self.mu.loss_factor else ""

    def verdicts(self, values: np.ndarray, spectra: list[Spectrum]) -> dict[float, Verdict]:
        """Verdict on each pressure, from its leading modes and a count."""
        found = {}
        for value, spectrum in zip(map(float, values), spectra):
            self.observer.progress(f"verdict at {value:.6g} Pa")
            found[value] = self.walk.verdict(self._place(value), spectrum)
        return found

    def pencil(self, value: float) -> CoupledPencil:
        place = self._place(value)
        symmetry = symmetry_named(self.options.symmetry)
        pencil = linearise_class(self.model, self.known[value].q, value, symmetry).pencil(self.mu)
        if value not in self._bands:
            found = self.walk.search(place)
            asked = replace(found.options, tolerance=self.options.search.tolerance)
            self._bands[value] = replace(found, options=asked)
        self._searches[pencil] = self._bands[value]
        return pencil

    def solve(self, pencil: CoupledPencil, count: int) -> Spectrum:
        options = replace(self._searches[pencil].options, left=True)
        return leading_modes(pencil, count, options, workspace=self.workspace)

    def checks(self, values: np.ndarray) -> tuple[tuple[Check, ...], tuple[str, ...]]:
        checks = []
        for index in np.unique(np.linspace(0, len(values) - 1, min(self.options.checks, len(values))).astype(int)):
            value = float(values[index])
            self.observer.progress(f"independent count at {value:.6g} Pa")
            pencil = self.pencil(value)
            options = self._searches[pencil].options
            found = certified_spectrum(pencil, self.options.count, options, workspace=self.workspace)
            error = float(found.spectrum.residual.max(initial=0.0))
            accurate = error <= self.options.search.tolerance
            checks.append(
                Check(value, error, found.unstable_count, found.unstable_count_independent, found.agrees, accurate)
            )
        self.done = tuple(checks)
        self.notes = max(self._bands.values(), key=lambda search: search.band).notes
        return self.done, self.notes

    def states(self, values: np.ndarray) -> tuple[SteadyState, ...]:
        return tuple(self.known[float(value)] for value in values)


def _refusal(walk: StabilityWalk, place: Mu) -> str:
    try:
        walk.require_valid(place)
    except NotValidError as error:
        return str(error)
    return ""


def _largest_gap(wanted: np.ndarray, found: np.ndarray) -> float:
    """Largest relative distance of an eigenvalue from the nearest of those found."""
    return max((float(np.abs(found - x).min(initial=np.inf) / abs(x)) for x in wanted), default=0.0)


def _with_left(pencil: CoupledPencil, spectrum: Spectrum) -> Spectrum:
    """With left vectors of a small pencil, by inverse iteration."""
    workspace = Workspace()
    found = [left_by_inverse_iteration(pencil, value, workspace) for value in spectrum.eigenvalues]
    if not found:
        return replace(spectrum, left_q=spectrum.q, left_u=spectrum.u)
    w, W = (np.array(part).reshape(len(found), -1).T.conj() for part in zip(*found))
    w, W, _, _ = biorthogonalise(pencil, spectrum.eigenvalues, spectrum.q, spectrum.u, w, W)
    return replace(spectrum, left_q=w, left_u=W)


def _farthest(values: np.ndarray, used: list[float]) -> float:
    """The value whose place among all is farthest from those used."""
    at = np.array([int(np.argmin(np.abs(values - u))) for u in used])
    return float(values[int(np.argmax(np.abs(np.arange(len(values))[:, None] - at).min(axis=1)))])
