"""Back-pressure states: what their file holds and what can be read off them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...drawing import views
from ...model.symmetry import equilibria_of
from ...record.header import Header
from ...record.mesh import WholeValve
from ...record.record import Record, plain
from ...record.table import Column, printed_head, printed_row
from ...record.vtkhdf import Step
from ..measured.figures import draw_shapes
from ..result import StudyResult
from ..session import Session
from ..state import State, states_of
from . import curves, figures
from .class_result import ClassBuckling, first_buckling, read_classes
from .closing import ClosingResult, ClosingSample, Turn
from .columns import (
    BUCKLED,
    BUCKLING,
    COMPARED,
    FIELDS,
    OPENED,
    PATH,
    POINT,
    REVERSAL,
    SAMPLE,
    STATES,
    SUMMARY,
    valid_rows,
)
from .measured import MeasuredClosure, measured_closure
from .model import ClosureModel, closure_model
from .pressed_state import PressedState
from .printed import verdict
from .safety import SafetyFactor, find_safety
from .steps import ClosureSteps


class ClosureResult(StudyResult):
    """States under back pressure in the order they were found, with the path that led to them.

    Parameters
    ----------
    record : Record
    session : Session, optional
    prefix : str
        Of the tables of the walk: those with the other supports have one.

    Attributes
    ----------
    states : tuple of PressedState
        At the back pressures asked for.
    before_limit : PressedState or None
        Last state before the first limit.
    walk, buckling : tuples of objects with the columns of `columns.POINT` and `columns.BUCKLED`
    opened : tuple of State
        Of an open start, steady states of the flow as its pressure falls.
    closing : ClosingResult or None
        History of the valve while its drive turned round, where that was asked for.
    compared : ClosureResult or None
        The same with the other supports, where that was asked for.
    """

    kind = "closure"

    def __init__(self, record: Record, session: Session | None = None, prefix: str = ""):
        super().__init__(record, session)
        self._prefix = prefix

    def table(self, name: str) -> str:
        """Name of a table of the walk in the record."""
        return self._prefix + name

    @property
    def header(self) -> Header:
        header = self.record.header
        if not self._prefix or not self._setting:
            return header
        return replace(header, case=header.case.replace({"closure.supports": self.supports}))

    @cached_property
    def model(self) -> ClosureModel:
        """The model under back pressure; rebuilt on first use."""
        return closure_model(self.header.rebuildable_case())

    @cached_property
    def _setting(self) -> dict[str, Any]:
        found = self.record.notes(self.table(STATES))
        return found[0] if found else {}

    @property
    def supports(self) -> str:
        """Either "contact" or "held-lips"."""
        return self._setting.get("supports", self.record.header.case.closure.supports)

    @property
    def reference_opening(self) -> float:
        """Passage between the inner faces of the lip at rest, whole valve, m2."""
        return float(self._setting.get("reference_opening", np.nan))

    @cached_property
    def _all_states(self) -> tuple[PressedState, ...]:
        found = []
        for row in self._rows(STATES, (*SUMMARY, *FIELDS)):
            values, index = row
            kept = values["stiffness_eigenvalues"]
            values["stiffness_eigenvalues"] = kept[~np.isnan(kept)]
            found.append(PressedState(**values, results=self, index=index))
        return tuple(found)

    @property
    def states(self) -> tuple[PressedState, ...]:
        return tuple(state for state in self._all_states if not state.before_limit)

    @property
    def before_limit(self) -> PressedState | None:
        return next((state for state in self._all_states if state.before_limit), None)

    @cached_property
    def walk(self) -> tuple[SimpleNamespace, ...]:
        return tuple(SimpleNamespace(**row) for row, _ in self._rows(PATH, POINT))

    @cached_property
    def buckling(self) -> tuple[SimpleNamespace, ...]:
        return tuple(SimpleNamespace(**row) for row, _ in self._rows(BUCKLING, BUCKLED))

    @cached_property
    def classes(self) -> tuple[ClassBuckling, ...]:
        """Classes of motion other than that of the path, where they were watched."""
        return read_classes(self.record, self.table(PATH))

    @cached_property
    def opened(self) -> tuple[State, ...]:
        return states_of(self, OPENED)

    @cached_property
    def closing(self) -> ClosingResult | None:
        turning = self.record.notes("turning")
        if self._prefix or not turning:
            return None
        over = {"halvings": 0, "failure": ""} | next(iter(self.record.notes("turned")), {})
        columns = {c.name: self.record.column(REVERSAL, c.name) for c in SAMPLE}
        rows = valid_rows(self.record, REVERSAL)
        samples = tuple(ClosingSample(**{name: plain(values[i]) for name, values in columns.items()}) for i in rows)
        return ClosingResult(samples, Turn.of(self.case), turning[0]["shut_below"], over["halvings"], over["failure"])

    @cached_property
    def compared(self) -> ClosureResult | None:
        if self._prefix or not self.record.notes(COMPARED + STATES):
            return None
        return ClosureResult(self.record, None, COMPARED)

    def _rows(self, table: str, columns: Sequence[Column]) -> list[tuple[dict[str, Any], int]]:
        """Rows of a table of the walk that hold, with their numbers."""
        name = self.table(table)
        data = {c.name: self.record.column(name, c.name) for c in columns}
        return [({key: plain(values[i]) for key, values in data.items()}, i) for i in valid_rows(self.record, name)]

    @property
    def walk_failure(self) -> str | None:
        """Why the list of pressures was not gone to its end."""
        found = [note for note in self.record.notes("walked") if note["table"] == self.table(STATES)]
        return found[-1]["failure"] if found else None

    def nearest(self, pressure: float) -> PressedState:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    @property
    def critical_pressure(self) -> float | None:
        """Lowest back pressure at which the wall buckles on the path followed, Pa; None if it does not."""
        return self.buckling[0].pressure if self.buckling else None

    @property
    def closing_pressure(self) -> float | None:
        """Lowest pressure on the path, Pa, at which some section was shut; None if none was."""
        shut = [point.pressure for point in self.walk if point.sealed_length > 0]
        return min(shut) if shut else None

    @cached_property
    def measured(self) -> MeasuredClosure:
        """Measured data beside the states."""
        return measured_closure(self)

    @cached_property
    def safety(self) -> SafetyFactor | None:
        """Margin of the valve to its first limit; None if no equilibrium was found."""
        return find_safety(self)

    def summary(self) -> dict[str, Any]:
        followed = [point for point in self.walk if np.isfinite(point.lowest_eigenvalue)]
        softest = min(followed, key=lambda point: point.lowest_eigenvalue, default=None)
        own = equilibria_of(self.case.part).name
        document = {
            "supports": self.supports,
            "points": [state.summary() for state in self.states],
            "before_limit": None if self.before_limit is None else self.before_limit.summary(),
            "closing_pressure": self.closing_pressure,
            "buckling": [
                {"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue, "symmetry": own}
                for b in self.buckling
            ],
            "critical_pressure": self.critical_pressure,
            "first_buckling": first_buckling(self.critical_pressure, self.classes, own),
            "classes": [part.summary() for part in self.classes],
            "safety": None if self.safety is None else self.safety.summary(),
            "softest": {"pressure": softest.pressure, "lowest_stiffness_eigenvalue": softest.lowest_eigenvalue}
            if softest
            else None,
            "path": {c.name: [getattr(point, c.name) for point in self.walk] for c in POINT},
            "opened": [state.summary() for state in self.opened],
            "reversal": None if self.closing is None else self.closing.summary(),
            "reference_opening": self.reference_opening,
            **self.measured.summary(),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }
        return document if self.compared is None else document | {"compared": self.compared.summary()}

    # -- for people
    # ----

    def lines(self) -> list[str]:
        lines = [*printed_head(SUMMARY), *(printed_row(SUMMARY, state) for state in self._all_states), *verdict(self)]
        if self.compared is None:
            return lines
        return [f"Supports: {self.supports}", *lines, f"Supports: {self.compared.supports}", *self.compared.lines()]

    def remarks(self) -> list[str]:
        if self.compared is None:
            return verdict(self)
        parts = (self, self.compared)
        return [line for part in parts for line in (f"Supports: {part.supports}", *verdict(part))]

    def shortfall(self) -> str | None:
        if not self.failures:
            return None
        asked = len(self.case.closure.pressures)
        parts = [part for part in (self, self.compared) if part is not None]
        short = [f"{len(p.states)} of {asked} back pressures were reached" for p in parts if len(p.states) < asked]
        kept = f"; what was found is kept in {self.path}" if self.path else ""
        return f"{', '.join(short) or 'Not everything was reached'}{kept}"

    # -- in space
    # ----

    def drawers(self, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
        """Figures over the pressure, and of one state: that of the highest pressure unless another is chosen."""
        if not self.states:
            return
        yield from figures.draw(self)
        yield from curves.draw(self)
        yield from draw_shapes(self.measured.shapes)
        yield from views.draw_layers(self, pressure)
        if self.compared is not None and self.compared.states:
            for name, draw in self.compared.drawers(pressure):
                yield f"{name}-{self.compared.supports}", draw
            yield "supports-compared", lambda: curves.supports_compared(self, self.compared)

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        return ClosureSteps(sorted(self.states, key=lambda state: state.pressure), valve)
