"""Back-pressure states: what can be read off their record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.measured import AREA, SHAPE
from ...drawing import views
from ...model.symmetry import equilibria_of
from ...record.header import Header
from ...record.mesh import WholeValve
from ...record.record import Record, plain
from ...record.states import LAYERS
from ...record.table import Column, printed_head, printed_row
from ...record.vtkhdf import Step, layer_field_names, motion
from ...shell.recovery import LayerFields
from ..measured.curves import MeasuredCurve, MeasuredParts
from ..measured.figures import draw_shapes
from ..measured.kept import joined, kept_tables
from ..measured.sections import MeasuredShapes, WallSections
from ..result import StateSteps, StudyResult
from ..session import Session
from ..state import State, states_of
from . import figures
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
from .reversal import Turn
from .safety import (
    ClassBuckling,
    Closing,
    SafetyFactor,
    find_safety,
    first_buckling,
    rated_verdict,
    read_classes,
    sentences,
)
from .valve import ClosureModel, Passage, closure_model, film_leak, layer_maxima


class PressedState(SimpleNamespace):
    """A state under back pressure: the columns `SUMMARY` and `FIELDS` of its row, and what can be asked about it.

    Attributes
    ----------
    results : ClosureResult
    index : int
        Its row in the table of states.
    """

    __eq__, __hash__ = object.__eq__, object.__hash__

    def __repr__(self) -> str:
        shut = "shut" if self.closed else "not shut"
        return f"<PressedState at {self.pressure / 1e3:.6g} kPa: {shut}, {self.contact_force:.4g} N between the walls>"

    @cached_property
    def layers(self) -> LayerFields:
        """Strains and stresses of the layers."""
        record, table = self.results.record, self.results.table(STATES)
        found = {c.name.split("/")[1]: record.value(table, c.name, self.index) for c in LAYERS}
        return LayerFields(record.mesh.layer_names, **found)

    @property
    def passage(self) -> Passage:
        """Passage of the part that is computed."""
        results = self.results
        reference = results.reference_opening / results.mesh.part.copies
        return Passage(results.mesh.z, self.opening, reference, results.case.closure.shut_fraction)

    @cached_property
    def leak(self) -> float:
        """Leak of the whole valve through the gaps that are left, m3/s; 0 where a section is shut all over."""
        mesh, fluid = self.results.mesh, self.results.case.fluid
        x = (mesh.nodes[:, 0] + self.nodal[:, 0])[mesh.rows]
        gap = np.where(self.opening[:, None] > 0.0, self.gap[mesh.rows], 0.0)
        return film_leak(self.pressure, mesh.z, x, gap, mesh.part.copies, fluid.density, fluid.dynamic_viscosity)

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        values = {c.name: getattr(self, c.name) for c in SUMMARY} | {"leak": self.leak}
        extremes = zip(self.results.mesh.layer_titles(), *layer_maxima(self.layers))
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()} | {
            "sealed_intervals": [list(pair) for pair in self.passage.shut_intervals],
            "stiffness_eigenvalues": self.stiffness_eigenvalues.tolist(),
            "layers": [
                {"layer": title, "largest_strain": float(e), "largest_stress": float(s)} for title, e, s in extremes
            ],
        }


@dataclass(frozen=True)
class MeasuredClosure(MeasuredParts):
    """Measurements under back pressure; None for a quantity that was not measured.

    Attributes
    ----------
    passage : MeasuredCurve or None
        Narrowest passage left, m2, over the back pressure.
    shapes : MeasuredShapes or None
        Sections of the wall.
    """

    passage: MeasuredCurve | None = None
    shapes: MeasuredShapes | None = None

    keys = {"passage": "measured_area", "shapes": "measured_sections"}


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
    closing : Closing or None
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
    def closing(self) -> Closing | None:
        turning = self.record.notes("turning")
        if self._prefix or not turning:
            return None
        over = {"halvings": 0, "failure": ""} | next(iter(self.record.notes("turned")), {})
        columns = {c.name: self.record.column(REVERSAL, c.name) for c in SAMPLE}
        rows = valid_rows(self.record, REVERSAL)
        samples = tuple(SimpleNamespace(**{name: plain(values[i]) for name, values in columns.items()}) for i in rows)
        return Closing(samples, Turn.of(self.case), turning[0]["shut_below"], over["halvings"], over["failure"])

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

    def along(self, pressure: np.ndarray, name: str) -> np.ndarray:
        """A column of `columns.POINT` at back pressures (k,), Pa: of states where they are, between the load steps by a
        straight line, from the first to the last one before arclength takes over; NaN beyond.
        """
        known: dict[float, float] = {}
        for point in self.walk:
            if point.arclength or point.pressure <= max(known, default=0.0):
                break
            known[point.pressure] = getattr(point, name)
        # of a state that was asked for the contact is renewed until it holds; load steps do with less
        own = {"lowest_eigenvalue": "lowest_stiffness_eigenvalue"}.get(name, name)
        known |= {state.pressure: getattr(state, own) for state in self.states if not state.beyond_limit}
        if not known:
            return np.full(len(pressure), np.nan)
        places, values = np.array(sorted(known.items())).T
        return np.interp(pressure, places, values, left=np.nan, right=np.nan)

    @cached_property
    def measured(self) -> MeasuredClosure:
        """Measured data beside the states."""
        tables = kept_tables(self.record)
        areas = joined(tables, AREA, "pressure", "area")
        points = joined(tables, SHAPE, "pressure", "z", "face", "x", "y")
        passage = None
        if areas is not None:
            pressure, area = np.array(areas)
            computed = self.along(pressure, "least_opening")
            passage = MeasuredCurve("passage left", "area", pressure, area, computed, ("mm2", 1e6))
        shapes = points and MeasuredShapes.of(points, WallSections(self.mesh, self.states))
        return MeasuredClosure(passage, shapes)

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
            "rated": rated_verdict(self),
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
        columns = self.case.units.columns(SUMMARY)
        lines = [*printed_head(columns), *(printed_row(columns, state) for state in self._all_states), *sentences(self)]
        if self.compared is None:
            return lines
        return [f"Supports: {self.supports}", *lines, f"Supports: {self.compared.supports}", *self.compared.lines()]

    def remarks(self) -> list[str]:
        if self.compared is None:
            return sentences(self)
        parts = (self, self.compared)
        return [line for part in parts for line in (f"Supports: {part.supports}", *sentences(part))]

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
        yield from draw_shapes(self.measured.shapes)
        yield from views.draw_layers(self, pressure)
        if self.compared is not None and self.compared.states:
            for name, draw in self.compared.drawers(pressure):
                yield f"{name}-{self.compared.supports}", draw
            yield "supports-compared", lambda: figures.supports_compared(self, self.compared)

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        return StateSteps(sorted(self.states, key=lambda state: state.pressure), lambda state: _step(state, valve))


def _step(state: PressedState, valve: WholeValve) -> Step:
    """Fields of a state; "time" is the back pressure in Pa."""
    mesh = state.results.mesh
    quantities = {"von_mises": state.layers.von_mises, "largest_stretch": state.layers.stretch[:, :, 1]}
    cells = {"thickness": mesh.thickness}
    for quantity, values in quantities.items():
        cells |= dict(zip(layer_field_names(mesh, quantity), values.T))
    points = motion(mesh, valve, state.nodal)
    points |= {"contact_pressure": state.contact_pressure[valve.node], "gap": state.gap[valve.node]}
    return Step(state.pressure, points, {name: valve.cells(values) for name, values in cells.items()})
