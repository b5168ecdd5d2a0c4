"""The valve under back pressure: states with the path that leads to them, where the wall buckles, how safe it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...case.measured import AREA, SHAPE
from ...model.closed import ClosedValve, Passage
from ...model.supports import HELD_LIPS
from ...model.symmetry import equilibria_of
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord
from ...record.states import (
    CONVERGED,
    ENDED,
    LARGEST,
    LAYERS,
    LIP,
    NODAL,
    OPENING,
    RESIDUAL,
    WHERE,
    by_node,
    by_row,
    read_layers,
    show_place,
)
from ...record.table import TEXT, Column, Shown, TableSpec, document_of, printed_head, printed_row
from ...record.vtkhdf import Step, faces
from ...shell.recovery import LayerFields
from ..comparing import Compared, Comparison
from ..measured import PASSAGE, Measured, keep_measured
from ..result import StudyResult
from ..session import Session, Study, print_rows
from ..state import pressure_steps
from . import figures
from .safety import (
    ClassBuckling,
    SafetyFactor,
    buckles_first,
    find_safety,
    rated_verdict,
    read_classes,
    rising_points,
    sentences,
)
from .walk import BUCKLING, MOST_EIGENVALUES, PATH, STATES, ClosureWalk, film_leak, layer_maxima, rows_to_keep


def _by_node(mesh: MeshData) -> tuple[int, ...]:
    return (len(mesh.nodes),)


_SEAL = Shown("sealed", "lip+joint mm", 12, lambda s: f"{s.lip_seal * 1e3:.1f}+{s.joint_seal * 1e3:.1f}")
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
        Column("least_opening", "m^2", _LEFT, shown=Shown("opening left", "mm2", 12, ".2f")),
        Column("sealed_length", "m", "Length along the axis on which sections are shut"),
        Column("lip_seal", "m", "The part that begins at the lip", shown=_SEAL),
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
    Column("least_opening_position", "m", "Where it is, from the lip", shown=Shown("at z", "mm", 5, ".0f")),
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
_WORK = "Work of the pressure, energy gained by wall and contact, and what is missing"
_SLOPE = "Derivative of the displacements and rotations of each node by the pressure"
#: What it takes to go on from a state.
RESTART = (
    Column("way/step", "Pa", "Load step to try next"),
    Column("way/slope", "m/Pa, rad/Pa", _SLOPE, shape=by_node),
    Column("way/energy", "J", _WORK, shape=(3,)),
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
    return tuple(TableSpec.on(mesh, name, columns) for name, columns in walks.items())


def run(session: Session, record: GrowingRecord) -> None:
    """Equilibria at `closure.pressures` of the case."""
    case, closure = session.case, session.case.closure
    keep_measured(record, "closure.measured", closure.measured, MEASURED, case.fluid.density)
    record.begin("closure", len(closure.pressures))
    if case.gravity.is_there:
        record.warn("Gravity has no part in back pressure: wall and fluid weigh nothing in these states.")
    ClosureWalk(ClosedValve(case), record).go(closure.pressures)


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
        return read_layers(self.results.record, STATES, self.index)

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
        x = faces(mesh, self.nodal)[0][mesh.rows, 0]
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

    Attributes
    ----------
    states : tuple of PressedState
        At the back pressures asked for.
    before_limit : PressedState or None
        Last state before the first limit.
    walk, buckling : tuples of objects with the columns `POINT` and `BUCKLED`
    """

    kind = "closure"

    @cached_property
    def model(self) -> ClosedValve:
        """The model under back pressure; rebuilt on first use."""
        return ClosedValve(self.header.rebuildable_case())

    @property
    def supports(self) -> str:
        """Either "contact" or "held-lips"."""
        return self.case.closure.supports

    @property
    def reference_opening(self) -> float:
        """Passage between the inner faces of the lip at rest, of lips that stand apart in touch, whole valve, m2."""
        return float(next(iter(self.record.notes(STATES)), {}).get("reference_opening", np.nan))

    @cached_property
    def _all_states(self) -> tuple[PressedState, ...]:
        found = []
        for index, row in enumerate(self._rows(STATES, (*SUMMARY, *FIELDS))):
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
        return tuple(SimpleNamespace(**row) for row in self._rows(PATH, POINT))

    @cached_property
    def buckling(self) -> tuple[SimpleNamespace, ...]:
        return tuple(SimpleNamespace(**row) for row in self._rows(BUCKLING, BUCKLED))

    @cached_property
    def classes(self) -> tuple[ClassBuckling, ...]:
        """Classes of motion other than that of the path, where they were watched."""
        return read_classes(self.record)

    def _rows(self, table: str, columns: tuple[Column, ...]) -> list[dict[str, Any]]:
        """Rows of a table of the walk."""
        return self.record.table_rows(TableSpec(table, columns))

    @property
    def walk_failure(self) -> str | None:
        """Why the list of pressures was not gone to its end."""
        found = self.record.notes("walked")
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
        """Pressure on the path, Pa, up to which the load had to rise for some section to be shut; 0 for a bill that is
        moulded shut; None if none was, or supports hold the lips.
        """
        if self.supports == HELD_LIPS:
            return None
        if self.case.valve.is_preset:
            return 0.0
        highest = 0.0
        for point in self.walk:
            if point.sealed_length > 0:
                return max(highest, point.pressure)
            highest = max(highest, point.pressure)
        return None

    def at(self, pressure: np.ndarray, name: str) -> np.ndarray:
        """A column of `POINT` at back pressures (k,), Pa: of states where they are, between the load steps by a
        straight line, from the first to the last one before arclength takes over; NaN beyond.
        """
        known = {point.pressure: getattr(point, name) for point in rising_points(self)}
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
        softest, first = self.softest, buckles_first(self)
        return {
            "supports": self.supports,
            "points": [state.summary() for state in self.states],
            "before_limit": self.before_limit and self.before_limit.summary(),
            "closing_pressure": self.closing_pressure,
            "buckling": [
                {"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue, "symmetry": own}
                for b in self.buckling
            ],
            "critical_pressure": self.critical_pressure,
            "first_buckling": first and {"pressure": first.pressure, "symmetry": first.symmetry},
            "classes": [part.summary() for part in self.classes],
            "safety": self.safety and self.safety.summary(),
            "rated": rated_verdict(self),
            "softest": softest
            and {"pressure": softest.pressure, "lowest_stiffness_eigenvalue": softest.lowest_eigenvalue},
            "path": {c.name: [getattr(point, c.name) for point in self.walk] for c in POINT},
            "reference_opening": self.reference_opening,
            **self.measured.summary(),
            **self.ending(),
        }

    @property
    def softest(self) -> SimpleNamespace | None:
        """Point of the path, before arclength takes over, with the lowest stiffness eigenvalue."""
        return min(rising_points(self), key=lambda point: point.lowest_eigenvalue, default=None)

    # -- for people

    def lines(self) -> list[str]:
        columns = self.case.units.columns(SUMMARY)
        return [*printed_head(columns), *(printed_row(columns, state) for state in self._all_states), *sentences(self)]

    def remarks(self) -> list[str]:
        return sentences(self)

    def _missed(self, lost: int) -> str:
        asked = len(self.case.closure.pressures)
        few = f"{len(self.states)} of {asked} back pressures were reached" if len(self.states) < asked else ""
        kept = f"; what was found is kept in {self.path}" if self.path else ""
        return f"{few or 'Not everything was reached'}{kept}"

    # -- in space

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        return pressure_steps(self.states, valve, nodes=("contact_pressure", "gap"))


#: Keys that do not change what a run finds.
_QUIET = tuple(
    f"closure.{key}"
    for key in ("pressures", "measured", "rated_pressure", "max_step", "eigenvalues", "arclength", "symmetry")
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
    """Hold several runs against the first. Raises CaseError if one of them has no state."""
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
    rows_to_keep=rows_to_keep,
    live=lambda case: print_rows(case.units.columns(SUMMARY)),
    compare=compare,
)
