"""The valve under back pressure in space: side views, contact on the unrolled wall, the shape it buckles into."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure

from ...drawing.style import (
    COMPUTED,
    MAGNITUDE,
    PUBLISHED,
    REST,
    colour_bar,
    headline,
    kilopascals,
    new_figure,
    some_of,
)
from ...drawing.views import COLOURS, ValveSkin, draw_skin, faces, unrolled

if TYPE_CHECKING:
    from .pressed_state import PressedState
    from .result import ClosureResult


def draw(result: ClosureResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a closure result, each with its name."""
    yield "side-views", lambda: side_views(result)
    if any(state.contact_nodes for state in result.states):
        yield "contact-map", lambda: contact_map(result)
    if result.buckling:
        yield "buckling-shape", lambda: buckling_shape(result)


def side_views(result: ClosureResult) -> Figure:
    """Valve cut open at x = 0 at up to four back pressures: the wall where it is cut, the inner face behind it coloured
    by displacement, and a view in space (compare Fig. 3-21 of the thesis).
    """
    states = some_of(sorted(result.states, key=lambda s: s.pressure), 4)
    skin = ValveSkin.of(result.mesh)
    rows = -(-len(states) // 2)
    figure = new_figure(11.0, 3.4 * rows + 0.6)
    panels = figure.subplots(rows, 2 if len(states) > 1 else 1, squeeze=False, sharex=True, sharey=True).ravel()
    scale = Normalize(0.0, max(s.max_displacement for s in states) * 1e3 or 1.0)
    for letter, axes, state in zip("abcd", panels, states):
        _cut(axes, skin, state, scale)
        _inset(axes, skin, state, scale)
        axes.set_title(
            f"({letter}) {kilopascals(state.pressure)}, largest {state.max_displacement * 1e3:.1f} mm", loc="left"
        )
        axes.set_xlabel("Distance from the lip z, mm")
        axes.set_ylabel("y, mm")
        axes.tick_params(labelbottom=True, labelleft=True)
    for axes in panels[len(states) :]:
        axes.set_visible(False)
    colour_bar(figure, ScalarMappable(scale, COLOURS), list(panels), "Displacement, mm", shrink=0.7, aspect=30)
    headline(figure, f"Back pressure, {supports_of(result)}: cut at x = 0 (dashed: at rest)")
    return figure


def _cut(axes, skin: ValveSkin, state: PressedState, scale: Normalize) -> None:
    """Projection along x of the inner face of one half, far cells first, and of the wall in the plane x = 0."""
    corners = skin.corners(state.nodal) * 1e3
    size = skin.means(np.linalg.norm(state.nodal[:, :3], axis=1)) * 1e3
    count = len(skin.valve.quads)
    inner = np.arange(count, 2 * count)
    inner = inner[corners[inner][:, :, 0].mean(axis=1) > 0]
    order = inner[np.argsort(-corners[inner][:, :, 0].mean(axis=1))]
    look = {"facecolors": COLOURS(scale(size[order])), "edgecolors": "0.25", "linewidths": 0.15}
    axes.add_collection(PolyCollection(corners[order][:, :, [2, 1]], **look))
    mesh = state.results.mesh
    line = mesh.centre_line
    low, high = ((face[line] * 1e3)[:, [2, 1]] for face in faces(mesh, state.nodal))
    wall = np.concatenate([low, high[::-1]])
    walls = PolyCollection([wall, wall * [1, -1]], facecolors="#c9b8a8", edgecolors="black", linewidths=0.7)
    walls.set_label("wall")
    axes.add_collection(walls)
    for face in faces(mesh):
        for sign in (1, -1):
            axes.plot(face[line, 2] * 1e3, sign * face[line, 1] * 1e3, "--", color="0.5", lw=0.8)
    top = 1.08 * float(faces(mesh)[1][:, 1].max()) * 1e3
    axes.set_aspect("equal")
    axes.set_xlim(-10, mesh.z[-1] * 1e3 + 10)
    axes.set_ylim(-top, 1.3 * top)


def _inset(axes, skin: ValveSkin, state: PressedState, scale: Normalize) -> None:
    small = axes.inset_axes([0.0, 0.56, 0.5, 0.46], projection="3d", computed_zorder=False)
    size = skin.means(np.linalg.norm(state.nodal[:, :3], axis=1)) * 1e3
    draw_skin(small, skin.corners(state.nodal)[:, :, [2, 0, 1]], COLOURS(scale(size)), zoom=1.35)
    small.patch.set_alpha(0.0)


def contact_map(result: ClosureResult) -> Figure:
    """Contact pressure on the unrolled inner face of the part at up to four back pressures, up to its maximum."""
    states = some_of(sorted((s for s in result.states if s.contact_nodes), key=lambda s: s.pressure), 4)
    mesh = result.mesh
    arc, z = (1e3 * value for value in unrolled(mesh))
    ratios = [state.contact_pressure[mesh.rows] / state.pressure for state in states]
    last = min(len(z) - 1, int(np.flatnonzero((np.array(ratios) > 0).any(axis=(0, 2)))[-1]) + 3)
    figure = new_figure(3.1 * len(states) + 0.9, 4.8)
    panels = figure.subplots(1, len(states), squeeze=False, sharex=True, sharey=True).ravel()
    # the few nodes beside the fold of the side edge, where it peaks, do not take all of the range
    scale = PowerNorm(0.5, 0.0, max(float(ratio.max()) for ratio in ratios))
    shown = slice(0, last + 1)
    for axes, state, ratio in zip(panels, states, ratios):
        look = {"shading": "gouraud", "cmap": MAGNITUDE, "norm": scale, "rasterized": True}
        drawn = axes.pcolormesh(arc[shown], z[shown], ratio[shown], **look)
        touching = ratio > 0
        axes.plot(arc[touching], z[touching], ".", ms=1.6, color="white", alpha=0.7)
        peak = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        axes.plot(arc[peak], z[peak], "x", color=PUBLISHED, ms=7, mew=1.6)
        axes.axhline(result.case.valve.duckbill_length * 1e3, color="0.6", lw=0.8, ls=":")
        axes.set_title(
            f"{kilopascals(state.pressure)}\n{state.contact_force:.0f} N on {state.sealed_area * 1e4:.0f} cm²\n"
            f"largest {ratio[peak]:.3g} times, {ratio[peak] * state.pressure / 1e3:.3g} kPa",
            loc="left",
            fontsize=9,
        )
        axes.set_xlabel("Arc from the centre, mm")
        axes.grid(False)
        axes.set_xlim(arc[shown].min(), arc[shown].max())
        axes.set_ylim(0, z[last].max())
        axes.tick_params(labelleft=True)
    panels[0].set_ylabel("Distance from the lip z, mm")
    colour_bar(figure, drawn, list(panels), "Contact pressure over back pressure")
    headline(figure, f"Contact pressure, {supports_of(result)} (dots: touching nodes; cross: largest)")
    return figure


def buckling_shape(result: ClosureResult) -> Figure:
    """The first buckling state and the shape it leaves it by, exaggerated."""
    first, mesh = result.buckling[0], result.mesh
    shape = first.shape / np.abs(first.shape[:, :3]).max()
    size = np.linalg.norm(shape[:, :3], axis=1)
    skin = ValveSkin.of(mesh)
    figure = new_figure(10.0, 4.4)
    left = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    corners = skin.corners(first.nodal + 0.03 * shape)[:, :, [2, 0, 1]]
    draw_skin(left, corners, COLOURS(skin.means(size) / size.max()), zoom=1.25)
    left.set_title("Buckling state plus 30 mm of its shape", loc="left", fontsize=10)
    right = figure.add_subplot(1, 2, 2)
    row = mesh.rows[int(np.argmax(np.abs(shape[mesh.rows, :3]).max(axis=(1, 2))))]
    for nodal, look in (
        (None, {"color": REST, "ls": "--", "lw": 1.2, "label": "inner face at rest"}),
        (first.nodal, {"color": COMPUTED, "label": "buckling state"}),
        (first.nodal + 0.015 * shape, {"color": PUBLISHED, "lw": 1.1, "ls": ":", "label": "± 15 mm of the shape"}),
        (first.nodal - 0.015 * shape, {"color": PUBLISHED, "lw": 1.1, "ls": ":"}),
    ):
        right.plot(*faces(mesh, nodal)[0][row, :2].T * 1e3, **look)
    right.set_aspect("equal")
    right.set_xlabel("x, mm")
    right.set_ylabel("y, mm")
    right.set_title(f"Section at z = {1e3 * mesh.nodes[row[0], 2]:.0f} mm, where the shape is largest", loc="left")
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    headline(figure, f"Buckling at {kilopascals(first.pressure)} ({first.kind}), {supports_of(result)}")
    return figure


def supports_of(result: ClosureResult) -> str:
    """Name of the supports that hold the walls apart, for titles."""
    return "contact of the inner faces" if result.supports == "contact" else "supports of Th. 3.6"
