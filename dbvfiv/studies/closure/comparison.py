"""Back pressure on several valves: one figure, one table with differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import REST, new_figure
from ...errors import CaseError
from .. import comparing
from ..measured.figures import MEASURED, draw_section_of_runs, some_sections
from .result import ClosureResult

#: Keys that do not change what a run finds.
_QUIET = tuple(
    f"closure.{key}"
    for key in ("pressures", "measured", "rated_pressure", "max_step", "eigenvalues", "arclength", "symmetry", "start")
)
#: Columns of the path that are compared: in a table with a factor, a title and a unit.
COLUMNS = {
    "lip_seal": (1e3, "Sealed from the lip", "mm"),
    "contact_force": (1.0, "Force between the walls", "N"),
    "max_displacement": (1e3, "Largest displacement", "mm"),
    "least_opening": (1e6, "Narrowest passage", "mm²"),
    "lowest_eigenvalue": (1e-3, "Lowest stiffness eigenvalue", "10³ 1/s²"),
}


@dataclass(frozen=True)
class Comparison:
    """Numbers of several runs at the back pressures of the first.

    Attributes
    ----------
    labels : list of str
        What tells the runs apart.
    pressure : (k,) array, Pa
    values : dict of (runs, k) arrays, SI
        By the names of `COLUMNS`; between load steps of a run by a straight line, NaN beyond them.
    critical_pressure, safety : lists of float or None
        Where the wall buckles, Pa, and the safety factor of each run.
    measured : list of str
        What the runs are off by from measured data.
    """

    labels: list[str]
    pressure: np.ndarray
    values: dict[str, np.ndarray]
    critical_pressure: list[float | None]
    safety: list[float | None]
    measured: list[str]

    @property
    def remark(self) -> str:
        """Sentence on obstacles to a comparison; always empty, since closure runs can always be compared."""
        return ""

    def difference(self, name: str) -> np.ndarray:
        """(runs, k) numbers less those of the first run, SI."""
        return self.values[name] - self.values[name][0]

    def summary(self) -> list[dict[str, Any]]:
        """One entry for each pressure, SI; None where a run has nothing."""
        rows = []
        for k, pressure in enumerate(self.pressure):
            found = {name: comparing.plain(values[:, k]) for name, values in self.values.items()}
            found |= {f"{name}_difference": comparing.plain(self.difference(name)[:, k]) for name in self.values}
            rows.append({"pressure": float(pressure)} | found)
        return rows

    def lines(self) -> list[str]:
        """Tables for people: each run and what it differs by from the first."""
        runs = range(len(self.labels))
        lines = [f"{i}: {label}" for i, label in enumerate(self.labels, 1)]
        for name, (factor, title, unit) in COLUMNS.items():
            head = f"{'kPa':>10}" + "".join(f"{i + 1:>12}" + (f"{'less 1':>12}" if i else "") for i in runs)
            lines += ["", f"{title}, {unit}", head]
            less = self.difference(name)
            for k, pressure in enumerate(self.pressure):
                cells = "".join(
                    comparing.cell(factor * self.values[name][i, k], 12, ".5g")
                    + (comparing.cell(factor * less[i, k], 12, "+.5g") if i else "")
                    for i in runs
                )
                lines.append(f"{pressure / 1e3:10.6g}{cells}")
        lines.append("")
        for i, (critical, factor) in enumerate(zip(self.critical_pressure, self.safety), 1):
            buckles = "no buckling on its path" if critical is None else f"buckles at {critical / 1e3:.6g} kPa"
            lines.append(f"{i}: {buckles}{'' if factor is None else f', safety factor {factor:.3g}'}.")
        return lines + self.measured


def compare(results: Sequence[ClosureResult]) -> Comparison:
    """Hold several runs against the first.

    Raises
    ------
    CaseError
        If one of them has no state.
    """
    for result in results:
        if not result.states:
            raise CaseError(f"{str(result.path or result.header.name)!r} holds no states to compare.")
    pressure = np.array(sorted({state.pressure for state in results[0].states}))
    values = {name: np.array([result.along(pressure, name) for result in results]) for name in COLUMNS}
    return Comparison(
        comparing.labels(results, _QUIET),
        pressure,
        values,
        [result.critical_pressure for result in results],
        [None if result.safety is None else result.safety.factor for result in results],
        comparing.tabulate_deviations([result.measured for result in results]),
    )


def draw(results: Sequence[ClosureResult]) -> Figure:
    """Figure of the compared quantities over the back pressure, and of measured and computed sections."""
    names = comparing.labels(results, _QUIET)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))
    shapes = [result.measured.shapes for result in results]
    sections = some_sections(shapes, 3)
    rows = -(-(len(COLUMNS) + len(sections)) // 2)
    figure = new_figure(9.6, 2.6 * rows + 0.22 * len(results))
    panels = figure.subplots(rows, 2).ravel()
    for axes, (name, (factor, title, unit)) in zip(panels, COLUMNS.items()):
        for result, label, colour in zip(results, names, colours):
            pressure = np.array([point.pressure for point in result.walk])
            values = factor * np.array([getattr(point, name) for point in result.walk], float)
            axes.plot(pressure / 1e3, values, color=colour, marker="." if len(pressure) == 1 else None, label=label)
        axes.set_ylabel(f"{title}, {unit}")
        axes.set_xlabel("Back pressure, kPa")
    for result in results:
        passage = result.measured.passage
        if passage is not None:
            panels[3].plot(passage.pressure / 1e3, 1e6 * passage.measured, color="black", **MEASURED)
    panels[4].axhline(0.0, color=REST, lw=0.9)
    for axes in panels[: len(COLUMNS)]:
        axes.set_xlim(left=0)  # after everything: a limit that is set holds
    for axes, section in zip(panels[len(COLUMNS) :], sections):
        draw_section_of_runs(axes, section, shapes, colours)
    for axes in panels:
        axes.set_visible(axes.has_data())
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=2 if len(results) > 3 else 1)
    panels[0].set_title("Back pressure (crosses: measured)", loc="left", fontweight="bold")
    return figure
