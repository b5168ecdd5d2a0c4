"""Equilibria over a list of pressures, each from the one before, and what can be read off them.

Lips that leave a gap at rest have no pressure that divides shut from open. What is called cracking here is a passage at
the lips that has grown to a stated multiple of that at rest; of a bill that is moulded shut, of what rough faces leave,
which carries nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from ...case.measured import AREA, DISCHARGE, SHAPE, TAPS
from ...case.quantity import head_of
from ...errors import CaseError, SolveError
from ...exchange.files import state_name, write_shapes
from ...model.equilibria import LoadPath, SteadyOptions, first_opening, redescribe, state_warnings
from ...model.load_curve import LimitPoint
from ...model.state import SteadyState, parted_width
from ...model.valve import ValveModel
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord
from ...record.states import PATH_RESTART, shown_summary, state_table
from ...record.table import Column, Shown, TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step
from ...texts import digits
from ..case import Case
from ..comparing import Compared, Comparison
from ..measured import FLOW, LIP_AREA, Measured, keep_measured
from ..result import StudyResult
from ..session import Session, Study, print_rows
from ..state import State, gather_states, pressure_steps, reach_states, states_of
from . import figures

#: Table of the states, and kinds of the notes that hold the cracking pressure, limit points, further equilibria at the
#: pressure of a state, and how much of the lip has parted.
STATES, CRACKING, LIMIT, FURTHER, PARTED = "states", "cracking", "limit point", "further equilibrium", "parted"
#: Beginning of the warning where no cracking pressure is given.
NOT_FOUND = "The cracking pressure was not found:"
#: Measurements that belong beside steady states.
MEASURED = {DISCHARGE: FLOW, AREA: LIP_AREA, SHAPE: None, TAPS: None}
#: Relative accuracy of the cracking pressure, and difference of two displacements below which they are of one state.
_ACCURACY, _SAME = 1e-5, 1e-4
#: Pressures at which a passage that has grown is looked for, over the first at which it has: from one on, so many.
_FIRST, _STEPS = 2.0**-8, 9


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a steady result on a mesh."""
    return (state_table(STATES, mesh, PATH_RESTART),)


def run(session: Session, record: GrowingRecord) -> None:
    """Equilibria at `steady.pressures` of the case.

    A pressure that is not reached is a failure, and the list goes on from the last equilibrium.
    """
    model, steady, case = session.model, session.case.steady, session.case
    keep_measured(record, "steady.measured", steady.measured, MEASURED, case.fluid.density)
    record.begin("steady", len(steady.pressures))
    states: list[SteadyState] = []
    try:
        reach_states(model, case, record, STATES, steady.pressures, states, record.item)
    finally:
        record.warn(*state_warnings(model, states))
    if model.flow.has_fluid and states and not record.notes(CRACKING):
        record.progress("cracking pressure")
        try:
            record.note(CRACKING, **find_cracking(model, states, steady.cracking_area)._asdict())
        except SolveError as error:  # none is given then
            record.warn(f"{NOT_FOUND} {error}")
    if states and LoadPath(model, SteadyOptions.of(case)).follows_curve:
        _note_curve(model, states, max(steady.pressures), record)


def _note_curve(model: ValveModel, states: Sequence[SteadyState], highest: float, record: GrowingRecord) -> None:
    """Keep limit points of the curve of equilibria up to a pressure, Pa, what else it holds there at the pressures of
    the states, and how much of the lip has parted.
    """
    path, case = LoadPath(model, SteadyOptions.of(model.case), observer=record), model.case
    with suppress(SolveError):
        path.go_to(max(state.pressure for state in states))
    limits = path.curve.limits(highest)
    for limit in limits:
        record.note(LIMIT, **limit._asdict())
    span = [limit.pressure for limit in limits]
    for state in states:
        if case.valve.is_preset and not state.is_sealed and state.pressure > model.flow.back:
            width, pressed = parted_width(model, state.q)
            record.note(PARTED, pressure=state.pressure, width=width, pressed=pressed)
        if len(span) < 2 or not min(span) <= state.pressure <= max(span):
            continue
        for q in path.curve.passages(state.pressure, highest):
            other = redescribe(model, replace(state, q=q))
            if abs(other.lip_displacement - state.lip_displacement) > _SAME * abs(state.max_displacement):
                found = {name: getattr(other, name) for name in ("lip_opening", "mass_flow", "max_displacement")}
                record.note(FURTHER, pressure=state.pressure, **found)


def _met(limits: Sequence[LimitPoint], rising: bool) -> list[float]:
    """Limit points, Pa, that a load meets on its way along a curve: each beyond those before it."""
    met: list[float] = []
    for limit in limits if rising else limits[::-1]:
        if limit.highest == rising and (not met or (limit.pressure > met[-1]) == rising):
            met.append(limit.pressure)
    return met


def _told(pressures: Sequence[float]) -> str:
    if len(pressures) > 2:
        return f"{len(pressures)} pressures from {digits(pressures[0], 4)} to {digits(pressures[-1], 4)} Pa"
    return " and ".join(f"{p:.4g}" for p in pressures) + " Pa"


class Cracking(NamedTuple):
    """Cracking pressure: that at which the passage at the lips has grown to a multiple of its area at rest."""

    area_ratio: float  #: The multiple.
    pressure: float | None = None  #: Pa; driving pressure there, over that at rest; None where no state is open so far.
    head: float | None = None  #: m; the same as a head of the fluid.
    sealed: bool = False  #: The faces press on each other at rest, so nothing passes before.

    def sentence(self, highest: float) -> str:
        """Sentence on the cracking pressure; `highest` is the highest pressure among the states, Pa."""
        grown = f"{self.area_ratio:g} times the passage at rest"
        if self.sealed and self.pressure is None:
            return f"Cracking: not up to {highest / 1e3:.4g} kPa; the faces press on each other and nothing flows."
        if self.sealed:
            return (
                f"Cracking pressure: {digits(self.pressure, 4)} Pa ({1e3 * self.head:.3g} mm of the fluid) over that "
                "at rest; before it the faces press on each other and nothing flows."
            )
        if self.pressure is None:
            return f"Cracking: not up to {highest / 1e3:.4g} kPa, where the lips leave less than {grown}."
        return (
            f"Cracking pressure: {digits(self.pressure, 4)} Pa ({1e3 * self.head:.3g} mm of the fluid) over that "
            f"at rest, where the lips leave {grown}; they leave a gap at rest, so some fluid passes before."
        )


def find_cracking(model: ValveModel, states: Iterable[SteadyState], area_ratio: float) -> Cracking:
    """Cracking pressure between rest and the states found of a model with a flow. Raises SolveError if a state on the
    way is not found.
    """
    rest = model.rows.areas(model.nodal(model.rest()))[0]
    wanted = np.log(area_ratio * rest)
    if model.case.valve.is_preset:
        return _first_opening(model, max(state.pressure for state in states), area_ratio)
    open_ = [state for state in states if np.log(max(state.station_area[0], rest)) >= wanted]
    if not open_:
        return Cracking(area_ratio)
    upper = min(open_, key=lambda state: state.pressure)
    path = LoadPath(model, SteadyOptions.of(model.case))
    back = model.flow.back

    @cache
    def missing(drive: float) -> float:
        """Logarithm of the passage over the one wanted, at a pressure over that at rest."""
        if drive == 0.0 and model.weight is None:
            return -np.log(area_ratio)
        return float(np.log(max(path.go_to(back + drive).station_area[0], rest * 1e-6)) - wanted)

    if missing(0.0) >= 0.0:  # the weight alone has opened it
        return Cracking(area_ratio, 0.0, 0.0)
    steps = [0.0, *np.geomspace(_FIRST, 1.0, _STEPS) * (upper.pressure - back)]  # far down at once lips may cross
    number = next((i for i, drive in enumerate(steps[1:], 1) if missing(drive) >= 0.0), None)
    if number is None:
        raise SolveError("Rising pressures lead to another equilibrium than the one that was found.")
    drive = float(brentq(missing, steps[number - 1], steps[number], xtol=1e-12, rtol=_ACCURACY))
    return Cracking(area_ratio, drive, head_of(drive, model.case.fluid.density))


def _first_opening(model: ValveModel, highest: float, area_ratio: float) -> Cracking:
    """Cracking pressure of a bill that is moulded shut, on its curve of equilibria up to a pressure, Pa."""
    LoadPath(model, SteadyOptions.of(model.case)).go_to(highest)
    pressure = first_opening(model, area_ratio)
    if pressure is None or pressure > highest:
        return Cracking(area_ratio, sealed=True)
    drive = pressure - model.flow.back
    return Cracking(area_ratio, drive, head_of(drive, model.case.fluid.density), True)


def flow_at(states: Sequence[SteadyState], pressure: np.ndarray, rest: float, name: str = "mass_flow") -> np.ndarray:
    """A column of states at pressures: their own where they are there, else between them, NaN beyond them.

    Flows go with powers of what drives them, so a monotone cubic runs through their logarithms.

    Parameters
    ----------
    states : sequence of SteadyState
    pressure : (k,) array, Pa
    rest : float, Pa
        Where nothing flows.
    name : str
        A column that is positive where something flows.
    """
    known = {state.pressure: getattr(state, name) for state in states}
    found = np.array([known.get(p, np.nan) for p in pressure])
    points = np.array(sorted((p, flow) for p, flow in known.items() if p > rest and flow > 0))
    asked = np.isnan(found) & (np.asarray(pressure) > rest)
    if len(points) > 1 and asked.any():
        curve = PchipInterpolator(np.log(points[:, 0] - rest), np.log(points[:, 1]), extrapolate=False)
        found[asked] = np.exp(curve(np.log(np.asarray(pressure)[asked] - rest)))
    return found


# -- for people


def _hydraulic(name: str, title: str, unit: str, width: int, form: str = ".4g") -> Column:
    """Printed column of the hydraulics of a state."""
    return Column(name, "", "", shown=Shown(title, unit, width, lambda s: f"{getattr(s.hydraulics, name):{form}}"))


#: Of the line in front, and of the pipe behind, where there is one.
_LINE = (_hydraulic("supply_head", "supply", "m", 8), _hydraulic("line_loss", "line loss", "m", 9))
_TAIL = (_hydraulic("recovered_head", "recovered", "m", 9), _hydraulic("tail_loss", "pipe loss", "m", 9))
_VALVE = (
    Column("flange_pressure", "", "", shown=Shown("pressure", "static kPa", 10, ".6g")),
    _hydraulic("total_head", "total head", "m", 10),
    _hydraulic("head_loss", "loss", "m", 8),
    _hydraulic("flange_velocity", "at the flange", "m/s", 13),
    _hydraulic("loss_coefficient", "K", "", 8),
    _hydraulic("discharge_coefficient", "Cd", "", 7, ".4f"),
    _hydraulic("kv", "Kv", "m3/h", 8),
    _hydraulic("cv", "Cv", "gpm", 8),
)


def hydraulic_lines(case: Case, states: Sequence[State]) -> list[str]:
    """Table of the states that flow, and what it supposes."""
    flowing = [state for state in states if state.hydraulics is not None]
    if not flowing:
        return []
    columns = case.units.columns((*(_LINE if case.has_line else ()), *_VALVE, *(_TAIL if case.has_tail else ())))
    said = [_outlet_sentence(case)]
    if case.downstream.pressure:
        said[0] += f" Downstream are {case.downstream.pressure / 1e3:.4g} kPa, and heads are over the surroundings."
    if case.has_line:
        line = "Supply: total head at the far end of the line; what follows the line loss is of the valve alone."
        said.insert(0, line)
    return [*printed_head(columns), *(printed_row(columns, state) for state in flowing), *said]


def _outlet_sentence(case: Case) -> str:
    if not case.has_tail:
        return "Free discharge: the energy of the jet is lost, nothing is recovered."
    behind, lost = case.downstream, "head as Borda and Carnot have it"
    if behind.expansion_loss is not None:
        lost = f"{behind.expansion_loss:g} of its velocity head"
    pipe = f"a pipe of {1e3 * behind.pipe_diameter:.4g} mm"
    return f"Into {pipe}: the jet widens and loses {lost}; K and Kv are up to behind that."


class SteadyResult(StudyResult):
    """Equilibria in the order they were found.

    Attributes
    ----------
    states : tuple of State
    """

    kind = "steady"

    @cached_property
    def states(self) -> tuple[State, ...]:
        return states_of(self, STATES)

    @property
    def cracking(self) -> Cracking | None:
        """Cracking pressure at which the valve begins to open; None without a flow."""
        notes = self.record.notes(CRACKING)
        return Cracking(**{name: notes[-1][name] for name in Cracking._fields if name in notes[-1]}) if notes else None

    @property
    def limits(self) -> list[LimitPoint]:
        """Limit points of the curve of equilibria up to the highest pressure, in its order."""
        return [LimitPoint(note["pressure"], note["highest"]) for note in self.record.latest(LIMIT)]

    @cached_property
    def measured(self) -> Measured:
        """Measured data beside the states."""
        return Measured(self, MEASURED)

    def at(self, pressure: np.ndarray, name: str) -> np.ndarray:
        """A column of the states at pressures (k,), Pa; see `flow_at`."""
        return flow_at(self.states, pressure, self.case.rest_pressure, name)

    def only(self, *states: State) -> SteadyResult:
        """A result with some of its states."""
        return gather_states(self, states)

    def nearest(self, pressure: float) -> State:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    def summary(self) -> dict[str, Any]:
        """Keys as scripts rely on, in SI units."""
        cracking = self.cracking and self.cracking._asdict()
        if cracking is not None and not cracking["sealed"]:
            del cracking["sealed"]
        states = {"points": [state.summary() for state in self.states], "cracking": cracking}
        if self.limits:
            states["limit_points"] = [limit._asdict() for limit in self.limits]
            further = self.record.latest(FURTHER)
            states["further_equilibria"] = [{name: note[name] for name in _FURTHER} for note in further]
        return states | self.measured.summary() | self.ending()

    def lines(self) -> list[str]:
        columns = shown_summary(self.case)
        return [*printed_head(columns), *(printed_row(columns, state) for state in self.states), *self.remarks()]

    def remarks(self) -> list[str]:
        lines, cracking = hydraulic_lines(self.case, self.states), self.cracking
        if cracking is not None and self.states:
            lines.append(cracking.sentence(max(state.pressure for state in self.states)))
        lines += self._parted_sentences() + self._limit_sentences()
        return [*lines, *self.measured.sentences()]

    def _parted_sentences(self) -> list[str]:
        part = [note for note in self.record.latest(PARTED) if 0 < note["width"] < note["pressed"] * (1 - 1e-9)]
        return [
            f"At {digits(note['pressure'], 4)} Pa {1e3 * note['width']:.3g} of the {1e3 * note['pressed']:.3g} mm of "
            "the lips that touch at rest have parted; the rest is pressed."
            for note in part
        ]

    def _limit_sentences(self) -> list[str]:
        """Sentences on limit points and on what else is in equilibrium at the pressures of the states."""
        if not self.limits:
            return []
        high = [limit.pressure for limit in self.limits if limit.highest]
        low = [limit.pressure for limit in self.limits if not limit.highest]
        up, down = (_told(_met(self.limits, rising)) for rising in (True, False))
        back = f"; one that falls jumps back at {down}" if low else ""
        rows = ""
        if len(high) > 1 and len(low) > 1 and self.case.valve.is_preset:
            rows = (
                f" There are {len(high)} such pairs between {digits(min(low), 4)} and {digits(max(high), 4)} Pa, as "
                "the faces part row by row of the mesh; a finer one has fewer."
            )
        said = [
            f"Limit points: a pressure that rises leaves the curve of equilibria at {up} and jumps "
            f"to where it goes on{back}. The states are those of a pressure that rises slowly from rest." + rows
        ]
        for note in self.record.latest(FURTHER):
            said.append(
                f"At {digits(note['pressure'], 4)} Pa there is another equilibrium, with a lip opening of "
                f"{1e3 * note['lip_opening']:.3g} mm, {note['mass_flow']:.4g} kg/s and displacements up to "
                f"{1e3 * note['max_displacement']:.3g} mm."
            )
        return said

    def _missed(self, lost: int) -> str:
        if not self.states:
            return "No pressure was reached"
        kept = f"; those states are kept in {self.path}" if self.path else ""
        return f"{len(self.states)} of {len(self.case.steady.pressures)} pressures were reached{kept}"

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        return pressure_steps(self.states, valve, rows=("pressure", "velocity"))

    def export_shapes(
        self, folder: str | Path = ".", format: str = "stl", shapes: Sequence[str] = (), quarter: bool = False
    ) -> list[Path]:
        """Write faces of the wall, the wall and the fluid inside of each state as STL (m) or STEP (mm); see
        `dbvfiv.exchange.files.write_shapes`.
        """
        written = []
        for state in self.states:
            name = state_name(self.header.name, state.pressure)
            written += write_shapes(self.mesh, state.nodal, folder, name, format, shapes, quarter)
        return written


#: What is said of a further equilibrium.
_FURTHER = ("pressure", "lip_opening", "mass_flow", "max_displacement")
#: Keys that do not change what a run finds.
_QUIET = tuple(f"steady.{key}" for key in ("pressures", "measured", "cracking_area", "max_iterations", "min_step"))
_COMPARED = (Compared("mass_flow"), Compared("volume_flow", 1e3, unit="L/s", share=True, key="difference"))


def compare(results: Sequence[SteadyResult]) -> Comparison:
    """Hold the flows of several runs against the first. Raises CaseError if one of them has no flow or no state."""
    for result in results:
        if result.case.drive.kind != "flow":
            name = str(result.path or result.header.name)
            raise CaseError(f"{name!r} holds states without flow, so there is no discharge to compare.")
    places = sorted({result.case.pressure_at for result in results})
    remark = f"The pressures are not of one place: {' and '.join(places)}." if len(places) > 1 else ""
    return Comparison.of(results, _QUIET, _COMPARED, partial(figures.draw_together, quiet=_QUIET), remark=remark)


STUDY = Study(
    "steady", tables_of, run, SteadyResult, live=lambda case: print_rows(shown_summary(case)), compare=compare
)
