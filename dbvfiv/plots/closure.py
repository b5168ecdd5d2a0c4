"""The valve under back pressure in space: side views, contact on the unrolled wall, the shape it buckles into."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..record.whole_valve import WholeValve
from .deformed import COLOURS, shaded
from .layers import unrolled
from .style import MAGNITUDE, kilopascals, new_figure, some_of

if TYPE_CHECKING:
    from ..results.closure import ClosureResults, PressedState

#: Contact pressures above this multiple of the back pressure share a colour: they stand at single nodes beside the fold
#: of the side edge.
_CLIP = 4.0


def draw(result: ClosureResults) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a closure result, each with its name."""
    yield "side-views", lambda: side_views(result)
    if any(state.contact_nodes for state in result.states):
        yield "contact-map", lambda: contact_map(result)
    if result.buckling:
        yield "buckling-shape", lambda: buckling_shape(result)


def side_views(result: ClosureResults) -> Figure:
    """Valve seen from the side at up to four back pressures, coloured by displacement, with a view in space (compare
    Fig. 3-21 of the thesis).
    """
    states = some_of(sorted(result.states, key=lambda s: s.pressure), 4)
    valve = WholeValve.of(result.mesh)
    rows = -(-len(states) // 2)
    figure = new_figure(11.0, 3.2 * rows + 0.6)
    panels = figure.subplots(rows, 2 if len(states) > 1 else 1, squeeze=False, sharex=True, sharey=True).ravel()
    scale = Normalize(0.0, max(s.max_displacement for s in states) * 1e3)
    for letter, axes, state in zip("abcd", panels, states):
        _side(axes, valve, state, scale)
        axes.set_title(
            f"({letter}) {kilopascals(state.pressure)}, largest {state.max_displacement * 1e3:.1f} mm",
            loc="left",
            fontsize=10,
        )
        _inset(figure, axes, valve, state, scale)
    for axes in panels[len(states) :]:
        axes.set_visible(False)
    for axes in panels[: len(states)][-2:]:
        axes.set_xlabel("Distance from the lip z, mm")
        axes.tick_params(labelbottom=True)
    for axes in panels[::2]:
        axes.set_ylabel("y, mm")
    bar = figure.colorbar(ScalarMappable(scale, COLOURS), ax=list(panels), shrink=0.7, pad=0.02, aspect=30)
    bar.set_label("Displacement, mm")
    bar.outline.set_visible(False)
    figure.suptitle(f"Back pressure, {_supports(result)}: mid-surface from the side", fontweight="bold", fontsize=11)
    return figure


def _side(axes, valve: WholeValve, state: PressedState, scale: Normalize) -> None:
    """Projection along x of the half that faces the viewer, far quadrilaterals first."""
    points, size = _moved(valve, state)
    corners = points[valve.quads] * 1e3
    near = np.flatnonzero(valve.points[valve.quads][:, :, 0].mean(axis=1) >= 0)
    order = near[np.argsort(corners[near][:, :, 0].mean(axis=1))]
    colours = COLOURS(scale(size[valve.quads[order]].mean(axis=1)))
    axes.add_collection(
        PolyCollection(corners[order][:, :, [2, 1]], facecolors=colours, edgecolors="0.25", linewidths=0.15)
    )
    quarter = state.results.mesh
    rest = quarter.nodes[quarter.rows[:, 0]] * 1e3
    axes.plot(rest[:, 2], rest[:, 1], "--", color="0.5", lw=0.9)
    axes.plot(rest[:, 2], -rest[:, 1], "--", color="0.5", lw=0.9)
    axes.set_aspect("equal")
    axes.set_xlim(-10, quarter.z[-1] * 1e3 + 10)
    axes.set_ylim(-155, 195)


def _inset(figure: Figure, axes, valve: WholeValve, state: PressedState, scale: Normalize) -> None:
    points, size = _moved(valve, state)
    corners = points[valve.quads][:, :, [2, 0, 1]]
    small = axes.inset_axes([0.0, 0.56, 0.5, 0.46], projection="3d", computed_zorder=False)
    colours = shaded(corners, COLOURS(scale(size[valve.quads].mean(axis=1))))
    small.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.1))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for setter, a, b in zip((small.set_xlim, small.set_ylim, small.set_zlim), low, high):
        setter(a, b)
    small.set_box_aspect(high - low, zoom=1.35)
    small.view_init(elev=26, azim=-140)
    small.set_axis_off()
    small.patch.set_alpha(0.0)


def contact_map(result: ClosureResults) -> Figure:
    """Contact pressure on the unrolled inner face of a quarter at up to four back pressures."""
    states = some_of(sorted((s for s in result.states if s.contact_nodes), key=lambda s: s.pressure), 4)
    mesh = result.mesh
    arc, z = (1e3 * value for value in unrolled(mesh))
    pressed = np.array([s.contact_pressure for s in states])[:, mesh.rows].max(axis=(0, 2)) > 0
    last = min(len(z) - 1, int(np.flatnonzero(pressed)[-1]) + 3)
    figure = new_figure(3.1 * len(states) + 0.9, 4.8)
    panels = figure.subplots(1, len(states), squeeze=False, sharex=True, sharey=True).ravel()
    scale = Normalize(0.0, _CLIP)
    for axes, state in zip(panels, states):
        ratio = state.contact_pressure[mesh.rows] / state.pressure
        axes.pcolormesh(
            arc[: last + 1],
            z[: last + 1],
            ratio[: last + 1],
            shading="gouraud",
            cmap=MAGNITUDE,
            norm=scale,
            rasterized=True,
        )
        touching = ratio > 0
        axes.plot(arc[touching], z[touching], ".", ms=1.6, color="white", alpha=0.7)
        axes.axhline(result.case.valve.duckbill_length * 1e3, color="0.6", lw=0.8, ls=":")
        axes.set_title(
            f"{kilopascals(state.pressure)}\n{state.contact_force:.0f} N on {state.sealed_area * 1e4:.0f} cm²",
            loc="left",
            fontsize=10,
        )
        axes.set_xlabel("Arc from the centre, mm")
        axes.grid(False)
        axes.set_xlim(0, arc[: last + 1].max())
        axes.set_ylim(0, z[last].max())
    panels[0].set_ylabel("Distance from the lip z, mm")
    bar = figure.colorbar(ScalarMappable(scale, MAGNITUDE), ax=list(panels), pad=0.02, aspect=28, extend="max")
    bar.set_label("Contact pressure over back pressure")
    bar.outline.set_visible(False)
    figure.suptitle(f"Contact pressure, {_supports(result)} (dots: touching nodes)", fontweight="bold", fontsize=11)
    return figure


def buckling_shape(result: ClosureResults) -> Figure:
    """The first buckling state and the shape it leaves it by, exaggerated."""
    first, mesh = result.buckling[0], result.mesh
    valve = WholeValve.of(mesh)
    mode = first.shape[:, :3] / np.abs(first.shape[:, :3]).max()
    size = np.linalg.norm(valve.vectors(mode), axis=1)
    figure = new_figure(10.0, 4.4)
    left = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    base = valve.points + valve.vectors(first.nodal[:, :3])
    corners = (base + 0.03 * valve.vectors(mode))[valve.quads][:, :, [2, 0, 1]]
    colours = shaded(corners, COLOURS(size[valve.quads].mean(axis=1) / size.max()))
    left.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.2))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for setter, a, b in zip((left.set_xlim, left.set_ylim, left.set_zlim), low, high):
        setter(a, b)
    left.set_box_aspect(high - low, zoom=1.25)
    left.view_init(elev=26, azim=-140)
    left.set_axis_off()
    left.set_title("Buckling state plus 30 mm of its shape", loc="left", fontsize=10)
    right = figure.add_subplot(1, 2, 2)
    row = mesh.rows[int(np.argmax(np.linalg.norm(mode[mesh.rows], axis=2).max(axis=1)))]
    rest, moved = mesh.nodes[row], (mesh.nodes + first.nodal[:, :3])[row]
    right.plot(*rest[:, :2].T * 1e3, "--", color="0.55", lw=1.2, label="at rest")
    right.plot(*moved[:, :2].T * 1e3, color="#1f4e79", label="buckling state")
    for sign in (1, -1):
        there = moved + sign * 0.015 * mode[row]
        right.plot(
            *there[:, :2].T * 1e3, color="#c0392b", lw=1.1, ls=":", label="± 15 mm of the shape" if sign > 0 else None
        )
    right.set_aspect("equal")
    right.set_xlabel("x, mm")
    right.set_ylabel("y, mm")
    right.set_title(f"Section at z = {rest[0, 2] * 1e3:.0f} mm, where the shape is largest", loc="left", fontsize=10)
    right.legend(loc="lower left")
    figure.suptitle(
        f"Buckling at {kilopascals(first.pressure)} ({first.kind}), {_supports(result)}", fontweight="bold", fontsize=11
    )
    return figure


def _moved(valve: WholeValve, state: PressedState) -> tuple[np.ndarray, np.ndarray]:
    """Positions (np, 3), m, and sizes of displacement (np,), mm."""
    shift = valve.vectors(state.nodal[:, :3])
    return valve.points + shift, np.linalg.norm(shift, axis=1) * 1e3


def _supports(result: ClosureResults) -> str:
    return "contact of the inner faces" if result.supports == "contact" else "supports of Th. 3.6"
