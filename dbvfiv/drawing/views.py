"""The valve in figures: faces of the wall, surfaces in space, the unrolled wall, the valve as described."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..case.model import Case
from ..case.part import QUARTER, Part
from ..materials.laws import OrthotropicPly
from ..model.sizes import ValveSizes
from ..model.valve import ValveModel
from ..record.mesh import MeshData, WholeValve
from ..record.vtkhdf import faces
from .style import COMPUTED, HALO, MAGNITUDE, MOTION, PUBLISHED, REST, colour_bar, driven, headline, new_figure


def closed_section(section: np.ndarray, part: Part = QUARTER) -> np.ndarray:
    """Closed curve (k, 2) through the mirror images of a section of a part that ends at (x, 0)."""
    right = np.concatenate([section, section[-2::-1] * [1, -1]])
    return np.concatenate([right, right[-2::-1] * [-1, 1]]) if part.is_quarter else right


def offset_line(z: np.ndarray, y: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces of a wall in the plane x = 0 of which the line (z, y) is the middle, where its rotations are not known.

    Parameters
    ----------
    z, y : (m,) arrays, m
    half : (m,) array, m
        Half the wall, towards the outer face; negative for the inner one.

    Returns
    -------
    z, y : (m,) arrays, m
    """
    along = np.stack([np.gradient(z), np.gradient(y)])
    along /= np.linalg.norm(along, axis=0)
    return z - half * along[1], y + half * along[0]


@dataclass(frozen=True)
class ValveSkin:
    """Both faces of the whole valve and the rims that join them, ready to be drawn."""

    mesh: MeshData
    valve: WholeValve

    @classmethod
    def of(cls, mesh: MeshData) -> ValveSkin:
        """Skin of the whole valve."""
        return cls(mesh, WholeValve.of(mesh))

    @cached_property
    def quads(self) -> np.ndarray:
        """(n, 4) points of each quadrilateral: outer face, inner face, rims; inner points follow the outer ones."""
        quads, count = self.valve.quads, len(self.valve.points)
        edges = np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)])
        _, where, often = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
        rim = edges[where[often == 1]]
        return np.concatenate([quads, quads + count, np.hstack([rim, rim[:, ::-1] + count])])

    @property
    def triangles(self) -> np.ndarray:
        """(2 n, 3) points of the halves of the quadrilaterals."""
        return np.concatenate([self.quads[:, [0, 1, 2]], self.quads[:, [0, 2, 3]]])

    def points(self, nodal: np.ndarray) -> np.ndarray:
        """(2 np, 3) m, the outer face first, from nodal unknowns (nn, c) of the part."""
        inner, outer = faces(self.mesh, nodal)
        return np.concatenate([self.valve.vectors(outer), self.valve.vectors(inner)])

    def corners(self, nodal: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of the quadrilaterals."""
        return self.points(nodal)[self.quads]

    def moving_points(self, steady: np.ndarray, motion: np.ndarray, parity: np.ndarray) -> np.ndarray:
        """(2 np, 3) m, points of a motion (nn, c) about a symmetric state (nn, c); `parity` (np,) are its factors at
        the points of mirrored images.
        """
        points = self.points(steady + motion)
        if np.any(parity < 0):
            points = np.where(np.tile(parity, 2)[:, None] < 0, self.points(steady - motion), points)
        return points

    def moving_corners(self, steady: np.ndarray, motion: np.ndarray, parity: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of the quadrilaterals of a motion, see `moving_points`."""
        return self.moving_points(steady, motion, parity)[self.quads]

    def means(self, field: np.ndarray) -> np.ndarray:
        """(n,) mean over each quadrilateral of a field (nn,) of the part's nodes."""
        return self.spread(field)[self.quads].mean(axis=1)

    def spread(self, field: np.ndarray) -> np.ndarray:
        """(2 np,) values at the points of a field (nn,) of the part's nodes."""
        return np.tile(field[self.valve.node], 2)


#: Of displacements, and of the thickness of the wall.
COLOURS, _THICKNESS = matplotlib.colormaps[MOTION], matplotlib.colormaps[MAGNITUDE]
_LIGHT = np.array([-0.35, -0.45, 0.82])


def shaded(corners: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """Colours (n, 4) darkened where the faces turn from the light; inner and outer side alike."""
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    light = 0.62 + 0.38 * np.abs(normal @ (_LIGHT / np.linalg.norm(_LIGHT)))
    return np.concatenate([colours[:, :3] * light[:, None], colours[:, 3:]], axis=1)


def draw_skin(axes, corners: np.ndarray, colours: np.ndarray, zoom: float) -> None:
    """A small view without axes of quadrilaterals (n, 4, 3) and their colours (n, 4)."""
    colours = shaded(corners, colours)
    axes.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.1))
    _look_at(axes, corners.reshape(-1, 3), zoom)
    axes.set_axis_off()


def _look_at(axes, points: np.ndarray, zoom: float) -> None:
    """Fit three-dimensional axes to points (k, 3), all directions to one scale, seen from above the lips."""
    low, high = points.min(axis=0), points.max(axis=0)
    for set_limits, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high):
        set_limits(a, b)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.view_init(elev=26, azim=-140)


def frame(axes, points: np.ndarray) -> None:
    """Fit three-dimensional axes with their names to points (k, 3), mm, all directions to one scale."""
    _look_at(axes, points, zoom=1.12)
    axes.set_proj_type("persp", focal_length=0.6)
    axes.set_xlabel("z, mm", labelpad=12)
    axes.set_ylabel("x, mm", labelpad=8)
    axes.set_zlabel("y, mm", labelpad=2)
    axes.locator_params(nbins=5)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor((1, 1, 1, 0))
        axis.pane.set_edgecolor("0.8")


def mark_pieces(result: Any, *panels) -> None:
    """Thin lines where duckbill, saddle, cuff, flare and flange meet."""
    valve = result.case.valve
    if valve.key_points is not None:
        return
    for axes in panels:
        z = 0.0
        for length in (valve.duckbill_length, valve.saddle_length, valve.cuff_length, valve.flare_length):
            z += length
            if length > 0:
                axes.axvline(z * 1e3, color="0.6", lw=0.8, ls=":")


def unrolled(mesh: MeshData) -> tuple[np.ndarray, np.ndarray]:
    """Arc length from the middle of the lips and axial position of the nodes, both (rows, columns) in m, at rest."""
    points = mesh.nodes[mesh.rows]
    steps = np.linalg.norm(np.diff(points, axis=1), axis=2)
    arc = np.concatenate([np.zeros((len(points), 1)), np.cumsum(steps, axis=1)], axis=1)
    middle = mesh.part.centre(arc.shape[1])
    return arc - arc[:, middle : middle + 1], points[:, :, 2]


def draw_chosen(
    result: Any, pressure: float | None, figures: Mapping[str, Callable[[Any], Figure]]
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a state of a result, each with its name; of the highest pressure unless another is chosen."""
    state = result.nearest(pressure if pressure is not None else max(s.pressure for s in result.states))
    for name, figure in figures.items():
        yield name, partial(figure, state)


def deformed(state: Any) -> Figure:
    """Whole valve with the thickness of its wall, true to scale, coloured by displacement (compare Fig. 7-11 of the
    thesis).
    """
    skin = ValveSkin.of(state.results.mesh)
    size = np.linalg.norm(state.nodal[:, :3], axis=1) * 1e3
    corners = skin.corners(state.nodal)[:, :, [2, 0, 1]] * 1e3  # axis of the valve, width, opening
    figure = new_figure(8.2, 4.9)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    scale = Normalize(0.0, size.max() or 1.0)
    colours = shaded(corners, COLOURS(scale(skin.means(size))))
    axes.add_collection3d(
        Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3, clip_on=False)
    )
    frame(axes, corners.reshape(-1, 3))
    colour_bar(figure, ScalarMappable(scale, COLOURS), axes, "Displacement, mm", shrink=0.62, pad=0.06, aspect=22)
    x, y, z = (1e3 * value for value in state.max_displacement_position)
    headline(
        figure,
        f"Deformed valve at {driven(state.results.case, state.pressure)}: "
        f"largest displacement {state.max_displacement * 1e3:.1f} mm\n"
        f"at (x, y, z) = ({x:.0f}, ±{abs(y):.0f}, {z:.0f}) mm",
    )
    return figure


def layer_stress(state: Any) -> Figure:
    """Von Mises stress of each layer over the part that is computed, unrolled: arc length from the centre against the
    axis (compare Fig. 7-12 of the thesis).
    """
    mesh = state.results.mesh
    arc, z = unrolled(mesh)
    values = state.layers.von_mises.T / 1e6
    figure, panels = layer_panels(mesh, values, "Stress, MPa")
    for number, (axes, stress) in enumerate(zip(panels, values)):
        side = {0: ", inside", len(values) - 1: ", outside"}.get(number, "") if len(values) > 1 else ""
        axes.set_title(axes.get_title(loc="left") + side, loc="left", fontsize=10)
        peak = int(np.argmax(stress))
        middle = [0.25 * (f[:-1, :-1] + f[1:, :-1] + f[:-1, 1:] + f[1:, 1:]).ravel()[peak] * 1e3 for f in (arc, z)]
        axes.plot(*middle, "+", color=PUBLISHED, ms=9, mew=1.6)
        axes.set_title(axes.get_title(loc="right"), loc="right", fontsize=9, color=PUBLISHED)
        axes.set_xlim(arc.min() * 1e3, arc.max() * 1e3)
    at = state.results.case.units.pressure(state.pressure)
    return headline(figure, f"Von Mises stress in the layers at {at} (largest in each element)")


def layer_panels(mesh, values: np.ndarray, label: str, titles: Sequence[str] | None = None) -> tuple[Figure, list]:
    """A panel for each layer with its values (layers, elements) over the unrolled part, the largest written above.

    Parameters
    ----------
    mesh : the mesh of the result, with its layers
    label : of the colour bars
    titles : of the panels, where they are not all layers
    """
    titles = [f"{i}  {title}" for i, title in enumerate(mesh.layer_titles(), 1)] if titles is None else titles
    arc, z = unrolled(mesh)
    columns = min(3, len(values))
    rows = -(-len(values) // columns)
    figure = new_figure(3.2 * columns, 4.1 * rows + 0.4)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for number, (axes, title, of_layer) in enumerate(zip(panels, titles, values)):
        shape = (mesh.shape[1], mesh.shape[0])
        image = axes.pcolormesh(arc * 1e3, z * 1e3, of_layer.reshape(shape), cmap=MAGNITUDE, vmin=0.0, rasterized=True)
        colour_bar(figure, image, axes, label, pad=0.03)
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_title(f"max {of_layer.max():.3g}", loc="right", fontsize=9)
        axes.grid(False)
        axes.tick_params(labelbottom=True, labelleft=True)
        if number % columns == 0:
            axes.set_ylabel("Distance from the lip z, mm")
        if number + columns >= len(values):
            axes.set_xlabel("Arc from the centre, mm")
    for axes in panels[len(values) :]:
        axes.set_visible(False)
    return figure, list(panels[: len(values)])


#: Of rubbers and of plies in the picture of the layers.
_RUBBER, _PLY = "#c9ced6", "#e8b878"


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
    return headline(figure, _title(model))


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
    colours = np.concatenate([_THICKNESS(scale(values)), np.full((rim, 4), (0.75, 0.75, 0.75, 1.0))])
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
        axes.text(begin + 0.5 * length, 1.03 * height, f"{name}\n{length:.4g} mm", ha="center", va="bottom", fontsize=8)
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
    axes.pcolormesh(1e3 * z, 1e3 * arc, values, cmap=_THICKNESS, norm=scale, shading="flat", edgecolor="1", lw=0.1)
    axes.set_xlabel("z, mm")
    axes.set_ylabel(f"Arc from {mesh.part.middle}, mm")
    axes.grid(False)
    axes.set_title("Thickness and mesh", loc="left", fontweight="bold")
    colour_bar(figure, ScalarMappable(scale, _THICKNESS), axes, "Wall, mm", aspect=18)


def _layers(axes: Axes, model: ValveModel, mesh: MeshData) -> None:
    """Layers from inside (below) to outside where most of them are, with their angles, true to their shares."""
    shell, zone = model.shell, 0
    if shell.zones is not None:
        zone = int(np.argmax(shell.zones.presence.sum(axis=1)))
    section = shell.section if shell.zones is None else shell.at_rest.sections[zone]
    element = mesh.part.centre(mesh.rows.shape[1]) if shell.zones is None else shell.at_rest.elements[zone][0]
    wall, place, kinds = 1e3 * mesh.thickness[element], 0.0, []
    for share, title, layer in zip(section.fractions, mesh.layer_titles(), section.layers):
        height = wall * share
        if height == 0:
            continue
        ply = isinstance(layer.law, OrthotropicPly)
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
