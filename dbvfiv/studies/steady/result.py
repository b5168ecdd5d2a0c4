"""Equilibria over a list of pressures: what their file holds and what can be read off them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from matplotlib.figure import Figure

from ...drawing import views
from ...record.mesh import MeshData, WholeValve
from ...record.states import shown_summary, state_table
from ...record.table import TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step, layer_field_names, motion
from ..load_path import WAY_ON, way_on_shapes
from ..measured.figures import draw_shapes
from ..result import StudyResult
from ..state import State, gather_states, states_of
from . import cracking, discharge, hydraulics, passage, shapes
from .measured import MeasuredStates, measured_states

STATES = "states"


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a steady result on a mesh."""
    return (state_table(STATES, mesh, WAY_ON, way_on_shapes(mesh)),)


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
    def cracking(self) -> cracking.Cracking | None:
        """Cracking pressure at which the valve begins to open; None without a flow."""
        notes = self.record.notes(cracking.NOTE)
        names = cracking.Cracking.__dataclass_fields__
        return cracking.Cracking(**{name: notes[-1][name] for name in names}) if notes else None

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
        lines, cracking = hydraulics.lines(self.case, self.states), self.cracking
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
        yield from discharge.draw(self)
        yield from shapes.draw(self)
        yield from passage.draw(self)
        yield from draw_shapes(self.measured.shapes)
        yield from views.draw_deformed(self, pressure)
        yield from views.draw_layers(self, pressure)

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """States in the order of their pressures, as ParaView wants its times."""
        ordered = sorted({state.pressure: state for state in self.states}.values(), key=lambda state: state.pressure)
        return StateSteps(self, ordered, valve)


@dataclass(frozen=True)
class StateSteps(Sequence):
    """States as steps, made one at a time; "time" is the pressure in Pa."""

    result: SteadyResult
    states: Sequence[State]
    valve: WholeValve

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, number: int) -> Step:
        state, valve, mesh = self.states[number], self.valve, self.result.mesh
        stress = state.layers
        rows = mesh.element_rows()
        cell_data = {
            "thickness": mesh.thickness,
            "pressure": 0.5 * (state.station_pressure[rows] + state.station_pressure[rows + 1]),
            "velocity": 0.5 * (state.station_velocity[rows] + state.station_velocity[rows + 1]),
        }
        for name, values in zip(layer_field_names(mesh, "von_mises"), stress.von_mises.T):
            cell_data[name] = values
        for name, values in zip(layer_field_names(mesh, "largest_stretch"), stress.stretch[:, :, 1].T):
            cell_data[name] = values
        return Step(
            state.pressure,
            motion(mesh, valve, state.nodal),
            {name: valve.cells(values) for name, values in cell_data.items()},
        )
