"""Deformed shapes in sections: the lip seen from downstream, the centre line seen from the side."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ...drawing.style import REST, kilopascals, new_figure, pressure_colours, pressure_heading, pressure_name, some_of
from ...drawing.views import closed_section, faces, mark_pieces
from .discharge import ordered

if TYPE_CHECKING:
    from .result import SteadyResult


def draw(result: SteadyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name."""
    yield "lip-shapes", lambda: lip_shapes(result)
    yield "centre-line", lambda: centre_line(result)


def lip_shapes(result: SteadyResult) -> Figure:
    """Inner faces of the lips at several pressures, all around, and the outer face at the highest (compare Fig.
    7-10 of the thesis, which shows the mid-surface).
    """
    figure = new_figure(7.2, 4.6)
    axes = figure.add_subplot()
    lip, part = result.mesh.rows[0], result.mesh.part
    axes.plot(
        *closed_section(faces(result.mesh)[0][lip, :2], part).T * 1e3, color=REST, lw=1.2, ls="--", label="at rest"
    )
    states = some_of(ordered(result))
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        inner, outer = faces(result.mesh, state.nodal)
        axes.plot(*closed_section(inner[lip, :2], part).T * 1e3, color=colour, label=kilopascals(state.pressure))
    axes.plot(*closed_section(outer[lip, :2], part).T * 1e3, color=colour, lw=0.9, label="its outer face")
    axes.set_aspect("equal")
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_title("Lips at the outlet, inner faces", loc="left", fontweight="bold")
    figure.legend(loc="outside lower center", ncols=5, title=pressure_name(result.case).lower())
    return figure


def centre_line(result: SteadyResult) -> Figure:
    """Inner and outer face in the middle of the lips, y over z, and at the side edges, x over z at y = 0."""
    figure = new_figure(7.2, 6.2)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [1, 1]})
    states = some_of(ordered(result))
    colours = pressure_colours([s.pressure for s in states])
    moved = [faces(result.mesh, state.nodal) for state in states]
    rest = faces(result.mesh)
    part, edges = result.mesh.part, [(lower, result.mesh.rows[:, -1], 0)]
    if not part.is_quarter:
        edges.append((lower, result.mesh.rows[:, 0], 0))
    for axes, line, across in ((upper, result.mesh.centre_line, 1), *edges):
        for face, width in ((0, 1.6), (1, 0.8)):
            look = {"color": REST, "lw": 0.75 * width, "ls": "--", "label": None if face else "at rest"}
            axes.plot(rest[face][line, 2] * 1e3, rest[face][line, across] * 1e3, **look)
            for state, both, colour in zip(states, moved, colours):
                place = both[face][line] * 1e3
                label = None if face else kilopascals(state.pressure)
                axes.plot(place[:, 2], place[:, across], color=colour, lw=width, label=label)
        axes.tick_params(labelbottom=True)
    mark_pieces(result, upper, lower)
    upper.set_ylabel("y, mm")
    lower.set_ylabel("x, mm")
    lower.set_xlabel("Distance from the lip z, mm")
    upper.set_title(f"Inner (thick) and outer face at {part.middle}", loc="left", fontweight="bold")
    lower.set_title("Side edge, y = 0", loc="left", fontweight="bold")
    upper.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), title=pressure_heading(result.case))
    return figure
