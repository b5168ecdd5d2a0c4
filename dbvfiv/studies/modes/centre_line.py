"""The centre line of the lips over one cycle of a mode."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import COMPUTED, REST, new_figure, phase_looks
from ...drawing.views import faces, mark_pieces
from ...drawing.waves import wave_content
from ...model.symmetry import symmetry_named
from .plane import conditions, mode_title
from .shapes import drawn_amplitude

if TYPE_CHECKING:
    from .mode import ModeShape
    from .result import ModesResult

_PHASES, _DRAWN = 10, 3
#: Part of the largest swing below which a phase means nothing.
_STILL = 0.02


def draw(result: ModesResult, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name: of the first three modes, or of one. In a motion that is antisymmetric
    about it the line x = 0 does not swing in y.
    """
    chosen = result.modes[:_DRAWN] if mode is None else [result.mode(mode)]
    for each in (mode for mode in chosen if symmetry_named(mode.symmetry).signs[0] > 0):
        yield f"centre-line-{each.number}", lambda each=each: centre_line(result, each)


def centre_line(result: ModesResult, mode: ModeShape) -> Figure:
    """Inner face at x = 0 over one cycle (compare Fig. 7-16 of the thesis): its place, the swing in y, how the motion
    lags along it, and how much of it travels.
    """
    line, z = result.mesh.centre_line, result.mesh.z * 1e3
    figure = new_figure(7.4, 8.0)
    place, swing, lag = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [1.25, 1.1, 0.8]})
    amplitude = drawn_amplitude(result.state, mode)
    _draw_cycle(place, swing, result, mode, amplitude)
    motion = mode.shape[line, 1]
    lag.plot(z, _lag(motion), "o-", color=COMPUTED, ms=3)
    mark_pieces(result, place, swing, lag)
    place.set_ylabel("y, mm")
    swing.set_ylabel("Swing in y, mm")
    lag.set_ylabel("Phase in y, degrees")
    lag.set_xlabel("Distance from the lip z, mm")
    lag.set_xlim(min(0.0, float(place.dataLim.x0) - 2), z.max())
    place.set_title(f"{mode_title(mode)} ({conditions(result)})", loc="left", fontweight="bold")
    swing.set_title(
        f"drawn for a largest displacement of {1e3 * amplitude:.3g} mm; a linear mode has no amplitude of its own",
        loc="left",
        fontsize=9,
    )
    lag.set_title(_wave(mode, motion, result.mesh.z), loc="left", fontsize=9)
    place.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    swing.legend(loc="upper left", bbox_to_anchor=(1.01, 1.05), title="share of\nthe cycle")
    for axes in (place, swing):
        axes.tick_params(labelbottom=True)
    return figure


def _draw_cycle(place, swing, result: ModesResult, mode: ModeShape, amplitude: float) -> None:
    """Inner face and swing of the line x = 0 at some phases, about the steady state."""
    mesh, steady = result.mesh, result.state.nodal
    line, z = mesh.centre_line, mesh.z * 1e3
    phases = np.arange(_PHASES) / _PHASES
    for share, look in zip(phases, phase_looks(_PHASES)):
        shape = mode.at_phase(2 * np.pi * share)
        at = 1e3 * faces(mesh, steady + amplitude * shape)[0][line]
        place.plot(at[:, 2], at[:, 1], lw=1.2, **look)
        swing.plot(z, 1e3 * amplitude * shape[line, 1], lw=1.2, label=f"{share:.1f}", **look)
    for nodal, look in (
        (None, {"color": REST, "ls": "--", "lw": 1.2, "label": "inner face\nat rest"}),
        (steady, {"color": "black", "lw": 2.0, "label": "steady state"}),
    ):
        at = 1e3 * faces(mesh, nodal)[0][line]
        place.plot(at[:, 2], at[:, 1], **look)
    place.axhline(0.0, color=REST, lw=0.8)
    envelope = 1e3 * amplitude * np.abs(mode.shape[line, 1])
    swing.fill_between(z, -envelope, envelope, color="0.5", alpha=0.13, lw=0)


def _wave(mode: ModeShape, motion: np.ndarray, z: np.ndarray) -> str:
    if mode.frequency == 0:
        return "no oscillation, so that no wave travels"
    return wave_content(motion, z).words()


def _lag(swing: np.ndarray) -> np.ndarray:
    """Phase, degrees, continuous along the line and zero where it swings most; NaN where it hardly moves."""
    size = np.abs(swing)
    if not size.max() > 0:
        return np.full(len(swing), np.nan)
    phase = np.degrees(np.unwrap(np.angle(swing)))
    phase -= phase[int(np.argmax(size))]
    return np.where(size > _STILL * size.max(), phase, np.nan)
