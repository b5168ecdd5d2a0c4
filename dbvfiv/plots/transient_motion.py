"""Animation of a run: lip, centre line and history, side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

from ..errors import CaseError
from .style import ACCENT, COMPUTED, REST, new_figure, style

if TYPE_CHECKING:
    from ..transient.result import TransientResults


def animate(result: TransientResults, path: Path, frames: int = 48, duration: float | None = None) -> Path:
    """Write a GIF of the centre line, the passage and the history over the last cycle.

    Parameters
    ----------
    frames : int
    duration : float, optional
        End of the run to show, s; the last cycle by default, or the whole run if there is none.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """
    h = result.history
    t = h["time"]
    start, end = result.cycle or (t[0], t[-1])
    if duration is not None:
        start = max(t[0], end - duration)
    times = np.linspace(start, end, frames, endpoint=False)
    rows = np.searchsorted(t, times).clip(0, len(t) - 1)
    z = 1e3 * result.mesh.z
    moving = _moving(h["centre_line"][rows])
    rest = 1e3 * result.mesh.nodes[result.mesh.rows[:, 0], 1]
    line = 1e3 * h["centre_line"]
    area = 1e4 * 4.0 * h["station_area"]
    shown = (t >= start - (end - start)) & (t <= end)
    with style():
        figure = new_figure(7.2, 6.0)
        upper, middle, lower = figure.subplots(3, 1, gridspec_kw={"height_ratios": [3, 2, 2]})
        upper.plot(z, rest, color=REST, lw=1.0, ls="--")
        upper.plot(z, -rest, color=REST, lw=1.0, ls="--")
        walls = [upper.plot(z, sign * rest, color=COMPUTED)[0] for sign in (1, -1)]
        top = 1.1 * (rest + line[rows])[:, moving].max()
        upper.set(xlim=(0, z[moving][-1]), ylim=(-top, top), ylabel="y, mm")
        upper.set_title("Centre line, x = 0, where the valve moves", loc="left", fontweight="bold")
        bar = middle.plot(z, area[rows[0]], color=COMPUTED)[0]
        low, high = area[rows][:, moving].min(), area[rows][:, moving].max()
        middle.axhline(0.0, color=REST, lw=0.8)
        middle.set(
            xlim=(0, z[moving][-1]),
            ylim=(min(0.0, 1.1 * low), 1.05 * high),
            xlabel="Distance from the lip z, mm",
            ylabel="Flow area, cm²",
        )
        lower.set_xlim(t[shown][0], t[shown][-1])
        lower.plot(t[shown], 1e3 * h["lip_opening"][shown], color=COMPUTED, lw=1.2)
        dot = lower.plot([], [], "o", color=ACCENT)[0]
        lower.set(xlabel="Time, s", ylabel="Lip opening, mm")

        def frame(number: int):
            row = rows[number]
            for wall, sign in zip(walls, (1, -1)):
                wall.set_ydata(sign * (rest + line[row]))
            bar.set_ydata(area[row])
            dot.set_data([t[row]], [1e3 * h["lip_opening"][row]])
            return [*walls, bar, dot]

        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            FuncAnimation(figure, frame, frames=frames).save(path, writer=PillowWriter(fps=20), dpi=80)
        except OSError as error:
            raise CaseError(f"{str(path)!r} cannot be written ({error.strerror or error}).") from error
    return path


def _moving(line: np.ndarray) -> slice:
    """Rows from the lip to the last one that swings by more than a seventh of the largest swing, of the times (k, m)
    shown.
    """
    swing = np.ptp(line, axis=0)
    reach = np.flatnonzero(swing > 0.15 * swing.max()) if swing.max() > 0 else np.arange(line.shape[1])
    return slice(0, max(int(reach[-1]) + 1, 2))
