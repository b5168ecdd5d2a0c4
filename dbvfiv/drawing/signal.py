"""A measured or computed signal with its spectrum, as a laboratory's panel shows it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..errors import CaseError
from ..verdict import Series, Verdict, spectrum
from .style import ACCENT, COMPUTED, new_figure, style


def signal(name: str, time: np.ndarray, values: np.ndarray, verdict: Verdict) -> Figure:
    """Signal over time and its amplitude spectrum, with the numbers of the verdict."""
    figure = new_figure(7.6, 5.4)
    upper, lower = figure.subplots(2, 1)
    upper.plot(time, values, color=COMPUTED, lw=1.0)
    upper.axhline(verdict.mean, color=ACCENT, lw=0.9, ls="--")
    for edge in verdict.judged:
        if time[0] < edge < time[-1]:  # only a part of the record is judged
            upper.axvline(edge, color=ACCENT, lw=0.9, ls=":")
    upper.set(xlabel="Time, s", ylabel=name, xlim=(time[0], time[-1]))
    upper.set_title(name, loc="left", fontweight="bold")
    upper.set_title(f"{verdict.name}{'' if verdict.decided else ' (not certain)'}", loc="right", fontsize=10)
    label = "Amplitude"
    if len(values) >= 4:
        within = (time >= verdict.judged[0]) & (time <= verdict.judged[1])
        series = Series.of(time[within], values[within])
        frequency, amplitude = spectrum(series)
        label = f"Amplitude (resolution {1.0 / series.duration:.2g} Hz)"
        lower.semilogy(frequency, np.maximum(amplitude, 1e-9 * max(amplitude.max(), 1e-300)), color=COMPUTED, lw=1.0)
        lower.set_xlim(0, frequency[-1])
    if verdict.period > 0:
        lower.axvline(verdict.frequency, color=ACCENT, lw=0.9, ls="--")
    lower.set(xlabel="Frequency, Hz", ylabel=label)
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


def save_signal(folder: Path, name: str, time: np.ndarray, values: np.ndarray, verdict: Verdict) -> Path:
    """Draw a signal into a PNG file of a folder.

    Raises
    ------
    CaseError
        If the folder cannot be written.
    """
    path = Path(folder) / f"{re.sub(r'[^A-Za-z0-9]+', '-', name).strip('-') or 'signal'}.png"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with style():
            signal(name, time, values, verdict).savefig(path)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    return path
