"""Figures of a branch of cycles: amplitude and frequency, envelope, phase plane, wave along the valve, spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import (
    ACCENT,
    COMPUTED,
    HALO,
    REST,
    UNSTABLE,
    colour_bar,
    headline,
    new_figure,
    new_panel,
    parameter_label,
    phase_looks,
    pressure_colours,
)
from ...drawing.views import layer_panels
from ..result import RangeResult
from ..stability.place import describe_fixed

#: Cycles shown in the phase plane and in spectra.
SHOWN = 7
#: Instants of a period in the figure of the centre line.
INSTANTS = 12


def draw(result: RangeResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a branch, each with its name."""
    if not result.points:
        return
    yield "branch", lambda: branch(result)
    yield "envelope", lambda: envelope(result)
    yield "phase-plane", lambda: phase_plane(result)
    yield "centre-line-cycle", lambda: centre_line(result)
    yield "wave", lambda: wave(result)
    yield "spectrum", lambda: spectrum(result)
    yield "stress-range", lambda: stress_range(result)


def _title(result: RangeResult) -> str:
    return f"{result.header.name}, {describe_fixed(result.case, result.parameter)}"


def _values(result: RangeResult) -> np.ndarray:
    return np.array([point.value for point in result.points]) / PARAMETERS[result.parameter].scale


def branch(result: RangeResult) -> Figure:
    """Amplitude and frequency over the parameter, unstable cycles dashed, special points marked."""
    figure = new_figure(7.2, 6.0)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    x = _values(result)
    onset = result.onset
    for axes, name, factor, start in (
        (top, "amplitude", 1e3, 0.0),
        (bottom, "frequency", 1.0, onset["frequency"] if onset else np.nan),
    ):
        y = factor * np.array([getattr(point, name) for point in result.points])
        if onset:
            x_all = np.insert(x, 0, onset["value"] / PARAMETERS[result.parameter].scale)
            _with_stability(axes, result, x_all, np.insert(y, 0, start), first=1)
            axes.plot(x_all[0], start, "o", mfc="white", color=REST, ms=7, zorder=4, label="onset")
        else:
            _with_stability(axes, result, x, y)
    _mark_special(result, top)
    top.set_ylabel("Amplitude of one lip, mm")
    top.set_ylim(0, 1.1e3 * max(point.amplitude for point in result.points))
    bottom.set_ylabel("Frequency, Hz")
    bottom.set_xlabel(parameter_label(result.case, result.parameter))
    top.tick_params(labelbottom=True)
    top.set_title(_title(result), loc="left", fontweight="bold")
    top.legend(loc="best")
    return figure


def _with_stability(axes, result: RangeResult, x: np.ndarray, y: np.ndarray, first: int = 0) -> None:
    """Curves through cycles: full where both ends of a piece are stable or unknown."""
    states = [point.stable for point in result.points]
    states = [states[0]] * first + states
    seen = set()
    for k in range(len(x) - 1):
        unstable = states[k + 1] is False or (states[k] is False and k >= first)
        name = "unstable" if unstable else "stable" if states[k + 1] else "cycles"
        look = {"color": UNSTABLE, "ls": "--"} if unstable else {"color": COMPUTED}
        axes.plot(x[k : k + 2], y[k : k + 2], label=None if name in seen else name, **look)
        seen.add(name)
    axes.plot(x[first:], y[first:], ".", color=COMPUTED, ms=6)


def _mark_special(result: RangeResult, axes) -> None:
    row = PARAMETERS[result.parameter]
    for special in result.special_points:
        x, y = special["value"] / row.scale, 1e3 * special["amplitude"]
        axes.plot(x, y, "D", color=ACCENT, ms=6, zorder=5)
        look = {"textcoords": "offset points", "fontsize": 8.5, "color": ACCENT, "path_effects": HALO}
        axes.annotate(f"{special['kind']}\n{row.amount(special['value'], 4)}", (x, y), xytext=(8, -7), va="top", **look)


def envelope(result: RangeResult) -> Figure:
    """Between which displacements the lip swings, and its mean."""
    label = parameter_label(result.case, result.parameter)
    figure, axes = new_panel(7.0, 4.4, _title(result), label, "Displacement of one lip, mm")
    x = _values(result)
    low, high, mean = (
        1e3 * np.array([getattr(point, name) for point in result.points])
        for name in ("lip_least", "lip_largest", "lip_mean")
    )
    order = np.argsort(x, kind="stable")
    axes.fill_between(x[order], low[order], high[order], color=COMPUTED, alpha=0.12, lw=0)
    axes.plot(x, high, ".-", color=COMPUTED, label="largest")
    axes.plot(x, mean, "--", color=REST, label="mean")
    axes.plot(x, low, ".-", color=ACCENT, label="least")
    axes.set_ylim(bottom=min(0.0, float(low.min())))
    axes.legend(loc="best")
    return figure


def _some(result: RangeResult) -> Iterator[tuple[Any, np.ndarray, str]]:
    """Some cycles, each with its colour and its label."""
    points = [point for point in result.points if point.asked] or list(result.points)
    shown = [points[i] for i in np.unique(np.linspace(0, len(points) - 1, SHOWN).round().astype(int))]
    labels = [PARAMETERS[result.parameter].amount(point.value, 4) for point in shown]
    return zip(shown, pressure_colours([point.value for point in shown]), labels)


def phase_plane(result: RangeResult) -> Figure:
    """Orbits of some cycles in the plane of displacement and velocity of the lip."""
    figure, axes = new_panel(6.6, 5.2, _title(result), "Displacement of one lip, mm", "Its velocity, m/s")
    for point, colour, label in _some(result):
        lip, rate = (np.append(x, x[0]) for x in (point.orbit.lip, point.orbit.lip_rate))
        look = {"ls": "--"} if point.stable is False else {}
        axes.plot(1e3 * lip, rate, color=colour, label=label, **look)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title=PARAMETERS[result.parameter].words, frameon=False)
    return figure


def centre_line(result: RangeResult) -> Figure:
    """The line x = 0 at instants of a period of the last cycle."""
    point = result.nearest()
    figure, axes = new_panel(7.4, 4.4, _at(result, point), "Distance from the lip z, mm", "Displacement in y, mm")
    z, line = 1e3 * result.mesh.z, point.orbit.centre_line
    for k, look in enumerate(phase_looks(INSTANTS)):
        axes.plot(z, 1e3 * line[k * len(line) // INSTANTS], lw=1.3, label=f"{k}/{INSTANTS}", **look)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title="of a period", fontsize=8)
    return figure


def wave(result: RangeResult) -> Figure:
    """The motion of the line x = 0 about its mean over one period of the last cycle: a wave along the valve."""
    point = result.nearest()
    orbit = point.orbit
    figure, axes = new_panel(6.6, 4.4, _at(result, point), "Distance from the lip z, mm", "Time, ms")
    moved = 1e3 * (orbit.centre_line - orbit.centre_line.mean(axis=0))
    size = np.abs(moved).max()
    image = axes.pcolormesh(
        1e3 * result.mesh.z,
        1e3 * orbit.time,
        moved,
        cmap="RdBu_r",
        vmin=-size,
        vmax=size,
        shading="nearest",
        rasterized=True,
    )
    colour_bar(figure, image, axes, "Displacement about the mean, mm")
    axes.grid(False)
    return figure


def spectrum(result: RangeResult) -> Figure:
    """Harmonics of the displacement of the lip of some cycles."""
    figure, axes = new_panel(6.8, 4.4, _title(result), "Harmonic", "Amplitude of one lip, mm")
    for point, colour, label in _some(result):
        parts = 1e3 * point.orbit.lip_harmonics[1:]
        axes.semilogy(np.arange(1, len(parts) + 1), parts, "o-", ms=4, lw=1.0, color=colour, label=label)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), title=PARAMETERS[result.parameter].words)
    return figure


def stress_range(result: RangeResult) -> Figure:
    """Largest range of a stress over a period of the last cycle, in each layer on the unrolled part."""
    point = result.nearest()
    figure, _ = layer_panels(result.mesh, point.ranges.stress.T / 1e6, "Range of stress, MPa")
    return headline(figure, f"Range of stress over a period, {_at(result, point)}")


def _at(result: RangeResult, point: Any) -> str:
    row = PARAMETERS[result.parameter]
    return f"{result.header.name}: {row.text(point.value)}, {point.frequency:.4g} Hz"
