"""Growth rates along one parameter and where they vanish."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import ACCENT, COMPUTED, HALO, PUBLISHED, REST, limits, log_axis, new_figure, parameter_label
from ..result import StudyResult
from ..stability.place import describe_fixed
from .line import Interval

_UNSTABLE = "#f6ddcf"


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an onset result, each with its name."""
    if len(result.values):
        yield "onset", lambda: onset(result)


def onset(result: StudyResult) -> Figure:
    """Growth rate and frequency of the leading modes, unstable ranges shaded, uncertain ones hatched, onsets marked."""
    axis = result.case.onset.axis
    scale = PARAMETERS[axis.parameter].scale
    values = result.values / scale
    figure = new_figure(7.2, 5.8)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _shade(result, scale, top, bottom)
    low = _draw_scan(result, values, top, bottom)
    for row in result.points:
        _mark(row, scale, axis.parameter, top, bottom)
    # room for the words at the marks
    top.set_ylim(low, max(1.1 * np.nanmax(result.growth_rates), -0.3 * low))
    top.set_ylabel("Growth rate, 1/s")
    bottom.set_ylabel("Frequency, Hz")
    bottom.set_ylim(bottom=0)
    bottom.set_xlabel(parameter_label(result.case, axis.parameter))
    top.set_title(_title(result), loc="left", fontweight="bold")
    figure.legend(loc="outside lower center", ncols=3)
    for axes in (top, bottom):
        if axis.log:
            log_axis(axes.xaxis, *limits(values, True))
        axes.set_xlim(*limits(values, axis.log))
        axes.tick_params(labelbottom=True)
    return figure


def _shade(result: StudyResult, scale: float, *panels) -> None:
    """Unstable ranges in a tint; hatched where nothing is certified, and so nothing claimed."""
    unsure = {"facecolor": "#ececec", "edgecolor": "#9a9a9a", "hatch": "////"}
    _span(result.unstable_intervals, scale, panels, "unstable", facecolor=_UNSTABLE)
    _span(result.uncertain_intervals, scale, panels, "uncertain", **unsure)


def _span(intervals: list[Interval], scale: float, panels, label: str, **look) -> None:
    for number, (a, b) in enumerate(intervals):
        for axes in panels:
            named = label if axes is panels[0] and not number else None
            axes.axvspan(a / scale, b / scale, lw=0, zorder=0, label=named, **look)


def _draw_scan(result: StudyResult, values: np.ndarray, top, bottom) -> float:
    """Curves of the scan; the growth rate down to which they are shown."""
    growth, frequency = result.growth_rates, result.frequencies
    low = _floor(growth)
    for k in range(1, growth.shape[1]):
        shown = growth[:, k] > low
        label = "further modes" if k == 1 else None
        top.plot(values, np.where(shown, growth[:, k], np.nan), "s", color=REST, ms=3.5, label=label)
        bottom.plot(values, np.where(shown, frequency[:, k], np.nan), "s", color=REST, ms=3.5)
    top.plot(values, growth[:, 0], ".-", color=COMPUTED, label="leading mode")
    changes = np.flatnonzero(_jumps(frequency[:, 0]))
    bottom.plot(np.insert(values, changes, np.nan), np.insert(frequency[:, 0], changes, np.nan), ".-", color=COMPUTED)
    for part, style in zip(result.classes, ("--", "-.", ":")):
        scan, scale = part["scan"], PARAMETERS[result.parameter].scale
        places, rates = np.array(scan["values"]) / scale, np.array(scan["growth_rate"])
        look = {"ls": style, "color": ACCENT, "lw": 1.2}
        top.plot(places, np.where(rates > low, rates, np.nan), label=f"class {part['symmetry']}", **look)
        bottom.plot(places, scan["frequency"], **look)
    top.axhline(0.0, color="0.25", lw=1.0)
    return low


def _mark(row: dict, scale: float, parameter: str, top, bottom) -> None:
    """An onset with its uncertainty and its numbers: full where it is supercritical, hollow where it is subcritical."""
    x = row["value"] / scale
    inside = "white" if row["criticality"] == "sub" else PUBLISHED
    look = {"marker": "o", "ms": 7, "color": PUBLISHED, "mfc": inside, "ls": "none", "zorder": 5}
    top.plot(x, 0.0, **look)
    bottom.plot(x, row["frequency"], **look)
    if row["uncertainty"] is not None:
        reach = row["uncertainty"] / scale
        top.plot([x - reach, x + reach], [0, 0], color=ACCENT, lw=3.5, alpha=0.75, zorder=4, solid_capstyle="butt")
    kind = {"super": "supercritical", "sub": "subcritical"}.get(row["criticality"], "")
    words = f"{x:.4g}{_unit(parameter)}\n{row['frequency']:.3g} Hz" + (f"\n{kind}" if kind else "")
    # on the side of the mark that the curve leaves free
    place = {"xytext": (9, -8), "va": "top"} if row["gains"] else {"xytext": (9, 8), "va": "bottom"}
    look = {"textcoords": "offset points", "fontsize": 8.5, "color": PUBLISHED, "path_effects": HALO}
    top.annotate(words, (x, 0.0), **look, **place)


def _unit(parameter: str) -> str:
    unit = PARAMETERS[parameter].shown_unit
    return f" {unit}" if unit else ""


def _floor(growth: np.ndarray) -> float:
    leading = growth[:, 0]
    return float(min(-5.0, 1.25 * np.nanmin(leading), -0.6 * np.nanmax(np.abs(leading))))


def _jumps(frequency: np.ndarray) -> np.ndarray:
    """Mask of values where another mode has become the leading one."""
    step = np.abs(np.diff(frequency, prepend=frequency[:1]))
    return step > 0.25 * np.maximum(frequency, 1.0)


def _title(result: StudyResult) -> str:
    return f"{result.header.name}, {describe_fixed(result.case, result.parameter)}"
