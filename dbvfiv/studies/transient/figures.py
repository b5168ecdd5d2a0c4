"""Figures of a time history: histories, energies, phase portrait, spectrum, centre line over a cycle, pressures in
space and time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import ACCENT, COMPUTED, MAGNITUDE, REST, colour_bar, driven, headline, new_figure, phase_looks
from ...verdict import Series, in_steps, spectrum

if TYPE_CHECKING:
    from .result import TransientResult


def draw(result: TransientResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
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


def title(result: TransientResult) -> str:
    """Name of the case, its last pressure, its fluid."""
    case = result.case
    fluid = f", {case.fluid.density:g} kg/m³, {case.fluid.continuity}" if case.drive.kind == "flow" else ""
    fluid = f"{fluid} {case.outside.words}".rstrip()
    return f"{result.header.name}: {driven(case, float(result.history['inlet_pressure'][-1]))}{fluid}"


def history(result: TransientResult) -> Figure:
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
            panels[0].plot(t, h["inlet_mass_flow"], color=ACCENT, lw=1.0, ls="--", label="in at the flange")
            # below the numbers of the axis
            panels[0].legend(loc="upper left", bbox_to_anchor=(0.0, -0.11), ncols=2, borderaxespad=0.0)
        panels[0].set_ylabel("Mass flow, kg/s")
        panels[2].plot(t, 1e4 * h["smallest_area"], color=ACCENT, lw=1.3, ls="--", label="smallest of all rows")
        panels[2].plot(t, 1e4 * h["outlet_area"], color=COMPUTED, lw=1.0, label="at the lip")
        panels[2].set_ylabel("Flow area, cm²")
        # beside the axes' title line: an oscillation leaves no empty place within
        panels[2].legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2, borderaxespad=0.0)
    lip.plot(t, 1e3 * h["lip_opening"], color=COMPUTED, lw=1.3)
    lip.set_ylabel("Clear lip opening, mm")
    panels[-1].set_xlabel("Time, s")
    panels[-1].set_xlim(t[0], t[-1])
    panels[0].set_title(title(result), loc="left", fontweight="bold")
    verdict = result.verdict
    sure = "" if verdict["decided"] else " (not certain)"
    panels[0].set_title(f"{verdict['verdict']}{sure}", loc="right", fontsize=10)
    for axes in panels:
        axes.tick_params(labelbottom=True)
    return figure


def energies(result: TransientResult) -> Figure:
    """Energies of the wall, what has gone in and out, and, on an axis of its own, what these leave unexplained."""
    h = result.history
    figure = new_figure(8.0, 7.2)
    upper, lower, rest = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    t = h["time"]
    for axes, curves in ((upper, _STORED), (lower, _EXCHANGED)):
        for name, label, look in curves:
            if np.any(h.get(name, 0.0)):
                axes.plot(t, h[name], lw=1.2, label=label, **look)
        if result.mesh.relaxing:
            _draw_branches(axes, result, "branch_energy" if axes is upper else "branch_loss")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    turned_over = float(np.abs(np.diff(h["pressure_work"])).sum())
    scale, unit = _readable(h["balance"])
    rest.plot(t, scale * h["balance"], color="0.25", lw=1.2)
    rest.axhline(0.0, color=REST, lw=0.8)
    worst = float(np.abs(h["balance"]).max())
    share = f", {100 * worst / turned_over:.2g} % of the work turned over" if turned_over > 0 else ""
    rest.set_title(f"unexplained: at most {scale * worst:.3g} {unit}{share}", loc="left", fontsize=9)
    upper.set_ylabel("Energy, J")
    lower.set_ylabel("Since the start, J")
    rest.set_ylabel(f"Imbalance, {unit}")
    rest.set_xlabel("Time, s")
    rest.set_xlim(t[0], t[-1])
    for axes in (upper, lower):
        axes.tick_params(labelbottom=True)
    upper.set_title(f"Energies of the wall, {title(result)}", loc="left", fontweight="bold")
    return figure


def _draw_branches(axes, result: TransientResult, name: str) -> None:
    """Energies of the Maxwell branches: held by all of them together, or lost in each group of layers."""
    h, groups = result.history, result.mesh.relaxing
    if name == "branch_energy":
        axes.plot(h["time"], h[name].sum(axis=1), lw=1.2, color="0.45", ls="--", label="layers that\nrelax")
        return
    for column, group in enumerate(groups):
        grey = f"{0.15 + 0.55 * column / max(len(groups) - 1, 1):.2f}"
        label = f"lost in\n{group}" if len(group) < 24 else f"lost in\n{group[:21]} ..."
        axes.plot(h["time"], h[name][:, column], lw=1.2, color=grey, ls="--", label=label)


_STORED = (
    ("kinetic_energy", "kinetic", {"color": ACCENT}),
    ("outside_energy", "fluid\noutside", {"color": ACCENT, "ls": "--"}),
    ("strain_energy", "strain", {"color": COMPUTED}),
    ("stop_energy", "stops or\ncontact", {"color": "0.45", "ls": ":"}),
    ("weight_energy", "weight of\nthe wall", {"color": COMPUTED, "ls": ":"}),
)
_EXCHANGED = (
    ("pressure_work", "work of the\npressure", {"color": COMPUTED}),
    ("dissipation", "lost to\ndamping", {"color": ACCENT}),
    ("contact_loss", "lost in\ncontact", {"color": "0.45", "ls": "--"}),
    ("numerical_loss", "numerical\ndamping", {"color": "0.25", "ls": "-."}),
    ("outside_renewed", "renewals of the\nadded mass", {"color": "0.45", "ls": ":"}),
)


def _readable(energy: np.ndarray) -> tuple[float, str]:
    """Factor and unit in which an energy, J, has few digits before the point."""
    size = float(np.abs(energy).max())
    for factor, unit in ((1.0, "J"), (1e3, "mJ"), (1e6, "µJ")):
        if size * factor >= 1.0:
            return factor, unit
    return 1e9, "nJ"


def _cycle_rows(result: TransientResult) -> np.ndarray:
    """Rows of the last cycle; of the last fifth of the run where there is none."""
    t = result.history["time"]
    start, end = result.cycle or (t[-1] - 0.2 * (t[-1] - t[0]), t[-1])
    return np.flatnonzero((t >= start - 1e-12) & (t <= end))


def centre_line(result: TransientResult, count: int = 6) -> Figure:
    """Displacement in y along the line x = 0 at several times of a cycle (compare Fig. 7-16 of the thesis)."""
    h, rows = result.history, _cycle_rows(result)
    chosen = rows[
        np.unique(np.linspace(0, len(rows) - 1, count + 1).round().astype(int))[: count if result.cycle else None]
    ]
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    z = 1e3 * result.mesh.z
    for row, look in zip(chosen, phase_looks(len(chosen))):
        after = 1e3 * (h["time"][row] - h["time"][rows[0]])
        axes.plot(z, 1e3 * h["centre_line"][row], label=f"{after:.1f} ms", **look)
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
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title="after")
    return figure


def phase_portrait(result: TransientResult) -> Figure:
    """Velocity of the lip over its opening; the last cycles stand out."""
    h = result.history
    figure = new_figure(6.0, 4.6)
    axes = figure.add_subplot()
    x, v = 1e3 * h["lip_opening"], h["lip_velocity"]
    axes.plot(x, v, color="0.6", lw=0.7, label="whole run")
    rows = _cycle_rows(result)
    rows = np.concatenate(
        [[max(rows[0] - 1, 0)], rows]
    )  # a cycle is no whole number of steps: one more closes the loop
    axes.plot(x[rows], v[rows], color=COMPUTED, lw=1.8, label="last cycle" if result.cycle else "last fifth of the run")
    axes.plot(x[0], v[0], "o", color=ACCENT, label="start")
    axes.set_xlabel("Clear lip opening, mm")
    axes.set_ylabel("Velocity of one lip, m/s")
    axes.set_title("Phase portrait of the lip", loc="left", fontweight="bold")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
    return figure


def spectra(result: TransientResult) -> Figure:
    """Amplitude spectra of mass flow and lip opening over the second half of the run, with their resolution."""
    h = result.history
    figure = new_figure(7.2, 5.2)
    flow = result.case.drive.kind == "flow"
    panels = figure.subplots(2 if flow else 1, 1, sharex=True, squeeze=False)[:, 0]
    half = len(h["time"]) // 2
    signals = ([("mass_flow", 1.0, "Mass flow, kg/s")] if flow else []) + [
        ("lip_opening", 1e3, "Clear lip opening, mm")
    ]
    heading, highest = "Spectrum of the second half (Hann window)", 0.0
    for axes, (name, factor, label) in zip(panels, signals):
        axes.set_ylabel(label)
        if len(h["time"]) - half < 16:
            heading = "The second half of the run is too short for a spectrum"
            continue
        series = Series.of(h["time"][half:], factor * h[name][half:])
        heading = f"Spectrum of the second half (Hann window, resolution {1.0 / series.duration:.2g} Hz)"
        there = _spectrum(axes, series)
        base = (result.verdict.get(name) or {}).get("frequency")
        highest = max(highest, min(there, _HARMONICS * base) if base else there)
        if base:
            axes.axvline(base, color=ACCENT, lw=0.9, ls="--", zorder=0)
            axes.set_title(f"frequency by the verdict: {in_steps(base, 1.0 / series.duration)} Hz", **_BESIDE)
    panels[-1].set_xlim(0, min(1.15 * highest, 0.5 / np.median(np.diff(h["time"]))) or None)
    panels[-1].set_xlabel("Frequency, Hz")
    panels[0].tick_params(labelbottom=True)
    headline(figure, heading)
    return figure


#: Multiples of the frequency of a motion up to which a spectrum is drawn at most: slams fill it to its end.
_HARMONICS = 25
_BESIDE = {"loc": "right", "fontsize": 9, "color": ACCENT}


def _spectrum(axes, series: Series) -> float:
    """Draw a spectrum with a dot at each line that it resolves; the frequency up to which there is something, Hz."""
    frequency, amplitude = spectrum(series)
    amplitude = np.maximum(amplitude, 1e-12 * max(amplitude.max(), 1e-30))
    axes.semilogy(frequency, amplitude, ".-" if len(frequency) < 200 else "-", color=COMPUTED, lw=1.1, ms=4)
    axes.set_ylim(bottom=1e-6 * max(amplitude.max(), 1e-9))
    above = np.flatnonzero(amplitude > 1e-4 * amplitude.max())
    return float(frequency[above[-1]]) if len(above) else 0.0


def wave(result: TransientResult) -> Figure:
    """Displacement of the centre line in space and time: slanted bands are waves."""
    return _space_time(result, "centre_line", 1e3, "Displacement in y, mm", "Motion of the centre line")


def pressures(result: TransientResult) -> Figure:
    """Pressure in space and time."""
    return _space_time(result, "station_pressure", 1e-3, "Static pressure, kPa", "Pressure along the valve")


def _space_time(result: TransientResult, name: str, factor: float, label: str, heading: str) -> Figure:
    h = result.history
    t = h["time"]
    start = max(t[0], t[-1] - (4.0 * (result.cycle[1] - result.cycle[0]) if result.cycle else t[-1] - t[0]))
    rows = np.flatnonzero(t >= start)
    rows = rows[:: max(1, len(rows) // 1500)]
    values = factor * h[name][rows].T
    figure = new_figure(7.6, 4.2)
    axes = figure.add_subplot()
    # single spikes must not take the whole range; what lies beyond is said
    low, high = np.percentile(values, [0.5, 99.5])
    low, high = (low, high) if high > low else (low - 0.5, low + 0.5)
    look = {"vmin": low, "vmax": high, "cmap": MAGNITUDE, "shading": "nearest", "rasterized": True}
    drawn = axes.pcolormesh(t[rows], 1e3 * result.mesh.z, values, **look)
    axes.grid(False)
    axes.set_xlabel("Time, s")
    axes.set_ylabel("Distance from the lip z, mm")
    axes.set_title(heading, loc="left", fontweight="bold")
    margin = 0.01 * (high - low)
    beyond = (values.min() < low - margin, values.max() > high + margin)
    if any(beyond):
        axes.set_title(f"from {values.min():.3g} to {values.max():.3g} {label.split(', ')[1]}", loc="right", fontsize=9)
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    colour_bar(figure, drawn, axes, label, aspect=25, extend=extend)
    return figure
