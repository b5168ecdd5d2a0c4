"""The walk over the back pressures of a case, kept in a record while it goes on and taken up again from there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from ...errors import SolveError
from ...model.equilibria import model_warnings, state_warnings
from ...model.symmetry import symmetry_named
from ...record.record import GrowingRecord
from ...record.states import LAYERS
from ...shell.recovery import layer_fields
from .buckling import Buckling
from .class_result import BUCKLED_CLASS, LOWEST
from .columns import BUCKLED, BUCKLING, FIELDS, MOST_EIGENVALUES, PATH, POINT, STATES, SUMMARY, valid_rows, void_rows
from .model import ClosureModel
from .opening import opening
from .path import ClosureOptions, ClosurePath
from .path_point import PathPoint, PathRestart
from .remarks import FoundPlace, overlap_warnings, start_warnings
from .state import ClosureState


class ClosureWalk:
    """The walk of one model.

    Parameters
    ----------
    model : ClosureModel
    record : GrowingRecord
    prefix : str
        Of the tables that the walk is kept in.
    """

    def __init__(self, model: ClosureModel, record: GrowingRecord, prefix: str = ""):
        self.model, self.record, self.compared = model, record, bool(prefix)
        self.states, self.points, self.buckling = (prefix + table for table in (STATES, PATH, BUCKLING))
        self.path = ClosurePath(model, ClosureOptions.of(model.case), record, self._follow)
        self._kept = {self.points: 0, self.buckling: 0}  # of what this walk has found
        self._classes_kept, self._class_buckling_kept = 0, {}
        self._limit_kept = False

    def go(self, pressures: Sequence[float]) -> None:
        """Equilibria at back pressures, Pa, each reached from the one before; those that the record holds are not found
        again. One that is not reached ends the list, for those after it lie beyond it.
        """
        record = self.record
        self._say([*model_warnings(self.model), *start_warnings(self.model)])
        if not record.notes(self.states):
            copies = self.model.mesh.part.copies
            reference = copies * opening(self.model, self.model.pressed.rest()).reference
            record.note(self.states, supports=self.model.supports, reference_opening=reference)
        try:
            over = [note for note in record.notes("walked") if note["table"] == self.states]
            failure = over[-1]["failure"] if over else self._walk(pressures)
            if not over:
                record.note("walked", table=self.states, failure=failure)
            if failure is not None:
                record.fail(self._named(failure))
        finally:
            found = self._found()
            self._say(
                [*state_warnings(self.model, found), *self._buckling_warnings(), *overlap_warnings(self.model, found)]
            )

    def _walk(self, pressures: Sequence[float]) -> str | None:
        """Go over the list, and say why it was not gone to its end."""
        done = self._resume()
        for pressure in pressures[done:]:
            try:
                state = self.path.go_to(pressure)
            except SolveError as error:
                self._follow(self.path)
                return str(error)
            self._reached(state)
        return None

    # -- the record
    # ----

    def _follow(self, path: ClosurePath) -> None:
        """Keep what is new on the path."""
        self._follow_classes(path)
        for table, found, row_of in (
            (self.points, path.points, self._point_row),
            (self.buckling, path.buckling, self._buckling_row),
        ):
            for item in found[self._kept[table] :]:
                self.record.append(table, row_of(item))
            self._kept[table] = len(found)
        if path.before_limit is not None and not self._limit_kept:
            self._limit_kept = True
            self.record.append(self.states, self._state_row(path.before_limit) | self._no_restart())
            self.record.item(path.before_limit)

    def _follow_classes(self, path: ClosurePath) -> None:
        """Keep what is new of the classes of motion that the path does not have."""
        for pressure, lowest in path.classes.lowest[self._classes_kept :]:
            self.record.note(LOWEST, table=self.points, pressure=pressure, lowest=lowest)
        self._classes_kept = len(path.classes.lowest)
        for name, watch in path.classes.watches.items():
            for found in watch.found[self._class_buckling_kept.get(name, 0) :]:
                self.record.note(
                    BUCKLED_CLASS,
                    table=self.points,
                    symmetry=name,
                    kind=found.kind,
                    pressure=found.pressure,
                    eigenvalue=found.eigenvalue,
                )
                self._say(
                    [f"The wall buckles at {found.pressure:.6g} Pa in class {name}: {symmetry_named(name).words}."]
                )
            self._class_buckling_kept[name] = len(watch.found)

    def _reached(self, state: ClosureState) -> None:
        """Keep a state with what it takes to go on from it; what led to it is kept already."""
        at = self.path.restart(state.lowest_stiffness_eigenvalue)
        multiplier = np.zeros(len(state.nodal))
        multiplier[self.model.pressed.contact.nodes] = at.multiplier
        restart = {
            "way/step": at.step,
            "way/slope": self.model.pressed.nodal(at.slope),
            "way/multiplier": multiplier,
            "way/energy": at.energy,
            "way/path": self.record.rows(self.points),
            "way/buckling": self.record.rows(self.buckling),
        }
        self.record.append(self.states, self._state_row(state) | restart)
        self.record.item(state)

    def _resume(self) -> int:
        """Stand at the last state that was asked for, if there is one, and say how many there are."""
        record = self.record
        rows = [row for row in valid_rows(record, self.states) if not self._value("before_limit", row)]
        last = rows[-1] if rows else None
        void_rows(record, self.states, 0 if last is None else last + 1)
        void_rows(record, self.points, 0 if last is None else int(self._value("way/path", last)))
        void_rows(record, self.buckling, 0 if last is None else int(self._value("way/buckling", last)))
        if last is None:
            return 0
        restrict = self.model.shell.dofs.restrict
        buckling = tuple(self._read_buckling())
        self._kept[self.buckling] = len(buckling)
        self.path.resume(
            PathRestart(
                float(self._value("pressure", last)),
                restrict(self._value("nodal", last)),
                restrict(self._value("way/slope", last)),
                self._value("way/multiplier", last)[self.model.pressed.contact.nodes],
                float(self._value("way/step", last)),
                bool(self._value("beyond_limit", last)),
                float(self._value("lowest_stiffness_eigenvalue", last)),
                tuple(self._value("way/energy", last)),
                buckling,
            )
        )
        return len(rows)

    def _read_buckling(self) -> Iterator[Buckling]:
        restrict = self.model.shell.dofs.restrict
        for row in valid_rows(self.record, self.buckling):
            found = {c.name: self.record.value(self.buckling, c.name, row) for c in BUCKLED}
            q, shape = restrict(found["nodal"]), restrict(found["shape"])
            yield Buckling(str(found["kind"]), float(found["pressure"]), q, shape, float(found["eigenvalue"]))

    def _value(self, column: str, row: int) -> Any:
        return self.record.value(self.states, column, row)

    # -- rows
    # ----

    def _state_row(self, state: ClosureState) -> dict[str, Any]:
        row = {c.name: getattr(state, c.name) for c in (*SUMMARY, *FIELDS)}
        values = np.full(MOST_EIGENVALUES, np.nan)
        values[: len(state.stiffness_eigenvalues)] = state.stiffness_eigenvalues
        layers = layer_fields(self.model.shell, self.model.shell.dofs.restrict(state.nodal))
        return row | {"stiffness_eigenvalues": values} | {c.name: getattr(layers, c.name.split("/")[1]) for c in LAYERS}

    def _no_restart(self) -> dict[str, Any]:
        nodes = len(self.model.mesh.nodes)
        counts = {"way/path": self.record.rows(self.points), "way/buckling": self.record.rows(self.buckling)}
        return counts | {
            "way/step": np.nan,
            "way/slope": np.full(self.model.shell.dofs.free.shape, np.nan),
            "way/multiplier": np.full(nodes, np.nan),
            "way/energy": np.full(6, np.nan),
        }

    @staticmethod
    def _point_row(point: PathPoint) -> dict[str, Any]:
        return {c.name: getattr(point, c.name) for c in POINT}

    def _buckling_row(self, found: Buckling) -> dict[str, Any]:
        nodal = self.model.pressed.nodal
        own = {name: getattr(found, name) for name in ("pressure", "kind", "eigenvalue")}
        return own | {"nodal": nodal(found.q), "shape": nodal(found.shape)}

    # -- what is worth knowing
    # ----

    def _say(self, sentences: Iterable[str]) -> None:
        for sentence in sentences:
            if not self.compared:
                self.record.warn(sentence)
            elif sentence not in self.record.warnings:
                self.record.warn(self._named(sentence))

    def _named(self, sentence: str) -> str:
        return f"With the supports {self.model.supports}: {sentence}" if self.compared else sentence

    def _found(self) -> list[FoundPlace]:
        restrict = self.model.shell.dofs.restrict
        return [
            FoundPlace(
                *(float(self._value(name, row)) for name in ("pressure", "overlap")),
                restrict(self._value("nodal", row)),
            )
            for row in valid_rows(self.record, self.states)
        ]

    def _buckling_warnings(self) -> Iterator[str]:
        for row in valid_rows(self.record, self.buckling)[:1]:
            pressure, kind = (self.record.value(self.buckling, name, row) for name in ("pressure", "kind"))
            yield f"The wall buckles at {pressure:.6g} Pa ({kind}); states at higher pressures lie beyond it."
