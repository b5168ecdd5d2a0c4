"""Deformed shapes in sections: the lip seen from downstream, the centre line seen from the side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .discharge import ordered
from .style import REST, kilopascals, new_figure, pressure_colours, some_of

if TYPE_CHECKING:
    from ..studies.steady.result import SteadyResult


def draw(result: SteadyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name."""
    yield "lip-shapes", lambda: lip_shapes(result)
    yield "centre-line", lambda: centre_line(result)


def lip_shapes(result: SteadyResult) -> Figure:
    """Mid-surface of the lip at several pressures, all four quarters (compare Fig. 7-10 of the thesis)."""
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    lip = result.mesh.rows[0]
    rest = result.mesh.nodes[lip, :2]
    axes.plot(*_closed(rest).T * 1e3, color=REST, lw=1.2, ls="--", label="at rest")
    states = some_of(ordered(result))
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        axes.plot(*_closed(rest + state.nodal[lip, :2]).T * 1e3, color=colour, label=kilopascals(state.pressure))
    axes.set_aspect("equal")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_title("Lip at the outlet, mid-surface", loc="left", fontweight="bold")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=5)
    return figure


def centre_line(result: SteadyResult) -> Figure:
    """Deformed lines of the two symmetry planes: y over z at x = 0 and x over z at y = 0."""
    figure = new_figure(7.2, 6.2)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [1, 1]})
    states = some_of(ordered(result))
    colours = pressure_colours([s.pressure for s in states])
    for axes, line, across in ((upper, result.mesh.rows[:, 0], 1), (lower, result.mesh.rows[:, -1], 0)):
        rest = result.mesh.nodes[line]
        axes.plot(rest[:, 2] * 1e3, rest[:, across] * 1e3, color=REST, lw=1.2, ls="--", label="at rest")
        for state, colour in zip(states, colours):
            moved = rest + state.nodal[line, :3]
            axes.plot(moved[:, 2] * 1e3, moved[:, across] * 1e3, color=colour, label=kilopascals(state.pressure))
    mark_pieces(result, upper, lower)
    upper.set_ylabel("y, mm")
    lower.set_ylabel("x, mm")
    lower.set_xlabel("Distance from the lip z, mm")
    upper.set_title("Centre line, x = 0", loc="left", fontweight="bold")
    lower.set_title("Side edge, y = 0", loc="left", fontweight="bold")
    upper.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return figure


def mark_pieces(result: SteadyResult, *panels) -> None:
    """Thin lines where duckbill, saddle and flange meet."""
    valve = result.case.valve
    if valve.key_points is not None:
        return
    for axes in panels:
        for z in (valve.duckbill_length, valve.duckbill_length + valve.saddle_length):
            axes.axvline(z * 1e3, color="0.6", lw=0.8, ls=":")


def _closed(quarter: np.ndarray) -> np.ndarray:
    """Closed curve (k, 2) through the four mirror images of a quarter from (0, y) to (x, 0)."""
    right = np.concatenate([quarter, quarter[-2::-1] * [1, -1]])
    return np.concatenate([right, right[-2::-1] * [-1, 1]])
