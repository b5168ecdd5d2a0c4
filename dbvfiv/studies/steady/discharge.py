"""Curves over the pressure: discharge, lip area, jet velocity, deflections."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...case.quantity import head_of
from ...drawing.style import (
    ACCENT,
    COMPUTED,
    PUBLISHED,
    kilopascals,
    new_figure,
    parameter_label,
    pressure_colours,
    some_of,
)
from ..measured.figures import MEASURED, draw_curve
from . import published

if TYPE_CHECKING:
    from ..state import State
    from .result import SteadyResult


def draw(result: SteadyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name."""
    if result.case.drive.kind == "flow":
        yield "head-discharge", lambda: head_discharge(result)
        yield "area-discharge", lambda: area_discharge(result)
        if result.measured.area is not None:
            yield "area-pressure", lambda: area_pressure(result)
        yield "jet-velocity", lambda: jet_velocity(result)
        if result.case.has_line:
            yield "operating-point", lambda: operating_point(result)
    yield "deflection", lambda: deflection(result)


def ordered(result: SteadyResult) -> list[State]:
    """States from low to high pressure."""
    return sorted(result.states, key=lambda state: state.pressure)


def head_discharge(result: SteadyResult) -> Figure:
    """Static inlet pressure over mass flow (compare Fig. 7-4 of the thesis)."""
    states = ordered(result)
    figure, axes = _axes("Mass flow, kg/s", parameter_label(result.case, "pressure"))
    axes.plot(
        [s.mass_flow for s in states], [s.pressure / 1e3 for s in states], "o-", color=COMPUTED, label=_name(result)
    )
    if published.applies(result.case):
        data = published.HEAD_DISCHARGE
        axes.plot(
            data.mass_flow,
            np.array(data.pressure) / 1e3,
            "D",
            color=PUBLISHED,
            label=data.label,
            mfc="none",
            mew=1.6,
            ms=7,
        )
    points = result.measured.discharge
    if points is not None:
        axes.plot(points.measured, points.pressure / 1e3, color="black", label="measured", **MEASURED)
    return _finish(figure, axes, "Head and discharge")


def operating_point(result: SteadyResult) -> Figure:
    """Total head that the valve takes and that the line leaves it, over the flow; they cross where the valve works.

    The head of the line is that of its far end less losses that go with the square of the flow, for some of the
    pressures.
    """
    states = [state for state in ordered(result) if state.hydraulics is not None]
    figure, axes = _axes("Flow, L/s", "Total head at the flange, m")
    flow = np.array([0.0] + [1e3 * s.volume_flow for s in states])
    rest = head_of(result.case.rest_pressure - result.case.level_pressure, result.case.fluid.density)
    head = np.array([rest] + [s.hydraulics.total_head for s in states])
    axes.plot(flow, head, "-", color=COMPUTED, label="valve and what is behind it")
    chosen = some_of(states, 5)
    reach = np.linspace(0.0, 1.15 * flow.max(), 60)
    for state, colour in zip(chosen, pressure_colours([s.pressure for s in chosen])):
        found = state.hydraulics
        lost = found.line_loss * (reach / (1e3 * state.volume_flow)) ** 2
        axes.plot(
            reach, found.supply_head - lost, "--", color=colour, lw=1.2, label=f"line, {kilopascals(state.pressure)}"
        )
        axes.plot(1e3 * state.volume_flow, found.total_head, "o", color=colour)
    return _finish(figure, axes, "Operating points")


def area_discharge(result: SteadyResult) -> Figure:
    """Lip area over mass flow (compare Fig. 7-5 of the thesis)."""
    states = ordered(result)
    figure, axes = _axes("Mass flow, kg/s", "Flow area at the lip, cm²")
    axes.plot(
        [s.mass_flow for s in states], [s.outlet_area * 1e4 for s in states], "o-", color=COMPUTED, label=_name(result)
    )
    both = result.measured.discharged_area
    if both is not None:
        axes.plot(both[:, 0], both[:, 1] * 1e4, color="black", label="measured", **MEASURED)
    return _finish(figure, axes, "Lip area and discharge")


def area_pressure(result: SteadyResult) -> Figure:
    """Lip area over the static inlet pressure, with what was measured."""
    figure, axes = _axes(parameter_label(result.case, "pressure"), "Flow area at the lip, cm²")
    computed = [(s.pressure, s.outlet_area) for s in ordered(result)]
    draw_curve(axes, computed, result.measured.area, 1e4, _name(result))
    return _finish(figure, axes, "Lip area and pressure")


def jet_velocity(result: SteadyResult) -> Figure:
    """Jet velocity over pressure (compare Fig. 7-7 of the thesis)."""
    states = ordered(result)
    figure, axes = _axes(parameter_label(result.case, "pressure"), "Velocity, m/s")
    p = np.array([s.pressure for s in states])
    axes.plot(
        p / 1e3, [s.outlet_velocity for s in states], "o-", color=COMPUTED, label=f"jet at the lip, {_name(result)}"
    )
    axes.plot(p / 1e3, [s.station_velocity[-1] for s in states], "s-", color=ACCENT, ms=4.5, label="inlet")
    fine = np.linspace(0.0, p.max(), 200)
    axes.plot(
        fine / 1e3,
        np.sqrt(2 * fine / result.case.fluid.density),
        ":",
        color="0.35",
        lw=1.3,
        label=r"$\sqrt{2\,p/\rho}$, without the velocity at the inlet",
    )
    return _finish(figure, axes, "Jet velocity")


def deflection(result: SteadyResult) -> Figure:
    """Clear lip opening, between the inner faces, and largest displacement over pressure."""
    states = ordered(result)
    figure, axes = _axes(parameter_label(result.case, "pressure"), "Opening, displacement, mm")
    p = [s.pressure / 1e3 for s in states]
    axes.plot(
        p,
        [s.max_displacement * 1e3 for s in states],
        "s-",
        color=ACCENT,
        ms=4.5,
        label="largest displacement of the wall",
    )
    axes.plot(p, [s.lip_opening * 1e3 for s in states], "o-", color=COMPUTED, label="clear lip opening at its middle")
    return _finish(figure, axes, "Opening and deflection", from_zero=all(s.lip_opening >= 0 for s in states))


def _name(result: SteadyResult) -> str:
    return f"dbvfiv, {result.header.name}"


def _axes(x: str, y: str):
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    return figure, axes


def _finish(figure: Figure, axes, title: str, from_zero: bool = True) -> Figure:
    axes.set_title(title, loc="left", fontweight="bold")
    axes.margins(0.06)
    axes.set_xlim(0, 1.08 * max(0.0, axes.dataLim.x1) or None)
    if from_zero:
        axes.set_ylim(0, 1.12 * max(0.0, axes.dataLim.y1) or None)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.14), ncols=2)
    return figure
