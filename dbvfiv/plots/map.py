"""Stability maps: growth rate of the leading mode, onset curves with their frequency, labelled regions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator
from scipy.ndimage import distance_transform_edt, label

from ..case.parameters import PARAMETERS
from .style import new_figure

if TYPE_CHECKING:
    from ..results.map import MapResults

#: Growth below zero in blues, above in warm colours, near zero pale.
_GROWTH = LinearSegmentedColormap.from_list(
    "growth",
    [
        (0.0, "#29506d"),
        (0.25, "#7ea3bd"),
        (0.4999, "#e8f0f4"),
        (0.5001, "#fdf0dc"),
        (0.75, "#ee9b54"),
        (1.0, "#a3261b"),
    ],
)
_FREQUENCY = "viridis"
_HALO = [withStroke(linewidth=3.2, foreground="white")]
_TITLES = {0.0: "Quasi-steady continuity", 1.0: "Storage: moving walls displace fluid"}


def draw(result: MapResults) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a map, each with its name."""
    if any(not column.failure for column in result.columns):
        yield "stability-map", lambda: stability_map(result)
        yield "leading-frequency", lambda: leading_frequency(result)


def stability_map(result: MapResults) -> Figure:
    """The headline: where the valve flutters."""
    growth = result.grid("growth_rate")
    levels = growth_levels(growth)
    norm = BoundaryNorm(levels, 256)
    figure, panels = _panels(result)
    lines, mesh = None, None
    span = _frequency_span(result)
    for law, axes in enumerate(panels):
        mesh = _cells(axes, result, growth[law], _GROWTH, norm)
        _uncertain(axes, result, law)
        lines = _curves(axes, result, law, span) or lines
        _regions(axes, result, law)
    bar = figure.colorbar(mesh, ax=panels, pad=0.015, aspect=30, ticks=levels[::2], extend="both", location="right")
    bar.set_label("Growth rate of the leading mode, 1/s")
    if lines is not None:
        bar = figure.colorbar(lines, ax=panels, pad=0.015, aspect=30, location="right")
        bar.set_label("Frequency along the onset curve, Hz")
    _headline(figure, result)
    return figure


def leading_frequency(result: MapResults) -> Figure:
    """Frequency of the leading mode; it changes with a jump where another mode takes the lead."""
    frequency = np.ma.masked_invalid(result.grid("frequency"))
    top = float(frequency.max()) if frequency.count() else 1.0
    norm = matplotlib.colors.Normalize(0.0, top)
    figure, panels = _panels(result)
    mesh = None
    for law, axes in enumerate(panels):
        mesh = _cells(axes, result, frequency[law], matplotlib.colormaps["cividis"], norm)
        _uncertain(axes, result, law)
        for curve in result.curves:
            if curve.law == law:
                axes.plot(_shown(result.plan.x, curve.x), _shown(result.plan.y, curve.y), color="white", lw=3.0)
                axes.plot(_shown(result.plan.x, curve.x), _shown(result.plan.y, curve.y), color="#a3261b", lw=1.6)
        _regions(axes, result, law)
    bar = figure.colorbar(mesh, ax=panels, pad=0.015, aspect=30)
    bar.set_label("Frequency of the leading mode, Hz")
    _headline(figure, result)
    return figure


def growth_levels(growth: np.ndarray) -> np.ndarray:
    """Steps of colour, symmetric about zero, fine near it; 1-2-5 numbers up to what the map holds."""
    top = float(np.nanmax(np.abs(growth))) if np.isfinite(growth).any() else 1.0
    steps = [f * 10.0**k for k in range(-3, 7) for f in (1.0, 2.0, 5.0)]
    largest = next((s for s in steps if s >= 0.7 * top), top)
    up = [s for s in steps if s <= largest * 1.0001][-6:]
    return np.array([*(-s for s in up[::-1]), 0.0, *up])


def _panels(result: MapResults):
    count = len(result.plan.laws)
    figure = new_figure(8.4 if count == 1 else 13.2, 5.4)
    panels = np.atleast_1d(figure.subplots(1, count, sharex=True, sharey=True))
    for number, (law, axes) in enumerate(zip(result.plan.laws, panels)):
        axes.grid(False)
        for set_scale, axis in ((axes.set_xscale, result.plan.x), (axes.set_yscale, result.plan.y)):
            if axis.log:
                set_scale("log")
        axes.set_xlabel(PARAMETERS[result.plan.x.parameter].label)
        if number == 0:
            axes.set_ylabel(PARAMETERS[result.plan.y.parameter].label)
        if "storage" not in (result.plan.x.parameter, result.plan.y.parameter):
            axes.set_title(_TITLES.get(law, f"Blend of the continuity laws {law:g}"), loc="left")
        for place, axis in ((axes.xaxis, result.plan.x), (axes.yaxis, result.plan.y)):
            if axis.log:
                place.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
                decades = np.log10(axis.values[-1] / axis.values[0])
                place.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.6 else (1.0,), numticks=12))
        axes.tick_params(which="both", direction="out")
        for spine in axes.spines.values():
            spine.set_visible(True)
    return figure, list(panels)


def _headline(figure: Figure, result: MapResults) -> None:
    case = result.case
    mesh = case.mesh
    shown = {
        "pressure": f"{case.drive.pressure / 1e3:g} kPa",
        "density": f"{case.fluid.density:g} kg/m³",
        "alpha": f"α = {case.damping.alpha:g} 1/s",
    }
    shown["beta"] = f"β = {case.damping.beta:g} s"
    fixed = [text for name, text in shown.items() if name not in (result.plan.x.parameter, result.plan.y.parameter)]
    figure.suptitle(f"Stability of {result.header.name}", x=0.01, ha="left", fontweight="bold", fontsize=12)
    words = [", ".join(fixed), f"{mesh.around} × {mesh.along} elements", _vouched(result)]
    figure.supxlabel(" · ".join(w for w in words if w), x=0.01, ha="left", fontsize=8.5, color="0.35")


def _vouched(result: MapResults) -> str:
    certified, found = result.grid("certified"), result.grid("unstable") >= 0
    text = f"{int(certified.sum())} of {int(found.sum())} cells certified by two counts"
    if (found & ~certified.astype(bool)).any():
        text += ", the others hatched"
    return text + (f", {len(result.checks)} solved again in full" if result.checks else "")


def _edges(axis) -> np.ndarray:
    """Borders of the cells around the values of an axis."""
    values = _shown(axis, np.asarray(axis.values))
    v = np.log(values) if axis.log else values
    middle = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate([[v[0]], middle, [v[-1]]])
    return np.exp(edges) if axis.log else edges


def _shown(axis, values):
    return np.asarray(values) / PARAMETERS[axis.parameter].scale


def _cells(axes, result: MapResults, values, colours, norm):
    axes.set_facecolor("#d9d9d9")
    x, y = _edges(result.plan.x), _edges(result.plan.y)
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(values), cmap=colours, norm=norm, rasterized=True)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    gaps = np.argwhere(~np.isfinite(np.ma.filled(values, np.nan)))
    for j, i in gaps:
        axes.fill_between(x[i : i + 2], y[j], y[j + 1], facecolor="#d9d9d9", hatch="////", edgecolor="#9a9a9a", lw=0)
    return mesh


def _uncertain(axes, result: MapResults, law: int) -> None:
    """Hatch the cells that carry no certificate: what their colour says is not vouched for."""
    doubtful = ~result.grid("certified")[law].astype(bool) & (result.grid("unstable")[law] >= 0)
    if not doubtful.any():
        return
    x, y = _edges(result.plan.x), _edges(result.plan.y)
    hatching = axes.pcolor(x, y, np.ma.masked_where(~doubtful, doubtful), hatch="xxx", alpha=0.0)
    hatching.set_label("uncertain")


def _frequency_span(result: MapResults) -> tuple[float, float]:
    values = np.concatenate([c.frequency for c in result.curves]) if result.curves else np.array([0.0, 1.0])
    low, high = float(values.min()), float(values.max())
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _curves(axes, result: MapResults, law: int, span):
    lines = None
    for curve in result.curves:
        if curve.law != law:
            continue
        points = np.column_stack([_shown(result.plan.x, curve.x), _shown(result.plan.y, curve.y)])
        if len(points) == 1:
            axes.plot(*points[0], "o", color="black", ms=4)
            continue
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        axes.add_collection(LineCollection([points], colors="black", linewidths=4.4, capstyle="round"))
        lines = LineCollection(
            pieces, cmap=_FREQUENCY, norm=matplotlib.colors.Normalize(*span), linewidths=2.6, capstyle="round"
        )
        lines.set_array(0.5 * (curve.frequency[1:] + curve.frequency[:-1]))
        if not curve.exact:
            lines.set_linestyle((0, (3, 1.5)))
        axes.add_collection(lines)
        _ticks_along(axes, points, curve.frequency)
    return lines


def _ticks_along(axes, points: np.ndarray, frequency: np.ndarray) -> None:
    """The frequency written at a few places of a curve that is long enough."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    scale = [
        np.log10 if axes.get_xscale() == "log" else np.asarray,
        np.log10 if axes.get_yscale() == "log" else np.asarray,
    ]
    unit = np.column_stack(
        [(s(points[:, k]) - s(limits[k, 0])) / (s(limits[k, 1]) - s(limits[k, 0])) for k, s in enumerate(scale)]
    )
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(unit, axis=0), axis=1))])
    if length[-1] < 0.25:
        return
    for share in np.linspace(0.12, 0.88, max(2, min(5, int(length[-1] / 0.35)))):
        i = int(np.argmin(np.abs(length - share * length[-1])))
        if not (0.03 < unit[i, 0] < 0.95 and 0.04 < unit[i, 1] < 0.95):
            continue
        axes.annotate(
            f"{frequency[i]:.3g} Hz",
            points[i],
            xytext=(7, 5),
            textcoords="offset points",
            fontsize=8,
            color="black",
            path_effects=_HALO,
            clip_on=True,
        )


def _regions(axes, result: MapResults, law: int) -> None:
    """Words in the middle of each sizeable region."""
    unstable, certified = result.grid("unstable")[law], result.grid("certified")[law].astype(bool)
    known = certified & (unstable >= 0)
    x, y = _edges(result.plan.x), _edges(result.plan.y)
    regions = ((known & (unstable > 0), "unstable"), (known & (unstable == 0), "stable"))
    for mask, word in (*regions, (~certified & (unstable >= 0), "uncertain")):
        parts, count = label(mask)
        for number in range(1, count + 1):
            part = parts == number
            if part.sum() < 0.03 * part.size:
                continue
            depth = distance_transform_edt(np.pad(part, 1))[1:-1, 1:-1]
            j, i = np.unravel_index(int(np.argmax(depth)), depth.shape)
            if depth[j, i] < 1.5:
                continue
            middle = [
                np.sqrt(e[k] * e[k + 1]) if axis.log else 0.5 * (e[k] + e[k + 1])
                for e, k, axis in ((x, i, result.plan.x), (y, j, result.plan.y))
            ]
            axes.annotate(
                word,
                middle,
                ha="center",
                va="center",
                fontsize=12.5,
                fontweight="bold",
                color="0.12",
                path_effects=_HALO,
            )
