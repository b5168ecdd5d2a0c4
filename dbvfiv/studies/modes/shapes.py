"""Mode shapes in space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ...drawing.style import UNSTABLE, colour_bar, headline, new_figure
from ...drawing.views import COLOURS, ValveSkin, faces, frame, shaded
from ...model.symmetry import symmetry_named
from .plane import conditions, mode_title

if TYPE_CHECKING:
    from ..state import State
    from .mode import ModeShape
    from .result import ModesResult

_PANELS = 6
#: Share of the clear height that a drawn mode may take, and share of the amplitude it is drawn with in any case.
_OPEN, _SEEN = 0.85, 0.2


def draw(result: ModesResult, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name."""
    if mode is not None:
        yield f"mode-shape-{mode}", lambda: mode_shapes(result, [result.mode(mode)])
    elif result.modes:
        yield "mode-shapes", lambda: mode_shapes(result, result.modes[:_PANELS])


def mode_shapes(result: ModesResult, modes) -> Figure:
    """Modes at the phase of their largest displacement, the whole valve, coloured by the amplitude over a cycle."""
    columns = min(2, len(modes))
    rows = -(-len(modes) // columns)
    figure = new_figure(8.2, 5.0) if columns == 1 else new_figure(5.2 * columns, 3.2 * rows)
    skin = ValveSkin.of(result.mesh)
    scale = Normalize(0.0, 1.0)
    panels = []
    for number, mode in enumerate(modes):
        axes = figure.add_subplot(rows, columns, number + 1, projection="3d", computed_zorder=False)
        surface = ModeSurface(result, mode, skin)
        surface.draw(axes, 0.0)
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else "black"
        axes.set_title(mode_title(mode), fontsize=10, color=colour, loc="left", y=0.95 if columns > 1 else 1.0)
        if columns > 1:  # small panels show the shape; the scales stand in the figure of a single mode
            axes.set_axis_off()
            axes.set_box_aspect(np.ptp(surface.limits(), axis=0), zoom=1.45)
        panels.append(axes)
    shrink = 0.62 if rows == 1 else 0.4
    label = "Amplitude, relative to the largest"
    colour_bar(figure, ScalarMappable(scale, COLOURS), panels, label, shrink=shrink, pad=0.08)
    length = 1e3 * np.ptp(result.mesh.z)
    headline(figure, f"Mode shapes {conditions(result)}, lips at the front; the valve is {length:.0f} mm long")
    return figure


class ModeSurface:
    """The valve swinging in a mode, ready to be drawn at any phase.

    Parameters
    ----------
    result : ModesResult
    mode : ModeShape
    skin : ValveSkin, optional
    """

    def __init__(self, result: ModesResult, mode: ModeShape, skin: ValveSkin | None = None):
        self.skin = skin or ValveSkin.of(result.mesh)
        self.mode = mode
        self.amplitude = drawn_amplitude(result.state, mode)
        self.steady = result.state.nodal
        self.parity = symmetry_named(mode.symmetry).parity(self.skin.valve.sign)
        self.colours = COLOURS(self.skin.means(mode.amplitude))

    def corners(self, phase: float) -> np.ndarray:
        """(n, 4, 3) mm, in the order axis of the valve, width, opening."""
        motion = self.amplitude * self.mode.at_phase(phase)
        return self.skin.moving_corners(self.steady, motion, self.parity)[:, :, [2, 0, 1]] * 1e3

    def limits(self) -> np.ndarray:
        """(2, 3) mm, corners of a box that holds the whole cycle."""
        quarters = np.concatenate([self.corners(phase).reshape(-1, 3) for phase in np.pi * np.arange(4) / 2])
        return np.array([quarters.min(axis=0), quarters.max(axis=0)])

    def draw(self, axes, phase: float) -> Poly3DCollection:
        """Draw at a phase, rad."""
        corners = self.corners(phase)
        colours = shaded(corners, self.colours)
        surface = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3, clip_on=False)
        axes.add_collection3d(surface)
        frame(axes, self.limits())
        return surface

    def move(self, surface: Poly3DCollection, phase: float) -> None:
        """Take what `draw` gave to another phase, rad."""
        corners = self.corners(phase)
        colours = shaded(corners, self.colours)
        surface.set_verts(corners)
        surface.set_facecolors(colours)
        surface.set_edgecolors(colours)


def drawn_amplitude(state: State, mode: ModeShape) -> float:
    """Largest displacement, m, at which a mode shows well and the inner faces of the lips do not cross."""
    mesh = state.results.mesh
    symmetry = symmetry_named(mode.symmetry)
    if not symmetry.moves_lips_apart:
        return mode.drawn_amplitude(state)
    line = mesh.centre_line  # which a sideways sway leaves in place
    line = line if symmetry.signs[0] > 0 and mesh.part.is_quarter else mesh.rows.ravel()
    height = faces(mesh, state.nodal)[0][line, 1]
    swing = np.abs(mode.shape[line, 1])
    chosen = (swing > 1e-3) & (height > 0)
    wanted = mode.drawn_amplitude(state)
    room = float(np.min(_OPEN * height[chosen] / swing[chosen])) if chosen.any() else wanted
    return min(wanted, max(room, _SEEN * wanted))
