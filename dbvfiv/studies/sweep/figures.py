"""Figures of a sweep: damping and frequency of tracked modes over the parameter, and the root locus."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import groupby
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...case.parameters import PARAMETERS
from ...drawing.style import (
    DANGER,
    HALO,
    MAGNITUDE,
    UNSTABLE,
    branch_looks,
    colour_bar,
    driven,
    limits,
    log_axis,
    new_figure,
    parameter_label,
)
from ...texts import digits
from ..result import RangeResult

#: Confidence below which a match is drawn as doubtful.
DOUBTFUL = 0.5
#: Of strips without a mode that is known, of stable ones, and of those with an unstable mode.
_GROUNDS = (
    {"facecolor": "#ececec", "edgecolor": "#9a9a9a", "hatch": "////", "lw": 0},
    {"color": "#1f4e790d", "lw": 0},
    {"color": DANGER, "lw": 0},
)


def draw(result: RangeResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a sweep, each with its name."""
    if len(result.values) and result.branches:
        yield "sweep", lambda: curves(result)
        yield "root-locus", lambda: root_locus(result)


def curves(result: RangeResult) -> Figure:
    """Growth rate, frequency and damping ratio of each branch; crossings of zero growth marked, spans with unstable
    modes shaded.
    """
    label, factor = parameter_label(result.case, result.parameter), 1.0 / PARAMETERS[result.parameter].scale
    figure = new_figure(7.6, 8.6)
    ratios = {"height_ratios": [1.25, 1.0, 0.9]}
    growth, frequency, ratio = panels = figure.subplots(3, 1, sharex=True, gridspec_kw=ratios)
    x = result.values * factor
    for branch, look in zip(result.branches, branch_looks(len(result.branches))):
        _draw_branch(panels, x, branch, look)
    for crossing in result.crossings():
        _mark_crossing(growth, crossing, result, x)
    for axes in panels:
        _shade(axes, result, x)
        if result.axis.log:
            log_axis(axes.xaxis, x[0], x[-1])
        axes.set_xlim(*limits(x, result.axis.log))
        axes.tick_params(labelbottom=True)
    for axes, title in ((growth, "Growth rate, 1/s"), (frequency, "Frequency, Hz"), (ratio, "Damping ratio, %")):
        axes.set_ylabel(title)
    growth.axhline(0.0, color="0.25", lw=1.1)
    ratio.axhline(0.0, color="0.25", lw=1.1)
    frequency.set_ylim(bottom=min(0.0, frequency.get_ylim()[0]))
    ratio.set_xlabel(label)
    over = f"{label[0].lower()}{label[1:]}".partition(",")[0]
    growth.set_title(f"Modes over {over}, {surroundings_of(result)}", loc="left", fontweight="bold")
    handles, labels = growth.get_legend_handles_labels()
    if any(np.nanmin(b.confidence, initial=1.0) < DOUBTFUL for b in result.branches):
        handles.append(Line2D([], [], ls="", marker="x", color="black", ms=8, mew=1.6))
        labels.append("doubtful match")
    growth.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.01, 1.02), title="mode")
    word = "certified against full solves" if result.certified else "not certified"
    hatched = " Hatched: no mode is known." if (result.unstable_count < 0).any() else ""
    words = f"Red ground: at least one unstable mode.{hatched} The sweep is {word}."
    if result.crossings():
        words += "\nDiamonds: interpolated between the values computed; `dbvfiv onset` finds them exactly."
    figure.supxlabel(words, x=0.01, ha="left", fontsize=9)
    return figure


def _draw_branch(panels, x: np.ndarray, branch: Any, look: dict) -> None:
    """A branch in the three panels, doubtful matches crossed."""
    size = np.hypot(branch.growth_rate, branch.angular_frequency)
    second = (branch.angular_frequency < 0).any()  # of a pair that two real modes became: both are seen
    series = (branch.growth_rate, branch.frequency, -100 * branch.growth_rate / np.where(size > 0, size, 1.0))
    doubtful = branch.confidence < DOUBTFUL
    look = look | {"lw": 1.7, "ls": "--" if second else "-", "ms": 3.6, "markevery": max(1, len(x) // 30)}
    for axes, values in zip(panels, series):
        axes.plot(x, values, label=f"{branch.id}", **look)
        axes.plot(x[doubtful], values[doubtful], "x", color="black", ms=8, mew=1.6)


def _mark_crossing(axes, crossing: Any, result: RangeResult, x: np.ndarray) -> None:
    """A crossing of zero growth and its numbers, beside it where there is room."""
    row = PARAMETERS[result.parameter]
    at = crossing.value / row.scale
    axes.plot(at, 0.0, "D", color=UNSTABLE, ms=6, zorder=4)
    side = -1 if _share(at, x, result.axis.log) > 0.7 else 1
    swing = f"{digits(crossing.frequency, 2)} Hz" if crossing.frequency > 0 else "no oscillation"
    look = {"textcoords": "offset points", "fontsize": 9, "color": UNSTABLE, "path_effects": HALO}
    look["ha"] = "left" if side > 0 else "right"
    axes.annotate(f"≈ {row.amount(crossing.value, 3)}, {swing}", (at, 0.0), (7 * side, 7), **look)


def surroundings_of(result: RangeResult) -> str:
    """Fixed parameters of a sweep, for titles."""
    case = result.case
    parts = []
    if result.parameter != "pressure":
        parts.append(driven(case, result.points[0]["pressure"]))
    if result.parameter != "density" and case.drive.kind == "flow":
        parts.append(f"{case.fluid.density:g} kg/m³")
    parts += [
        PARAMETERS[name].text(getattr(case.damping, name))
        for name in ("alpha", "beta", "loss_factor")
        if name != result.parameter and not case.damping.lacks(name)
    ]
    return ", ".join(parts)


def _share(at: float, x: np.ndarray, log: bool) -> float:
    place = np.log if log else np.asarray
    return float((place(at) - place(x[0])) / (place(x[-1]) - place(x[0])))


def _shade(axes, result: RangeResult, x: np.ndarray) -> None:
    """Ground red where a mode is unstable, its edges at the crossings; hatched beside values without a mode."""
    place, crossings = np.log if result.axis.log else np.asarray, result.crossings()
    met = np.array([crossing.value for crossing in crossings]) / PARAMETERS[result.parameter].scale
    edges = np.unique([*x, *met]) if len(x) > 1 else np.array(limits(x, result.axis.log))
    middles = 0.5 * (place(edges[:-1]) + place(edges[1:]))
    growth = np.array([np.interp(middles, place(x), branch.growth_beyond_rounding) for branch in result.branches])
    # a mode that is not followed is counted at both ends of a strip without a crossing
    counted = np.interp(middles, place(x), result.unstable_count > 0) == 1.0
    counted &= ~(np.isin(edges[:-1], met) | np.isin(edges[1:], met))
    looks = np.where((growth > 0).any(axis=0) | counted, 2, np.isfinite(growth).any(axis=0)).tolist()
    for look, strips in groupby(range(len(looks)), looks.__getitem__):
        first, *_, last = [*strips] * 2
        axes.axvspan(edges[first], edges[last + 1], zorder=0, **_GROUNDS[look])


def root_locus(result: RangeResult) -> Figure:
    """Growth rate and frequency of each branch, coloured by the parameter; a ring where it begins, crossings of the
    axis marked.
    """
    figure = new_figure(7.6, 5.4)
    axes = figure.add_subplot()
    x = result.values / PARAMETERS[result.parameter].scale
    colours = matplotlib.colors.ListedColormap(matplotlib.colormaps[MAGNITUDE](np.linspace(0.0, 0.9, 256)))
    ends_of_x = limits(x, result.axis.log)
    scale = LogNorm(*ends_of_x) if result.axis.log else Normalize(*ends_of_x)
    ends: dict[tuple[float, ...], list[int]] = {}
    for branch in result.branches:
        points = np.column_stack([branch.growth_rate, branch.frequency])
        there = np.isfinite(points).all(axis=1)
        if not there.any():
            continue
        joined = there[:-1] & there[1:]
        pieces = np.stack([points[:-1], points[1:]], axis=1)[joined]
        axes.add_collection(
            LineCollection(pieces, colors=colours(scale(0.5 * (x[:-1] + x[1:])[joined])), linewidths=1.8)
        )
        axes.scatter(*points[there].T, c=x[there], cmap=colours, norm=scale, s=13, zorder=3)
        first, last = np.flatnonzero(there)[[0, -1]]
        axes.plot(*points[first], "o", mfc="white", mec=colours(scale(x[first])), mew=1.6, ms=7, zorder=4)
        ends.setdefault(tuple(points[last].round(6)), []).append(branch.id)
    for place, ids in ends.items():
        axes.annotate(", ".join(map(str, ids)), place, (6, 4), textcoords="offset points", fontsize=9.5, color="0.15")
    _mark_axis(axes, result)
    axes.margins(0.06)
    axes.autoscale_view()
    low, high = axes.get_xlim()
    high = max(high, 0.08 * (high - low))
    axes.axvspan(0.0, high, color=DANGER, lw=0, zorder=0)
    axes.axvline(0.0, color="0.25", lw=1.1, zorder=1)
    axes.set_xlim(low, high)
    axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])
    axes.text(0.995, 0.015, "unstable", transform=axes.transAxes, ha="right", va="bottom", color=UNSTABLE, fontsize=9)
    bar = colour_bar(figure, ScalarMappable(scale, colours), axes, parameter_label(result.case, result.parameter))
    if result.axis.log:
        log_axis(bar.ax.yaxis, x[0], x[-1])
    axes.set_xlabel("Growth rate, 1/s")
    axes.set_ylabel("Frequency, Hz")
    axes.set_title(f"Root locus, {surroundings_of(result)}", loc="left", fontweight="bold")
    words = "Rings: where a branch begins; numbers: where it ends."
    if result.crossings():
        words += " Diamonds: interpolated between the values computed."
    figure.supxlabel(words, x=0.01, ha="left", fontsize=9)
    return figure


def _mark_axis(axes, result: RangeResult) -> None:
    row = PARAMETERS[result.parameter]
    look = {"textcoords": "offset points", "fontsize": 9, "color": UNSTABLE, "path_effects": HALO}
    for crossing in result.crossings():
        axes.plot(0.0, crossing.frequency, "D", color=UNSTABLE, ms=6, zorder=5)
        axes.annotate(f"≈ {row.amount(crossing.value, 3)}", (0.0, crossing.frequency), (9, 6), **look)
