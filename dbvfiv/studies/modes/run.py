"""Leading modes of the coupled valve at one steady state, with an independent count of the unstable ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from eigen import (
    CertifiedSpectrum,
    CoupledPencil,
    SearchOptions,
    Spectrum,
    TransferBasis,
    certified_spectrum,
)

from ...case.parameters import Mu
from ...errors import CaseError, NotValidError
from ...model import ValveModel
from ...model.classes import linearise_class
from ...model.equilibria import require_equilibrium
from ...model.material_stability import material_stability
from ...model.state import SteadyState
from ...model.symmetry import EQUILIBRIA, SYMMETRIES, Symmetry
from ...observer import Observer
from ..stability.family import ValveFamily, name_state_in_failures
from ..stability.verdict import STABLE, UNDECIDED, Verdict

#: Structural modes in the basis behind the independent count.
_BASIS = 24
_NO_PLUG = (
    "Inner fluid answers to the areas of this half of the valve and does not go along where it sways sideways in x: "
    "such modes are too quick and too lightly damped in a liquid."
)


@dataclass(frozen=True)
class ModesOptions:
    """Options of `run_modes`.

    Attributes
    ----------
    count : int
        Modes wanted, a conjugate pair being one; fewer are given where eigenvalues accumulate.
    in_vacuo : bool
        Leave the fluid out; the steady pressures stay as follower loads.
    search : SearchOptions
        Band and limit point are chosen by the damping where they are not given.
    """

    count: int = 10
    in_vacuo: bool = False
    search: SearchOptions = field(default_factory=SearchOptions)

    @classmethod
    def of(cls, case) -> ModesOptions:
        """Options of a case file."""
        modes = case.modes
        shift = None if modes.shift is None else (complex(modes.shift, 2 * math.pi * modes.shift_frequency),)
        return cls(
            modes.count, modes.in_vacuo, SearchOptions(modes.max_frequency, shifts=shift, tolerance=modes.tolerance)
        )


@dataclass(frozen=True)
class FoundModes:
    """Leading modes of one state.

    Attributes
    ----------
    model : ValveModel
    state : SteadyState
    mu : Mu
    in_vacuo : bool
    certified : CertifiedSpectrum
        Eigenvalues, vectors, residuals and both counts of the unstable ones.
    claimed : float, Hz
        Frequency up to which the search speaks for the state.
    searched : (k,) bool array
        Modes in the region that every study searches; of walls with loss factors slow and strongly damped ones lie
        beside it.
    shapes : (k, nn, c) complex
        Displacements and rotations of the nodes, the largest displacement being 1 and real.
    areas, pressures : (k, m) complex
        Changes of the row areas (m2, of the part) and station pressures (Pa) for a largest displacement of 1 m; no
        pressures in vacuo, and none of either to first order but in the class of the equilibria.
    inlet_velocities : (k,) complex, m/s
        Likewise.
    notes : tuple of str
    symmetry : Symmetry
    """

    model: ValveModel
    state: SteadyState
    mu: Mu
    in_vacuo: bool
    certified: CertifiedSpectrum
    claimed: float
    searched: np.ndarray
    shapes: np.ndarray
    areas: np.ndarray
    pressures: np.ndarray
    inlet_velocities: np.ndarray
    notes: tuple[str, ...] = ()
    symmetry: Symmetry = SYMMETRIES[EQUILIBRIA]

    @property
    def spectrum(self) -> Spectrum:
        return self.certified.spectrum

    @property
    def eigenvalues(self) -> np.ndarray:
        """(k,) complex, 1/s, sorted by growth rate."""
        return self.spectrum.eigenvalues

    @cached_property
    def verdict(self) -> Verdict:
        """Stability of the state in this symmetry class."""
        found, count = self.certified, self.certified.count
        verdict = Verdict.of(
            self.eigenvalues[self.searched],
            found.unstable_count,
            found.unstable_count_independent,
            found.certificate.certain,
            line=count.line,
            band=min(count.band, self.claimed),
            statement="" if found.agrees else found.statement,
        )
        if np.isinf(count.band) or verdict.outcome != STABLE:
            return verdict
        beyond = " Above that the count finds more: modes may be unstable there; modes.max_frequency moves the end."
        return replace(verdict, outcome=UNDECIDED, reason=verdict.reason + beyond)

    @property
    def stable(self) -> bool | None:
        """True where all modes decay; None where that is not known."""
        return self.verdict.stable


def run_modes(
    model: ValveModel,
    state: SteadyState,
    mu: Mu | None = None,
    options: ModesOptions | None = None,
    observer: Observer | None = None,
    symmetry: Symmetry = SYMMETRIES[EQUILIBRIA],
) -> FoundModes:
    """Leading modes of a steady state in one class of motion.

    Parameters
    ----------
    model : ValveModel
    state : SteadyState
        An equilibrium of the model.
    mu : Mu, optional
        Parameter point; that of the case by default.
    options : ModesOptions, optional
    observer : Observer, optional
    symmetry : Symmetry, optional
        The class; that of the equilibria by default.

    Raises
    ------
    CaseError
        For a valve at rest with fluid in it: without a pressure its velocity is undetermined.
    NotValidError
        If the constants of a rubber with loss factors are unstable at this state.
    SolveError
        If the state is no equilibrium, or no shift was found at which the pencil can be factored.
    """
    mu = Mu.of(model.case) if mu is None else mu
    options = ModesOptions.of(model.case) if options is None else options
    observer = Observer() if observer is None else observer
    require_equilibrium(model, state)
    without_fluid = options.in_vacuo or not model.flow.has_fluid
    if not without_fluid and state.pressure <= model.flow.back:
        raise CaseError(
            f"Coupled modes need an inlet pressure greater than {model.flow.back:g}, because without one the velocity "
            "of an ideal fluid is undetermined; "
            "modes.in_vacuo gives those of the structure at rest."
        )
    if mu.loss_factor:
        rubber = material_stability(model, state.q, state.pressure, mu.loss_factor)
        if not rubber.holds:
            raise NotValidError(rubber.sentence)
    observer.begin("modes", 1)
    observer.progress("linearising")
    linear = linearise_class(model, state.q, state.pressure, symmetry)
    pencil = linear.pencil(mu, not without_fluid)
    observer.progress("searching")
    with name_state_in_failures(state.pressure):
        family = ValveFamily(linear, options.search.max_frequency, options.count)
        search = family.leading_under(mu, without_fluid)
        asked = replace(search.options, shifts=options.search.shifts, tolerance=options.search.tolerance)
        basis = TransferBasis(pencil, modes=max(_BASIS, options.count))
        certified = certified_spectrum(pencil, options.count, asked, basis=basis)
    notes = search.notes
    certified = replace(certified, spectrum=_ties_by_frequency(certified.spectrum))
    notes = (*notes, *certified.spectrum.notes)
    if symmetry.of_equilibria and not (model.mesh.part.is_quarter or without_fluid):
        notes = (*notes, _NO_PLUG)
    reach = search.claimed, family.is_searched(certified.spectrum.eigenvalues, mu, search.band)
    result = _described(model, state, mu, without_fluid, certified, reach, pencil, linear, notes, symmetry)
    observer.item(result)
    if result.stable is None:
        observer.warn(result.verdict.reason)
    observer.end(False)
    return result


def _described(
    model, state, mu, in_vacuo, certified: CertifiedSpectrum, reach, pencil, linear, notes, symmetry
) -> FoundModes:
    """Shapes, areas and pressures of the eigenvectors, scaled to a largest displacement of 1."""
    spectrum = certified.spectrum
    shapes, scales = [], []
    for q in spectrum.q.T:
        nodal = linear.nodal(q)
        scales.append(_largest(nodal))
        shapes.append(nodal / scales[-1])
    scale = np.array(scales, complex).reshape(len(spectrum))
    change, pressure = _changes(model, pencil, linear, spectrum, symmetry, in_vacuo)
    velocity = spectrum.u[0] if pencil.b else np.zeros(len(spectrum), complex)
    return FoundModes(
        model,
        state,
        mu,
        in_vacuo,
        certified,
        *reach,
        shapes=np.array(shapes, complex).reshape(len(spectrum), *model.shell.dofs.free.shape),
        areas=(change / scale).T,
        pressures=(pressure / scale).T,
        inlet_velocities=velocity / scale,
        notes=tuple(notes),
        symmetry=symmetry,
    )


def _changes(model, pencil: CoupledPencil, linear, spectrum, symmetry, in_vacuo) -> tuple[np.ndarray, np.ndarray]:
    """Changes of areas (m, k) and pressures (m or 0, k) of the eigenvectors."""
    if not symmetry.of_equilibria:
        return np.zeros((model.stations, len(spectrum)), complex), np.zeros(
            (0 if in_vacuo else model.stations, len(spectrum)), complex
        )
    change = linear.slope @ spectrum.q
    stations = 0 if in_vacuo else len(change)
    pressure = np.zeros((stations, len(spectrum)), complex)
    for i, value in enumerate(spectrum.eigenvalues if stations else ()):
        by_area, by_velocity, _, _ = pencil.fluid_at(value)
        # behind the stations stands what couples the fluid outside
        by_area, by_velocity = by_area[:stations, :stations], by_velocity[:stations]
        pressure[:, i] = by_area @ change[:, i] + by_velocity @ spectrum.u[:, i]
    return change, pressure


def _ties_by_frequency(spectrum: Spectrum) -> Spectrum:
    """Modes whose growth rates differ by rounding only, as without damping, in the order of their frequencies."""
    values = spectrum.eigenvalues
    unit = 1e-9 * np.abs(values).max(initial=0.0)
    return spectrum.select(np.lexsort((values.imag, -np.round(values.real / unit)))) if unit > 0 else spectrum


def _largest(nodal: np.ndarray) -> complex:
    """Largest displacement in any direction at any instant of a cycle, as a factor to divide by."""
    u = nodal[:, :3]
    # semi-axes of the ellipses on which the nodes move
    square, turning = np.sum(np.abs(u) ** 2, axis=1), np.sum(u**2, axis=1)
    reach = np.sqrt(0.5 * (square + np.abs(turning)))
    where = int(np.argmax(reach))
    phase = np.sqrt(turning[where] / abs(turning[where])) if abs(turning[where]) > 0 else 1.0
    return complex(reach[where] * phase) if reach[where] > 0 else 1.0 + 0j
