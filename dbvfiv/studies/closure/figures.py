"""Figures of the valve under back pressure: curves over the pressure, and the wall in space."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure

from ...drawing.style import (
    ACCENT,
    COMPUTED,
    HALO,
    MAGNITUDE,
    PUBLISHED,
    REST,
    colour_bar,
    headline,
    kilopascals,
    limits,
    log_axis,
    new_figure,
    new_panel,
    pressure_colours,
    some_of,
)
from ...drawing.views import COLOURS, ValveSkin, draw_chosen, draw_skin, layer_stress, unrolled
from ...record.vtkhdf import faces
from ..comparing import MEASURED, Compared, draw_curve, draw_runs, draw_shapes, labels
from ..result import StudyResult

#: Passage, mm2, below which a valve is shut for any purpose.
_SHUT = 0.01


def draw(result: StudyResult, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures over the pressure, and of one state: that of the highest pressure unless another is chosen."""
    if not result.states:
        return
    yield "side-views", lambda: side_views(result)
    if any(state.contact_nodes for state in result.states):
        yield "contact-map", lambda: contact_map(result)
    if result.buckling:
        yield "buckling-shape", lambda: buckling_shape(result)
    if result.walk:
        yield "closure-curve", lambda: closure_curve(result)
    yield "passage", lambda: passage(result)
    if result.measured.area is not None:
        yield "measured-passage", lambda: measured_passage(result)
    yield from draw_shapes(result.measured.shapes)
    yield from draw_chosen(result, pressure, {"layer-stress": layer_stress})


def side_views(result: StudyResult) -> Figure:
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
        axes.set(xlabel="Distance from the lip z, mm", ylabel="y, mm")
        axes.tick_params(labelbottom=True, labelleft=True)
    for axes in panels[len(states) :]:
        axes.set_visible(False)
    colour_bar(figure, ScalarMappable(scale, COLOURS), list(panels), "Displacement, mm", shrink=0.7, aspect=30)
    return headline(figure, f"Back pressure, {supports_of(result)}: cut at x = 0 (dashed: at rest)")


def _cut(axes, skin: ValveSkin, state, scale: Normalize) -> None:
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


def _inset(axes, skin: ValveSkin, state, scale: Normalize) -> None:
    small = axes.inset_axes([0.0, 0.56, 0.5, 0.46], projection="3d", computed_zorder=False)
    size = skin.means(np.linalg.norm(state.nodal[:, :3], axis=1)) * 1e3
    draw_skin(small, skin.corners(state.nodal)[:, :, [2, 0, 1]], COLOURS(scale(size)), zoom=1.35)
    small.patch.set_alpha(0.0)


def contact_map(result: StudyResult) -> Figure:
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
    return headline(figure, f"Contact pressure, {supports_of(result)} (dots: touching nodes; cross: largest)")


def buckling_shape(result: StudyResult) -> Figure:
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
    right.set(xlabel="x, mm", ylabel="y, mm")
    right.set_title(f"Section at z = {1e3 * mesh.nodes[row[0], 2]:.0f} mm, where the shape is largest", loc="left")
    right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    return headline(figure, f"Buckling at {kilopascals(first.pressure)} ({first.kind}), {supports_of(result)}")


def supports_of(result: StudyResult) -> str:
    """Name of the supports that hold the walls apart, for titles."""
    return "contact of the inner faces" if result.supports == "contact" else "supports of Th. 3.6"


def closure_curve(result: StudyResult) -> Figure:
    """Sealed length, contact force, deepest displacement and lowest stiffness over the back pressure; dots are the
    states that were asked for.
    """
    figure = new_figure(9.4, 6.8)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    length, force, moved, stiffness = panels
    _over_pressure(result, length, "contact_front", 1e3, label="front of contact on the centre line")
    _over_pressure(result, length, "sealed_length", 1e3, color=ACCENT, label="sealed length")
    _over_pressure(result, length, "lip_seal", 1e3, color=ACCENT, ls="--", label="of it from the lip on")
    length.axhline(result.case.valve.duckbill_length * 1e3, color=REST, lw=0.9, ls=":", label="duckbill")
    length.set_ylim(bottom=0)
    length.set_ylabel("Length along the axis, mm")
    length.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=8, borderaxespad=0.2)
    _over_pressure(result, force, "contact_force", 1.0)
    force.set_ylabel("Force between the walls, N")
    _over_pressure(result, moved, "max_displacement", 1e3)
    moved.set_ylabel("Largest displacement, mm")
    _over_pressure(result, stiffness, "lowest_eigenvalue", 1e-3)
    stiffness.axhline(0.0, color=REST, lw=0.9)
    stiffness.set_ylabel("Lowest stiffness eigenvalue, 10³ 1/s²")
    for b in result.buckling[:1]:
        for axes in panels:
            axes.axvline(b.pressure / 1e3, color=PUBLISHED, lw=1.0, ls="--")
        look = {"textcoords": "offset points", "color": PUBLISHED, "fontsize": 9, "path_effects": HALO}
        stiffness.annotate(f"{b.kind}, {kilopascals(b.pressure)}", (b.pressure / 1e3, 0), (6, 8), **look)
    for axes in panels:
        axes.set_xlabel("Back pressure, kPa")
        axes.tick_params(labelbottom=True)
        axes.set_xlim(*limits([0.0, *(point.pressure / 1e3 for point in result.walk)]))
    return headline(figure, f"Closure, {supports_of(result)} (dots: states asked for)")


def _over_pressure(result: StudyResult, axes, name: str, factor: float, **look) -> None:
    """A column of the path over the back pressure, with dots at the states."""
    look = {"color": COMPUTED} | look
    p = np.array([point.pressure for point in result.walk])
    values = factor * np.array([getattr(point, name) for point in result.walk], float)
    axes.plot(p / 1e3, values, marker="." if len(p) == 1 else None, **look)
    asked = [state.pressure / 1e3 for state in result.states]
    own = {"lowest_eigenvalue": "lowest_stiffness_eigenvalue"}.get(name, name)
    reached = [factor * getattr(state, own) for state in result.states]
    axes.plot(asked, reached, "o", color=look["color"], ms=4.5)


def passage(result: StudyResult) -> Figure:
    """Passage left between the inner faces along the axis."""
    title = f"What stays open, whole valve, {supports_of(result)} ({_SHUT:g} mm² or less drawn there)"
    places = "Distance from the lip z, mm", "Passage between the inner faces, mm²"
    figure, axes = new_panel(7.2, 4.4, title, *places)
    states = some_of(sorted(result.states, key=lambda s: s.pressure))
    z, copies = result.mesh.z * 1e3, result.mesh.part.copies
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        axes.semilogy(
            z,
            np.maximum(1e6 * copies * state.opening, _SHUT),
            color=colour,
            marker=".",
            ms=3,
            label=kilopascals(state.pressure),
        )
    axes.axhline(result.reference_opening * 1e6, color=REST, lw=1.0, ls="--", label="gap of the lips")
    limit = result.case.closure.shut_fraction * result.reference_opening
    axes.axhline(limit * 1e6, color=ACCENT, lw=1.0, ls=":", label="counts as shut below")
    axes.axvline(result.case.valve.duckbill_length * 1e3, color=REST, lw=0.8, ls=":")
    log_axis(axes.yaxis, _SHUT, 1e6 * copies * max(float(state.opening.max()) for state in states))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4)
    return figure


def measured_passage(result: StudyResult) -> Figure:
    """Narrowest passage left over the back pressure, with what was measured."""
    places = "Back pressure, kPa", "Narrowest passage between the inner faces, mm²"
    figure, axes = new_panel(6.4, 4.2, f"Passage left, {supports_of(result)}", *places)
    draw_curve(axes, [(p.pressure, p.least_opening) for p in result.walk], result.measured.area, 1e6, "computed")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.legend()
    return figure


def draw_together(results: Sequence[StudyResult], quantities: Sequence[Compared], quiet: Sequence[str] = ()) -> Figure:
    """Quantities of several runs over the back pressure, and measured and computed sections."""

    def panel(quantity: Compared) -> Callable:
        def draw(axes, result: StudyResult, name: str, colour) -> None:
            pressure = np.array([point.pressure for point in result.walk])
            values = quantity.factor * np.array([getattr(point, quantity.column) for point in result.walk], float)
            axes.plot(pressure / 1e3, values, color=colour, marker="." if len(pressure) == 1 else None, label=name)
            area = result.measured.area
            if quantity.column == "least_opening" and area is not None:
                axes.plot(area.pressure / 1e3, quantity.factor * area.measured, color="black", **MEASURED)
            if quantity.column == "lowest_eigenvalue" and result is results[0]:
                axes.axhline(0.0, color=REST, lw=0.9)

        return draw

    panels = {f"Back pressure, kPa|{q.title}, {q.unit}": panel(q) for q in quantities}
    title = "Back pressure (crosses: measured)"
    figure = draw_runs(results, labels(results, quiet), panels, 3, title, (9.6, 2.6))
    for axes in figure.axes[: len(quantities)]:
        axes.set_xlim(left=0)  # after everything: a limit that is set holds
    return figure
