"""Stability maps: growth rate of the leading mode, onset curves with their frequency, labelled regions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import matplotlib
import numpy as np
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from scipy.ndimage import distance_transform_edt, label

from ...case.parameters import PARAMETERS
from ...drawing.style import (
    HALO,
    MAGNITUDE,
    MOTION,
    SIGNED,
    colour_bar,
    headline,
    limits,
    log_axis,
    new_figure,
    parameter_label,
)
from ...texts import digits
from ..result import StudyResult
from ..stability.place import describe_fixed
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, OUTCOMES, STABLE, UNDECIDED
from .chances import BANDS

#: Places across a picture at which its regions are looked at.
_FINE = 120
#: Colour of cells of a sealed bill.
SEALED = "#c9b8a0"
_BAR = "Growth rate of the leading mode, 1/s"
_TITLES = {0.0: "Quasi-steady continuity", 1.0: "Storage: moving walls displace fluid"}


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a map, each with its name."""
    if any(not column.failure for column in result.columns):
        yield "stability-map", lambda: stability_map(result)
        yield "leading-frequency", lambda: leading_frequency(result)
    if np.isfinite(result.cycle_grid("amplitude")).any():
        yield "cycle-amplitude", lambda: cycle_amplitude(result)


def stability_map(result: StudyResult) -> Figure:
    """The headline: where the valve flutters. Cells that no independent count certifies are hatched."""
    growth = np.where(certified_cells(result), result.over_classes("growth_rate"), np.nan)
    levels = growth_levels(growth)
    norm = BoundaryNorm(levels, 256)
    figure, panels = _panels(result)
    for law, axes in enumerate(panels):
        mesh = _cells(axes, result, growth[law], matplotlib.colormaps[SIGNED], norm)
        _sealed(axes, result, law)
        _curves(axes, result, law)
        label_regions(axes, result, law)
        if result.case.map.samples and result.plan.laws[law] == result.plan.base.storage:
            _bands(axes, result)
    bar = colour_bar(figure, mesh, panels, _BAR, pad=0.015, ticks=levels, extend="both", spacing="uniform")
    bar.ax.set_yticklabels([f"{level:g}".replace("-", "\N{MINUS SIGN}") for level in levels])
    bar.ax.minorticks_off()
    return _finish(figure, result)


def _bands(axes, result: StudyResult) -> None:
    """Curves of the probability of flutter under the flow model of the case."""
    value = result.probability[0]
    if np.isfinite(value).any():
        x, y = (np.asarray(_shown(axis, np.asarray(axis.values))) for axis in (result.plan.x, result.plan.y))
        lines = axes.contour(x, y, value, BANDS, colors="black", linewidths=1.2, linestyles=(":", "-", "--"))
        lines.set(path_effects=HALO)
        for label in axes.clabel(lines, fmt={level: f"P = {100 * level:g} %" for level in BANDS}, fontsize=8):
            label.set(path_effects=HALO)


def leading_frequency(result: StudyResult) -> Figure:
    """Frequency of the leading mode; it changes with a jump where another mode takes the lead."""
    frequency = np.ma.masked_invalid(np.where(certified_cells(result), result.over_classes("frequency"), np.nan))
    top = float(frequency.max()) if frequency.count() else 1.0
    norm = matplotlib.colors.Normalize(0.0, top)
    figure, panels = _panels(result)
    for law, axes in enumerate(panels):
        mesh = _cells(axes, result, frequency[law], matplotlib.colormaps[MOTION], norm)
        _sealed(axes, result, law)
        _curves(axes, result, law)
        label_regions(axes, result, law)
    colour_bar(figure, mesh, panels, "Frequency of the leading mode, Hz", pad=0.015)
    return _finish(figure, result)


def cycle_amplitude(result: StudyResult) -> Figure:
    """Amplitude of the limit cycle where there is one; unstable cells without one are hatched, unstable cycles
    dotted.
    """
    amplitude = 1e3 * result.cycle_grid("amplitude")
    growing = result.cycle_grid("growing")
    unstable = (result.grid("unstable") != 0) | unstable_cells(result)
    norm = matplotlib.colors.Normalize(0.0, float(np.nanmax(amplitude)))
    figure, panels = _panels(result)
    x, y = (np.asarray(_shown(axis, np.asarray(axis.values))) for axis in (result.plan.x, result.plan.y))
    for law, axes in enumerate(panels):
        lacking = np.isnan(amplitude[law]) & unstable[law]
        shown = np.where(lacking, np.nan, np.nan_to_num(amplitude[law]))
        mesh = _cells(axes, result, shown, matplotlib.colormaps[MAGNITUDE].with_extremes(under="white"), norm)
        still = np.where(np.isnan(amplitude[law]) & ~lacking, 1.0, np.nan)
        axes.pcolormesh(_edges(result.plan.x), _edges(result.plan.y), still, cmap="gray", vmin=0.0, vmax=1.0)
        rows, columns = np.nonzero(growing[law] > 0)
        axes.plot(x[columns], y[rows], ".", color="black", ms=3)
        for line in result.touching_curves(law):
            touching = np.column_stack([_shown(result.plan.x, line[:, 0]), _shown(result.plan.y, line[:, 1])])
            axes.plot(*touching.T, color="C3", lw=2.0, marker="o", ms=3)
            axes.annotate("lips touch", touching[len(touching) // 2], fontsize=8, color="C3", path_effects=HALO)
        _curves(axes, result, law)
        label_regions(axes, result, law)
    colour_bar(figure, mesh, panels, "Amplitude of the limit cycle, one lip, mm", pad=0.015)
    return _finish(figure, result)


def certified_cells(result: StudyResult) -> np.ndarray:
    """(laws, rows, columns) whether two counts agree on a cell, and decide it."""
    decided = result.over_classes("outcome") != OUTCOMES.index(UNDECIDED)
    return result.over_classes("certified").astype(bool) & decided & (result.grid("unstable") >= 0)


def invalid_cells(result: StudyResult) -> np.ndarray:
    """(laws, rows, columns) where the constants of the rubber do not hold."""
    return result.over_classes("outcome") == OUTCOMES.index(NOT_VALID)


def unstable_cells(result: StudyResult) -> np.ndarray:
    """(laws, rows, columns) where the valve flutters or diverges."""
    return np.isin(result.over_classes("outcome"), [OUTCOMES.index(name) for name in (FLUTTERS, DIVERGES)])


def growth_levels(growth: np.ndarray) -> np.ndarray:
    """Steps of colour, symmetric about zero, fine near it; 1-2-5 numbers up to what the map holds."""
    top = float(np.nanmax(np.abs(growth))) if np.isfinite(growth).any() else 1.0
    steps = [f * 10.0**k for k in range(-3, 7) for f in (1.0, 2.0, 5.0)]
    largest = next((s for s in steps if s >= 0.7 * top), top)
    up = [s for s in steps if s <= largest * 1.0001][-6:]
    return np.array([*(-s for s in up[::-1]), 0.0, *up])


def _panels(result: StudyResult):
    count = len(result.plan.laws)
    figure = new_figure(8.4 if count == 1 else 13.2, 5.4)
    panels = np.atleast_1d(figure.subplots(1, count, sharex=True, sharey=True))
    for number, (law, axes) in enumerate(zip(result.plan.laws, panels)):
        axes.grid(False)
        axes.set_xlabel(parameter_label(result.case, result.plan.x.parameter))
        if number == 0:
            axes.set_ylabel(parameter_label(result.case, result.plan.y.parameter))
        if "storage" not in (result.plan.x.parameter, result.plan.y.parameter):
            axes.set_title(_TITLES.get(law, f"Blend of the flow models {law:g}"), loc="left")
        for place, axis in ((axes.xaxis, result.plan.x), (axes.yaxis, result.plan.y)):
            if axis.log:
                edges = _edges(axis)
                log_axis(place, edges[0], edges[-1])
        axes.tick_params(which="both", direction="out")
        for spine in axes.spines.values():
            spine.set_visible(True)
    return figure, list(panels)


def _finish(figure: Figure, result: StudyResult) -> Figure:
    case, mesh = result.case, result.case.mesh
    words = describe_fixed(case, *result.moved), f"{mesh.around} × {mesh.along} elements", _vouched(result)
    return headline(figure, f"Stability of {result.header.name}", *words)


def _vouched(result: StudyResult) -> str:
    certified, found = certified_cells(result), result.grid("unstable") >= 0
    text = f"{int(certified.sum())} of {int(found.sum())} cells certified by two counts"
    own, *others = (motion.name for motion in result.plan.classes)
    text += f" in classes {', '.join([own, *others])} (curves: {own})" if others else f" in class {own} alone"
    if not certified.all():
        text += ", the others hatched"
    if invalid_cells(result).any():
        text += " (not valid: the constants of the rubber do not hold there)"
    return text + (f", {len(result.checks)} solved again in full" if result.checks else "")


def _edges(axis) -> np.ndarray:
    """Borders of the cells around the values of an axis."""
    values = _shown(axis, np.asarray(axis.values))
    if len(values) == 1:
        return np.array(limits(values, axis.log))
    v = np.log(values) if axis.log else values
    middle = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate([[v[0]], middle, [v[-1]]])
    return np.exp(edges) if axis.log else edges


def _shown(axis, values):
    return np.asarray(values) / PARAMETERS[axis.parameter].scale


def _cells(axes, result: StudyResult, values, colours, norm):
    axes.set_facecolor("#d9d9d9")
    x, y = _edges(result.plan.x), _edges(result.plan.y)
    mesh = axes.pcolormesh(x, y, np.ma.masked_invalid(values), cmap=colours, norm=norm, rasterized=True)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    gaps = np.argwhere(~np.isfinite(np.ma.filled(values, np.nan)))
    for j, i in gaps:
        axes.fill_between(x[i : i + 2], y[j], y[j + 1], facecolor="#d9d9d9", hatch="////", edgecolor="#9a9a9a", lw=0)
    return mesh


def _sealed(axes, result: StudyResult, law: int) -> None:
    """Cells of a bill that is moulded shut and sealed: no flow, so that nothing but its own damping decides."""
    sealed = result.grid("sealed")[law] > 0
    if sealed.any():
        shown = np.where(sealed, 1.0, np.nan)
        colour = matplotlib.colors.ListedColormap([SEALED])
        axes.pcolormesh(_edges(result.plan.x), _edges(result.plan.y), shown, cmap=colour, rasterized=True)


def _curves(axes, result: StudyResult, law: int) -> None:
    """Onset curves in black, dashed where they are interpolated, their frequency written along them; contours thin,
    their level in their middle.
    """
    for curve in result.curves:
        if curve.law != law:
            continue
        points = np.column_stack([_shown(result.plan.x, curve.x), _shown(result.plan.y, curve.y)])
        if len(points) == 1:
            axes.plot(*points[0], "o", color="black", ms=4)
            continue
        dashes = "-" if curve.exact else (0, (3, 1.5))
        if curve.level:
            axes.plot(*points.T, color="0.15", lw=1.0, ls=dashes)
            look = {"ha": "center", "va": "center", "fontsize": 7.5, "color": "0.15", "path_effects": HALO}
            level = curve.level.replace("-", "\N{MINUS SIGN}")
            axes.annotate(level, points[len(points) // 2], clip_on=True, **look)
            continue
        axes.plot(*points.T, color="white", lw=4.6, solid_capstyle="round")
        axes.plot(*points.T, color="black", lw=2.4, ls=dashes, solid_capstyle="round")
        _ticks_along(axes, points, curve.frequency)


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
        step = unit[min(i + 1, len(unit) - 1)] - unit[max(i - 1, 0)]
        rising = step[0] * step[1] > 0  # the text lies right of the curve, below where it rises
        axes.annotate(
            f"{digits(frequency[i])} Hz",
            points[i],
            xytext=(8, -6) if rising else (8, 4),
            textcoords="offset points",
            va="top" if rising else "bottom",
            fontsize=8,
            color="black",
            path_effects=HALO,
            clip_on=True,
        )


def label_regions(axes, result: StudyResult, law: int) -> None:
    """Words, on a ground of their own, in the middle of the largest regions: stable in all classes of motion, unstable
    in any.
    """
    outcome, stable = result.over_classes("outcome")[law], OUTCOMES.index(STABLE)
    sure, invalid, unstable = (of(result)[law] for of in (certified_cells, invalid_cells, unstable_cells))
    cells = [_drawn_cells(axis) for axis in (result.plan.x, result.plan.y)]
    sealed = result.grid("sealed")[law] > 0
    regions = {"unstable": sure & unstable, "not valid": invalid, "stable": sure & (outcome == stable) & ~sealed}
    regions["sealed"] = sealed
    for word, mask in regions.items():
        parts, count = label(mask[np.ix_(cells[1], cells[0])])
        sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:]
        for number in np.flatnonzero((sizes >= 0.05 * parts.size) | (sizes == sizes.max(initial=-1))) + 1:
            # deep inside, and nearer to a longish word's shape than a square would be
            depth = distance_transform_edt(np.pad(parts == number, 1), sampling=(2.0, 1.0))[1:-1, 1:-1]
            j, i = np.unravel_index(int(np.argmax(depth)), depth.shape)
            axes.text(
                (i + 0.5) / _FINE,
                (j + 0.5) / _FINE,
                word,
                transform=axes.transAxes,
                ha="center",
                va="center",
                fontsize=10.5,
                fontweight="bold",
                bbox={"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": "0.3", "lw": 0.6},
            )


def _drawn_cells(axis) -> np.ndarray:
    """Cell under each of `_FINE` places across the picture."""
    edges = _edges(axis)
    edges = np.log(edges) if axis.log else edges
    places = edges[0] + (edges[-1] - edges[0]) * (np.arange(_FINE) + 0.5) / _FINE
    return np.clip(np.searchsorted(edges, places) - 1, 0, len(edges) - 2)
