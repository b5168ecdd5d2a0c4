"""Several runs of a study side by side: differing keys, numbers at the pressures of the first, one figure of all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..case.units import Units
from ..drawing.style import COMPUTED, kilopascals, new_figure, new_panel, pressure_colours, put_in_units, some_of, style
from ..drawing.views import closed_section
from ..errors import CaseError
from ..texts import json_value
from .measured import MeasuredCurve, MeasuredSection, MeasuredShapes
from .result import StudyResult


def labels(results: Sequence[StudyResult], quiet: Sequence[str] = ()) -> list[str]:
    """Legend entries that say what tells the runs apart: by three keys of their cases, by more where those do not; keys
    that only steer a run (`quiet`) or say how results are shown are left out.
    """
    flat = [_flat(result.case.to_dict()) for result in results]
    every = dict.fromkeys(key for case in flat for key in case)
    told = [key for key in every if key not in quiet and not key.startswith(("project.", "report."))]
    keys = [key for key in told if any(case.get(key) != flat[0].get(key) for case in flat)]
    if not keys:
        return [result.path.stem if result.path else result.header.name for result in results]
    last = [key.split(".")[-1] for key in keys]
    names = [key if last.count(word) > 1 else word for key, word in zip(keys, last)]
    for count in range(min(3, len(keys)), len(keys) + 1):
        found = [", ".join(f"{n} {_text(case.get(k))}" for n, k in zip(names[:count], keys)) for case in flat]
        if len(set(found)) == len(found):
            break
    return found


def _flat(data: Any, prefix: str = "") -> dict[str, Any]:
    tables = isinstance(data, list) and data and all(isinstance(item, dict) for item in data)
    if not (isinstance(data, dict) or tables):
        return {prefix: data}
    found = {}
    for key, value in enumerate(data) if tables else data.items():
        found |= _flat(value, f"{prefix}.{key}" if prefix else key)
    return found


def _text(value: Any) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


# -- numbers


@dataclass(frozen=True)
class Compared:
    """A quantity in which runs are compared."""

    column: str  #: Its name in results and in JSON.
    factor: float = 1.0  #: From SI to the unit of the table.
    #: title and unit: of its table; without a title the unit stands in the head of the columns, without both there is
    #: no table.
    title: str = ""
    unit: str = ""
    share: bool = False  #: Differences are shares of the first run's number, and not numbers less that.
    key: str = ""  #: Of the differences in JSON; empty where they are not there.


@dataclass(frozen=True)
class Comparison:
    """Numbers of several runs at the pressures of the first."""

    results: Sequence[StudyResult]
    labels: list[str]  #: What tells the runs apart.
    quantities: tuple[Compared, ...]
    picture: Callable[[Sequence[StudyResult]], Figure]  #: Draws the figure of the runs.
    pressure: np.ndarray  #: (k,), Pa.
    values: dict[str, np.ndarray]  #: dict of (runs, k), SI; by columns; NaN where a run has nothing.
    notes: list[str] = field(default_factory=list)  #: Sentences below the tables.
    remark: str = ""  #: What stands in the way of comparing; empty if nothing does.

    @classmethod
    def of(
        cls,
        results: Sequence[Any],
        quiet: Sequence[str],
        quantities: tuple[Compared, ...],
        picture: Callable[[Sequence[StudyResult]], Figure],
        notes: Iterable[str] = (),
        remark: str = "",
    ) -> Comparison:
        """Hold results with `states` and ``at(pressure, column)`` against the first. Raises CaseError if one of them
        has no state.
        """
        for result in results:
            if not result.states:
                raise CaseError(f"{str(result.path or result.header.name)!r} holds no states to compare.")
        pressure = np.array(sorted({state.pressure for state in results[0].states}))
        values = {q.column: np.array([result.at(pressure, q.column) for result in results]) for q in quantities}
        said = [*notes, *tabulate_deviations([result.measured.parts.values() for result in results])]
        return cls(results, labels(results, quiet), quantities, picture, pressure, values, said, remark)

    def difference(self, quantity: Compared) -> np.ndarray:
        """(runs, k) numbers less those of the first run, SI, or over these less 1; NaN over one of 0."""
        values = self.values[quantity.column]
        return values / np.where(values[0] == 0, np.nan, values[0]) - 1.0 if quantity.share else values - values[0]

    def summary(self) -> list[dict[str, Any]]:
        """One entry for each pressure, SI; None where a run has nothing."""
        table = dict(self.values) | {q.key: self.difference(q) for q in self.quantities if q.key}
        return [
            {"pressure": float(p)} | {name: json_value(values[:, k]) for name, values in table.items()}
            for k, p in enumerate(self.pressure)
        ]

    def document(self) -> dict[str, Any]:
        """Part of the JSON document beside the runs themselves."""
        return {"comparison": self.summary(), "remark": self.remark}

    def lines(self) -> list[str]:
        """Tables for people: each run and what it differs by from the first."""
        lines = [f"{i}: {label}" for i, label in enumerate(self.labels, 1)]
        for quantity in self.quantities:
            if quantity.unit:
                lines += self._table(quantity)
        return [*lines, *map(self.results[0].case.units.say, [*([self.remark] if self.remark else []), *self.notes])]

    def _table(self, quantity: Compared) -> Iterator[str]:
        runs, share = range(len(self.labels)), quantity.share
        (pressure, of_pressure), (shown, ratio) = map(self._shown, ("kPa", quantity.unit))
        unit, factor = "" if quantity.title else f", {shown}", quantity.factor * ratio
        width, form, scale = (9, "+.3f", 100.0) if share else (12, "+.5g", factor)
        if quantity.title:
            yield from ("", f"{quantity.title}, {shown}")
        less = "%" if share else "less 1"
        yield f"{pressure:>10}" + "".join(f"{f'{i + 1}{unit}':>12}" + (f"{less:>{width}}" if i else "") for i in runs)
        values, off = factor * self.values[quantity.column], scale * self.difference(quantity)
        for k, at in enumerate(self.pressure * of_pressure / 1e3):
            cells = (cell(values[i, k], 12, ".5g") + (cell(off[i, k], width, form) if i else "") for i in runs)
            yield f"{at:10.6g}{''.join(cells)}"

    def _shown(self, unit: str) -> tuple[str, float]:
        """Unit of tables as the first run shows it, and the factor on numbers in it."""
        label, ratio = self.results[0].case.units.label(f"Values, {unit}")
        return label.rpartition(", ")[2], ratio

    def draw(self) -> Figure:
        """Figure of the runs."""
        return self.picture(self.results)


def cell(value: float | None, width: int, form: str) -> str:
    """A number of a table for people; a dash where there is none."""
    return ("-" if value is None or not np.isfinite(value) else f"{value:{form}}").rjust(width)


def tabulate_deviations(runs: Sequence[Iterable[Any]]) -> list[str]:
    """Tables of the deviations of runs from the same measured data, one for each kind of data (a title and a number for
    each point, `off`): a row for each point that runs have, a column for each run; nothing if no run has any.
    """
    kinds: dict[str, list[dict[str, float]]] = {}
    for number, parts in enumerate(runs):
        for part in parts:
            title, values = part.off
            kinds.setdefault(title, [{} for _ in runs])[number] = values
    lines = []
    for title, columns in kinds.items():
        names = list(dict.fromkeys(name for column in columns for name in column))
        width = max(len(name) for name in names) + 2
        lines += ["", title, " " * width + "".join(f"{number:>10}" for number in range(1, len(runs) + 1))]
        lines += [
            f"{name:<{width}}" + "".join(cell(column.get(name, np.nan), 10, ".4g") for column in columns)
            for name in names
        ]
    return lines


# -- figures

#: How measured points look, and most sections that one figure shows.
MEASURED, _MOST = {"ls": "", "marker": "x", "mew": 1.6, "ms": 7}, 6


def colours_of(results: Sequence[Any]) -> np.ndarray:
    """A colour for each of several runs."""
    return matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))


def draw_runs(
    results: Sequence[Any],
    names: Sequence[str],
    panels: Mapping[str, Callable[[Axes, Any, str, Any], None]],
    sections: int,
    title: str,
    size: tuple[float, float],
) -> Figure:
    """Figure of several runs.

    Parameters
    ----------
    results, names : sequences
        Runs, and what they are called.
    panels : mapping
        From labels of panels, "x label|y label", to functions that draw one run into them: of axes, result, name and
        colour.
    sections : int
        Most measured sections beside these panels.
    title : str
        Of the first panel.
    size : (float, float), inches
        Width of several panels, and height of a row of them.
    """
    shapes, colours = [result.measured.shapes for result in results], colours_of(results)
    first = next((part for part in shapes if part is not None), None)
    chosen = [] if first is None else some_of(first.wide, sections)
    count = len(panels) + len(chosen)
    columns = min(count, 2)
    rows = -(-count // columns)
    width, height = (7.0, 4.6) if count == 1 else (size[0], size[1] * rows)
    figure = new_figure(width, height + 0.22 * len(results))
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, (label, draw) in zip(axes, panels.items()):
        for result, name, colour in zip(results, names, colours):
            draw(panel, result, name, colour)
        panel.set(**dict(zip(("xlabel", "ylabel"), label.split("|"))))
    for panel, section in zip(axes[len(panels) :], chosen):
        _draw_section_of_runs(panel, section, shapes, colours)
    for panel in axes:
        panel.set_visible(panel.has_data())
    axes[0].set_title(title, loc="left", fontweight="bold")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2 if len(results) > 3 else 1)
    return figure


def _draw_section_of_runs(axes: Axes, section: MeasuredSection, shapes: Sequence[Any], colours: Iterable[Any]) -> None:
    """The measured points of a section, and what several runs have computed there, in their colours."""
    for run, colour in zip(shapes, colours):
        curve = None if run is None else run.walls.curve(section.pressure, section.z, section.face)
        if curve is not None:
            axes.plot(*closed_section(curve, run.walls.mesh.part).T * 1e3, color=colour, lw=1.2)
    axes.plot(*section.points.T * 1e3, color="black", **MEASURED)
    _label(axes, section.title)


def draw_curve(
    axes: Axes,
    computed: Iterable[tuple[float, float]],
    curve: MeasuredCurve | None,
    factor: float,
    name: str,
    colours: tuple[Any, Any] = (COMPUTED, "black"),
) -> None:
    """A computed quantity over the pressure, (k, 2) Pa and SI, and the measured points, in two colours; `factor` is
    that of the axis.
    """
    pressure, values = np.array([*computed], float).reshape(-1, 2).T
    axes.plot(pressure / 1e3, factor * values, "o-", color=colours[0], ms=4, label=name)
    if curve is not None:
        axes.plot(curve.pressure / 1e3, factor * curve.measured, color=colours[1], label="measured", **MEASURED)


def draw_shapes(shapes: MeasuredShapes | None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of measured sections, each with its name."""
    if shapes is None:
        return
    if shapes.wide:
        yield "measured-sections", lambda: _sections(shapes)
    if _on_centre(shapes):
        yield "measured-centre-line", lambda: _centre_line(shapes)


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


def _sections(shapes: MeasuredShapes) -> Figure:
    """Measured sections and the computed ones in their planes, with the distances between them."""
    shown = some_of(shapes.wide, _MOST)
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    figure = new_figure(5.2 * columns + 0.6, 3.2 * rows + 0.4)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, section in zip(panels, shown):
        if section.curve is not None:
            axes.plot(*closed_section(section.curve, section.part).T * 1e3, color=COMPUTED, label="computed")
        axes.plot(*section.points.T * 1e3, color="black", label="measured", **MEASURED)
        known = np.isfinite(section.distance).all()
        _label(
            axes,
            f"{section.title}: {f'{1e3 * section.root_mean_square:.3g} mm rms' if known else 'not computed there'}",
        )
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _label(axes: Axes, title: str) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x, mm", ylabel="y, mm")
    axes.set_title(title, loc="left", fontsize=9)


def _centre_line(shapes: MeasuredShapes) -> Figure:
    """Measured points at x = 0 over the distance from the lip, and the computed faces there."""
    groups = _on_centre(shapes)
    figure, axes = new_panel(7.2, 4.2, "The wall at x = 0", "Distance from the lip z, mm", "y, mm")
    for ((pressure, face), points), colour in zip(groups.items(), pressure_colours([p for p, _ in groups])):
        line, name = shapes.walls.centre_line(pressure, face), f"{kilopascals(pressure)}, {face}"
        if line is not None:
            axes.plot(*line.T * 1e3, color=colour, label=f"{name}, computed")
        axes.plot(*points.T * 1e3, color=colour, label=f"{name}, measured", **MEASURED)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def save_figure(draw: Callable[[], Figure], path: Path, units: Units) -> Path:
    """Draw into a file, .png without a suffix, in the units of a case. Raises CaseError if it cannot be written."""
    path = path if path.suffix else path.with_suffix(".png")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with style():
            put_in_units(draw(), units).savefig(path)
    except (OSError, ValueError) as error:
        raise CaseError(f"{str(path)!r} cannot be written ({error}).") from error
    return path
