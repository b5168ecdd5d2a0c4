"""Measured data beside steady states: discharge, lip area, sections of the wall, pressures along the axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...case.measured import AREA, DISCHARGE, SHAPE, TAPS
from ...model.state import SteadyState
from ..measured.curves import MeasuredCurve, MeasuredTaps, lacking, state_at
from ..measured.kept import joined, kept_tables
from ..measured.sections import MeasuredShapes, WallSections
from .between import flow_at

if TYPE_CHECKING:
    from .result import SteadyResult

#: What JSON calls columns of states that were measured.
_COLUMNS = {"mass_flow": "mass_flow", "outlet_area": "area"}
#: What the files of steady.measured may hold.
KINDS = (DISCHARGE, AREA, SHAPE, TAPS)


@dataclass(frozen=True)
class MeasuredStates:
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

    def __iter__(self) -> Iterator[MeasuredCurve | MeasuredShapes | MeasuredTaps]:
        return (part for part in (self.discharge, self.area, self.shapes, self.taps) if part is not None)

    def sentences(self) -> list[str]:
        """Sentences that compare each measured quantity with the computed one."""
        return [part.sentence() for part in self]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; empty lists of what was not measured."""
        parts = {"measured": self.discharge, "measured_area": self.area, "measured_sections": self.shapes}
        parts["measured_taps"] = self.taps
        return {name: part.summary() if part is not None else [] for name, part in parts.items()}


def measured_states(result: SteadyResult) -> MeasuredStates:
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
