"""Figures of steady states: curves over the pressure with published and measured points, shapes, the passage."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...case.quantity import head_of
from ...case.valve import Valve
from ...drawing.style import (
    ACCENT,
    COMPUTED,
    PUBLISHED,
    REST,
    kilopascals,
    new_figure,
    new_panel,
    parameter_label,
    pressure_colours,
    pressure_heading,
    pressure_name,
    some_of,
)
from ...drawing.views import closed_section, deformed, draw_chosen, layer_stress, mark_pieces
from ...flow.terms.pump import from_case as pump_of
from ...record.vtkhdf import faces
from ..case import Case
from ..comparing import MEASURED, draw_curve, draw_runs, draw_shapes, labels
from ..measured import static_pressure
from ..result import StudyResult


def draw(result: StudyResult, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures over the pressure, and of one state: that of the highest pressure unless another is chosen."""
    if not result.states:
        return
    if result.case.drive.kind == "flow":
        yield "head-discharge", lambda: head_discharge(result)
        yield "area-discharge", lambda: area_discharge(result)
        if result.measured.area is not None:
            yield "area-pressure", lambda: area_pressure(result)
        yield "jet-velocity", lambda: jet_velocity(result)
        if result.case.has_line and any(state.hydraulics is not None for state in result.states):
            yield "operating-point", lambda: operating_point(result)
    yield "deflection", lambda: deflection(result)
    yield "lip-shapes", lambda: lip_shapes(result)
    yield "centre-line", lambda: centre_line(result)
    if result.case.drive.kind == "flow":
        yield "passage", lambda: passage(result)
    yield from draw_shapes(result.measured.shapes)
    yield from draw_chosen(result, pressure, {"deformed": deformed, "layer-stress": layer_stress})


def ordered(result: StudyResult) -> list[Any]:
    """States from low to high pressure."""
    return sorted(result.states, key=lambda state: state.pressure)


def _over(result: StudyResult, x: str, y: str, curves: dict[str, tuple[Any, Any, dict[str, Any]]]) -> tuple[Any, Any]:
    """Figure and axes with curves over states from low to high pressure; by their labels, the functions from a state to
    x and y, and looks.
    """
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set(xlabel=x, ylabel=y)
    states = ordered(result)
    for label, (at, value, look) in curves.items():
        look = {"marker": "o", "ls": "-", "color": COMPUTED, "label": label} | look
        axes.plot([at(s) for s in states], [value(s) for s in states], **look)
    return figure, axes


_SECOND = {"marker": "s", "color": ACCENT, "ms": 4.5}


def head_discharge(result: StudyResult) -> Figure:
    """Static inlet pressure over mass flow (compare Fig. 7-4 of the thesis)."""
    curve = {_name(result): (lambda s: s.mass_flow, _kilopascals, {})}
    figure, axes = _over(result, "Mass flow, kg/s", parameter_label(result.case, "pressure"), curve)
    if is_published(result.case):
        data, look = HEAD_DISCHARGE, {"color": PUBLISHED, "mfc": "none", "mew": 1.6, "ms": 7}
        axes.plot(data.mass_flow, np.array(data.pressure) / 1e3, "D", label=data.label, **look)
    points = result.measured.discharge
    if points is not None:
        axes.plot(points.measured, points.pressure / 1e3, color="black", label="measured", **MEASURED)
    return _finish(figure, axes, "Head and discharge")


def operating_point(result: StudyResult) -> Figure:
    """Total head that the valve takes and that the line leaves it, over the flow; they cross where the valve works.

    The head of the line is that of its far end less losses that go with the square of the flow, for some of the
    pressures: at the far end that of a reservoir, a static one with the velocity head of the flow, or what a pump
    gives, with the static lift of the state, as far as its table goes.
    """
    states = [state for state in ordered(result) if state.hydraulics is not None]
    figure, axes = _over(result, "Flow, L/s", "Total head at the flange, m", {})
    flow = np.array([0.0] + [1e3 * s.volume_flow for s in states])
    rest = head_of(result.case.rest_pressure - result.case.level_pressure, result.case.fluid.density)
    head = np.array([rest] + [s.hydraulics.total_head for s in states])
    axes.plot(flow, head, "-", color=COMPUTED, label="valve and what is behind it")
    chosen = some_of(states, 5)
    reach = np.linspace(0.0, 1.15 * flow.max(), 60)
    for state, colour in zip(chosen, pressure_colours([s.pressure for s in chosen])):
        found, label = state.hydraulics, f"line, {kilopascals(state.pressure)}"
        axes.plot(reach, left_by_line(result.case, state, reach), "--", color=colour, lw=1.2, label=label)
        axes.plot(1e3 * state.volume_flow, found.total_head, "o", color=colour)
    return _finish(figure, axes, "Operating points")


def left_by_line(case: Case, state: Any, flow: np.ndarray) -> np.ndarray:
    """Total head, m, that the line of a state leaves at flows, L/s; none where the pump's table has none."""
    found, own = state.hydraulics, 1e3 * state.volume_flow
    square, head = (flow / own) ** 2, np.full_like(flow, found.supply_head)
    if case.drive.at == "line":
        head += (found.supply_head - state.static_head(state.pressure - case.level_pressure)) * (square - 1.0)
    if (pump := pump_of(case)) is not None:
        given = np.array([float(pump.curve(q)) if pump.holds(q) else np.nan for q in 1e-3 * flow])
        head += given - float(pump.curve(1e-3 * own))
    return head - found.line_loss * square


def area_discharge(result: StudyResult) -> Figure:
    """Lip area over mass flow (compare Fig. 7-5 of the thesis)."""
    curve = {_name(result): (lambda s: s.mass_flow, lambda s: s.outlet_area * 1e4, {})}
    figure, axes = _over(result, "Mass flow, kg/s", "Flow area at the lip, cm²", curve)
    both = result.measured.discharged_area
    if both is not None:
        axes.plot(both[:, 0], both[:, 1] * 1e4, color="black", label="measured", **MEASURED)
    return _finish(figure, axes, "Lip area and discharge")


def area_pressure(result: StudyResult) -> Figure:
    """Lip area over the static inlet pressure, with what was measured."""
    figure, axes = _over(result, parameter_label(result.case, "pressure"), "Flow area at the lip, cm²", {})
    computed = [(s.pressure, s.outlet_area) for s in ordered(result)]
    draw_curve(axes, computed, result.measured.area, 1e4, _name(result))
    return _finish(figure, axes, "Lip area and pressure")


def jet_velocity(result: StudyResult) -> Figure:
    """Jet velocity over pressure (compare Fig. 7-7 of the thesis)."""
    curves = {
        f"jet at the lip, {_name(result)}": (_kilopascals, lambda s: s.outlet_velocity, {}),
        "inlet": (_kilopascals, lambda s: s.station_velocity[-1], _SECOND),
    }
    figure, axes = _over(result, parameter_label(result.case, "pressure"), "Velocity, m/s", curves)
    rest = result.case.rest_pressure
    fine = np.linspace(rest, max(rest, *(s.pressure for s in result.states)), 200)
    over = f"(p-{rest / 1e3:.4g}\\,\\mathrm{{kPa}})" if rest else "\\,p"
    ideal, label = (
        np.sqrt(2 * (fine - rest) / result.case.fluid.density),
        f"$\\sqrt{{2{over}/\\rho}}$, without the velocity at the inlet",
    )
    axes.plot(fine / 1e3, ideal, ":", color="0.35", lw=1.3, label=label)
    return _finish(figure, axes, "Jet velocity")


def deflection(result: StudyResult) -> Figure:
    """Clear lip opening, between the inner faces, and largest displacement over pressure."""
    curves = {
        "largest displacement of the wall": (_kilopascals, lambda s: s.max_displacement * 1e3, _SECOND),
        "clear lip opening at its middle": (_kilopascals, lambda s: s.lip_opening * 1e3, {}),
    }
    figure, axes = _over(result, parameter_label(result.case, "pressure"), "Opening, displacement, mm", curves)
    return _finish(figure, axes, "Opening and deflection", from_zero=all(s.lip_opening >= 0 for s in result.states))


def _kilopascals(state: Any) -> float:
    return state.pressure / 1e3


def _name(result: StudyResult) -> str:
    return f"dbvfiv, {result.header.name}"


def _finish(figure: Figure, axes, title: str, from_zero: bool = True) -> Figure:
    axes.set_title(title, loc="left", fontweight="bold")
    axes.margins(0.06)
    axes.set_xlim(0, 1.08 * max(0.0, axes.dataLim.x1) or None)
    if from_zero:
        axes.set_ylim(0, 1.12 * max(0.0, axes.dataLim.y1) or None)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.14), ncols=2)
    return figure


_WATER = 1000.0


class Published(NamedTuple):
    """Points of a published curve of the 12-inch valve: pressures, Pa, and mass flows of the whole valve, kg/s."""

    label: str
    pressure: tuple[float, ...]
    mass_flow: tuple[float, ...]
    source: str


#: Mass flows of the coupled model of Th. 4.3.3: handed to the viscous flow model at the pressures of Fig. 4-4.
HEAD_DISCHARGE = Published(
    "thesis, coupled model", (18e3, 29e3, 36e3), (47.88, 75.52, 90.82), "Th. 4.3.3, Fig. 4-4 and chapter 7"
)


def is_published(case: Case) -> bool:
    """True for the 12-inch valve with water flowing through it.

    Layers and materials may differ, shape and wall may not.
    """
    same_shape = case.valve.model_copy(update={"saddle": "ruled"}) == Valve()
    bare = not (case.has_line or case.has_tail or case.rest_pressure)
    return same_shape and case.drive.kind == "flow" and case.fluid.density == _WATER and bare


def lip_shapes(result: StudyResult) -> Figure:
    """Inner faces of the lips at several pressures, all around, and the outer face at the highest (compare Fig.
    7-10 of the thesis, which shows the mid-surface).
    """
    figure, axes = new_panel(7.2, 4.6, "Lips at the outlet, inner faces", "x, mm", "y, mm")
    lip, part = result.mesh.rows[0], result.mesh.part
    rest = closed_section(faces(result.mesh)[0][lip, :2], part)
    axes.plot(*rest.T * 1e3, color=REST, lw=1.2, ls="--", label="at rest")
    states = some_of(ordered(result))
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        inner, outer = faces(result.mesh, state.nodal)
        axes.plot(*closed_section(inner[lip, :2], part).T * 1e3, color=colour, label=kilopascals(state.pressure))
    axes.plot(*closed_section(outer[lip, :2], part).T * 1e3, color=colour, lw=0.9, label="its outer face")
    axes.set_aspect("equal")
    figure.legend(loc="outside lower center", ncols=5, title=pressure_name(result.case).lower())
    return figure


def centre_line(result: StudyResult) -> Figure:
    """Inner and outer face in the middle of the lips, y over z, and at the side edges, x over z at y = 0."""
    figure = new_figure(7.2, 6.2)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [1, 1]})
    states = some_of(ordered(result))
    colours = pressure_colours([s.pressure for s in states])
    moved = [faces(result.mesh, state.nodal) for state in states]
    rest = faces(result.mesh)
    part, edges = result.mesh.part, [(lower, result.mesh.rows[:, -1], 0)]
    if not part.is_quarter:
        edges.append((lower, result.mesh.rows[:, 0], 0))
    for axes, line, across in ((upper, result.mesh.centre_line, 1), *edges):
        for face, width in ((0, 1.6), (1, 0.8)):
            look = {"color": REST, "lw": 0.75 * width, "ls": "--", "label": None if face else "at rest"}
            axes.plot(rest[face][line, 2] * 1e3, rest[face][line, across] * 1e3, **look)
            for state, both, colour in zip(states, moved, colours):
                place = both[face][line] * 1e3
                label = None if face else kilopascals(state.pressure)
                axes.plot(place[:, 2], place[:, across], color=colour, lw=width, label=label)
        axes.tick_params(labelbottom=True)
    mark_pieces(result, upper, lower)
    upper.set(ylabel="y, mm")
    lower.set(xlabel="Distance from the lip z, mm", ylabel="x, mm")
    upper.set_title(f"Inner (thick) and outer face at {part.middle}", loc="left", fontweight="bold")
    lower.set_title("Side edge, y = 0", loc="left", fontweight="bold")
    upper.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), title=pressure_heading(result.case))
    return figure


#: What each panel shows of a state of a result.
_PANELS = (
    ("Static pressure, kPa", lambda state, result: static_pressure(state, result.case, result.mesh.z) / 1e3),
    ("Velocity, m/s", lambda state, result: state.station_velocity),
    ("Flow area, cm²", lambda state, result: result.mesh.part.copies * state.station_area * 1e4),
)


def passage(result: StudyResult) -> Figure:
    """Pressure over that of the surroundings, velocity and flow area over the distance from the lip, with pressures
    that were measured; the fluid flows from right to left.
    """
    figure = new_figure(7.2, 7.4)
    panels = figure.subplots(3, 1, sharex=True)
    states, taps = some_of(ordered(result)), result.measured.taps
    z = result.mesh.z * 1e3
    colours = pressure_colours([*(s.pressure for s in states), *([] if taps is None else taps.pressure)])
    for axes, (label, value) in zip(panels, _PANELS):
        for state, colour in zip(states, colours):
            axes.plot(z, value(state, result), color=colour, label=kilopascals(state.pressure))
        axes.set_ylabel(label)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.set_xlim(0, z[-1])
        axes.tick_params(labelbottom=True)
    if taps is not None:
        look = {"c": colours[len(states) :], "marker": MEASURED["marker"], "label": "measured"}
        panels[0].scatter(taps.z * 1e3, taps.measured / 1e3, zorder=3, **look)
    mark_pieces(result, *panels)
    panels[0].set_title("Along the passage (lip left, inlet right)", loc="left", fontweight="bold")
    panels[-1].set_xlabel("Distance from the lip z, mm")
    panels[0].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title=pressure_heading(result.case))
    return figure


def draw_together(
    results: Sequence[StudyResult], names: Sequence[str] | None = None, quiet: Sequence[str] = ()
) -> Figure:
    """Pressure over volume flow of several runs, with the measured points that they name; where there are measured
    areas, pressures along the axis or sections, a panel of each. Without `names` they are called by what tells their
    cases apart, keys that are `quiet` left out.
    """
    pressure, parts = parameter_label(results[0].case, "pressure"), [result.measured for result in results]
    panels = {f"Flow, L/s|{pressure}": _discharge_of_run}
    if any(part.area is not None for part in parts):
        panels[f"{pressure}|Flow area at the lip, cm²"] = _area_of_run
    if any(part.taps is not None for part in parts):
        panels["Distance from the lip z, mm|Pressure, computed less measured, kPa"] = _taps_of_run
    figure = draw_runs(results, names or labels(results, quiet), panels, 2, "Head and discharge", (10.0, 3.6))
    figure.axes[0].set_xlim(left=0)  # after all runs: a limit that is set holds
    figure.axes[0].set_ylim(bottom=0)
    return figure


def _discharge_of_run(axes, result: StudyResult, label: str, colour: Any) -> None:
    states, points = ordered(result), result.measured.discharge
    flow = [1e3 * s.volume_flow for s in states]
    axes.plot(flow, [s.pressure / 1e3 for s in states], "o-", color=colour, ms=4, label=label)
    if points is not None:
        flow = 1e3 * points.measured / result.case.fluid.density
        axes.plot(flow, points.pressure / 1e3, color=colour, label=f"measured, {label}", **MEASURED)


def _area_of_run(axes, result: StudyResult, label: str, colour: Any) -> None:
    computed = [(state.pressure, state.outlet_area) for state in ordered(result)]
    draw_curve(axes, computed, result.measured.area, 1e4, label, (colour, colour))


def _taps_of_run(axes, result: StudyResult, label: str, colour: Any) -> None:
    """Plot the computed less the measured tap pressure, kPa, over the distance from the lip."""
    taps = result.measured.taps
    if taps is not None:
        axes.plot(1e3 * taps.z, taps.excess / 1e3, color=colour, **MEASURED)
