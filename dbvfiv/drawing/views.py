"""The valve in figures: shaded surfaces in space, the unrolled wall, where its pieces meet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from .style import MOTION

if TYPE_CHECKING:
    from ..record.mesh import MeshData
    from ..studies.result import StudyResult as Result

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


def mark_pieces(result: Result, *panels) -> None:
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
