"""Measured points beside computed ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...model.state import SteadyState
from .between import flow_at

#: Kind of the note of a record that holds them.
NOTE = "measured"


@dataclass(frozen=True)
class Measured:
    """Points of a measured discharge curve, and what was computed there.

    Attributes
    ----------
    pressure, mass_flow : (k,) arrays, Pa, kg/s
        As drive.pressure has it; whole valve.
    computed : (k,) array, kg/s
        Between the states by a cubic; NaN beyond them.
    """

    pressure: np.ndarray
    mass_flow: np.ndarray
    computed: np.ndarray

    @property
    def difference(self) -> np.ndarray:
        """Computed over measured flow less 1; NaN where there is nothing to compare."""
        flows = np.where(self.mass_flow > 0, self.mass_flow, np.nan)
        return self.computed / flows - 1.0

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers, None where there is nothing to compare."""
        rows = zip(self.pressure, self.mass_flow, self.computed, self.difference)
        names = ("pressure", "mass_flow", "computed_mass_flow", "difference")
        return [{n: float(x) if np.isfinite(x) else None for n, x in zip(names, row)} for row in rows]

    def sentence(self) -> str:
        """For people."""
        known = self.difference[np.isfinite(self.difference)]
        begin = f"Measured: {len(self.pressure)} point{'s' * (len(self.pressure) > 1)}"
        if not len(known):
            return f"{begin}, none within the pressures computed."
        low, high = (f"{100 * share:+.3g}" for share in (known.min(), known.max()))
        spread = f"{low} to {high}" if low != high else low
        return f"{begin}; computed flow over measured {spread} % at the {len(known)} within the pressures computed."


def against(points: Sequence[Sequence[float]], states: Sequence[SteadyState], rest: float = 0.0) -> Measured:
    """Measured points (Pa, kg/s) against states; `rest` is the pressure, Pa, at which nothing flows."""
    pressure, mass_flow = np.array(points, float).T
    return Measured(pressure, mass_flow, flow_at(states, pressure, rest))
