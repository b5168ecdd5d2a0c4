"""The valve under back pressure: states with the path that leads to them, where the wall buckles, how safe it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.measured import AREA, SHAPE
from ...drawing import views
from ...errors import SolveError
from ...model.symmetry import equilibria_of
from ...record.header import Header
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord, Record, plain
from ...record.states import (
    CONVERGED,
    ENDED,
    LARGEST,
    LAYERS,
    LIP,
    NODAL,
    OPENING,
    PATH_RESTART,
    RESIDUAL,
    WHERE,
    by_node,
    by_row,
    read_layers,
    show_place,
    state_table,
)
from ...record.table import TEXT, Column, Shown, TableSpec, document_of, printed_head, printed_row
from ...record.vtkhdf import Step
from ...shell.recovery import LayerFields
from ..case import Case
from ..comparing import Compared, Comparison, draw_shapes
from ..measured import PASSAGE, Measured, keep_measured
from ..result import StudyResult
from ..session import Session
from ..state import State, pressure_steps, states_of
from ..study import Study, print_rows
from . import figures
from .reversal import OPENED, REVERSAL, SAMPLE, Closing, Turn, closing_valve, run_closing, turn_back
from .safety import (
    ClassBuckling,
    SafetyFactor,
    find_safety,
    first_buckling,
    rated_verdict,
    read_classes,
    sentences,
)
from .valve import CONTACT, HELD_LIPS, ClosureModel, Passage, closure_model, film_leak, layer_maxima
from .walk import BUCKLING, COMPARED, MOST_EIGENVALUES, PATH, STATES, ClosureWalk, valid_rows, void_rows


def _by_node(mesh: MeshData) -> tuple[int, ...]:
    return (len(mesh.nodes),)


def _show_opening(s: Any) -> str:
    return f"{s.least_opening * 1e6:.2f} at {s.least_opening_position * 1e3:.0f}"


def _show_seal(s: Any) -> str:
    return f"{s.lip_seal * 1e3:.1f}+{s.joint_seal * 1e3:.1f}"


_BETWEEN = "Force between the two walls, whole valve"
_LEFT = "Smallest passage left, whole valve"
_SEALED = "Area over which the inner faces press on each other, whole valve"
_FRONT = "How far from the lip the walls have met along the centre line"
_STRAIN = "Largest elongation or shortening of a layer in its plane"
_WATCHED = "Lowest eigenvalue of the tangent stiffness against the mass"
_BALANCE = "Sum of pressure, contact and support forces over the sum of their sizes"
_LAST = Shown("", "", 1, lambda s: "last before the limit" if s.before_limit else "")
#: Columns that every point of a path has, by their names; the first ones of a state are read off `valve.Pressed`.
_MEASURES = {
    c.name: c
    for c in (
        Column("pressure", "Pa", "Back pressure, outside", shown=Shown("pressure", "kPa", 9, ".6g")),
        replace(LARGEST, shown=show_place("displacement", 14, 2)),
        Column("contact_force", "N", _BETWEEN, shown=Shown("contact", "N", 8, ".1f")),
        Column("least_opening", "m^2", _LEFT, shown=Shown("opening left", "mm2 at z", 14, _show_opening)),
        Column("sealed_length", "m", "Length along the axis on which sections are shut"),
        Column(
            "lip_seal", "m", "The part that begins at the lip", shown=Shown("sealed", "lip+joint mm", 12, _show_seal)
        ),
        Column("contact_front", "m", _FRONT, shown=Shown("front", "mm", 7, ".1f")),
        Column("overlap", "m", "Deepest overlap of the inner faces"),
    )
}
_YES = Shown("closed", "", 7, lambda s: "yes" if s.closed else "no")
#: What a user reads off a state; the names are keys of the JSON output.
SUMMARY = (
    _MEASURES["pressure"],
    Column("closed", "", "Some section is shut", "bool", _YES),
    _MEASURES["sealed_length"],
    _MEASURES["lip_seal"],
    Column("joint_seal", "m", "The rest, at the joint of duckbill and saddle and on the saddle"),
    Column("sealed_area", "m^2", _SEALED),
    _MEASURES["contact_front"],
    _MEASURES["contact_force"],
    Column("largest_contact_pressure", "Pa", "Largest contact pressure at a node"),
    Column("contact_nodes", "", "Nodes in contact", "i8"),
    Column("penetration", "m", "Deepest penetration of contact points beyond the plane"),
    _MEASURES["overlap"],
    _MEASURES["least_opening"],
    Column("least_opening_position", "m", "Where it is, from the lip"),
    OPENING,
    LIP,
    _MEASURES["max_displacement"],
    WHERE,
    Column("largest_strain", "", _STRAIN, shown=Shown("strain", "%", 7, ".2f")),
    Column("largest_strain_layer", "", "The layer it occurs in", TEXT),
    Column("largest_stress", "Pa", "Largest von Mises stress of a layer"),
    Column("largest_stress_layer", "", "The layer it occurs in", TEXT),
    Column("lowest_stiffness_eigenvalue", "1/s^2", _WATCHED, shown=Shown("stiffness", "1/s2", 10, ".4g")),
    Column("lowest_symmetric_eigenvalue", "1/s^2", "The same of its symmetric part"),
    Column("asymmetry", "", "Largest entry of K - K' over that of K"),
    Column("stable", "", "Whether the lowest stiffness eigenvalue is positive", "bool"),
    Column("beyond_limit", "", "Whether the state lies beyond a limit point", "bool"),
    Column("force_balance", "", _BALANCE),
    Column("energy_balance", "", "Work less energies over work, along the path with its load steps"),
    CONVERGED,
    Column("iterations", "", "Newton iterations that led here from the state before", "i8"),
    Column("load_steps", "", "Load steps that led here from the state before", "i8"),
    Column("multiplier_updates", "", "Renewals of the contact multipliers", "i8"),
    RESIDUAL,
    *ENDED,
    Column("before_limit", "", "Not asked for: the last state before a limit", "bool", _LAST),
)
_OPENING = "Passage of the computed part between the inner faces at each row"
_EIGENVALUES = "Those nearest to zero, real parts; NaN behind those that were followed"
#: Fields of a state.
FIELDS = (
    NODAL,
    Column("opening", "m^2", _OPENING, shape=by_row),
    Column("contact_pressure", "Pa", "Contact pressure at each node", shape=_by_node),
    Column("gap", "m", "Height of the inner face above the closing plane at each node", shape=_by_node),
    Column("stiffness_eigenvalues", "1/s^2", _EIGENVALUES, shape=(MOST_EIGENVALUES,)),
)
_WORK = "Work, work of renewing multipliers, contact potential, strain energy, defect; number of equilibria in between"
_SLOPE = "Derivative of the displacements and rotations of each node by the pressure"
#: What it takes to go on from a state.
RESTART = (
    Column("way/step", "Pa", "Load step to try next"),
    Column("way/slope", "m/Pa, rad/Pa", _SLOPE, shape=by_node),
    Column("way/multiplier", "Pa", "Contact multiplier of each node; 0 where there is none", shape=_by_node),
    Column("way/energy", "J", _WORK, shape=(6,)),
    Column("way/path", "", "Rows of the path up to the state", "i8"),
    Column("way/buckling", "", "Rows of buckling states up to it", "i8"),
)
POINT = (
    *_MEASURES.values(),
    Column("lowest_eigenvalue", "1/s^2", "Lowest stiffness eigenvalue; NaN where arclength was followed"),
    Column("arclength", "", "Found by arclength", "bool"),
)
BUCKLED = (
    Column("pressure", "Pa", "Critical pressure"),
    Column("kind", "", "limit point or bifurcation", TEXT),
    Column("eigenvalue", "1/s^2", "Lowest stiffness eigenvalue in magnitude"),
    NODAL,
    Column("shape", "", "Buckling shape, displacements and rotations of each node", shape=by_node),
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a back-pressure result on a mesh."""
    walks = {STATES: (*SUMMARY, *FIELDS, *LAYERS, *RESTART), PATH: POINT, BUCKLING: BUCKLED}
    return (
        *(TableSpec.on(mesh, prefix + name, columns) for prefix in ("", COMPARED) for name, columns in walks.items()),
        state_table(OPENED, mesh, PATH_RESTART),
        TableSpec(REVERSAL, SAMPLE, chunk=256),
    )


def run(session: Session, record: GrowingRecord, in_time: bool = False, compare: bool = False) -> None:
    """Equilibria at `closure.pressures` of the case; with `in_time` the turn of its drive, with `compare` the same
    equilibria with the other supports.
    """
    if record.notes("asked"):
        asked = record.notes("asked")[0]
        in_time, compare = asked["in_time"], asked["compare"]
    else:
        record.note("asked", in_time=in_time, compare=compare)
    case, closure = session.case, session.case.closure
    keep_measured(record, "closure.measured", closure.measured, MEASURED, case.fluid.density)
    record.begin("closure", len(closure.pressures) * (2 if compare else 1))
    if case.gravity.is_there:
        record.warn("Gravity has no part in back pressure: wall and fluid weigh nothing in these states.")
    if compare:
        record.item(f"Supports: {closure.supports}")
    if closure.start == "open":
        turn_back(case, record)
    ClosureWalk(closure_model(case), record).go(closure.pressures)
    if in_time:
        _turn_in_time(case, record)
    if compare:
        other = HELD_LIPS if closure.supports == CONTACT else CONTACT
        record.item(f"Supports: {other}")
        ClosureWalk(closure_model(case, other), record, COMPARED).go(closure.pressures)


def _turn_in_time(case: Case, record: GrowingRecord) -> None:
    """Follow the turn of the drive; one that was cut short begins anew."""
    if not record.notes("turned"):
        void_rows(record, REVERSAL, 0)
        model = closing_valve(case)
        record.note("turning", shut_below=model.shut_below)
        halvings, failure = 0, ""
        try:
            halvings, failure = run_closing(model, lambda sample: record.append(REVERSAL, sample), record)
        except SolveError as error:
            failure = str(error)
        record.note("turned", halvings=halvings, failure=failure)
    failure = record.notes("turned")[-1]["failure"]
    if failure:
        record.fail(f"The turn of the drive in time was not followed to its end: {failure}")


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
        return read_layers(self.results.record, self.results.named(STATES), self.index)

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
        extremes = zip(self.results.mesh.layer_titles(), *layer_maxima(self.layers))
        return document_of(SUMMARY, self) | {
            "leak": self.leak,
            "sealed_intervals": [list(pair) for pair in self.passage.shut_intervals],
            "stiffness_eigenvalues": self.stiffness_eigenvalues.tolist(),
            "layers": [
                {"layer": title, "largest_strain": float(e), "largest_stress": float(s)} for title, e, s in extremes
            ],
        }


#: Measurements that belong beside states under back pressure.
MEASURED = {AREA: PASSAGE, SHAPE: None}


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
    walk, buckling : tuples of objects with the columns `POINT` and `BUCKLED`
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

    def named(self, name: str) -> str:
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
        return next(iter(self.record.notes(self.named(STATES))), {})

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
        for index, row in self._rows(STATES, (*SUMMARY, *FIELDS)):
            kept = row["stiffness_eigenvalues"]
            row["stiffness_eigenvalues"] = kept[~np.isnan(kept)]
            found.append(PressedState(**row, results=self, index=index))
        return tuple(found)

    @property
    def states(self) -> tuple[PressedState, ...]:
        return tuple(state for state in self._all_states if not state.before_limit)

    @property
    def before_limit(self) -> PressedState | None:
        return next((state for state in self._all_states if state.before_limit), None)

    @cached_property
    def walk(self) -> tuple[SimpleNamespace, ...]:
        return tuple(SimpleNamespace(**row) for _, row in self._rows(PATH, POINT))

    @cached_property
    def buckling(self) -> tuple[SimpleNamespace, ...]:
        return tuple(SimpleNamespace(**row) for _, row in self._rows(BUCKLING, BUCKLED))

    @cached_property
    def classes(self) -> tuple[ClassBuckling, ...]:
        """Classes of motion other than that of the path, where they were watched."""
        return read_classes(self.record, self.named(PATH))

    @cached_property
    def opened(self) -> tuple[State, ...]:
        return states_of(self, OPENED)

    @cached_property
    def closing(self) -> Closing | None:
        turning = self.record.notes("turning")
        if self._prefix or not turning:
            return None
        over = {"halvings": 0, "failure": ""} | next(iter(self.record.notes("turned")), {})
        samples = tuple(SimpleNamespace(**row) for _, row in self._rows(REVERSAL, SAMPLE))
        return Closing(samples, Turn.of(self.case), turning[0]["shut_below"], over["halvings"], over["failure"])

    @cached_property
    def compared(self) -> ClosureResult | None:
        if self._prefix or not self.record.notes(COMPARED + STATES):
            return None
        return ClosureResult(self.record, None, COMPARED)

    def _rows(self, table: str, columns: Sequence[Column]) -> Iterator[tuple[int, dict[str, Any]]]:
        """Rows of a table of the walk that hold, with their numbers."""
        name = self.named(table)
        data = {c.name: self.record.column(name, c.name) for c in columns}
        for i in valid_rows(self.record, name):
            yield i, {key: plain(values[i]) for key, values in data.items()}

    @property
    def walk_failure(self) -> str | None:
        """Why the list of pressures was not gone to its end."""
        found = [note for note in self.record.notes("walked") if note["table"] == self.named(STATES)]
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
        return min((point.pressure for point in self.walk if point.sealed_length > 0), default=None)

    def at(self, pressure: np.ndarray, name: str) -> np.ndarray:
        """A column of `POINT` at back pressures (k,), Pa: of states where they are, between the load steps by a
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
    def measured(self) -> Measured:
        """Measured data beside the states."""
        return Measured(self, MEASURED)

    @cached_property
    def safety(self) -> SafetyFactor | None:
        """Margin of the valve to its first limit; None if no equilibrium was found."""
        return find_safety(self)

    def summary(self) -> dict[str, Any]:
        own = equilibria_of(self.case.part).name
        softest = self.softest
        document = {
            "supports": self.supports,
            "points": [state.summary() for state in self.states],
            "before_limit": self.before_limit and self.before_limit.summary(),
            "closing_pressure": self.closing_pressure,
            "buckling": [
                {"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue, "symmetry": own}
                for b in self.buckling
            ],
            "critical_pressure": self.critical_pressure,
            "first_buckling": first_buckling(self.critical_pressure, self.classes, own),
            "classes": [part.summary() for part in self.classes],
            "safety": self.safety and self.safety.summary(),
            "rated": rated_verdict(self),
            "softest": softest
            and {"pressure": softest.pressure, "lowest_stiffness_eigenvalue": softest.lowest_eigenvalue},
            "path": {c.name: [getattr(point, c.name) for point in self.walk] for c in POINT},
            "opened": [state.summary() for state in self.opened],
            "reversal": self.closing and self.closing.summary(),
            "reference_opening": self.reference_opening,
            **self.measured.summary(),
            **self.ending(),
        }
        return document if self.compared is None else document | {"compared": self.compared.summary()}

    @property
    def softest(self) -> SimpleNamespace | None:
        """Point of the path, before arclength takes over, with the lowest stiffness eigenvalue."""
        followed = [point for point in self.walk if np.isfinite(point.lowest_eigenvalue)]
        return min(followed, key=lambda point: point.lowest_eigenvalue, default=None)

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
        return pressure_steps(self.states, valve, nodes=("contact_pressure", "gap"))


#: Keys that do not change what a run finds.
_QUIET = tuple(
    f"closure.{key}"
    for key in ("pressures", "measured", "rated_pressure", "max_step", "eigenvalues", "arclength", "symmetry", "start")
)
#: Columns of the path in which runs are compared.
_COMPARED = tuple(
    Compared(name, factor, title, unit, key=f"{name}_difference")
    for name, factor, title, unit in (
        ("lip_seal", 1e3, "Sealed from the lip", "mm"),
        ("contact_force", 1.0, "Force between the walls", "N"),
        ("max_displacement", 1e3, "Largest displacement", "mm"),
        ("least_opening", 1e6, "Narrowest passage", "mm²"),
        ("lowest_eigenvalue", 1e-3, "Lowest stiffness eigenvalue", "10³ 1/s²"),
    )
)


def compare(results: Sequence[ClosureResult]) -> Comparison:
    """Hold several runs against the first.

    Raises
    ------
    CaseError
        If one of them has no state.
    """
    notes = [""]
    for i, result in enumerate(results, 1):
        at, factor = result.critical_pressure, result.safety and result.safety.factor
        buckles = "no buckling on its path" if at is None else f"buckles at {at / 1e3:.6g} kPa"
        notes.append(f"{i}: {buckles}{'' if factor is None else f', safety factor {factor:.3g}'}.")
    draw = partial(figures.draw_together, quantities=_COMPARED, quiet=_QUIET)
    return Comparison.of(results, _QUIET, _COMPARED, draw, notes)


STUDY = Study(
    "closure",
    tables_of,
    run,
    ClosureResult,
    live=lambda case: print_rows(case.units.columns(SUMMARY)),
    compare=compare,
)
