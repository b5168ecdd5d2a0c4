"""A state under back pressure of a result, and what can be asked about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...record.states import LAYERS
from ...shell.recovery import LayerFields
from .columns import STATES, SUMMARY
from .opening import Opening
from .state import ClosureState

if TYPE_CHECKING:
    from .result import ClosureResult


@dataclass(frozen=True, eq=False)
class PressedState(ClosureState):
    """A state of a result, and what can be asked about it.

    Attributes
    ----------
    results : ClosureResult
    index : int
        Its row in the table of states.
    """

    results: ClosureResult = field(default=None, repr=False)
    index: int = field(default=0, repr=False)

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
    def sealed_intervals(self) -> list[list[float]]:
        """Intervals along the axis, m, on which the valve is shut."""
        results = self.results
        passage = Opening(
            results.mesh.z, self.opening, results.reference_opening / results.mesh.part.copies, self.gap, self.gap
        )
        return [list(pair) for pair in passage.shut_intervals(results.case.closure.shut_fraction)]

    @property
    def layer_extremes(self) -> list[dict[str, Any]]:
        """Largest elongation or shortening and largest von Mises stress (Pa) of each layer, inside to outside."""
        stretch, stress = self.layers.stretch, self.layers.von_mises
        strain = np.maximum(stretch[:, :, 1] - 1, 1 - stretch[:, :, 0]).max(axis=0)
        return [
            {"layer": title, "largest_strain": float(e), "largest_stress": float(s)}
            for title, e, s in zip(self.results.mesh.layer_titles(), strain, stress.max(axis=0))
        ]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        values = {c.name: getattr(self, c.name) for c in SUMMARY}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()} | {
            "sealed_intervals": self.sealed_intervals,
            "stiffness_eigenvalues": self.stiffness_eigenvalues.tolist(),
            "layers": self.layer_extremes,
        }
