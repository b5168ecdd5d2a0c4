"""Animation of a run: wall, passage and history, one above the other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

from ...drawing.style import ACCENT, COMPUTED, REST, new_figure, style
from ...drawing.views import nodal_thickness, offset_line
from ...errors import CaseError

if TYPE_CHECKING:
    from .result import TransientResult


def animate(result: TransientResult, path: Path, frames: int = 48, duration: float | None = None) -> Path:
    """Write a GIF of the faces at x = 0, the flow area and the lip's history.

    Parameters
    ----------
    frames : int
        At least 2.
    duration : float, optional
        End of the run to show, s; the last cycle by default, or the whole run if there is none.

    Raises
    ------
    CaseError
        If there are fewer than 2 frames, or the file cannot be written.
    """
    if frames < 2:
        raise CaseError(f"An animation needs at least 2 frames, not {frames}.")
    with style():
        figure, move = _picture(result, *_shown_rows(result, frames, duration))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            FuncAnimation(figure, move, frames=frames).save(path, writer=PillowWriter(fps=20), dpi=80)
        except OSError as error:
            raise CaseError(f"{str(path)!r} cannot be written ({error.strerror or error}).") from error
    return path


def cycles_to_animate(result: TransientResult, count: int) -> float:
    """Length, s, of the last `count` cycles; of the whole run for 1 where there is no cycle.

    Raises
    ------
    CaseError
        If the run does not hold so many.
    """
    t = result.history["time"]
    length = float(t[-1] - t[0])
    if count < 1:
        raise CaseError(f"--animate {count} asks for {count} cycles of a run; it takes 1 or more.")
    if result.cycle is None:
        if count > 1:
            raise CaseError(f"The run has no cycle to count by, so --animate {count} means nothing; 1 shows all of it.")
        return length
    period = result.cycle[1] - result.cycle[0]
    if count * period > length * (1 + 1e-9):
        raise CaseError(
            f"--animate {count} asks for {count} cycles of {1e3 * period:.3g} ms, and the run is {1e3 * length:.4g} ms "
            f"long."
        )
    return count * period


def _shown_rows(result: TransientResult, frames: int, duration: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the history that are pictures, and whether each row is in the history shown."""
    t = result.history["time"]
    start, end = result.cycle or (t[0], t[-1])
    if duration is not None:
        start = max(t[0], end - duration)
    rows = np.searchsorted(t, np.linspace(start, end, frames, endpoint=False)).clip(0, len(t) - 1)
    return rows, (t >= start - (end - start)) & (t <= end)


def _picture(result: TransientResult, rows: np.ndarray, shown: np.ndarray):
    """The figure, and the function that takes it to a row of the history."""
    h, mesh = result.history, result.mesh
    t, z = h["time"], 1e3 * mesh.z
    moving = _moving(h["centre_line"][rows])
    line = mesh.centre_line
    half = 0.5 * nodal_thickness(mesh)[line]
    area = 1e4 * mesh.part.copies * h["station_area"]
    figure = new_figure(7.2, 6.0)
    upper, middle, lower = figure.subplots(3, 1, gridspec_kw={"height_ratios": [3, 2, 2]})

    def wall(row: int | None) -> list[np.ndarray]:
        y = mesh.nodes[line, 1] + (0.0 if row is None else h["centre_line"][row])
        return [1e3 * np.stack(offset_line(mesh.z, y, sign * half)) for sign in (-1, 1)]

    for face in wall(None):
        for sign in (1, -1):
            upper.plot(face[0], sign * face[1], color=REST, lw=0.9, ls="--")
    drawn = [
        (upper.plot([], [], color=COMPUTED, lw=width)[0], face, sign)
        for face, width in ((0, 1.8), (1, 0.9))
        for sign in (1, -1)
    ]
    top = 1.1 * max(wall(row)[1][1][moving].max() for row in rows)
    upper.set(xlim=(0, z[moving][-1]), ylim=(-top, top), ylabel="y, mm")
    upper.set_title(
        f"Inner (thick) and outer faces at {mesh.part.middle}, where the valve moves", loc="left", fontweight="bold"
    )
    passage = middle.plot(z, area[rows[0]], color=COMPUTED)[0]
    low, high = area[rows][:, moving].min(), area[rows][:, moving].max()
    middle.axhline(0.0, color=REST, lw=0.8)
    middle.set(xlim=(0, z[moving][-1]), ylim=(min(0.0, 1.1 * low), 1.05 * high))
    middle.set(xlabel="Distance from the lip z, mm", ylabel="Flow area, cm²")
    lower.set_xlim(t[shown][0], t[shown][-1])
    lower.plot(t[shown], 1e3 * h["lip_opening"][shown], color=COMPUTED, lw=1.2)
    dot = lower.plot([], [], "o", color=ACCENT)[0]
    lower.set(xlabel="Time, s", ylabel="Clear lip\nopening, mm")

    def move(number: int):
        row = rows[number]
        both = wall(row)
        for curve, face, sign in drawn:
            curve.set_data(both[face][0], sign * both[face][1])
        passage.set_ydata(area[row])
        dot.set_data([t[row]], [1e3 * h["lip_opening"][row]])
        return [*(curve for curve, _, _ in drawn), passage, dot]

    return figure, move


def _moving(line: np.ndarray) -> slice:
    """Rows from the lip to the last one that swings by more than a seventh of the largest swing, of the times (k, m)
    shown.
    """
    swing = np.ptp(line, axis=0)
    reach = np.flatnonzero(swing > 0.15 * swing.max()) if swing.max() > 0 else np.arange(line.shape[1])
    return slice(0, max(int(reach[-1]) + 1, 2))
