"""Back-pressure states as fields on the valve for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...record.mesh import WholeValve
from ...record.vtkhdf import Step, layer_field_names, motion

if TYPE_CHECKING:
    from .pressed_state import PressedState


@dataclass(frozen=True)
class ClosureSteps(Sequence):
    """States as steps, made one at a time; "time" is the back pressure in Pa."""

    states: Sequence[PressedState]
    valve: WholeValve

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, number: int) -> Step:
        state, valve = self.states[number], self.valve
        mesh = state.results.mesh
        cells = {"thickness": mesh.thickness}
        for quantity, values in (
            ("von_mises", state.layers.von_mises),
            ("largest_stretch", state.layers.stretch[:, :, 1]),
        ):
            cells |= dict(zip(layer_field_names(mesh, quantity), values.T))
        points = motion(mesh, valve, state.nodal)
        points |= {"contact_pressure": state.contact_pressure[valve.node], "gap": state.gap[valve.node]}
        return Step(state.pressure, points, {name: valve.cells(values) for name, values in cells.items()})
