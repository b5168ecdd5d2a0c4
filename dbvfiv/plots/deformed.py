"""The deformed valve in space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from .faces import ValveSkin
from .style import MOTION, colour_bar, headline, new_figure, static

if TYPE_CHECKING:
    from ..studies.state import State
    from ..studies.steady.result import SteadyResult

#: Of displacements.
COLOURS = matplotlib.colormaps[MOTION]
_LIGHT = np.array([-0.35, -0.45, 0.82])


def draw(result: SteadyResult, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name; of the highest pressure unless another is chosen."""
    state = result.nearest(pressure if pressure is not None else max(s.pressure for s in result.states))
    yield "deformed", lambda: deformed(state)


def deformed(state: State) -> Figure:
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
        f"Deformed valve at {static(state.pressure)}: largest displacement {state.max_displacement * 1e3:.1f} mm\n"
        f"at (x, y, z) = ({x:.0f}, ±{abs(y):.0f}, {z:.0f}) mm",
    )
    return figure


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
