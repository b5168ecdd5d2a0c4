"""The deformed valve in space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from .axes import colour_bar, headline
from .faces import ValveSkin
from .style import driven, new_figure
from .views import COLOURS, frame, shaded


def draw(result: Any, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
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
