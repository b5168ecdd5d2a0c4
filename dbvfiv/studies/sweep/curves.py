"""Damping and frequency of tracked modes over the parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...case.parameters import PARAMETERS
from ...drawing.style import DANGER, HALO, UNSTABLE, branch_looks, driven, limits, log_axis, new_figure

if TYPE_CHECKING:
    from .result import Branch, Crossing, SweepResult

#: Confidence below which a match is drawn as doubtful.
DOUBTFUL = 0.5
_STABLE_GROUND = "#1f4e790d"


def draw(result: SweepResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a sweep, each with its name."""
    if len(result.values) and result.branches:
        yield "sweep", lambda: curves(result)


def curves(result: SweepResult) -> Figure:
    """Growth rate, frequency and damping ratio of each branch; crossings of zero growth marked, spans with unstable
    modes shaded.
    """
    row = PARAMETERS[result.parameter]
    name, unit, factor = row.words, row.shown_unit, 1.0 / row.scale
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
    for axes, label in ((growth, "Growth rate, 1/s"), (frequency, "Frequency, Hz"), (ratio, "Damping ratio, %")):
        axes.set_ylabel(label)
    growth.axhline(0.0, color="0.25", lw=1.1)
    ratio.axhline(0.0, color="0.25", lw=1.1)
    frequency.set_ylim(bottom=min(0.0, frequency.get_ylim()[0]))
    ratio.set_xlabel(f"{name}, {unit}")
    over = f"{name[0].lower()}{name[1:]}"
    growth.set_title(f"Modes over {over}, {surroundings_of(result)}", loc="left", fontweight="bold")
    handles, labels = growth.get_legend_handles_labels()
    if any(np.nanmin(b.confidence, initial=1.0) < DOUBTFUL for b in result.branches):
        handles.append(Line2D([], [], ls="", marker="x", color="black", ms=8, mew=1.6))
        labels.append("doubtful match")
    growth.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.01, 1.02), title="mode")
    word = "certified against full solves" if result.certified else "not certified"
    words = f"Red ground: at least one unstable mode. The sweep is {word}."
    if result.crossings():
        words += "\nDiamonds: interpolated between the values computed; `dbvfiv onset` finds them exactly."
    figure.supxlabel(words, x=0.01, ha="left", fontsize=9)
    return figure


def _draw_branch(panels, x: np.ndarray, branch: Branch, look: dict) -> None:
    """A branch in the three panels, doubtful matches crossed."""
    size = np.hypot(branch.growth_rate, branch.angular_frequency)
    second = (branch.angular_frequency < 0).any()  # of a pair that two real modes became: both are seen
    series = (branch.growth_rate, branch.frequency, -100 * branch.growth_rate / np.where(size > 0, size, 1.0))
    doubtful = branch.confidence < DOUBTFUL
    look = look | {"lw": 1.7, "ls": "--" if second else "-", "ms": 3.6, "markevery": max(1, len(x) // 30)}
    for axes, values in zip(panels, series):
        axes.plot(x, values, label=f"{branch.id}", **look)
        axes.plot(x[doubtful], values[doubtful], "x", color="black", ms=8, mew=1.6)


def _mark_crossing(axes, crossing: Crossing, result: SweepResult, x: np.ndarray) -> None:
    """A crossing of zero growth and its numbers, beside it where there is room."""
    row = PARAMETERS[result.parameter]
    unit, factor = row.shown_unit, 1.0 / row.scale
    at = factor * crossing.value
    axes.plot(at, 0.0, "D", color=UNSTABLE, ms=6, zorder=4)
    side = -1 if _share(at, x, result.axis.log) > 0.7 else 1
    swing = f"{crossing.frequency:.2g} Hz" if crossing.frequency > 0 else "no oscillation"
    look = {"textcoords": "offset points", "fontsize": 9, "color": UNSTABLE, "path_effects": HALO}
    look["ha"] = "left" if side > 0 else "right"
    axes.annotate(f"≈ {at:.3g} {unit}, {swing}", (at, 0.0), (7 * side, 7), **look)


def surroundings_of(result: SweepResult) -> str:
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


def _shade(axes, result: SweepResult, x: np.ndarray) -> None:
    """Ground red where a mode is unstable, its edges at the crossings."""
    factor = 1.0 / PARAMETERS[result.parameter].scale
    edges = sorted(
        {float(x[0]), float(x[-1]), *(factor * c.value for c in result.crossings() if x[0] < factor * c.value < x[-1])}
    )
    if len(edges) == 1:  # a single value
        edges = list(limits(x, result.axis.log))
    for low, high in zip(edges[:-1], edges[1:]):
        inside = result.unstable_count[(x >= low) & (x <= high)]
        unstable = bool(inside.size) and (inside > 0).mean() > 0.5
        axes.axvspan(low, high, color=DANGER if unstable else _STABLE_GROUND, lw=0, zorder=0)
