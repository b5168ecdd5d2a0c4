"""Measured points on figures: crosses on curves, sections of the wall, its line at x = 0."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...drawing.style import COMPUTED, kilopascals, new_figure, pressure_colours, some_of
from ...drawing.views import closed_section
from .curves import MeasuredCurve
from .sections import MeasuredSection, MeasuredShapes

#: How measured points look.
MEASURED = {"ls": "", "marker": "x", "mew": 1.6, "ms": 7}
#: Most sections that one figure shows.
_MOST = 6


def draw_shapes(shapes: MeasuredShapes | None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of measured sections, each with its name."""
    if shapes is None:
        return
    if _wide(shapes):
        yield "measured-sections", lambda: sections(shapes)
    if _on_centre(shapes):
        yield "measured-centre-line", lambda: centre_line(shapes)


def _wide(shapes: MeasuredShapes) -> list[MeasuredSection]:
    """Sections of more than one point."""
    return [section for section in shapes.sections if len(section.points) > 1]


def _on_centre(shapes: MeasuredShapes) -> dict[tuple[float, str], np.ndarray]:
    """Points at x = 0, where the middle of the lips is, in two sections or more: (k, 2) z and y, m, by pressure and
    face; none on a half, whose middle need not be there.
    """
    found: dict[tuple[float, str], list[tuple[float, float]]] = {}
    for section in shapes.sections:
        if section.z is None or not section.part.is_quarter:
            continue
        near = np.abs(section.points[:, 0]) <= 1e-3 * max(1e-2, np.abs(section.points).max())
        for _, y in section.points[near]:
            found.setdefault((section.pressure, section.face), []).append((section.z, abs(y)))
    return {at: np.array(points) for at, points in found.items() if len({z for z, _ in points}) > 1}


def sections(shapes: MeasuredShapes) -> Figure:
    """Measured sections and the computed ones in their planes, with the distances between them."""
    shown = some_of(_wide(shapes), _MOST)
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    figure = new_figure(5.2 * columns + 0.6, 3.2 * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, section in zip(panels, shown):
        draw_section(axes, section)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def draw_section(axes: Axes, section: MeasuredSection) -> None:
    """One section: the computed curve of the whole valve and the measured points."""
    if section.curve is not None:
        axes.plot(*closed_section(section.curve, section.part).T * 1e3, color=COMPUTED, label="computed")
    axes.plot(*section.points.T * 1e3, color="black", label="measured", **MEASURED)
    distance = 1e3 * section.distance
    told = f"{np.sqrt(np.mean(distance**2)):.3g} mm rms" if np.isfinite(distance).all() else "not computed there"
    _label(axes, f"{section.title}: {told}")


def some_sections(shapes: Sequence[MeasuredShapes | None], most: int) -> list[MeasuredSection]:
    """At most so many sections of more than one point, of the first of several runs that has measured ones."""
    first = next((part for part in shapes if part is not None), None)
    return [] if first is None else some_of(_wide(first), most)


def draw_section_of_runs(
    axes: Axes, section: MeasuredSection, shapes: Sequence[MeasuredShapes | None], colours: Sequence[Any]
) -> None:
    """The measured points of a section, and what several runs have computed there, in their colours."""
    for run, colour in zip(shapes, colours):
        curve = None if run is None else run.walls.curve(section.pressure, section.z, section.face)
        if curve is not None:
            axes.plot(*closed_section(curve, run.walls.mesh.part).T * 1e3, color=colour, lw=1.2)
    axes.plot(*section.points.T * 1e3, color="black", **MEASURED)
    _label(axes, section.title)


def _label(axes: Axes, title: str) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_title(title, loc="left", fontsize=9)


def centre_line(shapes: MeasuredShapes) -> Figure:
    """Measured points at x = 0 over the distance from the lip, and the computed faces there."""
    groups = _on_centre(shapes)
    figure = new_figure(7.2, 4.2)
    axes = figure.add_subplot()
    for ((pressure, face), points), colour in zip(groups.items(), pressure_colours([p for p, _ in groups])):
        line = shapes.walls.centre_line(pressure, face)
        if line is not None:
            axes.plot(*line.T * 1e3, color=colour, label=f"{kilopascals(pressure)}, {face}, computed")
        axes.plot(*points.T * 1e3, color=colour, label=f"{kilopascals(pressure)}, {face}, measured", **MEASURED)
    axes.set_xlabel("Distance from the lip z, mm")
    axes.set_ylabel("y, mm")
    axes.set_title("The wall at x = 0", loc="left", fontweight="bold")
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def draw_curve(
    axes: Axes,
    computed: Sequence[Sequence[float]],
    curve: MeasuredCurve | None,
    factor: float,
    name: str,
    colours: tuple[Any, Any] = (COMPUTED, "black"),
) -> None:
    """A computed quantity over the pressure, (k, 2) Pa and SI, and the measured points, in two colours; `factor` is
    that of the axis.
    """
    pressure, values = np.array(computed, float).reshape(-1, 2).T
    axes.plot(pressure / 1e3, factor * values, "o-", color=colours[0], ms=4, label=name)
    if curve is not None:
        axes.plot(curve.pressure / 1e3, factor * curve.measured, color=colours[1], label="measured", **MEASURED)
