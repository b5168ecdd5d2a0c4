"""Growth rates along one parameter and where they vanish."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator

from ..case.parameters import PARAMETERS
from .style import ACCENT, COMPUTED, PUBLISHED, REST, new_figure

if TYPE_CHECKING:
    from ..results.onset import OnsetResults

_UNSTABLE = "#f6ddcf"


def draw(result: OnsetResults) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an onset result, each with its name."""
    if len(result.values):
        yield "onset", lambda: onset(result)


def onset(result: OnsetResults) -> Figure:
    """Growth rate and frequency of the leading modes, unstable ranges shaded, onsets marked."""
    axis = result.case.onset.axis
    scale = PARAMETERS[axis.parameter].scale
    values = result.values / scale
    figure = new_figure(7.2, 5.6)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    ranges = unstable_ranges(result)
    for axes in (top, bottom):
        if axis.log:
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
            decades = np.log10(values[-1] / values[0]) if len(values) > 1 else 1.0
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.6 else (1.0,), numticks=12))
        for a, b in ranges:
            axes.axvspan(
                a / scale,
                b / scale,
                color=_UNSTABLE,
                lw=0,
                zorder=0,
                label="unstable" if axes is top and a == ranges[0][0] else None,
            )
    growth, frequency = result.growth_rates, result.frequencies
    low = _floor(growth)
    for k in range(1, growth.shape[1]):
        top.plot(
            values,
            np.where(growth[:, k] > low, growth[:, k], np.nan),
            ".",
            color=REST,
            ms=3.5,
            label="further modes" if k == 1 else None,
        )
        bottom.plot(values, np.where(growth[:, k] > low, frequency[:, k], np.nan), ".", color=REST, ms=3.5)
    top.plot(values, growth[:, 0], "-", color=COMPUTED, label="leading mode")
    changes = np.flatnonzero(_jumps(frequency[:, 0]))
    bottom.plot(np.insert(values, changes, np.nan), np.insert(frequency[:, 0], changes, np.nan), "-", color=COMPUTED)
    top.axhline(0.0, color="0.25", lw=1.0)
    for row in result.points:
        x = row["value"] / scale
        hollow = row["criticality"] == "sub"
        style = {
            "marker": "o",
            "ms": 7,
            "color": PUBLISHED,
            "mfc": "white" if hollow else PUBLISHED,
            "ls": "none",
            "zorder": 5,
        }
        top.plot(x, 0.0, **style)
        bottom.plot(x, row["frequency"], **style)
        if math.isfinite(row["uncertainty"]):
            top.plot(
                [x - row["uncertainty"] / scale, x + row["uncertainty"] / scale],
                [0, 0],
                color=ACCENT,
                lw=3.5,
                alpha=0.75,
                zorder=4,
                solid_capstyle="butt",
            )
        kind = {"super": "supercritical", "sub": "subcritical"}.get(row["criticality"], "")
        words = f"{x:.4g}{_unit(axis.parameter)}\n{row['frequency']:.3g} Hz" + (f"\n{kind}" if kind else "")
        # on the side of the mark that the curve leaves free
        place = {"xytext": (9, -8), "va": "top"} if row["gains"] else {"xytext": (9, 8), "va": "bottom"}
        top.annotate(
            words,
            (x, 0.0),
            textcoords="offset points",
            fontsize=8.5,
            color=PUBLISHED,
            path_effects=[withStroke(linewidth=3, foreground="white")],
            **place,
        )
    # room for the words at the marks
    top.set_ylim(low, max(1.1 * np.nanmax(growth), -0.3 * low))
    top.set_ylabel("Growth rate, 1/s")
    bottom.set_ylabel("Frequency, Hz")
    bottom.set_ylim(bottom=0)
    bottom.set_xlabel(PARAMETERS[axis.parameter].label)
    top.set_title(_title(result), loc="left", fontweight="bold")
    top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    if len(values) > 1:
        bottom.set_xlim(values[0], values[-1])
    return figure


def unstable_ranges(result: OnsetResults) -> list[tuple[float, float]]:
    """Ranges of the parameter within which some mode grows."""
    marks = sorted(row["value"] for row in result.points if row["edge"])
    marks = [result.values[0], *marks, result.values[-1]]
    found = []
    for a, b in zip(marks[:-1], marks[1:]):
        inside = (result.values >= a) & (result.values <= b)
        strict = (result.values > a) & (result.values < b)
        chosen = strict if strict.any() else inside
        if chosen.any() and np.median(result.growth_rates[chosen, 0]) > 0:
            found.append((a, b))
    return found


def _unit(parameter: str) -> str:
    unit = PARAMETERS[parameter].shown_unit
    return f" {unit}" if unit else ""


def _floor(growth: np.ndarray) -> float:
    leading = growth[:, 0]
    return float(min(-5.0, 1.25 * np.nanmin(leading), -0.6 * np.nanmax(np.abs(leading))))


def _jumps(frequency: np.ndarray) -> np.ndarray:
    """Where another mode has taken the lead."""
    step = np.abs(np.diff(frequency, prepend=frequency[:1]))
    return step > 0.25 * np.maximum(frequency, 1.0)


def _title(result: OnsetResults) -> str:
    case, parameter = result.case, result.parameter
    shown = {
        "pressure": f"{case.drive.pressure / 1e3:g} kPa",
        "density": f"{case.fluid.density:g} kg/m³",
        "storage": case.fluid.continuity,
    }
    fixed = ", ".join(text for name, text in shown.items() if name != parameter)
    return f"{result.header.name}, {fixed}"
