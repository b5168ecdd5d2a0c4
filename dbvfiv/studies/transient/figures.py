"""Figures of a time history, and its animation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from ...drawing.style import (
    ACCENT,
    COMPUTED,
    MAGNITUDE,
    REST,
    colour_bar,
    driven,
    headline,
    new_figure,
    new_panel,
    phase_looks,
    style,
)
from ...drawing.views import offset_line
from ...errors import CaseError
from ...shell.mesh import nodal_thickness
from ...verdict import Series, in_steps, spectrum
from ..comparing import colours_of, labels
from ..request import require_gif
from ..result import StudyResult


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a transient result, each with its name."""
    if not result.begun:
        return
    flow = result.case.drive.kind == "flow"
    yield "history", lambda: history(result)
    yield "energies", lambda: energies(result)
    yield "centre-line-cycle", lambda: centre_line(result)
    yield "phase-portrait", lambda: phase_portrait(result)
    yield "spectrum", lambda: spectra(result)
    yield "lip-wave", lambda: wave(result)
    if flow:
        yield "station-pressures", lambda: pressures(result)


def title(result: StudyResult) -> str:
    """Name of the case, its last pressure, its fluid."""
    case = result.case
    fluid = f", {case.fluid.density:g} kg/m³, {case.fluid.continuity}" if case.drive.kind == "flow" else ""
    fluid = f"{fluid} {case.outside.words}".rstrip()
    return f"{result.header.name}: {driven(case, float(result.history['inlet_pressure'][-1]))}{fluid}"


def verdict_word(verdict: Mapping[str, Any]) -> str:
    """Name of a verdict, and whether it is not certain."""
    return f"{verdict['verdict']}{'' if verdict['decided'] else ' (not certain)'}"


def history(result: StudyResult) -> Figure:
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
    panels[0].set_title(verdict_word(result.verdict), loc="right", fontsize=10)
    for axes in panels:
        axes.tick_params(labelbottom=True)
    return figure


def energies(result: StudyResult) -> Figure:
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
    rest.set(ylabel=f"Imbalance, {unit}", xlabel="Time, s")
    rest.set_xlim(t[0], t[-1])
    for axes in (upper, lower):
        axes.tick_params(labelbottom=True)
    upper.set_title(f"Energies of the wall, {title(result)}", loc="left", fontweight="bold")
    return figure


def _draw_branches(axes, result: StudyResult, name: str) -> None:
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


def _cycle_rows(result: StudyResult) -> np.ndarray:
    """Rows of the last cycle; of the last fifth of the run where there is none."""
    t = result.history["time"]
    start, end = result.cycle or (t[-1] - 0.2 * (t[-1] - t[0]), t[-1])
    return np.flatnonzero((t >= start - 1e-12) & (t <= end))


def centre_line(result: StudyResult, count: int = 6) -> Figure:
    """Displacement in y along the line x = 0 at several times of a cycle (compare Fig. 7-16 of the thesis)."""
    h, rows = result.history, _cycle_rows(result)
    chosen = rows[
        np.unique(np.linspace(0, len(rows) - 1, count + 1).round().astype(int))[: count if result.cycle else None]
    ]
    period = "the last fifth of the run"
    if result.cycle:
        period = f"one cycle of {1e3 * (result.cycle[1] - result.cycle[0]):.3g} ms"
    places = "Distance from the lip z, mm", "Displacement in y, mm"
    figure, axes = new_panel(7.2, 4.4, f"Centre line over {period}", *places)
    z = 1e3 * result.mesh.z
    for row, look in zip(chosen, phase_looks(len(chosen))):
        after = 1e3 * (h["time"][row] - h["time"][rows[0]])
        axes.plot(z, 1e3 * h["centre_line"][row], label=f"{after:.1f} ms", **look)
    axes.fill_between(
        z, 1e3 * h["centre_line"][rows].min(axis=0), 1e3 * h["centre_line"][rows].max(axis=0), color="0.9", zorder=0
    )
    axes.axhline(0.0, color=REST, lw=0.9)
    axes.set_xlim(0, z[-1])
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title="after")
    return figure


def phase_portrait(result: StudyResult) -> Figure:
    """Velocity of the lip over its opening; the last cycles stand out."""
    h = result.history
    plane = "Clear lip opening, mm", "Velocity of one lip, m/s"
    figure, axes = new_panel(6.0, 4.6, "Phase portrait of the lip", *plane)
    x, v = 1e3 * h["lip_opening"], h["lip_velocity"]
    axes.plot(x, v, color="0.6", lw=0.7, label="whole run")
    rows = _cycle_rows(result)
    rows = np.concatenate(
        [[max(rows[0] - 1, 0)], rows]
    )  # a cycle is no whole number of steps: one more closes the loop
    axes.plot(x[rows], v[rows], color=COMPUTED, lw=1.8, label="last cycle" if result.cycle else "last fifth of the run")
    axes.plot(x[0], v[0], "o", color=ACCENT, label="start")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=3)
    return figure


def spectra(result: StudyResult) -> Figure:
    """Amplitude spectra of mass flow and lip opening over the second half of the run, with their resolution."""
    h = result.history
    figure = new_figure(7.2, 5.2)
    flow = result.case.drive.kind == "flow"
    panels = figure.subplots(2 if flow else 1, 1, sharex=True, squeeze=False)[:, 0]
    half = int(np.argmin(np.abs(h["time"] - 0.5 * (h["time"][0] + h["time"][-1]))))
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
    return headline(figure, heading)


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


def wave(result: StudyResult) -> Figure:
    """Displacement of the centre line in space and time: slanted bands are waves."""
    return _space_time(result, "centre_line", 1e3, "Displacement in y, mm", "Motion of the centre line")


def pressures(result: StudyResult) -> Figure:
    """Pressure in space and time."""
    return _space_time(result, "station_pressure", 1e-3, "Static pressure, kPa", "Pressure along the valve")


def _space_time(result: StudyResult, name: str, factor: float, label: str, heading: str) -> Figure:
    h = result.history
    t = h["time"]
    start = max(t[0], t[-1] - (4.0 * (result.cycle[1] - result.cycle[0]) if result.cycle else t[-1] - t[0]))
    rows = np.flatnonzero(t >= start)
    rows = rows[:: max(1, len(rows) // 1500)]
    values = factor * h[name][rows].T
    figure, axes = new_panel(7.6, 4.2, heading, "Time, s", "Distance from the lip z, mm")
    # single spikes must not take the whole range; what lies beyond is said
    low, high = np.percentile(values, [0.5, 99.5])
    low, high = (low, high) if high > low else (low - 0.5, low + 0.5)
    look = {"vmin": low, "vmax": high, "cmap": MAGNITUDE, "shading": "nearest", "rasterized": True}
    drawn = axes.pcolormesh(t[rows], 1e3 * result.mesh.z, values, **look)
    axes.grid(False)
    margin = 0.01 * (high - low)
    beyond = (values.min() < low - margin, values.max() > high + margin)
    if any(beyond):
        axes.set_title(f"from {values.min():.3g} to {values.max():.3g} {label.split(', ')[1]}", loc="right", fontsize=9)
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")
    colour_bar(figure, drawn, axes, label, aspect=25, extend=extend)
    return figure


def animate(result: StudyResult, path: Path, frames: int = 48, duration: float | None = None) -> Path:
    """Write a GIF of the faces at x = 0, the flow area and the lip's history. Raises CaseError if there are fewer than
    2 frames, or the file cannot be written.

    Parameters
    ----------
    frames : int
        At least 2.
    duration : float, optional
        End of the run to show, s; the last cycle by default, or the whole run if there is none.
    """
    if frames < 2:
        raise CaseError(f"An animation needs at least 2 frames, not {frames}.")
    require_gif(path)
    with style():
        figure, move = _picture(result, *_shown_rows(result, frames, duration))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            FuncAnimation(figure, move, frames=frames).save(path, writer=PillowWriter(fps=20), dpi=80)
        except OSError as error:
            raise CaseError(f"{str(path)!r} cannot be written ({error.strerror or error}).") from error
    return path


def cycles_to_animate(result: StudyResult, count: int) -> float:
    """Length, s, of the last `count` cycles; of the whole run for 1 where there is no cycle. Raises CaseError if the
    run does not hold so many.
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


def _shown_rows(result: StudyResult, frames: int, duration: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the history that are pictures, and whether each row is in the history shown."""
    t = result.history["time"]
    start, end = result.cycle or (t[0], t[-1])
    if duration is not None:
        start = max(t[0], end - duration)
    rows = np.searchsorted(t, np.linspace(start, end, frames, endpoint=False)).clip(0, len(t) - 1)
    return rows, (t >= start - (end - start)) & (t <= end)


def _picture(result: StudyResult, rows: np.ndarray, shown: np.ndarray):
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


#: Keys that do not change what a run finds.
QUIET = tuple(
    f"transient.{key}" for key in ("save_every", "restart_every", "stop_when", "duration", "start_file", "start_state")
)


def draw_together(results: Sequence[StudyResult], names: Sequence[str] | None = None) -> Figure:
    """Mass flow and lip opening of several runs over time (compare Figs. 5-3 to 5-10, 7-13 and 7-14 of the thesis);
    where all end in cycles, these in phase. Without `names` they are called by what tells their cases apart.
    """
    cycles = all(_swings(result) for result in results)
    figure = new_figure(10.0 if cycles else 8.0, 5.6 + 0.22 * len(results))
    ratios = {"width_ratios": [3, 2] if cycles else [1]}
    panels = figure.subplots(2, 2 if cycles else 1, sharex="col", squeeze=False, gridspec_kw=ratios)
    styles = ["-", "--", "-.", ":"]
    for i, (result, label, colour) in enumerate(zip(results, names or labels(results, QUIET), colours_of(results))):
        h, look = result.history, {"ls": styles[i % 4], "color": colour, "lw": 0.9 if cycles else 1.4}
        parts = [(slice(None), h["time"])]
        if cycles:
            parts.append(_last_cycles(result))
        for column, (rows, time) in enumerate(parts):
            name = f"{label}: {verdict_word(result.verdict)}" if column == 0 else None
            panels[0, column].plot(time, h["mass_flow"][rows], label=name, **look)
            panels[1, column].plot(time, 1e3 * h["lip_opening"][rows], **look)
            look["lw"] = 1.5
    panels[0, 0].set_ylabel("Mass flow, kg/s")
    panels[1, 0].set(ylabel="Clear lip opening, mm", xlabel="Time, s")
    times = [result.history["time"] for result in results]
    panels[1, 0].set_xlim(min(t[0] for t in times), max(t[-1] for t in times))
    panels[0, 0].set_title("Comparison of runs", loc="left", fontweight="bold")
    if cycles:
        panels[0, 1].set_title("Last two cycles, in phase", loc="left")
        panels[1, 1].set_xlabel("Time from the lip's way up, ms")
    figure.legend(loc="outside lower left", ncols=2 if len(results) > 3 else 1)
    return figure


def _swings(result: StudyResult) -> bool:
    """True where a run ends in at least three cycles, and not in a transition."""
    return bool(result.cycle) and result.verdict["lip_displacement"]["cycles_observed"] >= 3


def _last_cycles(result: StudyResult, count: int = 2) -> tuple[slice, np.ndarray]:
    """Rows of the last cycles, and times, ms, from the instant at which the lip rises through its mean."""
    h = result.history
    t, x = h["time"], h["lip_displacement"] - result.verdict["lip_displacement"]["mean"]
    period = result.cycle[1] - result.cycle[0]
    rising = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0) & (t[1:] <= t[-1] - count * period))
    if not len(rising):
        first = int(np.searchsorted(t, t[-1] - count * period))
        return slice(first, None), 1e3 * (t[first:] - t[first])
    at = rising[-1]
    begin = t[at] - x[at] * (t[at + 1] - t[at]) / (x[at + 1] - x[at])
    end = int(np.searchsorted(t, begin + count * period, side="right")) + 1
    return slice(at, end), 1e3 * (t[at:end] - begin)
