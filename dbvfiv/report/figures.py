"""Figures of a report: head loss and opening over flow, vibration over head and pipe, the wall under back pressure;
the valve that answers to the pointer, drawn by plotly, which comes inside the page.

They are drawn in the units of tables, and put into those of the case like every other figure.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import plotly.graph_objects as go
from matplotlib.figure import Figure

from ..drawing.style import COMPUTED, DANGER, PUBLISHED, STABLE, UNSTABLE, new_figure, parameter_label
from ..drawing.views import ValveSkin
from ..texts import json_value
from .answers import loss_range
from .gather import Gathered

if TYPE_CHECKING:
    from ..case.units import Units
    from ..studies.state import State

_LEAST_DAMPED = "Damping ratio of\nthe least damped mode, %"
_LAYOUT = {
    "template": "plotly_white",
    "margin": {"l": 0, "r": 0, "t": 30, "b": 0},
    "font": {"family": "DejaVu Sans, Arial, sans-serif", "size": 13},
    "height": 400,
}
_CONFIG = {"displaylogo": False, "responsive": True}


def headloss_figure(found: Gathered) -> Figure:
    """Head loss and opening over the flow."""
    states = [s for s in sorted(found.get("steady").states, key=lambda s: s.pressure) if s.hydraulics is not None]
    flow = [1e3 * s.volume_flow for s in states]
    figure = new_figure(8.4, 3.1)
    loss, opening = figure.subplots(1, 2)
    loss.plot(flow, [s.hydraulics.head_loss for s in states], "o-", color=COMPUTED)
    opening.plot(flow, [1e3 * s.lip_opening for s in states], "o-", color=COMPUTED)
    for axes, name in ((loss, "Head loss, m"), (opening, "Opening, mm")):
        axes.set(xlabel="Flow, L/s", ylabel=name)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
    return figure


def vibration_figure(found: Gathered) -> Figure:
    """Least damping ratio over the head, and the factor on the damping of the wall at which chatter begins."""
    verdicts = {p: r.verdict for p, r in found.modes.items()}
    head = np.array(list(verdicts)) / 1e3
    figure = new_figure(8.4, 3.3)
    ratio, factor = figure.subplots(1, 2)
    damping = np.array([100 * v.damping_ratio for v in verdicts.values()])
    ratio.plot(head, damping, "-", color=COMPUTED, lw=1.2)
    for at, value, verdict in zip(head, damping, verdicts.values()):
        look = {True: ("o", STABLE), False: ("X", UNSTABLE)}.get(verdict.stable, ("s", "0.6"))
        ratio.plot(at, value, look[0], color=look[1], ms=8 if verdict.stable is False else 6)
    ratio.axhspan(min(0.0, np.nanmin(damping, initial=0.0)) - 0.5, 0.0, color=DANGER, lw=0)
    ratio.set_ylabel(_LEAST_DAMPED)
    _factors(found, factor, head, verdicts.values())
    for axes in (ratio, factor):
        axes.set_xlabel("Head, kPa" if found.case.units.heads else parameter_label(found.case, "pressure"))
        axes.set_xlim(left=0)
    return figure


def _factors(found: Gathered, axes, head, verdicts) -> None:
    """Neutral curve over head and damping; at heads without one the last factor that was looked at."""
    at, sought = (np.array(x) for x in zip(*((v.critical_damping_factor, v.damping_sought) for v in verdicts)))
    known = np.isfinite(at)
    low, high = 0.05, max(2.0, 1.2 * np.nanmax(sought, initial=0.0))
    if known.any():
        axes.fill_between(head, low, at, where=known, color=DANGER, lw=0)
        axes.plot(head, at, "o-", color=UNSTABLE, label="chatter below")
        low, high = min(low, at[known].min() / 1.5), max(high, 1.5 * at[known].max())
    for none, marker, colour, end in ((sought < 1, "v", STABLE, "down"), (sought > 1, "^", UNSTABLE, "up")):
        if none.any():
            axes.plot(head[none], sought[none], marker, color=colour, label=f"none found {end} to here")
    axes.axhline(1.0, color="0.2", lw=1.0, ls="--", label="this case")
    spread = loss_range(found.case)
    if spread is not None:
        axes.axhspan(*spread, color=COMPUTED, alpha=0.08, lw=0, label="range of the loss factors")
    axes.set_yscale("log")
    axes.set_ylim(0.8 * low, high)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylabel("Times the damping of the wall")
    axes.legend(loc="best", fontsize=8)


def pipe_figure(found: Gathered, sweeps: dict) -> Figure:
    """Least damping ratio over the length of the pipe, at several heads."""
    units = found.case.units
    figure = new_figure(7.0, 3.2)
    axes = figure.add_subplot()
    lowest = 0.0
    for number, (pressure, result) in enumerate(sweeps.items()):
        damping = np.array([100 * v.damping_ratio for v in result.verdicts])
        colour = (COMPUTED, PUBLISHED, "#6a8f3c")[number % 3]
        axes.plot(result.values, damping, "o-", color=colour, label=units.pressure(pressure, 3))
        lowest = min(lowest, np.nanmin(damping, initial=0.0))
    axes.axhspan(lowest - 0.5, 0.0, color=DANGER, lw=0)
    axes.axvline(found.case.upstream.length, color="0.2", lw=1.0, ls="--", label="this pipe")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("Length of the pipe, m")
    axes.set_ylabel(_LEAST_DAMPED)
    axes.legend(loc="best", fontsize=8)
    return figure


def closure_figure(result) -> Figure:
    """Sealed length and largest displacement, and the lowest stiffness of the wall, over the back pressure."""
    walk = [point for point in result.walk if not point.arclength]
    at = np.array([point.pressure for point in walk]) / 1e3
    figure = new_figure(8.4, 3.1)
    shape, stiffness = figure.subplots(1, 2)
    for name, label, colour in (
        ("sealed_length", "sealed length", COMPUTED),
        ("max_displacement", "largest displacement", PUBLISHED),
    ):
        shape.plot(at, [1e3 * getattr(point, name) for point in walk], color=colour, label=label)
    shape.set_ylabel("Length, mm")
    shape.legend(loc="best", fontsize=8)
    lowest = np.array([point.lowest_eigenvalue for point in walk])
    known = np.isfinite(lowest)
    stiffness.plot(at[known], 100 * lowest[known] / lowest[known][0], color=COMPUTED)
    stiffness.axhline(0.0, color=UNSTABLE, lw=1.0)
    stiffness.set_ylabel("Lowest stiffness of the wall\nover that at the start, %")
    rated = result.case.closure.rated_pressure
    for axes in (shape, stiffness):
        axes.set_xlabel("Back pressure, kPa")
        axes.set_xlim(left=0)
        if rated is not None:
            axes.axvline(rated / 1e3, color="0.2", lw=1.0, ls="--")
    return figure


def live_valve(state: State, units: Units) -> str:
    """The deformed valve in space, coloured by its displacement, with hover values, zoom and turn."""
    mm, size = units.name("size"), 1.0 / units.factor("size")
    skin = ValveSkin.of(state.results.mesh)
    points = skin.points(state.nodal)[:, [2, 0, 1]] * size
    corners = dict(zip("ijk", skin.triangles.T))
    moved = skin.spread(np.linalg.norm(state.nodal[:, :3], axis=1)) * size
    figure = go.Figure(layout=_LAYOUT)
    figure.add_mesh3d(
        x=_short(points[:, 0]),
        y=_short(points[:, 1]),
        z=_short(points[:, 2]),
        **corners,
        intensity=_short(moved),
        colorscale="Cividis",
        colorbar={"title": f"Displacement, {mm}"},
        flatshading=True,
        hovertemplate="z %{x:.3g}, x %{y:.3g}, y %{z:.3g}<br>displacement %{intensity:.3g} " + f"{mm}<extra></extra>",
    )
    look = {"nticks": 4, "tickfont": {"size": 11}}  # of short axes seen aslant more labels meet
    axes = {f"{axis}axis": {"title": f"{name}, {mm}"} | look for axis, name in zip("xyz", "zxy")}
    figure.update_scenes(aspectmode="data", camera={"eye": {"x": -2.2, "y": -2.3, "z": 1.3}}, **axes)
    return figure.to_html(full_html=False, include_plotlyjs=False, div_id="valve-live", config=_CONFIG)


def _short(values: np.ndarray) -> list[float | None]:
    """Numbers (k,) with the five digits that a pointer shows, so that the page stays small."""
    return json_value([float(f"{value:.5g}") for value in values])
