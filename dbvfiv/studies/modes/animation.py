"""One cycle of a mode as an animated GIF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.animation import PillowWriter

from ...drawing.style import headline, new_figure, style
from ...errors import CaseError
from .plane import conditions, mode_title
from .shapes import ModeSurface

if TYPE_CHECKING:
    from .mode import ModeShape
    from .result import ModesResult

_PICTURES_A_SECOND, _DOTS = 15, 90


def animate_mode(result: ModesResult, mode: ModeShape, path: str | Path, frames: int = 24) -> Path:
    """Write one cycle of a mode, endlessly repeated, growth or decay left out; of a mode that does not oscillate, a
    slow to and fro.

    Raises
    ------
    CaseError
        If the file cannot be written or there are fewer than 2 frames.
    """
    path = Path(path)
    if frames < 2:
        raise CaseError(f"An animation needs at least 2 frames, not {frames}.")
    with style():
        figure = new_figure(7.6, 4.6)
        axes = figure.add_subplot(projection="3d", computed_zorder=False)
        surface = ModeSurface(result, mode)
        collection = surface.draw(axes, 0.0)
        headline(figure, f"{mode_title(mode)} ({conditions(result)})")
        figure.set_layout_engine("none")  # the picture must not move
        axes.set_position([0.0, 0.05, 0.98, 0.9])
        writer = PillowWriter(fps=_PICTURES_A_SECOND)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with writer.saving(figure, str(path), _DOTS):
                for phase in 2 * np.pi * np.arange(frames) / frames:
                    surface.move(collection, phase)
                    writer.grab_frame()
        except OSError as error:
            raise CaseError(
                f"{str(path)!r} cannot be written ({error.strerror or 'the folder may not be written'})."
            ) from error
    return path
