"""The valve in figures: faces of the wall, shaded surfaces in space, the unrolled wall with its layers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..case.part import QUARTER, Part
from ..record.mesh import MeshData, WholeValve
from ..record.vtkhdf import motion
from .style import MAGNITUDE, MOTION, PUBLISHED, colour_bar, driven, headline, kilopascals, new_figure


def nodal_thickness(mesh: MeshData) -> np.ndarray:
    """Mean thickness (nn,) of the elements that meet at each node, m."""
    total, count = np.zeros(len(mesh.nodes)), np.zeros(len(mesh.nodes))
    np.add.at(total, mesh.quads, np.broadcast_to(mesh.thickness[:, None], mesh.quads.shape))
    np.add.at(count, mesh.quads, 1.0)
    return total / count


def faces(mesh: MeshData, nodal: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Inner and outer face of the part that is computed.

    Parameters
    ----------
    mesh : MeshData
    nodal : (nn, c) array, optional
        Displacements, m, and rotations of the nodes; at rest without it.

    Returns
    -------
    inner, outer : (nn, 3) arrays, m
    """
    half = 0.5 * nodal_thickness(mesh)[:, None]
    if nodal is None:
        return mesh.nodes - half * mesh.directors, mesh.nodes + half * mesh.directors
    moved = motion(mesh, WholeValve.of(mesh, quarter=True), nodal)
    middle = mesh.nodes + moved["displacement"]
    return middle - half * moved["director"], middle + half * moved["director"]


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
    """Both faces of the whole valve and the rims that join them, ready to be drawn.

    Attributes
    ----------
    mesh : MeshData
    valve : WholeValve
    """

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

    def points(self, nodal: np.ndarray) -> np.ndarray:
        """(2 np, 3) m, the outer face first, from nodal unknowns (nn, c) of the part."""
        inner, outer = faces(self.mesh, nodal)
        return np.concatenate([self.valve.vectors(outer), self.valve.vectors(inner)])

    def corners(self, nodal: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of the quadrilaterals."""
        return self.points(nodal)[self.quads]

    def moving_corners(self, steady: np.ndarray, motion: np.ndarray, parity: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of a motion (nn, c) about a symmetric state (nn, c); `parity` (np,) are its factors at
        the points of mirrored images.
        """
        points = self.points(steady + motion)
        if np.any(parity < 0):
            points = np.where(np.tile(parity, 2)[:, None] < 0, self.points(steady - motion), points)
        return points[self.quads]

    def means(self, field: np.ndarray) -> np.ndarray:
        """(n,) mean over each quadrilateral of a field (nn,) of the part's nodes."""
        both = np.tile(field[self.valve.node], 2)
        return both[self.quads].mean(axis=1)


#: Of displacements.
COLOURS = matplotlib.colormaps[MOTION]
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
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for set_limits, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high):
        set_limits(a, b)
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.view_init(elev=26, azim=-140)
    axes.set_axis_off()


def frame(axes, points: np.ndarray) -> None:
    """Fit three-dimensional axes to points (k, 3), all directions to one scale."""
    low, high = points.min(axis=0), points.max(axis=0)
    for set_limits, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high):
        set_limits(a, b)
    axes.set_box_aspect(high - low, zoom=1.12)
    axes.set_proj_type("persp", focal_length=0.6)
    axes.view_init(elev=26, azim=-140)
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


def draw_deformed(result: Any, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name; of the highest pressure unless another is chosen."""
    state = result.nearest(pressure if pressure is not None else max(s.pressure for s in result.states))
    yield "deformed", lambda: deformed(state)


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


def draw_layers(result: Any, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name; of the highest pressure unless another is chosen."""
    state = result.nearest(pressure if pressure is not None else max(s.pressure for s in result.states))
    yield "layer-stress", lambda: layer_stress(state)


def layer_stress(state: Any) -> Figure:
    """Von Mises stress of each layer over the part that is computed, unrolled: arc length from the centre against the
    axis (compare Fig. 7-12 of the thesis).
    """
    mesh = state.results.mesh
    arc, z = unrolled(mesh)
    values = state.layers.von_mises.T / 1e6
    figure, panels = layer_panels(mesh, values, "Stress, MPa")
    for number, (axes, stress) in enumerate(zip(panels, values)):
        side = ", inside" if number == 0 else ", outside" if number == len(values) - 1 else ""
        axes.set_title(axes.get_title(loc="left") + side, loc="left", fontsize=10)
        peak = int(np.argmax(stress))
        middle = [0.25 * (f[:-1, :-1] + f[1:, :-1] + f[:-1, 1:] + f[1:, 1:]).ravel()[peak] * 1e3 for f in (arc, z)]
        axes.plot(*middle, "+", color=PUBLISHED, ms=9, mew=1.6)
        axes.set_title(axes.get_title(loc="right"), loc="right", fontsize=9, color=PUBLISHED)
        axes.set_xlim(arc.min() * 1e3, arc.max() * 1e3)
    headline(figure, f"Von Mises stress in the layers at {kilopascals(state.pressure)} (largest in each element)")
    return figure


def layer_panels(mesh, values: np.ndarray, label: str) -> tuple[Figure, list]:
    """A panel for each layer with its values (layers, elements) over the unrolled part, the largest written above.

    Parameters
    ----------
    mesh : the mesh of the result, with its layers
    label : of the colour bars
    """
    arc, z = unrolled(mesh)
    columns = min(3, len(values))
    rows = -(-len(values) // columns)
    figure = new_figure(3.2 * columns, 4.1 * rows + 0.4)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for number, (axes, title, of_layer) in enumerate(zip(panels, mesh.layer_titles(), values)):
        shape = (mesh.shape[1], mesh.shape[0])
        image = axes.pcolormesh(arc * 1e3, z * 1e3, of_layer.reshape(shape), cmap=MAGNITUDE, vmin=0.0, rasterized=True)
        colour_bar(figure, image, axes, label, pad=0.03)
        axes.set_title(f"{number + 1}  {title}", loc="left", fontsize=10)
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
