"""The centre line of the lips over one cycle of a mode."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from .modes_plane import conditions, mode_title
from .shapes import mark_pieces
from .style import COMPUTED, REST, new_figure

if TYPE_CHECKING:
    from ..studies.modes.mode import ModeShape
    from ..studies.modes.result import ModesResult

_PHASES, _DRAWN = 10, 3
#: Part of the largest swing below which a phase means nothing.
_STILL = 0.02


def draw(result: ModesResult, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name: of the first three modes, or of one."""
    chosen = result.modes[:_DRAWN] if mode is None else [result.mode(mode)]
    for each in chosen:
        yield f"centre-line-{each.number}", lambda each=each: centre_line(result, each)


def centre_line(result: ModesResult, mode: ModeShape) -> Figure:
    """Line x = 0 over one cycle (compare Fig. 7-16 of Wang 2014): its place, its swing in y, and how the motion lags
    along it.
    """
    mesh, state = result.mesh, result.state
    line = mesh.rows[:, 0]
    rest, steady = mesh.nodes[line] * 1e3, state.nodal[line, :3] * 1e3
    amplitude = mode.drawn_amplitude(state)
    figure = new_figure(7.4, 8.0)
    place, swing, lag = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [1.25, 1.1, 0.8]})
    z = rest[:, 2]
    phases = np.arange(_PHASES) / _PHASES
    colours = matplotlib.colormaps["hsv"](phases * 0.92) * [0.82, 0.82, 0.82, 1.0]
    motion = mode.shape[line, :3]
    for share, colour in zip(phases, colours):
        moved = (motion * np.exp(2j * np.pi * share)).real
        at = rest + steady + 1e3 * amplitude * moved
        place.plot(at[:, 2], at[:, 1], color=colour, lw=1.2)
        swing.plot(z, 1e3 * amplitude * moved[:, 1], color=colour, lw=1.2, label=f"{share:.1f}")
    place.plot(z, rest[:, 1], color=REST, ls="--", lw=1.2, label="at rest")
    place.plot((rest + steady)[:, 2], (rest + steady)[:, 1], color="black", lw=2.0, label="steady state")
    envelope = 1e3 * amplitude * np.abs(motion[:, 1])
    swing.fill_between(z, -envelope, envelope, color="0.5", alpha=0.13, lw=0)
    lag.plot(z, _lag(motion[:, 1]), "o-", color=COMPUTED, ms=3)
    mark_pieces(result, place, swing, lag)
    place.set_ylabel("y, mm")
    swing.set_ylabel("Swing in y, mm")
    lag.set_ylabel("Phase in y, degrees")
    lag.set_xlabel("Distance from the lip z, mm")
    lag.set_xlim(min(0.0, float(np.min((rest + steady)[:, 2])) - 2), z.max())
    place.set_ylim(bottom=0)
    place.set_title(f"{mode_title(mode)} ({conditions(result)})", loc="left", fontweight="bold")
    swing.set_title(
        f"drawn for a largest displacement of {1e3 * amplitude:.3g} mm; a linear mode has no amplitude of its own",
        loc="left",
        fontsize=9,
    )
    lag.set_title("falling towards the lip: a wave that travels downstream", loc="left", fontsize=9)
    place.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    swing.legend(loc="upper left", bbox_to_anchor=(1.01, 1.05), title="share of\nthe cycle")
    return figure


def _lag(swing: np.ndarray) -> np.ndarray:
    """Phase, degrees, continuous along the line and zero where it swings most; NaN where it hardly moves."""
    size = np.abs(swing)
    if not size.max() > 0:
        return np.full(len(swing), np.nan)
    phase = np.degrees(np.unwrap(np.angle(swing)))
    phase -= phase[int(np.argmax(size))]
    return np.where(size > _STILL * size.max(), phase, np.nan)
