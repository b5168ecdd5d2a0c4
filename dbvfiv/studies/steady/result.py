"""Equilibria over a list of pressures: what their file holds, and what can be read off them.

The lips leave a gap at rest, so no pressure divides shut from open. What is called cracking here is a passage at the
lips that has grown to a stated multiple of that at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator

from ...case.measured import AREA, DISCHARGE, SHAPE, TAPS
from ...drawing import views
from ...model.state import SteadyState
from ...record.mesh import MeshData, WholeValve
from ...record.states import PATH_RESTART, shown_summary, state_table
from ...record.table import Column, Shown, TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step, layer_field_names, motion
from ..case import Case
from ..measured.curves import MeasuredCurve, MeasuredParts, MeasuredTaps, lacking, state_at
from ..measured.figures import draw_shapes
from ..measured.kept import joined, kept_tables
from ..measured.sections import MeasuredShapes, WallSections
from ..result import StateSteps, StudyResult
from ..state import State, gather_states, states_of
from . import figures


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


#: Kind of the note of a record that holds the cracking pressure.
CRACKING = "cracking"
#: Relative accuracy of the pressure.
_ACCURACY = 1e-5


@dataclass(frozen=True)
class Cracking:
    """Cracking pressure: that at which the passage has grown to a multiple of its area at rest.

    Attributes
    ----------
    area_ratio : float
        The multiple.
    pressure : float or None, Pa
        Driving pressure there, over the pressure downstream; None where no state is open so far.
    head : float or None, m
        The same as a head of the fluid.
    """

    area_ratio: float
    pressure: float | None
    head: float | None

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers."""
        return asdict(self)

    def sentence(self, highest: float) -> str:
        """Sentence on the cracking pressure; `highest` is the highest pressure among the states, Pa."""
        grown = f"{self.area_ratio:g} times the passage at rest"
        if self.pressure is None:
            return f"Cracking: not up to {highest / 1e3:.4g} kPa, where the lips leave less than {grown}."
        return (
            f"Cracking pressure: {self.pressure:.4g} Pa ({1e3 * self.head:.3g} mm of the fluid) over that downstream, "
            f"where the lips leave {grown}; they leave a gap at rest, so some fluid passes before."
        )


#: Of the line in front; where there is one.
_LINE = (
    Column("supply_head", "", "", shown=Shown("supply", "m", 8, lambda s: f"{s.hydraulics.supply_head:.4g}")),
    Column("line_loss", "", "", shown=Shown("line loss", "m", 9, lambda s: f"{s.hydraulics.line_loss:.4g}")),
)
#: Of the pipe behind; where there is one.
_TAIL = (
    Column("recovered", "", "", shown=Shown("recovered", "m", 9, lambda s: f"{s.hydraulics.recovered_head:.4g}")),
    Column("tail_loss", "", "", shown=Shown("pipe loss", "m", 9, lambda s: f"{s.hydraulics.tail_loss:.4g}")),
)
_VALVE = tuple(
    Column(name, "", "", shown=shown)
    for name, shown in (
        ("pressure", Shown("pressure", "static kPa", 10, lambda s: f"{s.flange_pressure / 1e3:.6g}")),
        ("total_head", Shown("total head", "m", 10, lambda s: f"{s.hydraulics.total_head:.4g}")),
        ("head_loss", Shown("loss", "m", 8, lambda s: f"{s.hydraulics.head_loss:.4g}")),
        ("flange_velocity", Shown("at the flange", "m/s", 13, lambda s: f"{s.hydraulics.flange_velocity:.4g}")),
        ("loss_coefficient", Shown("K", "", 8, lambda s: f"{s.hydraulics.loss_coefficient:.4g}")),
        ("discharge_coefficient", Shown("Cd", "", 7, lambda s: f"{s.hydraulics.discharge_coefficient:.4f}")),
        ("kv", Shown("Kv", "m3/h", 8, lambda s: f"{s.hydraulics.kv:.4g}")),
        ("cv", Shown("Cv", "gpm", 8, lambda s: f"{s.hydraulics.cv:.4g}")),
    )
)


def hydraulic_lines(case: Case, states: Sequence[State]) -> list[str]:
    """Table of the states that flow, and what it supposes."""
    flowing = [state for state in states if state.hydraulics is not None]
    if not flowing:
        return []
    columns = case.units.columns((*(_LINE if case.has_line else ()), *_VALVE, *(_TAIL if case.has_tail else ())))
    rows = [printed_row(columns, state) for state in flowing]
    said = [_outlet_sentence(case)]
    if case.downstream.pressure:
        said[0] += f" Downstream are {case.downstream.pressure / 1e3:.4g} kPa, and heads are over the surroundings."
    if case.has_line:
        said.insert(
            0, "Supply: total head at the far end of the line; what follows the line loss is of the valve alone."
        )
    return [*printed_head(columns), *rows, *said]


def _outlet_sentence(case: Case) -> str:
    if not case.has_tail:
        return "Free discharge: the energy of the jet is lost, nothing is recovered."
    pipe = f"a pipe of {1e3 * case.downstream.pipe_diameter:.4g} mm"
    if case.downstream.expansion_loss is None:
        return (
            f"Into {pipe}: the jet widens and loses head as Borda and Carnot have it; K and Kv are up to behind that."
        )
    lost = f"{case.downstream.expansion_loss:g} of its velocity head"
    return f"Into {pipe}: the jet widens and loses {lost}; K and Kv are up to behind that."


#: What JSON calls columns of states that were measured.
_COLUMNS = {"mass_flow": "mass_flow", "outlet_area": "area"}
#: What the files of steady.measured may hold.
KINDS = (DISCHARGE, AREA, SHAPE, TAPS)


@dataclass(frozen=True)
class MeasuredStates(MeasuredParts):
    """Measurements of steady states; None for a quantity that was not measured.

    Attributes
    ----------
    discharge : MeasuredCurve or None
        Mass flow, kg/s, over the pressure.
    area : MeasuredCurve or None
        Flow area at the lip, m2, over the pressure.
    shapes : MeasuredShapes or None
        Sections of the wall.
    taps : MeasuredTaps or None
        Static pressures along the axis.
    discharged_area : (k, 2) array or None
        Mass flow, kg/s, and area, m2, of the rows of tables that have both.
    """

    discharge: MeasuredCurve | None = None
    area: MeasuredCurve | None = None
    shapes: MeasuredShapes | None = None
    taps: MeasuredTaps | None = None
    discharged_area: np.ndarray | None = None

    keys = {"discharge": "measured", "area": "measured_area", "shapes": "measured_sections", "taps": "measured_taps"}


def measured_states(result: StudyResult) -> MeasuredStates:
    """Measured data of a result, against its states."""
    tables, states, rest = kept_tables(result.record), result.states, result.case.rest_pressure
    flows, areas = joined(tables, DISCHARGE, "pressure", "mass_flow"), joined(tables, AREA, "pressure", "area")
    points, taps = (
        joined(tables, kind, *names)
        for kind, names in ((SHAPE, ("pressure", "z", "face", "x", "y")), (TAPS, ("pressure", "z", "tap")))
    )
    both = joined([table for table in tables if AREA in table.holds], DISCHARGE, "mass_flow", "area")
    return MeasuredStates(
        flows and against(*flows, states, rest),
        areas and against(*areas, states, rest, "lip area", "outlet_area", ("cm2", 1e4)),
        points and MeasuredShapes.of(points, WallSections(result.mesh, states)),
        taps and _taps(*np.array(taps), states, result.mesh.z),
        None if both is None else np.array(both).T,
    )


def against(
    pressure: Sequence[float],
    measured: Sequence[float],
    states: Sequence[SteadyState],
    rest: float = 0.0,
    what: str = "flow",
    name: str = "mass_flow",
    unit: tuple[str, float] = ("kg/s", 1.0),
) -> MeasuredCurve:
    """Measured numbers over pressures, Pa, against a column `name` of states; `rest` is the pressure, Pa, at which
    nothing flows; people are told of `what`, in `unit` with its factor from SI.
    """
    pressure = np.array(pressure, float)
    computed = flow_at(states, pressure, rest, name)
    return MeasuredCurve(what, _COLUMNS[name], pressure, np.array(measured, float), computed, unit)


def _taps(
    pressure: np.ndarray,
    z: np.ndarray,
    measured: np.ndarray,
    states: Sequence[SteadyState],
    stations: np.ndarray,
) -> MeasuredTaps:
    """Taps against the pressures at the stations, m, of states that flow, which run straight between stations."""
    flowing = [state for state in states if state.mass_flow > 0]
    computed = np.full(len(z), np.nan)
    for p in set(pressure):
        chosen, state = pressure == p, state_at(flowing, p)
        if state is not None:
            along = state.station_pressure + state.outlet_pressure
            computed[chosen] = np.interp(z[chosen], stations, along, left=np.nan, right=np.nan)
    return MeasuredTaps(pressure, z, measured, computed, lacking(flowing, pressure))


STATES = "states"


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a steady result on a mesh."""
    return (state_table(STATES, mesh, PATH_RESTART),)


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
        names = Cracking.__dataclass_fields__
        return Cracking(**{name: notes[-1][name] for name in names}) if notes else None

    @cached_property
    def measured(self) -> MeasuredStates:
        """Measured data beside the states."""
        return measured_states(self)

    def only(self, *states: State) -> SteadyResult:
        """A result with some of its states."""
        return gather_states(self, states)

    def nearest(self, pressure: float) -> State:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    def summary(self) -> dict[str, Any]:
        """Keys as scripts rely on, in SI units."""
        return {
            "points": [state.summary() for state in self.states],
            "cracking": self.cracking and self.cracking.summary(),
            **self.measured.summary(),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def lines(self) -> list[str]:
        columns = shown_summary(self.case)
        return [*printed_head(columns), *(printed_row(columns, state) for state in self.states), *self.remarks()]

    def remarks(self) -> list[str]:
        lines, cracking = hydraulic_lines(self.case, self.states), self.cracking
        if cracking is not None and self.states:
            lines.append(cracking.sentence(max(state.pressure for state in self.states)))
        return [*lines, *self.measured.sentences()]

    def shortfall(self) -> str | None:
        if not self.failures:
            return None
        asked = len(self.case.steady.pressures)
        if not self.states:
            return "No pressure was reached"
        kept = f"; those states are kept in {self.path}" if self.path else ""
        return f"{len(self.states)} of {asked} pressures were reached{kept}"

    def drawers(self, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
        """Figures over the pressure, and of one state: that of the highest pressure unless another is chosen."""
        if not self.states:
            return
        yield from figures.draw(self)
        yield from draw_shapes(self.measured.shapes)
        yield from views.draw_deformed(self, pressure)
        yield from views.draw_layers(self, pressure)

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        ordered = sorted({state.pressure: state for state in self.states}.values(), key=lambda state: state.pressure)
        return StateSteps(ordered, lambda state: _step(state, valve))


def _step(state: State, valve: WholeValve) -> Step:
    """Fields of a state; "time" is the pressure in Pa."""
    mesh, rows = state.results.mesh, state.results.mesh.element_rows()
    cells = {"thickness": mesh.thickness}
    for name in ("pressure", "velocity"):
        values = getattr(state, f"station_{name}")
        cells[name] = 0.5 * (values[rows] + values[rows + 1])
    for quantity, values in (
        ("von_mises", state.layers.von_mises),
        ("largest_stretch", state.layers.stretch[:, :, 1]),
    ):
        cells |= dict(zip(layer_field_names(mesh, quantity), values.T))
    points = motion(mesh, valve, state.nodal)
    return Step(state.pressure, points, {name: valve.cells(values) for name, values in cells.items()})
