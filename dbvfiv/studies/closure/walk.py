"""The walk over the back pressures of a case: load steps, multiplier updates, the watch for buckling in every symmetry
class, arclength past limit points; kept in a record while it goes on and taken up again from there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from continuation import NotConverged

from ...errors import SolveError
from ...model.equilibria import model_warnings, state_warnings
from ...model.load_steps import LARGEST_JUMP, LoadStepOptions, LoadSteps
from ...model.newton import NewtonOptions, NewtonResult
from ...model.symmetry import ALL, symmetries_of, symmetry_named
from ...record.record import GrowingRecord, Record
from .buckling import (
    Buckling,
    BucklingWatch,
    StiffnessSpectrum,
    class_matrices,
    follow_past_limits,
    spectrum_of,
    stiffness_spectrum,
)
from .energy import EnergyLedger
from .valve import CONTACT, ClosureModel, Pressed

#: Tables of a walk, and their prefix of one with the other supports.
STATES, PATH, BUCKLING, COMPARED = "states", "path", "buckling", "compared_"
#: Notes on classes of motion besides that of the path: lowest eigenvalues of one equilibrium, and a state that buckles.
LOWEST, BUCKLED_CLASS = "class stiffness", "class buckling"
#: Most stiffness eigenvalues that are followed; the largest value of closure.eigenvalues.
MOST_EIGENVALUES = 100
#: Renewals of the multipliers before giving up.
MOST_UPDATES = 40
#: Overlap of the inner faces over the penetration that is left, from which on the faces count as crossed.
CROSSED = 10.0
#: Smallest load step over the target pressure, and of a walk that ends at its limit point, which arclength locates from
#: there: each halving beside a limit point costs two Newton runs that fail.
MIN_STEP, MIN_STEP_TO_LIMIT = 1e-5, 1e-3
#: Largest load step over the first from rest, where the lips meet.
FIRST_SHARE = 20


def void_rows(record: GrowingRecord, table: str, first: int) -> None:
    """Leave out the rows of a table from one on: they were on the way to something that was not reached, and whoever
    goes on finds them again.
    """
    if record.rows(table) > first:
        record.note("void", table=table, start=first, stop=record.rows(table))


def valid_rows(record: Record, table: str) -> list[int]:
    """Numbers of the rows of a table that were not left out."""
    void = [range(note["start"], note["stop"]) for note in record.notes("void") if note["table"] == table]
    return [row for row in range(record.rows(table)) if not any(row in rows for rows in void)]


class ClosureWalk:
    """The walk of one model; rows of its record are appended as soon as they are found.

    Parameters
    ----------
    model : ClosureModel
    record : GrowingRecord
    prefix : str
        Of the tables that the walk is kept in.

    Attributes
    ----------
    steps : LoadSteps
    watches : dict of BucklingWatch
        Of the class of the path, the first, and of others that are watched, by their names.
    """

    def __init__(self, model: ClosureModel, record: GrowingRecord, prefix: str = ""):
        self.model, self.record, self.compared = model, record, bool(prefix)
        self.states, self.points, self.buckling = (prefix + table for table in (STATES, PATH, BUCKLING))
        closure, steady, pressed = model.case.closure, model.case.steady, model.pressed
        jump = LARGEST_JUMP * float(np.mean(model.mesh.thickness))
        newton = NewtonOptions(steady.tolerance, steady.max_iterations)
        smallest = MIN_STEP if closure.arclength else MIN_STEP_TO_LIMIT
        options = LoadStepOptions(newton, smallest, closure.max_step / FIRST_SHARE, closure.max_step, jump)
        self.steps = LoadSteps(pressed, options, observer=record, accepted=self._accept)
        self.watches = {name: BucklingWatch(pressed, options, watch) for name, watch in self._spectra().items()}
        self.own = next(iter(self.watches.values()))
        if pressed.shell.stress_free is not None:  # the faces press on each other at rest
            self.steps.settle()
        self.energy = EnergyLedger(pressed, closure.balance_tolerance)
        self.energy.begin(self.steps.q, 0.0)
        self.beyond_limit = self._limit_met = False
        self._kept = dict.fromkeys(self.watches, 0)  # buckling states in the record

    def _spectra(self) -> dict[str, Any]:
        model, closure = self.model, self.model.case.closure
        (own, _), *others = symmetries_of(model.mesh.part).items()
        spectra = {own: lambda q, pressure: stiffness_spectrum(model.pressed, q, pressure, closure.eigenvalues)}
        for name, symmetry in others if closure.symmetry == ALL and model.supports == CONTACT else ():
            free = symmetry.free_unknowns(model.mesh)
            matrices = partial(class_matrices, model.pressed, free, symmetry.moves_lips_apart)
            spectra[name] = lambda q, p, matrices=matrices: spectrum_of(*matrices(q, p), p, closure.eigenvalues)
        return spectra

    def go(self, pressures: Sequence[float]) -> None:
        """Equilibria at back pressures, Pa, each reached from the one before; those that the record holds are not found
        again. One that is not reached ends the list, for those after it lie beyond it.
        """
        record = self.record
        self._warn([*model_warnings(self.model), *self.model.start_warnings()])
        if not record.notes(self.states):
            setting = {"supports": self.model.supports, "reference_opening": self.model.reference_opening}
            record.note(self.states, **setting)
        try:
            over = [note for note in record.notes("walked") if note["table"] == self.states]
            failure = over[-1]["failure"] if over else self._walk(pressures)
            if not over:
                record.note("walked", table=self.states, failure=failure)
            if failure is not None:
                record.fail(self._named(failure))
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
    # ----

    def _go_to(self, target: float) -> None:
        """Find and keep the equilibrium at a back pressure, Pa, with the penetration asked for.

        Raises
        ------
        SolveError
        """
        steps, iterations, count = self.steps, 0, 0
        try:
            way = steps.reach(target)
            last, iterations, count = way.result, way.iterations, way.steps
        except SolveError as error:
            self._go_past_limit(target, error)
            last = steps.settle()
        updates = 0
        while (depth := self.model.pressed.contact_state(steps.q).penetration) > self.model.case.closure.penetration:
            if updates == MOST_UPDATES:
                raise SolveError(
                    f"At {target:.6g} Pa {updates} renewals of the contact multipliers left a penetration of "
                    f"{depth:.2g} m; a larger closure.contact_depth may help."
                )
            self.model.pressed.renew_multipliers(steps.q)
            last = steps.settle()
            self.energy.add(steps.q, target, steps.slope)
            iterations, updates = iterations + last.iterations, updates + 1
        self.energy.settle()
        spectrum = self._watch(target, steps.q)
        found = {"iterations": iterations, "load_steps": count, "multiplier_updates": updates}
        self._keep_state(self.model, steps.q, target, spectrum, last, found, self._restart())

    def _accept(self, pressure: float, q: np.ndarray) -> None:
        """Keep an equilibrium between two back pressures."""
        self.energy.add(q, pressure, self.steps.slope)
        self._watch(pressure, q, point=True)

    def _watch(self, pressure: float, q: np.ndarray, point: bool = False) -> StiffnessSpectrum:
        """Look for buckling at the next equilibrium in every class; keep it as a point of the path if it is one."""
        spectrum = self.own.see(pressure, q)
        if point:
            self._keep_point(pressure, q, float(spectrum.values.real[0]))
        others = {name: watch.see(pressure, q).lowest for name, watch in list(self.watches.items())[1:]}
        if others:
            self.record.note(LOWEST, table=self.points, pressure=float(pressure), lowest=others)
        self._keep_buckling()
        if self.own.before is not None:
            self._keep_before_limit(*self.own.before)
        return spectrum

    def _go_past_limit(self, target: float, error: SolveError) -> None:
        """Arclength from the last equilibrium to the target pressure, or to the first limit point where it is to end.

        Raises
        ------
        SolveError
        """
        steps, pressed, goes_on = self.steps, self.model.pressed, self.model.case.closure.arclength
        start, q = steps.pressure, steps.q
        self.record.progress(f"arclength from {start:.6g} Pa")
        try:
            path = follow_past_limits(pressed, q, start, target, steps.options.newton.tolerance, self.record, goes_on)
        except NotConverged as reason:
            self._keep_before_limit(start, q)
            raise SolveError(f"{error} Arclength did not get under way either: {reason}") from reason
        rising = path.limits and not goes_on
        for pressure, place in path.points[1:-1] if rising else path.points[1:]:
            if rising:
                self._watch(pressure, place, point=True)
                start, q = pressure, place
            else:
                self._keep_point(pressure, place, np.nan, arclength=True)
            self.energy.add(place, pressure, refine=False)
        self.own.found.extend(path.limits)
        self._keep_buckling()
        if path.limits or not path.reached:
            self._keep_before_limit(start, q)
        self.beyond_limit = self.beyond_limit or bool(path.limits)
        for watch in self.watches.values():
            watch.forget()
        steps.pressure, steps.q = path.points[-1]
        steps.slope = None
        if rising:
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
            model, q, last, updates = self._settle_apart(pressure, q)
            spectrum = stiffness_spectrum(model.pressed, q, pressure, self.model.case.closure.eigenvalues)
            found = {"iterations": last.iterations, "load_steps": 0, "multiplier_updates": updates}
            self._keep_state(model, q, pressure, spectrum, last, found, None)
        except SolveError as error:
            self.record.warn(f"The last state before a limit, at {pressure:.6g} Pa, was not described: {error}")

    def _settle_apart(self, pressure: float, q: np.ndarray) -> tuple[ClosureModel, np.ndarray, NewtonResult, int]:
        """Equilibrium with the penetration asked for, on a model of its own: the walk is left as it is."""
        model = replace(self.model, pressed=copy(self.model.pressed))
        pressed, steps, updates = model.pressed, LoadSteps(model.pressed, self.steps.options, pressure, q), 0
        last = steps.settle()
        found = pressed.multiplier, steps.q
        allowed = model.case.closure.penetration
        try:
            while pressed.contact_state(steps.q).penetration > allowed and updates < MOST_UPDATES:
                pressed.renew_multipliers(steps.q)
                last, updates = steps.settle(), updates + 1
        except SolveError:  # the limit lies nearer than what renewed multipliers change
            pressed.multiplier, steps.q = found
            last, updates = steps.settle(), 0
        return model, steps.q, last, updates

    # -- the record
    # ----

    def _keep_point(self, pressure: float, q: np.ndarray, lowest: float, arclength: bool = False) -> None:
        point = Pressed(self.model, q, pressure)
        point.lowest_eigenvalue, point.arclength = lowest, arclength
        self.record.append(self.points, self.record.tables[self.points].row(point))

    def _keep_buckling(self) -> None:
        """Keep what is new of the buckling states of all classes."""
        nodal = self.model.pressed.nodal
        for name, watch in self.watches.items():
            for b in watch.found[self._kept[name] :]:
                row = {"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue}
                if watch is self.own:
                    self.record.append(self.buckling, row | {"nodal": nodal(b.q), "shape": nodal(b.shape)})
                else:
                    self.record.note(BUCKLED_CLASS, table=self.points, symmetry=name, **row)
                    words = symmetry_named(name).words
                    self._warn([f"The wall buckles at {b.pressure:.6g} Pa in class {name}: {words}."])
            self._kept[name] = len(watch.found)

    def _keep_state(
        self,
        model: ClosureModel,
        q: np.ndarray,
        pressure: float,
        spectrum: StiffnessSpectrum,
        last: NewtonResult,
        found: dict[str, int],
        way: dict[str, Any] | None,
    ) -> None:
        """Keep a state; one without restart data, its `way`, is the last before a limit."""
        state, table, lowest = Pressed(model, q, pressure), self.record.tables[self.states], spectrum.lowest
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
        none = {
            name: np.full(table.shapes[f"way/{name}"], np.nan) for name in ("step", "slope", "multiplier", "energy")
        }
        counts = {"path": self.record.rows(self.points), "buckling": self.record.rows(self.buckling)}
        state.way = SimpleNamespace(**(none | (way or {}) | counts))
        self.record.append(self.states, table.row(state))
        self.record.item(state)

    def _restart(self) -> dict[str, Any]:
        """Restart data of the present state."""
        pressed, steps = self.model.pressed, self.steps
        multiplier = np.zeros(pressed.mesh.node_count)
        multiplier[pressed.contact.nodes] = pressed.multiplier
        slope = pressed.nodal(steps.slope)
        return {"step": steps.step, "slope": slope, "multiplier": multiplier, "energy": self.energy.totals}

    def _resume(self) -> int:
        """Stand at the last state that was asked for, if there is one, and say how many there are."""
        record, steps = self.record, self.steps
        rows = [row for row in valid_rows(record, self.states) if not self._value("before_limit", row)]
        last = rows[-1] if rows else None
        void_rows(record, self.states, 0 if last is None else last + 1)
        void_rows(record, self.points, 0 if last is None else int(self._value("way/path", last)))
        void_rows(record, self.buckling, 0 if last is None else int(self._value("way/buckling", last)))
        if last is None:
            return 0
        pressed, restrict = self.model.pressed, self.model.shell.dofs.restrict
        steps.pressure, steps.step = float(self._value("pressure", last)), float(self._value("way/step", last))
        steps.q, steps.slope = restrict(self._value("nodal", last)), restrict(self._value("way/slope", last))
        pressed.multiplier = self._value("way/multiplier", last)[pressed.contact.nodes]
        self.energy.begin(steps.q, steps.pressure, steps.slope)
        self.energy.totals = tuple(self._value("way/energy", last))
        self.beyond_limit = bool(self._value("beyond_limit", last))
        for row in valid_rows(record, self.buckling):
            b = {name: record.value(self.buckling, name, row) for name in ("kind", "pressure", "eigenvalue")}
            q, shape = (restrict(record.value(self.buckling, name, row)) for name in ("nodal", "shape"))
            self.own.found.append(Buckling(str(b["kind"]), float(b["pressure"]), q, shape, float(b["eigenvalue"])))
        self._kept[next(iter(self.watches))] = len(self.own.found)
        self._limit_met = bool(self.own.found)
        for watch in self.watches.values():
            watch.see(steps.pressure, steps.q)
        return len(rows)

    def _value(self, column: str, row: int) -> Any:
        return self.record.value(self.states, column, row)

    # -- what is worth knowing
    # ----

    def _warn(self, sentences: Iterable[str]) -> None:
        for sentence in sentences:
            if not self.compared:
                self.record.warn(sentence)
            elif sentence not in self.record.warnings:
                self.record.warn(self._named(sentence))

    def _named(self, sentence: str) -> str:
        return f"With the supports {self.model.supports}: {sentence}" if self.compared else sentence

    def _warn_of_states(self) -> None:
        """Warnings about the states that were found: material, buckling, faces that overlap."""
        restrict = self.model.shell.dofs.restrict
        rows, found = valid_rows(self.record, self.states), []
        for row in rows:
            pressure, overlap = (float(self._value(name, row)) for name in ("pressure", "overlap"))
            found.append(SimpleNamespace(pressure=pressure, overlap=overlap, q=restrict(self._value("nodal", row))))
        self._warn(state_warnings(self.model, found))
        for row in valid_rows(self.record, self.buckling)[:1]:
            pressure, kind = (self.record.value(self.buckling, name, row) for name in ("pressure", "kind"))
            self._warn([f"The wall buckles at {pressure:.6g} Pa ({kind}); states at higher pressures lie beyond it."])
        worst = max(found, key=lambda state: state.overlap, default=None)
        if worst is not None and worst.overlap > CROSSED * self.model.case.closure.penetration:
            deepest = f"{worst.overlap * 1e3:.2g} mm at {worst.pressure:.6g} Pa"
            why = "because these supports stop the mid-surface and not the faces."
            self._warn([f"The inner faces overlap by up to {deepest}, {why}"])
