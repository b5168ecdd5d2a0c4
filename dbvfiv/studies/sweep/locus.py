"""Root locus: eigenvalues in the complex plane as the parameter moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import DANGER, HALO, MAGNITUDE, UNSTABLE, colour_bar, limits, log_axis, new_figure
from .curves import surroundings_of

if TYPE_CHECKING:
    from .result import SweepResult


def draw(result: SweepResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a sweep, each with its name."""
    if len(result.values) and result.branches:
        yield "root-locus", lambda: root_locus(result)


def root_locus(result: SweepResult) -> Figure:
    """Growth rate and frequency of each branch, coloured by the parameter; a ring where it begins, crossings of the
    axis marked.
    """
    row = PARAMETERS[result.parameter]
    name, unit, factor = row.words, row.shown_unit, 1.0 / row.scale
    figure = new_figure(7.6, 5.4)
    axes = figure.add_subplot()
    x = result.values * factor
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
    _mark_crossings(axes, result)
    axes.margins(0.06)
    axes.autoscale_view()
    low, high = axes.get_xlim()
    high = max(high, 0.08 * (high - low))
    axes.axvspan(0.0, high, color=DANGER, lw=0, zorder=0)
    axes.axvline(0.0, color="0.25", lw=1.1, zorder=1)
    axes.set_xlim(low, high)
    axes.set_ylim(bottom=-0.03 * axes.get_ylim()[1])
    axes.text(0.995, 0.015, "unstable", transform=axes.transAxes, ha="right", va="bottom", color=UNSTABLE, fontsize=9)
    bar = colour_bar(figure, ScalarMappable(scale, colours), axes, f"{name}, {unit}")
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


def _mark_crossings(axes, result: SweepResult) -> None:
    row = PARAMETERS[result.parameter]
    unit, factor = row.shown_unit, 1.0 / row.scale
    look = {"textcoords": "offset points", "fontsize": 9, "color": UNSTABLE, "path_effects": HALO}
    for crossing in result.crossings():
        axes.plot(0.0, crossing.frequency, "D", color=UNSTABLE, ms=6, zorder=5)
        axes.annotate(f"≈ {factor * crossing.value:.3g} {unit}", (0.0, crossing.frequency), (9, 6), **look)
