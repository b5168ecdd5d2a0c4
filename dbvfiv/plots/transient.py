"""Figures of a time history: histories, energies, phase portrait, spectrum, centre line over a cycle, pressures in
space and time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ..verdict import Series, spectrum
from .style import ACCENT, COMPUTED, REST, kilopascals, new_figure

if TYPE_CHECKING:
    from ..transient.result import TransientResults

#: Colours of the times of a cycle.
_CYCLE = "plasma"


def draw(result: TransientResults) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a transient result, each with its name."""
    flow = result.case.drive.kind == "flow"
    yield "history", lambda: history(result)
    yield "energies", lambda: energies(result)
    yield "centre-line-cycle", lambda: centre_line(result)
    yield "phase-portrait", lambda: phase_portrait(result)
    yield "spectrum", lambda: spectra(result)
    yield "lip-wave", lambda: wave(result)
    if flow:
        yield "station-pressures", lambda: pressures(result)


def title(result: TransientResults) -> str:
    case = result.case
    fluid = f", {case.fluid.density:g} kg/m³, {case.fluid.continuity}" if case.drive.kind == "flow" else ""
    return f"{result.header.name}: {kilopascals(float(result.history['inlet_pressure'][-1]))}{fluid}"


def history(result: TransientResults) -> Figure:
    """Mass flow, lip opening and areas over time."""
    h, case = result.history, result.case
    flow = case.drive.kind == "flow"
    figure = new_figure(8.0, 6.6 if flow else 3.2)
    panels = figure.subplots(3 if flow else 1, 1, sharex=True, squeeze=False)[:, 0]
    t = h["time"]
    lip = panels[1] if flow else panels[0]
    if flow:
        panels[0].plot(t, h["mass_flow"], color=COMPUTED, lw=1.3, label="out at the lip")
        if case.fluid.continuity == "storage":
            panels[0].plot(t, h["inlet_mass_flow"], color=ACCENT, lw=1.0, label="in at the flange")
            panels[0].legend(loc="best")
        panels[0].set_ylabel("Mass flow, kg/s")
        panels[2].plot(t, 1e4 * h["smallest_area"], color=ACCENT, lw=1.3, label="smallest of all rows")
        panels[2].plot(t, 1e4 * h["outlet_area"], color=COMPUTED, lw=1.0, label="at the lip")
        panels[2].set_ylabel("Flow area, cm²")
        # beside the axes' title line: an oscillation leaves no empty place within
        panels[2].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, borderaxespad=0.0)
    lip.plot(t, 1e3 * h["lip_opening"], color=COMPUTED, lw=1.3)
    lip.set_ylabel("Lip opening, mm")
    panels[-1].set_xlabel("Time, s")
    panels[-1].set_xlim(t[0], t[-1])
    panels[0].set_title(title(result), loc="left", fontweight="bold")
    verdict = result.verdict
    panels[0].set_title(f"{verdict['verdict']}{'' if verdict['decided'] else ' ?'}", loc="right", fontsize=10)
    return figure


def energies(result: TransientResults) -> Figure:
    """Energies of the wall, and what work and damping leave unexplained."""
    h = result.history
    figure = new_figure(8.0, 5.4)
    upper, lower = figure.subplots(2, 1, sharex=True)
    t = h["time"]
    for name, label, colour in (
        ("kinetic_energy", "kinetic", ACCENT),
        ("strain_energy", "strain", COMPUTED),
        ("stop_energy", "lip stops", "0.55"),
    ):
        if np.any(h[name]):
            upper.plot(t, h[name], color=colour, lw=1.2, label=label)
    for name, label, colour in (
        ("pressure_work", "work of the pressure", COMPUTED),
        ("dissipation", "lost to damping", ACCENT),
        ("balance", "balance", "0.35"),
    ):
        lower.plot(t, h[name], color=colour, lw=1.2, label=label)
    upper.set_ylabel("Energy, J")
    lower.set_ylabel("Since the start, J")
    lower.set_xlabel("Time, s")
    lower.set_xlim(t[0], t[-1])
    upper.legend(loc="best")
    lower.legend(loc="best")
    upper.set_title(f"Energies of the wall, {title(result)}", loc="left", fontweight="bold")
    return figure


def _cycle_rows(result: TransientResults) -> np.ndarray:
    """Rows of the last cycle; of the last fifth of the run where there is none."""
    t = result.history["time"]
    start, end = result.cycle or (t[-1] - 0.2 * (t[-1] - t[0]), t[-1])
    return np.flatnonzero((t >= start - 1e-12) & (t <= end))


def centre_line(result: TransientResults, count: int = 6) -> Figure:
    """Displacement in y along the line x = 0 at several times of a cycle (compare Fig. 7-16 of Wang 2014)."""
    h, rows = result.history, _cycle_rows(result)
    chosen = rows[
        np.unique(np.linspace(0, len(rows) - 1, count + 1).round().astype(int))[: count if result.cycle else None]
    ]
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    z = 1e3 * result.mesh.z
    colours = matplotlib.colormaps[_CYCLE](np.linspace(0.0, 0.85, len(chosen)))
    for row, colour in zip(chosen, colours):
        axes.plot(
            z, 1e3 * h["centre_line"][row], color=colour, label=f"{1e3 * (h['time'][row] - h['time'][rows[0]]):.1f} ms"
        )
    axes.fill_between(
        z, 1e3 * h["centre_line"][rows].min(axis=0), 1e3 * h["centre_line"][rows].max(axis=0), color="0.9", zorder=0
    )
    axes.axhline(0.0, color=REST, lw=0.9)
    axes.set_xlabel("Distance from the lip z, mm")
    axes.set_ylabel("Displacement in y, mm")
    period = (
        f"one cycle of {1e3 * (result.cycle[1] - result.cycle[0]):.3g} ms"
        if result.cycle
        else "the last fifth of the run"
    )
    axes.set_title(f"Centre line over {period}", loc="left", fontweight="bold")
    axes.set_xlim(0, z[-1])
    axes.legend(loc="best", title="after")
    return figure


def phase_portrait(result: TransientResults) -> Figure:
    """Velocity of the lip over its displacement; the last cycles stand out."""
    h = result.history
    figure = new_figure(6.0, 4.6)
    axes = figure.add_subplot()
    x, v = 1e3 * h["lip_displacement"], h["lip_velocity"]
    axes.plot(x, v, color="0.75", lw=0.7, label="whole run")
    rows = _cycle_rows(result)
    rows = np.concatenate(
        [[max(rows[0] - 1, 0)], rows]
    )  # a cycle is no whole number of steps: one more closes the loop
    axes.plot(x[rows], v[rows], color=COMPUTED, lw=1.8, label="last cycle" if result.cycle else "last fifth of the run")
    axes.plot(x[0], v[0], "o", color=ACCENT, label="start")
    axes.set_xlabel("Displacement of a lip, mm")
    axes.set_ylabel("Its velocity, m/s")
    axes.set_title("Phase portrait of the lip", loc="left", fontweight="bold")
    axes.legend(loc="best")
    return figure


def spectra(result: TransientResults) -> Figure:
    """Amplitude spectra of mass flow and lip opening over the second half of the run."""
    h = result.history
    figure = new_figure(7.2, 4.8)
    flow = result.case.drive.kind == "flow"
    panels = figure.subplots(2 if flow else 1, 1, sharex=True, squeeze=False)[:, 0]
    half = len(h["time"]) // 2
    signals = ([("mass_flow", 1.0, "Mass flow, kg/s")] if flow else []) + [("lip_opening", 1e3, "Lip opening, mm")]
    highest = 0.0
    for axes, (name, factor, label) in zip(panels, signals):
        if len(h["time"]) - half < 16:
            continue
        frequency, amplitude = spectrum(Series.of(h["time"][half:], factor * h[name][half:]))
        amplitude = np.maximum(amplitude, 1e-12 * max(amplitude.max(), 1e-30))
        axes.semilogy(frequency, amplitude, color=COMPUTED, lw=1.1)
        axes.set_ylim(bottom=1e-6 * max(amplitude.max(), 1e-9))
        axes.set_ylabel(label)
        above = np.flatnonzero(amplitude > 1e-4 * amplitude.max())
        highest = max(highest, frequency[above[-1]] if len(above) else 0.0)
        base = (result.verdict.get(name) or {}).get("frequency")
        if base:
            axes.axvline(base, color=ACCENT, lw=0.9, ls="--", zorder=0)
            axes.annotate(
                f"{base:.2f} Hz",
                (base, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(4, -12),
                textcoords="offset points",
                color=ACCENT,
                fontsize=9,
            )
    panels[-1].set_xlim(0, min(1.15 * highest, 0.5 / np.median(np.diff(h["time"]))) or None)
    panels[-1].set_xlabel("Frequency, Hz")
    panels[0].set_title("Spectrum of the second half (Hann window)", loc="left", fontweight="bold")
    return figure


def wave(result: TransientResults) -> Figure:
    """Displacement of the centre line in space and time: slanted bands are waves."""
    return _space_time(result, "centre_line", 1e3, "Displacement in y, mm", "Motion of the centre line")


def pressures(result: TransientResults) -> Figure:
    """Pressure in space and time."""
    return _space_time(result, "station_pressure", 1e-3, "Pressure, kPa", "Pressure along the valve")


def _space_time(result: TransientResults, name: str, factor: float, label: str, heading: str) -> Figure:
    h = result.history
    t = h["time"]
    start = max(t[0], t[-1] - (4.0 * (result.cycle[1] - result.cycle[0]) if result.cycle else t[-1] - t[0]))
    rows = np.flatnonzero(t >= start)
    rows = rows[:: max(1, len(rows) // 1500)]
    values = factor * h[name][rows].T
    figure = new_figure(7.6, 4.2)
    axes = figure.add_subplot()
    # single spikes must not take the whole range
    low, high = np.percentile(values, [0.5, 99.5])
    drawn = axes.pcolormesh(
        t[rows],
        1e3 * result.mesh.z,
        values,
        cmap="viridis",
        shading="nearest",
        rasterized=True,
        vmin=low,
        vmax=high if high > low else low + 1.0,
    )
    axes.grid(False)
    axes.set_xlabel("Time, s")
    axes.set_ylabel("Distance from the lip z, mm")
    axes.set_title(heading, loc="left", fontweight="bold")
    bar = figure.colorbar(drawn, ax=axes, aspect=25)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return figure
