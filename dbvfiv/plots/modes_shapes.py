"""Mode shapes in space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ..record.whole_valve import WholeValve
from .deformed import COLOURS, frame, shaded
from .modes_plane import UNSTABLE, conditions, mode_title
from .style import new_figure

if TYPE_CHECKING:
    from ..studies.modes.mode import ModeShape
    from ..studies.modes.result import ModesResult

_PANELS = 6


def draw(result: ModesResult, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name."""
    if mode is not None:
        yield f"mode-shape-{mode}", lambda: mode_shapes(result, [result.mode(mode)])
    elif result.modes:
        yield "mode-shapes", lambda: mode_shapes(result, result.modes[:_PANELS])


def mode_shapes(result: ModesResult, modes) -> Figure:
    """Modes at the phase of their largest displacement, all quarters, coloured by the amplitude over a cycle."""
    columns = min(2, len(modes))
    rows = -(-len(modes) // columns)
    figure = new_figure(8.2, 5.0) if columns == 1 else new_figure(5.2 * columns, 3.2 * rows)
    valve = WholeValve.of(result.mesh)
    scale = Normalize(0.0, 1.0)
    panels = []
    for number, mode in enumerate(modes):
        axes = figure.add_subplot(rows, columns, number + 1, projection="3d", computed_zorder=False)
        surface = ModeSurface(result, mode, valve)
        surface.draw(axes, 0.0)
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else "black"
        axes.set_title(mode_title(mode), fontsize=10, color=colour, loc="left", y=0.95 if columns > 1 else 1.0)
        if columns > 1:  # small panels show the shape, not the scales
            for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
                axis.set_ticklabels([])
            axes.set(xlabel="", ylabel="", zlabel="")
            axes.set_box_aspect(np.ptp(surface.limits(), axis=0), zoom=1.3)
        panels.append(axes)
    bar = figure.colorbar(
        ScalarMappable(scale, COLOURS), ax=panels, shrink=0.62 if rows == 1 else 0.4, pad=0.03, aspect=26
    )
    bar.set_label("Amplitude, relative to the largest")
    bar.outline.set_visible(False)
    figure.suptitle(f"Mode shapes {conditions(result)}, lips at the front", fontsize=11, fontweight="bold")
    return figure


class ModeSurface:
    """The valve swinging in a mode, ready to be drawn at any phase.

    Parameters
    ----------
    result : ModesResult
    mode : ModeShape
    valve : WholeValve, optional
    """

    def __init__(self, result: ModesResult, mode: ModeShape, valve: WholeValve | None = None):
        self.valve = valve or WholeValve.of(result.mesh)
        self.mode = mode
        self.amplitude = mode.drawn_amplitude(result.state)
        self.steady = self.valve.points + self.valve.vectors(result.state.nodal[:, :3])
        self.colours = COLOURS(mode.amplitude[self.valve.node][self.valve.quads].mean(axis=1))

    def points(self, phase: float) -> np.ndarray:
        """(np, 3) mm, in the order axis of the valve, width, opening."""
        swing = self.valve.vectors(self.mode.at_phase(phase)[:, :3])
        return (self.steady + self.amplitude * swing)[:, [2, 0, 1]] * 1e3

    def limits(self) -> np.ndarray:
        """(2, 3) mm, corners of a box that holds the whole cycle."""
        swing = self.valve.vectors(np.abs(self.mode.shape[:, :3])) * self.valve.sign  # amplitudes have no sign
        ends = [(self.steady + side * self.amplitude * np.abs(swing))[:, [2, 0, 1]] * 1e3 for side in (-1, 1)]
        return np.array([ends[0].min(axis=0), ends[1].max(axis=0)])

    def draw(self, axes, phase: float) -> Poly3DCollection:
        """Draw at a phase, rad."""
        corners = self.points(phase)[self.valve.quads]
        colours = shaded(corners, self.colours)
        surface = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3, clip_on=False)
        axes.add_collection3d(surface)
        frame(axes, self.limits())
        return surface

    def move(self, surface: Poly3DCollection, phase: float) -> None:
        """Take what `draw` gave to another phase, rad."""
        corners = self.points(phase)[self.valve.quads]
        colours = shaded(corners, self.colours)
        surface.set_verts(corners)
        surface.set_facecolors(colours)
        surface.set_edgecolors(colours)
