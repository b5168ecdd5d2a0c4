"""Head and discharge of several runs: one figure, one table with differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...drawing.style import new_figure, parameter_label
from ...errors import CaseError
from .. import comparing
from ..measured.figures import MEASURED, draw_curve, draw_section_of_runs, some_sections
from ..state import State
from .result import SteadyResult, flow_at

#: Keys that do not change what a run finds.
_QUIET = ("steady.pressures", "steady.measured", "steady.cracking_area", "steady.max_iterations", "steady.min_step")


@dataclass(frozen=True)
class Comparison:
    """Flows of several runs at the pressures of the first.

    Attributes
    ----------
    labels : list of str
        What tells the runs apart.
    pressure : (k,) array, Pa
    mass_flow, volume_flow : (runs, k) arrays, kg/s, m3/s
        Whole valve; between the states of a run by a monotone cubic, NaN beyond them.
    remark : str
        What stands in the way of comparing; empty if nothing does.
    measured : list of str
        What the runs are off by from measured data.
    """

    labels: list[str]
    pressure: np.ndarray
    mass_flow: np.ndarray
    volume_flow: np.ndarray
    remark: str = ""
    measured: Sequence[str] = ()

    @property
    def difference(self) -> np.ndarray:
        """(runs, k) volume flow over that of the first run less 1."""
        return self.volume_flow / self.volume_flow[0] - 1.0

    def summary(self) -> list[dict[str, Any]]:
        """One entry for each pressure; None where a run has nothing."""
        rows = zip(self.pressure, self.mass_flow.T, self.volume_flow.T, self.difference.T)
        names = ("mass_flow", "volume_flow", "difference")
        return [{"pressure": float(p)} | {n: comparing.plain(v) for n, v in zip(names, values)} for p, *values in rows]

    def lines(self) -> list[str]:
        """Table for people: flow of each run and what it differs by from the first."""
        numbered = [f"{i}: {label}" for i, label in enumerate(self.labels, 1)]
        runs = range(len(self.labels))
        head = f"{'kPa':>10}" + "".join(f"{f'{i + 1}, L/s':>12}" + (f"{'%':>9}" if i else "") for i in runs)
        rows = []
        for k, pressure in enumerate(self.pressure):
            cells = ""
            for i in runs:
                flow, off = 1e3 * self.volume_flow[i, k], 100 * self.difference[i, k]
                cells += comparing.cell(flow, 12, ".5g") + (comparing.cell(off, 9, "+.3f") if i else "")
            rows.append(f"{pressure / 1e3:10.6g}{cells}")
        return [*numbered, head, *rows, *([self.remark] if self.remark else []), *self.measured]


def compare(results: Sequence[SteadyResult]) -> Comparison:
    """Hold several runs against the first.

    Raises
    ------
    CaseError
        If one of them has no flow or no state.
    """
    for result in results:
        name = str(result.path or result.header.name)
        if result.case.drive.kind != "flow":
            raise CaseError(f"{name!r} holds states without flow, so there is no discharge to compare.")
        if not result.states:
            raise CaseError(f"{name!r} holds no states to compare.")
    pressure = np.array(sorted({state.pressure for state in results[0].states}))
    places = {result.case.pressure_at for result in results}
    remark = f"The pressures are not of one place: {' and '.join(sorted(places))}." if len(places) > 1 else ""
    flows = [np.array([_at(result, pressure, name) for result in results]) for name in ("mass_flow", "volume_flow")]
    told = comparing.tabulate_deviations([result.measured for result in results])
    return Comparison(comparing.labels(results, _QUIET), pressure, *flows, remark, told)


def _at(result: SteadyResult, pressure: np.ndarray, name: str) -> np.ndarray:
    return flow_at(result.states, pressure, result.case.rest_pressure, name)


def draw(results: Sequence[SteadyResult], names: Sequence[str] | None = None) -> Figure:
    """Pressure over volume flow of several runs, with the measured points that they name; where there are measured
    areas, pressures along the axis or sections, a panel of each. Without `names` they are called by what tells their
    cases apart.
    """
    parts = [result.measured for result in results]
    shapes = [part.shapes for part in parts]
    panels = [_discharge]
    panels += [_areas] if any(part.area is not None for part in parts) else []
    panels += [_taps] if any(part.taps is not None for part in parts) else []
    sections = some_sections(shapes, _SECTIONS)
    count = len(panels) + len(sections)
    columns = min(count, 2)
    rows = -(-count // columns)
    size = (7.0, 4.6) if count == 1 else (10.0, 3.6 * rows)
    figure = new_figure(size[0], size[1] + 0.22 * len(results))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))
    names = names or comparing.labels(results, _QUIET)
    for panel, draw_panel in zip(axes, panels):
        for result, label, colour in zip(results, names, colours):
            draw_panel(panel, result, label, colour)
    for panel, section in zip(axes[len(panels) :], sections):
        draw_section_of_runs(panel, section, shapes, colours)
    for panel in axes:
        panel.set_visible(panel.has_data())
    axes[0].set_xlim(left=0)  # after all runs: a limit that is set holds
    axes[0].set_ylim(bottom=0)
    axes[0].set_title("Head and discharge", loc="left", fontweight="bold")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2 if len(results) > 3 else 1)
    return figure


#: Most measured sections beside the other panels.
_SECTIONS = 2


def _discharge(axes: Axes, result: SteadyResult, label: str, colour: Any) -> None:
    states = _ordered(result)
    flow, pressure = [1e3 * s.volume_flow for s in states], [s.pressure / 1e3 for s in states]
    axes.plot(flow, pressure, "o-", color=colour, ms=4, label=label)
    points = result.measured.discharge
    if points is not None:
        flow = 1e3 * points.measured / result.case.fluid.density
        axes.plot(flow, points.pressure / 1e3, color=colour, label=f"measured, {label}", **MEASURED)
    axes.set_xlabel("Flow, L/s")
    axes.set_ylabel(parameter_label(result.case, "pressure"))


def _areas(axes: Axes, result: SteadyResult, label: str, colour: Any) -> None:
    computed = [(state.pressure, state.outlet_area) for state in _ordered(result)]
    draw_curve(axes, computed, result.measured.area, 1e4, label, (colour, colour))
    axes.set_xlabel(parameter_label(result.case, "pressure"))
    axes.set_ylabel("Flow area at the lip, cm²")


def _taps(axes: Axes, result: SteadyResult, label: str, colour: Any) -> None:
    """Plot the computed less the measured tap pressure, kPa, over the distance from the lip."""
    taps = result.measured.taps
    if taps is not None:
        axes.plot(1e3 * taps.z, taps.excess / 1e3, color=colour, **MEASURED)
    axes.set_xlabel("Distance from the lip z, mm")
    axes.set_ylabel("Pressure, computed less measured, kPa")


def _ordered(result: SteadyResult) -> list[State]:
    return sorted(result.states, key=lambda state: state.pressure)
