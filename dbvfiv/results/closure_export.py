"""Back-pressure states as fields on the valve for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..record.fields import layer_field_names, motion
from ..record.vtkhdf import Step
from ..record.whole_valve import WholeValve

if TYPE_CHECKING:
    from .closure import ClosureResults


@dataclass(frozen=True)
class _ClosureSteps(Sequence):
    """States as steps, made one at a time; "time" is the back pressure in Pa."""

    result: ClosureResults
    valve: WholeValve

    def __len__(self) -> int:
        return len(self.result.states)

    def __getitem__(self, number):
        state, valve, mesh = self.result.states[number], self.valve, self.result.mesh
        cells = {"thickness": mesh.thickness}
        for quantity, values in (
            ("von_mises", state.layers.von_mises),
            ("largest_stretch", state.layers.stretch[:, :, 1]),
        ):
            cells |= dict(zip(layer_field_names(mesh, quantity), values.T))
        points = motion(mesh, valve, state.nodal)
        points |= {"contact_pressure": state.contact_pressure[valve.node], "gap": state.gap[valve.node]}
        return Step(state.pressure, points, {name: valve.cells(values) for name, values in cells.items()})


def closure_steps(result: ClosureResults, valve: WholeValve) -> Sequence[Step]:
    """States in the order of their pressures, as ParaView wants its times."""
    steps = _ClosureSteps(result, valve)
    return sorted(steps, key=lambda step: step.value)
