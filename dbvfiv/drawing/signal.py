"""A measured or computed signal with its envelope, last cycles, spectrum and phase portrait, as a laboratory's panel
shows it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..verdict import Series, Verdict, spectrum
from ..verdict.lines import envelope
from ..verdict.reading import JudgedSignal
from ..verdict.series import smoothed
from .style import ACCENT, COMPUTED, draw_figures, new_figure, write_figures

#: Cycles in the zoom, peaks of the spectrum with labels, and points of the phase portrait at most.
CYCLES, PEAKS, POINTS = 10, 6, 20_000


def signal(name: str, time: np.ndarray, values: np.ndarray, verdict: Verdict) -> Figure:
    """Signal over time with its envelope, last ten cycles, spectrum with labelled peaks, phase portrait, and numbers of
    the verdict.
    """
    figure = new_figure(9.6, 7.2)
    grid = figure.add_gridspec(3, 2, width_ratios=(2, 1))
    upper, zoom = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, 0])
    lower, portrait = figure.add_subplot(grid[2, :]), figure.add_subplot(grid[1, 1])
    within = (time >= verdict.judged[0]) & (time <= verdict.judged[1])
    part = Series.of(time[within], values[within]) if np.count_nonzero(within) >= 4 else None
    _draw_signal(upper, time, values, verdict, part)
    upper.set_ylabel(name)
    upper.set_title(name, loc="left", fontweight="bold")
    upper.set_title(f"{verdict.name}{'' if verdict.decided else ' (not certain)'}", loc="right", fontsize=10)
    if part is not None:
        _draw_closely(zoom, portrait, part, verdict, name)
        _draw_spectrum(lower, part, verdict)
    numbers = [
        ("mean", verdict.mean),
        ("rms", verdict.rms),
        ("smallest", verdict.smallest),
        ("largest", verdict.largest),
    ]
    if verdict.period > 0:
        numbers += [("amplitude", verdict.amplitude), ("frequency, Hz", verdict.frequency)]
    lower.set_title("   ".join(f"{label} {value:.5g}" for label, value in numbers), loc="left", fontsize=9)
    return figure


def _draw_signal(axes, time: np.ndarray, values: np.ndarray, verdict: Verdict, part: Series | None) -> None:
    axes.plot(time, values, color=COMPUTED, lw=1.0)
    axes.axhline(verdict.mean, color=ACCENT, lw=0.9, ls="--")
    for edge in verdict.judged:
        if time[0] < edge < time[-1]:  # only a part of the record is judged
            axes.axvline(edge, color=ACCENT, lw=0.9, ls=":")
    if part is not None and verdict.period > 0 and part.duration > 4 * verdict.period:
        width = max(verdict.period, min(4 * verdict.period, part.duration / 16))
        swing = envelope(part, verdict.frequency, width)
        level = smoothed(part, width).values
        inner = slice(*(np.array([width, part.duration - width]) / part.step).astype(int))  # clear of both ends
        for sign in (1, -1):
            axes.plot(part.times()[inner], (level + sign * swing)[inner], color=ACCENT, lw=1.0)
    axes.set(xlabel="Time, s", xlim=(time[0], time[-1]))


def _draw_closely(zoom, portrait, part: Series, verdict: Verdict, name: str) -> None:
    """The last cycles, and the rate over the value there: a limit cycle is a closed curve."""
    dying = any(line.get("rate", 0.0) < 0 for line in verdict.lines[:1])
    wanted = CYCLES * verdict.period if verdict.period > 0 else 0.1 * part.duration
    count = int(np.clip(round(wanted / part.step), 16, len(part.values)))
    begin = int(np.argmax(np.abs(part.values - verdict.mean))) if dying else len(part.values) - count
    kept = slice(min(begin, len(part.values) - count), min(begin, len(part.values) - count) + count)
    zoom.plot(part.times()[kept], part.values[kept], ".-" if count < 400 else "-", color=COMPUTED, lw=1.0, ms=3)
    zoom.set(xlabel="Time, s", ylabel=name)
    calm = smoothed(part, verdict.period / 20 if verdict.period > 0 else 0.0)
    rate = np.gradient(calm.values, part.step)[kept][:POINTS]
    portrait.plot(calm.values[kept][:POINTS], rate, color=COMPUTED, lw=0.8)
    portrait.set(xlabel=name, ylabel="its rate, 1/s")


def _draw_spectrum(axes, part: Series, verdict: Verdict) -> None:
    frequency, amplitude = spectrum(part)
    axes.semilogy(frequency, np.maximum(amplitude, 1e-9 * max(amplitude.max(), 1e-300)), color=COMPUTED, lw=1.0)
    shown = [(line["frequency"], line["called"]) for line in verdict.lines[:PEAKS]]
    if not shown and verdict.period > 0:
        shown = [(verdict.frequency, "")]
    for at, called in shown:
        height = amplitude[min(int(round(at / frequency[1])), len(amplitude) - 1)]
        axes.axvline(at, color=ACCENT, lw=0.7, ls="--")
        label = f"{at:.4g} Hz" + (f", {called}" if called else "")
        axes.annotate(label, (at, height), xytext=(3, 3), textcoords="offset points", fontsize=8, color=ACCENT)
    highest = 4.0 * max((at for at, _ in shown), default=frequency[-1])
    axes.set(xlabel="Frequency, Hz", ylabel=f"Amplitude (resolution {1.0 / part.duration:.2g} Hz)")
    axes.set_xlim(0, min(frequency[-1], highest))


def save_signals(folder: Path, judged: Iterable[JudgedSignal]) -> list[Path]:
    """Draw signals into PNG files of a folder, each of its name. Raises CaseError if the folder cannot be written."""
    written: list[Path] = []
    for one in judged:
        own, taken = re.sub(r"[\W_]+", "-", one.signal.name).strip("-") or "signal", {path.stem for path in written}
        numbered = (own, *(f"{own}-{number}" for number in range(2, len(taken) + 2)))
        stem = next(stem for stem in numbered if stem not in taken)
        shown = partial(signal, one.signal.name, one.signal.time, one.signal.values, one.verdict)
        written += write_figures(draw_figures({stem: shown}, (), "record"), folder)
    return written
