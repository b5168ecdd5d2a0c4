"""Equilibria over a list of pressures, each from the one before, and what can be read off them.

The lips leave a gap at rest, so no pressure divides shut from open. What is called cracking here is a passage at the
lips that has grown to a stated multiple of that at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from ...case.measured import AREA, DISCHARGE, SHAPE, TAPS
from ...case.quantity import head_of
from ...drawing import views
from ...errors import CaseError, SolveError
from ...model import ValveModel
from ...model.equilibria import LoadPath, SteadyOptions, model_warnings, state_warnings
from ...model.state import SteadyState
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord
from ...record.states import PATH_RESTART, shown_summary, state_table
from ...record.table import Column, Shown, TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step
from ..case import Case
from ..comparing import Compared, Comparison, draw_shapes
from ..measured import FLOW, LIP_AREA, Measured, keep_measured
from ..result import StudyResult
from ..session import Session
from ..state import State, gather_states, pressure_steps, reach_states, states_of
from ..study import Study, print_rows
from . import figures

#: Table of the states, and kind of the note that holds the cracking pressure.
STATES, CRACKING = "states", "cracking"
#: Measurements that belong beside steady states.
MEASURED = {DISCHARGE: FLOW, AREA: LIP_AREA, SHAPE: None, TAPS: None}
#: Relative accuracy of the cracking pressure.
_ACCURACY = 1e-5


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
    for sentence in model_warnings(model):
        record.warn(sentence)
    states: list[SteadyState] = []
    try:
        reach_states(model, case, record, STATES, steady.pressures, states, record.item)
    finally:
        for sentence in state_warnings(model, states):
            record.warn(sentence)
    if model.flow.has_fluid and states and not record.notes(CRACKING):
        record.progress("cracking pressure")
        with suppress(SolveError):  # none is given then
            record.note(CRACKING, **find_cracking(model, states, steady.cracking_area)._asdict())


class Cracking(NamedTuple):
    """Cracking pressure: that at which the passage at the lips has grown to a multiple of its area at rest.

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
    pressure: float | None = None
    head: float | None = None

    def sentence(self, highest: float) -> str:
        """Sentence on the cracking pressure; `highest` is the highest pressure among the states, Pa."""
        grown = f"{self.area_ratio:g} times the passage at rest"
        if self.pressure is None:
            return f"Cracking: not up to {highest / 1e3:.4g} kPa, where the lips leave less than {grown}."
        return (
            f"Cracking pressure: {self.pressure:.4g} Pa ({1e3 * self.head:.3g} mm of the fluid) over that downstream, "
            f"where the lips leave {grown}; they leave a gap at rest, so some fluid passes before."
        )


def find_cracking(model: ValveModel, states: Iterable[SteadyState], area_ratio: float) -> Cracking:
    """Cracking pressure between rest and the states found of a model with a flow.

    Raises
    ------
    SolveError
        If a state on the way is not found.
    """
    rest = model.rows.areas(model.nodal(model.rest()))[0]
    wanted = np.log(area_ratio * rest)
    open_ = [state for state in states if np.log(max(state.station_area[0], rest)) >= wanted]
    if not open_:
        return Cracking(area_ratio)
    upper = min(open_, key=lambda state: state.pressure)
    path = LoadPath(model, SteadyOptions.of(model.case))
    back = model.flow.back

    def missing(drive: float) -> float:
        """Logarithm of the passage over the one wanted, at a pressure over that downstream."""
        if drive == 0.0 and model.weight is None:
            return -np.log(area_ratio)
        return float(np.log(max(path.go_to(back + drive).station_area[0], rest * 1e-6)) - wanted)

    if missing(0.0) >= 0.0:  # the weight alone has opened it
        return Cracking(area_ratio, 0.0, 0.0)
    drive = float(brentq(missing, 0.0, upper.pressure - back, xtol=1e-12, rtol=_ACCURACY))
    return Cracking(area_ratio, drive, head_of(drive, model.case.fluid.density))


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
# ----


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
        return Cracking(*(notes[-1][name] for name in Cracking._fields)) if notes else None

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
        states = {"points": [state.summary() for state in self.states], "cracking": cracking}
        return states | self.measured.summary() | self.ending()

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
        if not self.states:
            return "No pressure was reached"
        kept = f"; those states are kept in {self.path}" if self.path else ""
        return f"{len(self.states)} of {len(self.case.steady.pressures)} pressures were reached{kept}"

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
        return pressure_steps(self.states, valve, rows=("pressure", "velocity"))


#: Keys that do not change what a run finds.
_QUIET = tuple(f"steady.{key}" for key in ("pressures", "measured", "cracking_area", "max_iterations", "min_step"))
_COMPARED = (Compared("mass_flow"), Compared("volume_flow", 1e3, unit="L/s", share=True, key="difference"))


def compare(results: Sequence[SteadyResult]) -> Comparison:
    """Hold the flows of several runs against the first.

    Raises
    ------
    CaseError
        If one of them has no flow or no state.
    """
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
