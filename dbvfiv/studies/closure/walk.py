"""The walk over the back pressures of a case: load steps, the watch for buckling in every symmetry class, arclength
past limit points; kept in a record while it goes on and taken up again from there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from ...errors import SolveError
from ...model.classes import linearise_class
from ...model.closed import ClosedValve, area_under, load_steps
from ...model.equilibria import state_warnings
from ...model.load_curve import LoadCurve
from ...model.load_steps import LoadSteps
from ...model.newton import NewtonResult
from ...model.state import LipCentre
from ...model.supports import CONTACT, HELD_LIPS
from ...model.symmetry import ALL, Symmetry, symmetries_of, symmetry_named
from ...record.record import GrowingRecord, Record
from ...shell.recovery import LayerFields, layer_fields
from ..case import Case
from .buckling import Buckling, BucklingWatch, StiffnessSpectrum, follow_past_limits, spectrum_of


def film_leak(
    pressure: float, z: np.ndarray, x: np.ndarray, gap: np.ndarray, copies: int, density: float, viscosity: float
) -> float:
    """Leak of the whole valve, m3/s, under a back pressure, Pa, through the gaps that are left.

    A laminar film between two faces that are twice the gap apart, ``12 mu integral dz / integral h^3 dx`` (Batchelor
    1967, section 4.2), and the head of the jet in the narrowest row (Bernoulli). Without viscosity the jet alone.

    Parameters
    ----------
    pressure : float, Pa
    z : (rows,) array, m
    x, gap : (rows, columns) arrays, m
        Points of the inner face and their distance from the closing plane.
    copies : int
        Parts between face and closing plane of which the whole valve consists.
    density : float, kg/m3
    viscosity : float, Pa s
    """
    area = copies * area_under(gap, x)
    # Two faces, each before the plane, bound one film.
    conductance = 0.5 * copies * area_under(8.0 * np.maximum(gap, 0.0) ** 3, x)
    if not area.min() > 0.0 or not conductance.min() > 0.0:
        return 0.0
    film = 12.0 * viscosity * float(trapezoid(1.0 / conductance, z))
    jet = density / (2.0 * area.min() ** 2)
    return float(2.0 * pressure / (film + np.sqrt(film**2 + 4.0 * jet * pressure)))


class Pressed:
    """Equilibrium (n,) of a model at a back pressure, Pa, with the columns of a point or a state that follow from it.

    Attributes
    ----------
    nodal : (nn, c) array
    passage : Passage
    touch : ContactState
    """

    def __init__(self, model: ClosedValve, q: np.ndarray, pressure: float):
        part = model.mesh.part
        self.model, self.q, self.pressure, self.nodal = model, q, float(pressure), model.nodal(q)
        self.touch, self.passage = model.contact.state(q), model.passage(q)
        size, area = np.linalg.norm(self.nodal[:, :3], axis=1), self.passage.area
        self.max_displacement = float(size.max())
        self.max_displacement_position = model.mesh.nodes[np.argmax(size)]
        self.opening, self.least_opening = area, float(part.copies * area.min())
        self.least_opening_position = float(self.passage.z[np.argmin(area)])
        self.sealed_length, self.lip_seal = self.passage.shut_length, self.passage.lip_seal
        self.joint_seal, self.closed = self.sealed_length - self.lip_seal, bool(self.passage.shut_intervals)
        self.contact_force, self.penetration = part.walls * self.touch.total, self.touch.penetration

    def describe(self) -> None:
        """Add the columns that only states have."""
        model, plane, touch = self.model, self.model.contact, self.touch
        self.sealed_area = float(model.mesh.part.walls * plane.area[touch.touching].sum())
        self.largest_contact_pressure = float(touch.pressure.max(initial=0.0))
        self.contact_nodes = int(np.count_nonzero(touch.touching))
        self.contact_pressure, self.gap = np.zeros(len(self.nodal)), np.zeros(len(self.nodal))
        self.contact_pressure[plane.nodes] = touch.pressure
        self.gap[model.mesh.rows] = model.gaps(self.nodal)[model.mesh.rows]
        centre = LipCentre(model.mesh, model.shell)
        self.lip_opening, self.lip_displacement = centre.opening(self.q), centre.displacement(self.q)
        self.layers = layer_fields(model.shell, self.q)
        for name, values in zip(("largest_strain", "largest_stress"), layer_maxima(self.layers)):
            setattr(self, name, float(values.max()))
            setattr(self, f"{name}_layer", self.layers.names[int(np.argmax(values))])
        pressure = model.flow.steady_pressure(np.zeros(model.stations), self.pressure)
        self.force_balance = force_imbalance(model, self.q, model.nodal_pressure_force(self.nodal, pressure))

    @property
    def overlap(self) -> float:
        """Deepest overlap of the inner faces, m; rows held shut are left out."""
        plane, model = self.model.plane, self.model
        movable = np.ones(len(self.nodal), bool)
        movable[model.mesh.rows[model.held].ravel()] = False
        gap = plane.gaps(self.q)
        return float(max(0.0, -gap[movable[plane.nodes]].min(initial=0.0)))

    @property
    def contact_front(self) -> float:
        """Distance from the lip, m, up to which the walls have met along the centre line, to within the initial gap;
        linear between rows.
        """
        model, z = self.model, self.model.mesh.z
        # just less than the gap that lifted rows have at rest
        gap = np.where(model.held, 0.0, model.gaps(self.nodal)[model.mesh.centre_line])
        gap = gap - 0.999 * model.case.valve.initial_gap
        met = np.flatnonzero(gap <= 0)
        if not len(met):
            return 0.0
        last = int(met[-1])
        if last + 1 == len(gap):
            return float(z[last])
        a, b = gap[last], gap[last + 1]
        return float(z[last] + (z[last + 1] - z[last]) * a / (a - b))


def layer_maxima(layers: LayerFields) -> tuple[np.ndarray, np.ndarray]:
    """Largest elongation or shortening and largest von Mises stress, Pa, of each layer, (layers,) each."""
    strain = np.maximum(layers.stretch[:, :, 1] - 1, 1 - layers.stretch[:, :, 0])
    return strain.max(axis=0), layers.von_mises.max(axis=0)


def force_imbalance(model: Any, q: np.ndarray, load: np.ndarray) -> float:
    """Norm of the sum of a load (nn, c), N, contact and support forces over the sum of their norms.

    The supports give what the internal forces at held displacements ask for, so the check knows nothing of how the
    state was found.
    """
    nodal, plane = model.nodal(q), model.contact
    internal, contact = model.shell.with_free().force(nodal.ravel()).reshape(nodal.shape), np.zeros_like(nodal)
    contact[plane.nodes, plane.axis] = model.contact.state(q).force
    held = np.where(model.shell.dofs.free, 0.0, internal - load - contact)
    parts = [force[:, :3].sum(axis=0) for force in (load, contact, held)]
    total = sum(float(np.linalg.norm(part)) for part in parts)
    return float(np.linalg.norm(sum(parts))) / total if total > 0 else 0.0


#: Gauss points of a stretch, exact for the work of a load that is quadratic in the positions along a cubic path while
#: the pressure rises linearly.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass
class EnergyLedger:
    """Adds up the work along a path of equilibria and compares it with the energies gained.

    On every stretch between two equilibria

        int P f(q) dq = gain of strain energy + gain of the contact's energy,

    for the path is one of equilibria under a pressure P that changes linearly. The path in between is taken as a cubic
    through both ends with the tangents dq/dP where these are known, else as straight. A follower pressure on a surface
    with a free edge has no potential, so that its work is one along the path and not a function of its ends.
    """

    model: Any
    #: work, stored and defect: J; work of the pressure, energies gained, and the sum of the sizes of what is missing on
    #: each stretch.
    work: float = 0.0
    stored: float = 0.0
    defect: float = 0.0
    _last: tuple | None = field(default=None, repr=False)

    @property
    def error(self) -> float:
        """Defect of the energy balance, absolute values summed over all stretches, over the work of the pressure."""
        return self.defect / abs(self.work) if self.work else 0.0

    @property
    def totals(self) -> tuple[float, ...]:
        """All sums, to go on with elsewhere."""
        return self.work, self.stored, self.defect

    @totals.setter
    def totals(self, values: tuple[float, ...]) -> None:
        self.work, self.stored, self.defect = (float(value) for value in values)

    def begin(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Start the ledger at the first state of the path, with dq/dP if that is known."""
        self._last = pressure, q, slope, self._energy(q)

    def add(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Take the next equilibrium, with dq/dP if that is known."""
        before, start, slope0, energy = self._last
        self.begin(q, pressure, slope)
        rise, step, work = pressure - before, q - start, 0.0
        curved = slope0 is not None and slope is not None
        for x, weight in zip(0.5 * (1 + _POINTS), 0.5 * _WEIGHTS):
            place, rate = _hermite(x, start, step, rise * slope0, rise * slope) if curved else (start + x * step, step)
            force = -(before + x * rise) * self.model.pressure_derivative(place, 1.0)
            work += weight * float(force @ rate)
        gained = self._last[-1] - energy
        self.work += work
        self.stored += gained
        self.defect += abs(work - gained)

    def _energy(self, q: np.ndarray) -> float:
        return self.model.shell.energy(q) + self.model.support_energy(q)


def _hermite(x, start, step, m0, m1):
    """Cubic through two states and its derivative with respect to x in 0..1."""
    h = x * x * (3 - 2 * x)
    place = start + h * step + x * (1 - x) ** 2 * m0 + x * x * (x - 1) * m1
    rate = 6 * x * (1 - x) * step + (1 - x) * (1 - 3 * x) * m0 + x * (3 * x - 2) * m1
    return place, rate


#: Tables of a walk.
STATES, PATH, BUCKLING = "states", "path", "buckling"
#: Notes on classes of motion besides that of the path: lowest eigenvalues of one equilibrium, and a state that buckles.
LOWEST, BUCKLED_CLASS = "class stiffness", "class buckling"
#: Most stiffness eigenvalues that are followed; the largest value of closure.eigenvalues.
MOST_EIGENVALUES = 100
#: Overlap of the inner faces over the initial gap of the lips from which on the faces count as crossed.
CROSSED = 0.1


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """Rows of each table up to the last state that was asked for: the walk goes on from there."""
    asked = np.flatnonzero(~known.column(STATES, "before_limit").astype(bool))
    if not len(asked):
        return {STATES: 0, PATH: 0, BUCKLING: 0}
    path, buckling = (int(known.value(STATES, f"way/{name}", asked[-1])) for name in ("path", "buckling"))
    return {STATES: int(asked[-1]) + 1, PATH: path, BUCKLING: buckling}


class ClosureWalk:
    """The walk of one model; rows of its record are appended as soon as they are found.

    Attributes
    ----------
    steps : LoadSteps
    watches : dict of BucklingWatch
        Of the class of the path, the first, and of others that are watched, by their names.
    """

    def __init__(self, model: ClosedValve, record: GrowingRecord):
        self.model, self.record = model, record
        options = load_steps(model)
        self.steps = LoadSteps(model, options, observer=record, accepted=self._accept)
        self.watches = {name: BucklingWatch(model, options, watch) for name, watch in self._spectra().items()}
        self.own = next(iter(self.watches.values()))
        self.energy = EnergyLedger(model)
        self.energy.begin(self.steps.q, 0.0)
        self.beyond_limit = self._limit_met = False
        self._kept = dict.fromkeys(self.watches, 0)  # buckling states in the record

    def _spectra(self) -> dict[str, Callable[[np.ndarray, float], StiffnessSpectrum]]:
        model, closure = self.model, self.model.case.closure

        def of_class(symmetry: Symmetry):
            def spectrum(q: np.ndarray, pressure: float) -> StiffnessSpectrum:
                linear = linearise_class(model, q, pressure, symmetry)
                return spectrum_of(linear.stiffness, linear.mass, pressure, closure.eigenvalues)

            return spectrum

        classes = symmetries_of(model.mesh.part)
        watched = closure.symmetry == ALL and model.supports == CONTACT
        return {name: of_class(s) for name, s in classes.items() if watched or s.of_equilibria}

    def go(self, pressures: Sequence[float]) -> None:
        """Equilibria at back pressures, Pa, each reached from the one before; those that the record holds are not found
        again. One that is not reached ends the list, for those after it lie beyond it.
        """
        record = self.record
        self.record.warn(*self.model.start_warnings())
        if not record.notes(STATES):
            record.note(STATES, reference_opening=self.model.reference_opening)
        try:
            over = record.notes("walked")
            failure = over[-1]["failure"] if over else self._walk(pressures)
            if not over:
                record.note("walked", failure=failure)
            if failure is not None:
                record.fail(failure)
        finally:
            self._warn_of_states()

    def _walk(self, pressures: Sequence[float]) -> str | None:
        """Go over the list, and say why it was not gone to its end."""
        try:
            for pressure in pressures[self._resume() :]:
                self._go_to(pressure)
        except SolveError as error:
            return str(error)
        return None

    # -- equilibria

    def _go_to(self, target: float) -> None:
        """Find and keep the equilibrium at a back pressure, Pa. Raises SolveError."""
        steps, found = self.steps, {"iterations": 0, "load_steps": 0}
        try:
            way = steps.reach(target)
            last, found = way.result, {"iterations": way.iterations, "load_steps": way.steps}
            spectrum = self._seen
        except SolveError as error:
            self._go_past_limit(target, error)
            last, spectrum = steps.settle(), self._watch(target, steps.q)
            self.energy.begin(steps.q, target, steps.slope)  # as one that goes on from here
        self._keep_state(steps.q, target, spectrum, last, found, self._restart())

    def _accept(self, pressure: float, q: np.ndarray) -> None:
        """Keep an equilibrium between two back pressures."""
        self.energy.add(q, pressure, self.steps.slope)
        self._seen = self._watch(pressure, q, point=True)

    def _watch(self, pressure: float, q: np.ndarray, point: bool = False) -> StiffnessSpectrum:
        """Look for buckling at the next equilibrium, in every class up to a limit point; keep it as a point of the path
        if it is one.
        """
        spectrum = self.own.see(pressure, q)
        if point:
            self._keep_point(pressure, q, float(spectrum.values.real[0]))
        watches = [] if self.beyond_limit else list(self.watches.items())[1:]
        others = {name: watch.see(pressure, q).lowest for name, watch in watches}
        if others:
            self.record.note(LOWEST, pressure=float(pressure), lowest=others)
        self._keep_buckling()
        if self.own.before is not None:
            self._keep_before_limit(*self.own.before)
        return spectrum

    def _go_past_limit(self, target: float, error: SolveError) -> None:
        """Arclength from the last equilibrium to the target pressure, or to the first limit point where it is to end.
        Raises SolveError.
        """
        steps, goes_on = self.steps, self.model.case.closure.arclength
        start, q, falls = steps.pressure, steps.q, target < steps.pressure
        self.record.progress(f"arclength from {start:.6g} Pa")
        curve = LoadCurve(self.model, steps.options.newton, self.record, (start, q), not goes_on)
        try:
            path = follow_past_limits(curve, target)
        except SolveError as reason:
            if not falls:
                self._keep_before_limit(start, q)
            raise SolveError(f"{error} Arclength did not get under way either: {reason}") from reason
        passes = path.limits and goes_on
        for pressure, place in path.points[1:]:
            if not passes:
                self._watch(pressure, place, point=True)
                start, q = pressure, place
            else:
                self._keep_point(pressure, place, np.nan, arclength=True)
            self.energy.add(place, pressure)
        self.own.found.extend(path.limits)
        self._keep_buckling()
        if path.limits or not (path.reached or falls):
            self._keep_before_limit(start, q)
        self.beyond_limit = self.beyond_limit or bool(path.limits)
        for watch in self.watches.values() if passes else ():
            watch.forget()
        steps.pressure, steps.q = path.points[-1]
        steps.slope = None
        if path.limits and not goes_on:
            raise SolveError(
                f"The wall has a limit point at {path.limits[0].pressure:.6g} Pa: beyond it no equilibrium is near."
            )
        if not path.reached:
            raise SolveError(
                f"{error} Arclength ended at {steps.pressure:.6g} Pa after {len(path.points)} points ({path.reason})."
            )

    def _keep_before_limit(self, pressure: float, q: np.ndarray) -> None:
        """Describe and keep the last equilibrium before the first limit."""
        if self._limit_met or pressure <= 0:
            return
        self._limit_met = True
        try:
            apart = LoadSteps(self.model, self.steps.options, pressure, q)
            last = apart.settle()
            spectrum = self.own.spectrum(apart.q, pressure)
            self._keep_state(apart.q, pressure, spectrum, last, {"iterations": last.iterations, "load_steps": 0}, None)
        except SolveError as error:
            self.record.warn(f"The last state before a limit, at {pressure:.6g} Pa, was not described: {error}")

    # -- the record

    def _keep_point(self, pressure: float, q: np.ndarray, lowest: float, arclength: bool = False) -> None:
        point = Pressed(self.model, q, pressure)
        point.lowest_eigenvalue, point.arclength = lowest, arclength
        self.record.append(PATH, self.record.tables[PATH].row(point))

    def _keep_buckling(self) -> None:
        """Keep what is new of the buckling states of all classes."""
        nodal = self.model.nodal
        for name, watch in self.watches.items():
            for b in watch.found[self._kept[name] :]:
                row = {"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue}
                if watch is self.own:
                    self.record.append(BUCKLING, row | {"nodal": nodal(b.q), "shape": nodal(b.shape)})
                else:
                    self.record.note(BUCKLED_CLASS, symmetry=name, **row)
            self._kept[name] = len(watch.found)

    def _keep_state(
        self,
        q: np.ndarray,
        pressure: float,
        spectrum: StiffnessSpectrum,
        last: NewtonResult,
        found: dict[str, int],
        way: dict[str, Any] | None,
    ) -> None:
        """Keep a state; one without restart data, its `way`, is the last before a limit."""
        state, table, lowest = Pressed(self.model, q, pressure), self.record.tables[STATES], spectrum.lowest
        state.describe()
        values = spectrum.values.real
        vars(state).update(
            found,
            lowest_stiffness_eigenvalue=lowest,
            lowest_symmetric_eigenvalue=float(spectrum.symmetric_values[0]),
            asymmetry=spectrum.asymmetry,
            stable=bool(lowest > 0),
            stiffness_eigenvalues=np.pad(values, (0, MOST_EIGENVALUES - len(values)), constant_values=np.nan),
            beyond_limit=way is not None and self.beyond_limit,
            energy_balance=self.energy.error,
            converged=True,
            residual=last.residual,
            rounding=last.rounding,
            reason=last.reason,
            before_limit=way is None,
        )
        none = {name: np.full(table.shapes[f"way/{name}"], np.nan) for name in ("step", "slope", "energy")}
        counts = {"path": self.record.rows(PATH), "buckling": self.record.rows(BUCKLING)}
        state.way = SimpleNamespace(**(none | (way or {}) | counts))
        self.record.append(STATES, table.row(state))
        self.record.item(state)

    def _restart(self) -> dict[str, Any]:
        """Restart data of the present state, without a slope that is not known."""
        steps = self.steps
        way = {"step": steps.step, "energy": self.energy.totals}
        return way if steps.slope is None else way | {"slope": self.model.nodal(steps.slope)}

    def _resume(self) -> int:
        """Stand at the last state that was asked for, or at rest, and say how many there are."""
        rows = [row for row in range(self.record.rows(STATES)) if not self._value("before_limit", row)]
        if rows:
            self._take_up(rows[-1])
        for watch in self.watches.values():
            watch.see(self.steps.pressure, self.steps.q)
        return len(rows)

    def _take_up(self, last: int) -> None:
        """Stand at the state of a row."""
        record, steps, restrict = self.record, self.steps, self.model.shell.dofs.restrict
        steps.pressure, steps.step = float(self._value("pressure", last)), float(self._value("way/step", last))
        steps.q, slope = restrict(self._value("nodal", last)), restrict(self._value("way/slope", last))
        steps.slope = None if np.isnan(slope).any() else slope
        self.energy.begin(steps.q, steps.pressure, steps.slope)
        self.energy.totals = tuple(self._value("way/energy", last))
        self.beyond_limit = bool(self._value("beyond_limit", last))
        for row in range(record.rows(BUCKLING)):
            b = {name: record.value(BUCKLING, name, row) for name in ("kind", "pressure", "eigenvalue")}
            q, shape = (restrict(record.value(BUCKLING, name, row)) for name in ("nodal", "shape"))
            self.own.found.append(Buckling(str(b["kind"]), float(b["pressure"]), q, shape, float(b["eigenvalue"])))
        self._kept[next(iter(self.watches))] = len(self.own.found)
        self._limit_met = bool(self.own.found)

    def _value(self, column: str, row: int) -> Any:
        return self.record.value(STATES, column, row)

    # -- what is worth knowing

    def _warn_of_states(self) -> None:
        """Warnings about the states that were found: material, buckling, faces that overlap."""
        restrict = self.model.shell.dofs.restrict
        found = []
        for row in range(self.record.rows(STATES)):
            pressure, overlap = (float(self._value(name, row)) for name in ("pressure", "overlap"))
            found.append(SimpleNamespace(pressure=pressure, overlap=overlap, q=restrict(self._value("nodal", row))))
        self.record.warn(*state_warnings(self.model, found))
        for row in range(min(self.record.rows(BUCKLING), 1)):
            pressure, kind = (self.record.value(BUCKLING, name, row) for name in ("pressure", "kind"))
            self.record.warn(
                f"The wall buckles at {pressure:.6g} Pa ({kind}); states at higher pressures lie beyond it."
            )
        for note in self.record.notes(BUCKLED_CLASS):
            where = f"at {note['pressure']:.6g} Pa in class {note['symmetry']}"
            self.record.warn(f"The wall buckles {where}: {symmetry_named(note['symmetry']).words}.")
        worst = max(found, key=lambda state: state.overlap, default=None)
        held = self.model.supports == HELD_LIPS
        if worst is not None and worst.overlap > (CROSSED * self.model.case.valve.initial_gap if held else np.inf):
            deepest = f"{worst.overlap * 1e3:.2g} mm at {worst.pressure:.6g} Pa"
            why = "because these supports stop the mid-surface and not the faces."
            self.record.warn(f"The inner faces overlap by up to {deepest}, {why}")
