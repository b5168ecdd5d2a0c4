"""The valve as its case describes it, before anything is solved: faces, measures, wall, plies."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..case.model import Case
from ..model import ValveModel
from ..model.sizes import ValveSizes
from ..record.mesh import MeshData
from .style import COMPUTED, HALO, MAGNITUDE, REST, colour_bar, headline, new_figure
from .views import ValveSkin, draw_skin, faces, unrolled

_COLOURS = matplotlib.colormaps[MAGNITUDE]
#: Of rubbers and of plies in the picture of the layers.
_RUBBER, _PLY = "#c9ced6", "#e8b878"


def drawers_of(model: ValveModel) -> dict[str, Callable[[], Figure]]:
    """Pictures of a valve by name."""
    return {"valve": lambda: valve_figure(model)}


def valve_figure(model: ValveModel) -> Figure:
    """The valve in space, in its two planes of symmetry and in sections with measures, its wall and its layers."""
    case, mesh = model.case, MeshData.of(model)
    wall = 1e3 * mesh.thickness
    scale = Normalize(wall.min(), wall.max() if wall.max() > wall.min() else wall.max() * 1.001)
    figure = new_figure(11.6, 10.4)
    grid = figure.add_gridspec(3, 3, width_ratios=(1.35, 1.35, 1.0), height_ratios=(1.5, 1.0, 1.0))
    _in_space(figure.add_subplot(grid[0, :2], projection="3d", computed_zorder=False), mesh, scale)
    _sections(figure.add_subplot(grid[0, 2]), case, mesh)
    _plane(figure.add_subplot(grid[1, :2]), case, mesh, 1)
    _plane(figure.add_subplot(grid[2, :2]), case, mesh, 0)
    _wall(figure, figure.add_subplot(grid[1, 2]), mesh, scale)
    _layers(figure.add_subplot(grid[2, 2]), model, mesh)
    headline(figure, _title(model))
    return figure


def _title(model: ValveModel) -> str:
    case, sizes = model.case, ValveSizes.of(model)
    scaled = f", {case.valve.scale:g} times as given" if case.valve.scale != 1.0 else ""
    return (
        f"Valve as described{scaled}: {1e3 * case.valve.length:.4g} mm long, wall of {sizes.wall_mass:.3g} kg\n"
        f"passage at rest {1e4 * sizes.lip_area:.3g} cm² at the lips, {1e4 * sizes.inlet_area:.4g} cm² at the inlet"
    )


def _in_space(axes, mesh: MeshData, scale: Normalize) -> None:
    """Both faces of the whole valve, coloured by the thickness of the wall."""
    skin = ValveSkin.of(mesh)
    corners = skin.corners(np.zeros(mesh.nodal_shape))[:, :, [2, 0, 1]] * 1e3
    cells = len(skin.valve.quads)
    values = np.concatenate([1e3 * mesh.thickness[skin.valve.cell]] * 2)
    rim = len(skin.quads) - 2 * cells
    colours = np.concatenate([_COLOURS(scale(values)), np.full((rim, 4), (0.75, 0.75, 0.75, 1.0))])
    draw_skin(axes, corners, colours, zoom=1.12)


def _plane(axes: Axes, case: Case, mesh: MeshData, across: int) -> None:
    """Wall in the middle of the lips (across 1: y over z) or in the plane y = 0 (across 0), on both sides of the axis,
    with the lengths of its pieces.
    """
    line = mesh.centre_line if across else mesh.rows[:, -1]
    other, mirror = (line, -1.0) if across or mesh.part.is_quarter else (mesh.rows[:, 0], 1.0)
    found = []
    for nodes, sign in ((line, 1.0), (other, mirror)):
        inner, outer, middle = (1e3 * face[nodes][:, [2, across]] * [1.0, sign] for face in (*faces(mesh), mesh.nodes))
        axes.fill(*np.concatenate([inner, outer[::-1]]).T, color="0.85", lw=0)
        for face, width in ((inner, 1.6), (outer, 0.9)):
            axes.plot(*face.T, color=COMPUTED, lw=width)
        axes.plot(*middle.T, color=REST, lw=0.6, ls="--")
        found.append((inner, outer))
    top = max(face[:, 1].max() for face in found[0])
    bottom = min(face[:, 1].min() for face in found[1])
    for row, side in ((0, "right"), (-1, "left")):
        high, low = (outer[row] for _, outer in found)
        axes.annotate(
            f"{high[1] - low[1]:.4g} mm",
            tuple(low),
            textcoords="offset points",
            xytext=(-6 if side == "right" else 6, 4),
            ha=side,
            path_effects=HALO,
        )
    if across:
        _measure_pieces(axes, case, 1.18 * top)
    axes.set_ylim(1.15 * bottom, (1.5 if across else 1.15) * top)
    axes.set_xlim(-0.28e3 * case.valve.length, 1.28e3 * case.valve.length)
    axes.set_aspect("equal")
    axes.set_ylabel("y, mm" if across else "x, mm")
    if not across:
        axes.set_xlabel("Distance from the lip z, mm")
    name = ("Plane x = 0" if mesh.part.is_quarter else "Middle of the lips") if across else "Plane y = 0: side edges"
    axes.set_title(f"{name}, faces (full) and middle of the wall", loc="left", fontweight="bold")


def _measure_pieces(axes: Axes, case: Case, height: float) -> None:
    """Lengths of the pieces between arrows."""
    begin = 0.0
    for name in ("duckbill", "saddle", "cuff", "flare", "flange"):
        length = 1e3 * getattr(case.valve, f"{name}_length")
        if length == 0:
            continue
        arrow = {"arrowstyle": "<->", "lw": 0.9, "color": "0.3", "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (begin, height), (begin + length, height), arrowprops=arrow)
        axes.text(begin + 0.5 * length, 1.03 * height, f"{name}\n{length:.4g}", ha="center", va="bottom", fontsize=8)
        begin += length


def _sections(axes: Axes, case: Case, mesh: MeshData) -> None:
    """Inner and outer face of the lip and of the inlet, of the part that is computed."""
    inner, outer = faces(mesh)
    for row, name, look in ((0, "lip", COMPUTED), (-1, "inlet", "0.45")):
        nodes = mesh.rows[row]
        for face, width, label in ((inner, 1.6, name), (outer, 0.8, None)):
            axes.plot(*(1e3 * face[nodes, :2].T), color=look, lw=width, label=label)
    axes.set_aspect("equal")
    axes.set_xlim(left=0 if mesh.part.is_quarter else None)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_title("Sections, inner face thick", loc="left", fontweight="bold")
    axes.legend(loc="upper right")


def _wall(figure: Figure, axes: Axes, mesh: MeshData, scale: Normalize) -> None:
    """Thickness over the unrolled part."""
    arc, z = unrolled(mesh)
    values = 1e3 * mesh.thickness.reshape(mesh.shape[::-1])
    axes.pcolormesh(1e3 * z, 1e3 * arc, values, cmap=_COLOURS, norm=scale, shading="flat", edgecolor="1", lw=0.1)
    axes.set_xlabel("z, mm")
    axes.set_ylabel(f"Arc from {mesh.part.middle}, mm")
    axes.grid(False)
    axes.set_title("Thickness and mesh", loc="left", fontweight="bold")
    colour_bar(figure, ScalarMappable(scale, _COLOURS), axes, "Wall, mm", aspect=18)


def _layers(axes: Axes, model: ValveModel, mesh: MeshData) -> None:
    """Layers from inside (below) to outside where most of them are, with their angles, true to their shares."""
    shell, zone = model.shell, 0
    if shell.zones is not None:
        zone = int(np.argmax(shell.zones.presence.sum(axis=1)))
    section = shell.section if shell.zones is None else shell.at_rest.sections[zone]
    element = mesh.part.centre(mesh.rows.shape[1]) if shell.zones is None else shell.at_rest.elements[zone][0]
    wall, place, kinds = 1e3 * mesh.thickness[element], 0.0, []
    for share, title, layer in zip(section.fractions, mesh.layer_titles(), model.case.layers):
        height = wall * share
        if height == 0:
            continue
        ply = layer.material == "fibre" or bool(layer.angle)
        kinds.append((_PLY, "ply, angle from the axis") if ply else (_RUBBER, "rubber"))
        axes.barh(place + 0.5 * height, 1.0, height, color=kinds[-1][0], edgecolor="white", lw=1.2)
        axes.text(0.02, place + 0.5 * height, title, va="center", fontsize=8)
        axes.text(0.98, place + 0.5 * height, f"{height:.3g} mm", va="center", ha="right", fontsize=8)
        place += height
    axes.set_xlim(0, 1)
    axes.set_ylim(0, place)
    axes.set_xticks([])
    axes.grid(False)
    axes.set_ylabel("From the inner face, mm")
    where = "the middle of the lip" if shell.zones is None else f"z = {1e3 * model.mesh.element_z[element]:.4g} mm"
    axes.set_title(f"Layers at {where}", loc="left", fontweight="bold")
    axes.legend(
        handles=[Patch(color=colour, label=label) for colour, label in dict.fromkeys(kinds)],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.02),
        ncols=2,
        fontsize=8,
    )
