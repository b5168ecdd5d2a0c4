"""Figures of a flow in three dimensions beside the one-dimensional law."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ..drawing.style import (
    ACCENT,
    COMPUTED,
    HALO,
    MAGNITUDE,
    PUBLISHED,
    REST,
    colour_bar,
    headline,
    kilopascals,
    new_figure,
)
from .comparison import FlowComparison

#: Of the pipe that is drawn, in lengths of the valve: before the flange and behind the lip.
_BEFORE, _BEHIND = 0.5, 2.0


def draw(found: FlowComparison) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures, each with its name."""
    yield "velocity", lambda: velocity(found)
    yield "pressure", lambda: pressure(found)
    yield "rows", lambda: rows(found)


def velocity(found: FlowComparison) -> Figure:
    """Speed in the planes x = 0 and y = 0, and that of the law (compare Fig. 7-8 of the thesis)."""
    case = found.case
    flange, lip = case.domain.rows[[-1, 0]]
    length = flange - lip
    left, right = -1e3 * _BEFORE * length, 1e3 * (1.0 + _BEHIND) * length
    top = 1e3 * min(case.domain.radius, 1.6 * case.domain.bore)
    figure = new_figure(9.6, 5.6)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 1.0, 0.22])
    fastest = float(np.percentile(np.linalg.norm(found.fields.velocity, axis=1), 99.9))
    for panel, side, name in ((axes[0], 0, "y, mm, at x = 0"), (axes[1], -1, "x, mm, at y = 0")):
        for z, across, value in _plane(found, side):
            drawn = panel.pcolormesh(1e3 * (flange - z), 1e3 * across, value, cmap=MAGNITUDE, vmin=0, vmax=fastest)
        panel.set(ylabel=name, ylim=(0, top))
        panel.grid(False)
    place, speed = _law_speed(found)
    axes[2].pcolormesh(
        1e3 * (flange - place), [0, 1], np.tile(speed, (2, 1)), cmap=MAGNITUDE, vmin=0, vmax=fastest, shading="gouraud"
    )
    axes[2].set(xlim=(left, right), yticks=[], xlabel="Distance from the flange, mm, the flow from left to right")
    axes[2].set_ylabel("law", rotation=0, ha="right", va="center")
    axes[2].grid(False)
    colour_bar(figure, drawn, axes, "Speed, m/s")
    headline(figure, f"Flow through {case.name} at {_at(found)}: k-omega SST, and the one-dimensional law below")
    return figure


def _plane(found: FlowComparison, side: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Places along and across, m, and speeds of the cells beside a plane of symmetry, block by block."""
    cells, start = found.case.cells, 0
    speed = np.linalg.norm(found.fields.velocity, axis=1)
    for name, block in cells.blocks.items():
        l, m, n = block.shape
        values = speed[start : start + l * m * n].reshape(l, m, n)
        start += l * m * n
        if name == "core" and side:  # along the opening the core's columns are counted the other way
            nodes, values = block.nodes[:, :, 0], values[:, :, 0]
        else:
            nodes, values = block.nodes[:, side], values[:, side]
        points = cells.points[nodes]
        yield points[..., 2], points[..., 0 if side else 1], values


def _law_speed(found: FlowComparison) -> tuple[np.ndarray, np.ndarray]:
    """Places and speeds of the law, and of its jet behind the lip."""
    z, speed = found.case.domain.rows, found.case.state.station_velocity
    length = z[-1] - z[0]
    place = np.concatenate([[z[0] - _BEHIND * length], z, [z[-1] + _BEFORE * length]])
    return place, np.concatenate([speed[:1], speed, speed[-1:]])


def pressure(found: FlowComparison) -> Figure:
    """Mean pressure along pipe, valve and pipe (compare Fig. 7-9 of the thesis)."""
    case, s = found.case, found.summary
    flange, lip = case.domain.rows[[-1, 0]]
    figure = new_figure(7.2, 4.2)
    axes = figure.add_subplot()
    scale = found.law_flange / found.flange
    axes.plot(1e3 * (flange - found.stations), 1e-3 * scale * found.mean_pressure, color=COMPUTED, label="k-omega SST")
    law = case.state.station_pressure
    axes.plot(1e3 * (flange - case.domain.rows), 1e-3 * law, color=ACCENT, label="one-dimensional law")
    if "recovery" in s:
        head = 0.5 * case.density * s["jet_velocity"] ** 2 * scale
        ideal = 1.0 - (s["lip_area"] / (0.25 * np.pi * case.pipe**2)) ** 2
        ends = 1e3 * (flange - lip) + np.array([800.0, 3000.0])
        for loss, look, name in (
            (s["law_loss"], {"color": REST, "lw": 4.0, "alpha": 0.6}, "jet that widens as Borda and Carnot have it"),
            (s["published_loss"], {"color": PUBLISHED, "ls": "--"}, "the thesis's recovery"),
        ):
            if loss is not None:
                axes.plot(ends, np.full(2, 1e-3 * (ideal - loss) * head), label=name, **look)
    axes.axvspan(0.0, 1e3 * (flange - lip), color="0.95", zorder=0)
    axes.text(500.0 * (flange - lip), axes.get_ylim()[1], "valve", ha="center", va="top", path_effects=HALO)
    axes.set(xlabel="Distance from the flange, mm", ylabel="Mean pressure over that beside the lip, kPa")
    axes.legend()
    axes.set_title(f"Pressure along the pipe at {_at(found)}", loc="left", weight="bold")
    return figure


def rows(found: FlowComparison) -> Figure:
    """Pressures on the wall by row, and their difference from the law."""
    figure = new_figure(7.2, 5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    r = found.rows
    z = 1e3 * r["z"]
    above.plot(z, 1e-3 * r["inside"], color=COMPUTED, label="inner face, k-omega SST")
    above.plot(z, 1e-3 * r["outside"], color=COMPUTED, ls=":", label="outer face, k-omega SST")
    above.plot(z, 1e-3 * r["law"], color=ACCENT, label="one-dimensional law")
    above.set_ylabel("Pressure, kPa")
    above.legend()
    below.plot(z, 1e-3 * (r["net"] - r["law"]), color=COMPUTED)
    below.axhline(0.0, color=REST, lw=0.8)
    below.set(xlabel="z from the lip, mm", ylabel="Net, less the law, kPa")
    headline(figure, f"Pressure on the wall with {_at(found)} at the flange")
    return figure


def _at(found: FlowComparison) -> str:
    return kilopascals(found.case.state.pressure)
