"""Leading modes of the coupled valve at one steady state, with an independent count of the unstable ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from eigen.basis import TransferBasis
from eigen.certificate import CertifiedSpectrum, certified_spectrum, missing_pairs
from eigen.factor import Workspace
from eigen.operator import CoupledPencil
from eigen.search import leading_modes
from eigen.spectrum import SearchOptions, Spectrum

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, SolveError
from ...model.equilibria import require_equilibrium
from ...model.leading import LeadingSearch
from ...model.state import SteadyState
from ...model.symmetry import EQUILIBRIA, SYMMETRIES, Symmetry, symmetry_named
from ...model.valve import GRAZING, ValveModel
from ...observer import Observer
from ...record.table import Column
from ...record.vtkhdf import faces
from ...texts import shortly
from ..stability.dimensions import VARIANT
from ..stability.line import ParameterLine
from ..stability.scan import Crossing, Scan
from ..stability.verdict import FLUTTERS, STABLE, Verdict, lowered, oscillates
from ..stability.walk import StabilityWalk, ValveFamily, name_state_in_failures
from ..state import State

if TYPE_CHECKING:
    from . import Keys

#: Structural modes in the basis behind the independent count.
_BASIS = 24
_NO_PLUG = (
    "Inner fluid answers to the areas of this half of the valve and does not go along where it sways sideways in x: "
    "such modes are too quick and too lightly damped in a liquid."
)
#: One row for each mode in a result file.
MODE = (
    *VARIANT,
    Column("growth_rate", "1/s", "Real part of the eigenvalue"),
    Column("angular_frequency", "rad/s", "Imaginary part of the eigenvalue, not negative"),
    Column("residual", "", "Relative residual of the full pencil"),
    Column("backward_error", "", "The same against matrix norms"),
    Column(
        "shape",
        "1, rad/m",
        "Displacements and rotations of the nodes, the largest displacement being 1 and real",
        "c16",
    ),
    Column(
        "area",
        "m",
        "Change of the flow area of the computed part at each row, m2 for 1 m of largest displacement",
        "c16",
    ),
    Column("pressure", "Pa/m", "Change of the pressure at each row for 1 m of largest displacement", "c16"),
    Column("inlet_velocity", "1/s", "Change of the inlet velocity for 1 m of largest displacement", "c16"),
)


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode; a conjugate pair is one mode, with frequency >= 0.

    Motion: Re(shape exp(eigenvalue t)), of undetermined amplitude.
    """

    number: int  #: From 1, by falling growth rate.
    growth_rate: float  #: 1/s.
    angular_frequency: float  #: rad/s.
    #: residual and backward_error: see `eigen.Spectrum`.
    residual: float
    backward_error: float
    #: (nn, c) complex; displacements and rotations of the nodes, c = 5; the largest displacement is 1 and real.
    shape: np.ndarray = field(repr=False)
    area: np.ndarray = field(repr=False)  #: (m,) complex, m2 per m.
    pressure: np.ndarray = field(repr=False)  #: (m,) complex, Pa per m; NaN in vacuo.
    inlet_velocity: complex = field(repr=False)  #: m/s per m.
    symmetry: str = EQUILIBRIA  #: Class of motion, see `dbvfiv.model.symmetry`.

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.number}: growth {self.growth_rate:+.5g} 1/s at {self.frequency:.5g} Hz>"

    @property
    def eigenvalue(self) -> complex:
        """1/s."""
        return complex(self.growth_rate, self.angular_frequency)

    @property
    def frequency(self) -> float:
        """Hz."""
        return self.angular_frequency / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """-growth rate over |eigenvalue|; 1 or -1 where nothing oscillates."""
        size = abs(self.eigenvalue)
        return -self.growth_rate / size if size > 0 else 0.0

    @property
    def amplitude(self) -> np.ndarray:
        """(nn,) largest displacement of each node over a cycle, 1 at most."""
        u = self.shape[:, :3]
        square, turning = np.sum(np.abs(u) ** 2, axis=1), np.sum(u**2, axis=1)
        return np.sqrt(0.5 * (square + np.abs(turning)))

    def at_phase(self, phase: float) -> np.ndarray:
        """(nn, c) displacements and rotations at a phase of the cycle, rad; growth or decay left out."""
        return (self.shape * np.exp(1j * phase)).real

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return {
            "growth_rate": self.growth_rate,
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "residual": self.residual,
            "symmetry": self.symmetry,
        }


#: Largest displacement at which a mode is drawn, over the length of the valve; share of the clear height that it may
#: take, and share of the largest that it has in any case.
_LARGEST, _OPEN, _SEEN = 0.035, 0.85, 0.1


def drawn_amplitude(state: State, mode: ModeShape) -> float:
    """Largest displacement, m, at which a mode shows well and the inner faces of the lips do not cross."""
    mesh, symmetry = state.results.mesh, symmetry_named(mode.symmetry)
    largest = _LARGEST * float(np.ptp(mesh.z))
    if not symmetry.moves_lips_apart:
        return largest
    line = mesh.centre_line  # which a sideways sway leaves in place
    line = line if symmetry.signs[0] > 0 and mesh.part.is_quarter else mesh.rows.ravel()
    height = faces(mesh, state.nodal)[0][line, 1]
    swing = np.abs(mode.shape[line, 1])
    chosen = (swing > 1e-3) & (height > 0)
    room = float(np.min(_OPEN * height[chosen] / swing[chosen])) if chosen.any() else largest
    return min(largest, max(room, _SEEN * largest))


#: The independent count as a curve.
CURVE = (
    *VARIANT,
    Column("frequency", "Hz", "Points on the line at which the determinant was evaluated"),
    Column("phase", "rad", "Continuous phase of the determinant against that of a stable structure"),
)


@shortly
@dataclass(frozen=True, eq=False)
class Certificate:
    """Eigenvalue count by two routes: the list of modes, and the argument principle."""

    agrees: bool
    #: unstable_count and unstable_count_independent: from the list of modes, and from the winding of the determinant;
    #: both eigenvalues of a conjugate pair count.
    unstable_count: int
    unstable_count_independent: int
    statement: str  #: The count and its certainty in a sentence.
    certain: bool  #: True where the phase of the determinant could be followed everywhere.
    line: float  #: 1/s; growth rate above which eigenvalues are counted: 0 but for undamped structures.
    counted_up_to: float  #: Hz; frequency at which the independent count ends; infinite but for searches in a band.
    distance: float  #: Distance of the winding from a whole number.
    response_error: float  #: Error of log det made by the reduced basis behind the count; NaN if no basis was used.
    status: str  #: "complete" if no mode was missed among those listed.
    asked: int
    complete_above: float  #: 1/s.
    band: float  #: Hz; every eigenvalue above this growth rate and up to this frequency was found.
    rejected: int  #: Pairs thrown away because of their residual.
    #: frequency and phase: (k,) Hz, rad; phase of the determinant on the line.
    frequency: np.ndarray
    phase: np.ndarray

    @classmethod
    def of(cls, found: CertifiedSpectrum) -> Certificate:
        spectrum, count, error = found.spectrum, found.count, found.response_error
        own = {name: getattr(found, name) for name in ("agrees", "unstable_count", "unstable_count_independent")}
        own |= {name: getattr(count, name) for name in ("certain", "distance", "phase")}
        own |= {name: getattr(spectrum, name) for name in ("status", "asked", "rejected")}
        limits = {"complete_above": spectrum.complete_above, "band": spectrum.band, "line": count.line}
        limits |= {"counted_up_to": count.band, "response_error": np.nan if error is None else error}
        rest = {name: float(value) for name, value in limits.items()}
        return cls(**own, **rest, statement=found.statement, frequency=count.frequencies)

    def note(self) -> dict[str, Any]:
        """All but the curve, as a note of a record."""
        curve = [column.name for column in CURVE]
        return {name: value for name, value in vars(self).items() if name not in curve}

    @classmethod
    def joined(cls, parts: Mapping[str, Certificate]) -> Certificate:
        """Join the certificates of several symmetry classes, given by their names.

        Counts add up, and what holds for all of them holds. The curve is that of the first.
        """
        each = list(parts.values())
        if len(each) == 1:
            return each[0]
        incomplete = [c.status for c in each if c.status != "complete"]
        rules = {
            all: ("agrees", "certain"),
            sum: ("unstable_count", "unstable_count_independent", "asked", "rejected"),
            max: ("line", "distance", "complete_above"),
            min: ("counted_up_to", "band"),
        }
        joined = {name: rule([getattr(c, name) for c in each]) for rule, names in rules.items() for name in names}
        return replace(
            each[0],
            **joined,
            statement=" ".join(f"In {name}: {lowered(c.statement)}" for name, c in parts.items()),
            response_error=max((c.response_error for c in each if c.response_error >= 0), default=float("nan")),
            status=incomplete[0] if incomplete else "complete",
        )

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON, without the counts and the curve."""
        return {name: value for name, value in self.note().items() if not name.startswith("unstable_count")}


@dataclass(frozen=True)
class FoundModes:
    """Leading modes of one state in one variant."""

    modes: tuple[ModeShape, ...]  #: By falling growth rate.
    certificate: Certificate  #: Of the eigenvalue count.
    verdict: Verdict  #: Stability of the state in this symmetry class.
    notes: tuple[str, ...] = ()
    spectrum: Spectrum | None = None  #: Eigenvalues, vectors and residuals, of a run.
    #: Where faces are about to part or have just met: how many `faces`, growth rates, 1/s, and frequencies, Hz, with
    #: them `parted` and `held`. Empty elsewhere.
    grazing: dict[str, Any] = field(default_factory=dict)

    @property
    def eigenvalues(self) -> np.ndarray:
        """(k,) complex, 1/s, sorted by growth rate."""
        return np.array([mode.eigenvalue for mode in self.modes], complex)

    @property
    def stable(self) -> bool | None:
        """True where all modes decay; None where that is not known."""
        return self.verdict.stable

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return {
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "certificate": self.certificate.summary(),
        } | ({"grazing": self.grazing} if self.grazing else {})


def run_modes(
    model: ValveModel,
    state: SteadyState,
    mu: Mu | None = None,
    keys: Keys | None = None,
    observer: Observer | None = None,
    symmetry: Symmetry = SYMMETRIES[EQUILIBRIA],
    walk: StabilityWalk | None = None,
) -> FoundModes:
    """Leading modes of a steady state in one class of motion. Raises CaseError for a valve at rest with fluid in it:
    without a pressure its velocity is undetermined. Raises NotValidError if the constants of a rubber with loss factors
    are unstable at this state. Raises SolveError if the state is no equilibrium, or no shift was found at which the
    pencil can be factored.

    Parameters
    ----------
    state : SteadyState
        An equilibrium of the model.
    mu : Mu, optional
        Parameter point; that of the case by default.
    keys : Keys, optional
        Section `modes`; that of the case by default. Band and limit point are chosen by the damping where it has none.
    observer : Observer, optional
    symmetry : Symmetry, optional
        The class; that of the equilibria by default.
    walk : StabilityWalk, optional
        One that knows the state.
    """
    keys = model.case.modes if keys is None else keys
    observer = Observer() if observer is None else observer
    require_equilibrium(model, state)
    in_vacuo = keys.in_vacuo or not model.flow.has_fluid
    if not in_vacuo and state.pressure <= model.flow.back:
        raise CaseError(
            f"Coupled modes need an inlet pressure greater than {model.flow.back:g}, because without one the velocity "
            "of an ideal fluid is undetermined; "
            "modes.in_vacuo gives those of the structure at rest."
        )
    place = Mu.of(model.case).at(**(mu or {})).at(pressure=state.pressure)
    if walk is None:
        walk = StabilityWalk(model.case, observer, model, symmetry)
        walk.give(Mu.of(model.case).at(pressure=state.pressure), state)
    walk.require_valid(place)
    observer.progress("linearising")
    linear = walk.family(place).linear
    pencil = linear.pencil(place, not in_vacuo)
    observer.progress("searching")
    with name_state_in_failures(state.pressure):
        family = ValveFamily(linear, keys.max_frequency, keys.count)
        search = family.leading(place, in_vacuo)
        asked = replace(search.options, shifts=keys.shifts, tolerance=keys.tolerance)
        workspace = Workspace()
        basis = TransferBasis(pencil, modes=max(_BASIS, keys.count), workspace=workspace)
        certified = certified_spectrum(pencil, keys.count, asked, workspace=workspace, basis=basis)
    certified = replace(certified, spectrum=_ties_by_frequency(certified.spectrum))
    notes = (*search.notes, *certified.spectrum.notes)
    if symmetry.of_equilibria and not (model.mesh.part.is_quarter or in_vacuo):
        notes = (*notes, _NO_PLUG)
    searched = family.is_searched(certified.spectrum.eigenvalues, place, search)
    verdict = _verdict(certified, searched, search, linear.seal is not None)
    if verdict.outcome == STABLE and certified.count.band < asked.whole:
        beyond = missing_pairs(
            pencil, certified.spectrum, basis, certified.count.line, replace(asked, max_frequency=None), workspace
        )
        verdict = verdict.open_above(search.left_open(verdict.band, () if beyond is None else beyond.eigenvalues))
    modes = _shapes(model, pencil, linear, certified.spectrum, symmetry, in_vacuo)
    grazing = _one_sided(model, state, pencil, asked, keys.count) if symmetry.of_equilibria else {}
    notes = (*notes, *_contact_notes(model, state, linear, modes, symmetry), *_grazing_notes(model, grazing))
    result = FoundModes(modes, Certificate.of(certified), verdict, notes, certified.spectrum, grazing)
    if result.stable is None:
        observer.warn(result.verdict.reason)
    return result


def _contact_notes(model, state: SteadyState, linear, modes: Sequence[ModeShape], symmetry: Symmetry) -> list[str]:
    """Limits of the modes of a bill that is moulded shut, and up to which amplitude."""
    if not model.case.valve.is_preset:
        return []
    said = []
    if linear.seal is not None:
        fluid = ", with the still fluid behind the seal" if model.flow.has_fluid else ""
        said.append(
            f"Sealed: the faces touch up to z = {1e3 * model.mesh.z[linear.seal]:.4g} mm and nothing flows; the modes "
            f"are those of the wall held there{fluid}."
        )
    if symmetry.of_equilibria and modes and model.touching(state.q):
        reach = model.contact_reach(state.q, modes[0].shape)
        said.append(
            f"The first mode is that of the {model.touching(state.q)} nodes whose faces touch; from {1e3 * reach:.2g} "
            "mm of its largest displacement on faces part or meet."
        )
    return said


def _one_sided(model, state: SteadyState, pencil: CoupledPencil, search: SearchOptions, count: int) -> dict[str, Any]:
    """Spectra on both sides of faces that graze, as `FoundModes.grazing` has them."""
    faces, changes = model.grazing(state.q)
    found: dict[str, Any] = {"faces": faces} if changes else {}
    for name, change in changes.items():
        values = leading_modes(pencil.replace(K=pencil.K + change), count, search).eigenvalues
        found[name] = [{"growth_rate": v.real, "frequency": abs(v.imag) / (2 * np.pi)} for v in values.tolist()]
    return found


def _grazing_notes(model, grazing: dict[str, Any]) -> list[str]:
    if not grazing:
        return []
    said = []
    for name in ("parted", "held"):  # highly damped walls may have no mode within reach of the search
        first = "no mode is listed"
        if listed := grazing[name]:
            first = f"the first mode has {listed[0]['growth_rate']:+.4g} 1/s at {listed[0]['frequency']:.4g} Hz"
        said.append(f"{first} with them {name}")
    within = 1e6 * GRAZING * model.contact.law.rounding
    faces = "1 node whose face is" if grazing["faces"] == 1 else f"{grazing['faces']} nodes whose faces are"
    return [f"Grazing: {faces} within {within:.2g} um of parting or meeting; {', '.join(said)}."]


def _verdict(found: CertifiedSpectrum, searched: np.ndarray, search: LeadingSearch, sealed: bool) -> Verdict:
    """Verdict from the modes in the region that every study searches, up to the frequency that is claimed."""
    count = found.count
    return Verdict.of(
        found.spectrum.eigenvalues[searched],
        found.unstable_count,
        found.unstable_count_independent,
        found.certificate.certain,
        line=count.line,
        band=min(count.band, search.claimed),
        statement="" if found.agrees else found.statement,
        sealed=sealed,
    )


def _shapes(model, pencil: CoupledPencil, linear, spectrum, symmetry, in_vacuo) -> tuple[ModeShape, ...]:
    """Modes with shapes, areas and pressures of the eigenvectors, scaled to a largest displacement of 1."""
    change, pressure = _changes(model, pencil, linear, spectrum, symmetry, in_vacuo)
    found = []
    for i, value in enumerate(spectrum.eigenvalues):
        nodal = linear.nodal(spectrum.q[:, i])
        scale = _largest(nodal)
        found.append(
            ModeShape(
                number=i + 1,
                growth_rate=float(value.real),
                angular_frequency=float(value.imag),
                residual=float(spectrum.residual[i]),
                backward_error=float(spectrum.backward_error[i]),
                shape=nodal / scale,
                area=change[:, i] / scale,
                pressure=pressure[:, i] / scale,
                inlet_velocity=complex(spectrum.u[0, i] / scale) if pencil.b else 0j,
                symmetry=symmetry.name,
            )
        )
    return tuple(found)


def _changes(model, pencil: CoupledPencil, linear, spectrum, symmetry, in_vacuo) -> tuple[np.ndarray, np.ndarray]:
    """Changes of areas and pressures (m, k) of the eigenvectors; no pressures in vacuo, NaN, and none of either to
    first order but in the class of the equilibria.
    """
    pressure = np.full((model.stations, len(spectrum)), np.nan if in_vacuo else 0.0, complex)
    if not symmetry.of_equilibria:
        return np.zeros_like(pressure, complex), pressure
    change = linear.slope @ spectrum.q
    for i, value in enumerate(() if in_vacuo else spectrum.eigenvalues):
        by_area, by_velocity, _, _ = pencil.fluid_at(value)
        # behind the stations stands what couples the fluid outside
        stations = len(change)
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


#: Factors asked, from that of the case outwards; below a twentieth a wall is as good as undamped.
LOWER, HIGHER = np.geomspace(1.0, 0.05, 9), np.geomspace(1.0, 10.0, 7)
#: Relative accuracy of the factor.
ACCURACY = 1e-4


def critical_damping_factor(walk: StabilityWalk, place: Mu, verdict: Verdict) -> tuple[float, float]:
    """Factor on the loss factors, or on beta, at which flutter begins, next to 1, and what was looked at without one.

    It lies below 1 where the state is stable and above where it flutters.

    Parameters
    ----------
    verdict : Verdict
        On the place.

    Returns
    -------
    float
        NaN where none is found.
    float
        The last factor looked at where none up to it, or down to it, makes the difference; NaN where one is found, the
        wall has no such damping or none beside it that holds, the verdict is another, the search fails, or no mode is
        neutral there by the full matrices.
    """
    if place.damping not in ("loss_factor", "beta") or verdict.outcome not in (STABLE, FLUTTERS):
        return np.nan, np.nan
    try:
        return _change(walk, place, verdict)
    except SolveError:  # the verdict stands by itself
        return np.nan, np.nan


def _change(walk: StabilityWalk, place: Mu, verdict: Verdict) -> tuple[float, float]:
    """Factor at which the verdict changes, and the last one that was looked at."""
    name, own = place.damping, place[place.damping]
    factors = LOWER if verdict.outcome == STABLE else HIGHER
    highest = PARAMETERS[name].high
    if name == "loss_factor":
        highest = walk.built(place).model.relaxation.highest(own, min(highest, own * factors.max()))
    factors = factors[own * factors <= highest]
    if name == "loss_factor":
        factors = walk.holding(place, factors)
    line = ParameterLine(walk, place, name, own * factors)
    if not line.is_reduced:  # a wall that nothing couples, which with the least damping is nearest to growth
        alone = verdict.outcome == STABLE and not walk.family(place).forces.shape[1]
        calm = alone and (line.spectrum(line.values[-1]).real < 0).all()
        return np.nan, float(factors[-1]) if calm else np.nan

    def flutter(value: float) -> np.ndarray:
        values = np.asarray(line.column.model.eigenvalues(line.place(value)))
        return values[oscillates(values)]

    scan, sought = Scan(flutter), np.nan
    for factor, (near, far) in zip(factors[1:].tolist(), pairwise(map(scan.at, line.values))):
        if not (len(near.eigenvalues) and len(far.eigenvalues)):
            break
        if (near.pairs > 0) != (far.pairs > 0):
            onset = line.locate(Crossing(0, *sorted((near, far), key=lambda one: one.value)), ACCURACY, scan=scan)
            # rounding of factorisations would part a resumed run from a whole one
            return float(f"{onset.value / own:.8g}") if np.isfinite(onset.residual) else np.nan, np.nan
        sought = factor if (far.pairs > 0) == (verdict.outcome == FLUTTERS) else np.nan
    return np.nan, sought
