"""Several runs in one figure."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import new_figure
from .. import comparing
from ..result import StudyResult

_QUIET = tuple(
    f"transient.{key}" for key in ("save_every", "restart_every", "stop_when", "duration", "start_file", "start_state")
)


def labels(results: Sequence[StudyResult]) -> list[str]:
    """Legend entries that say what tells the runs apart."""
    return comparing.labels(results, _QUIET)


def compare(results: Sequence[StudyResult], names: Sequence[str] | None = None) -> Figure:
    """Mass flow and lip opening of several runs over time (compare Figs. 5-3 to 5-10, 7-13 and 7-14 of the thesis);
    where all end in cycles, these in phase.

    Parameters
    ----------
    results : sequence of StudyResult
    names : sequence of str, optional
        What the runs are called; by what tells their cases apart without them.
    """
    cycles = all(_swings(result) for result in results)
    figure = new_figure(10.0 if cycles else 8.0, 5.6 + 0.22 * len(results))
    panels = figure.subplots(
        2, 2 if cycles else 1, sharex="col", squeeze=False, gridspec_kw={"width_ratios": [3, 2] if cycles else [1]}
    )
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))
    styles = ["-", "--", "-.", ":"]
    for i, (result, label, colour) in enumerate(zip(results, names or labels(results), colours)):
        h, look = result.history, {"ls": styles[i % 4], "color": colour, "lw": 0.9 if cycles else 1.4}
        parts = [(slice(None), h["time"])]
        if cycles:
            parts.append(_last_cycles(result))
        for column, (rows, time) in enumerate(parts):
            panels[0, column].plot(
                time,
                h["mass_flow"][rows],
                label=f"{label}: {result.verdict['verdict']}" if column == 0 else None,
                **look,
            )
            panels[1, column].plot(time, 1e3 * h["lip_opening"][rows], **look)
            look["lw"] = 1.5
    panels[0, 0].set_ylabel("Mass flow, kg/s")
    panels[1, 0].set_ylabel("Clear lip opening, mm")
    panels[1, 0].set_xlabel("Time, s")
    panels[1, 0].set_xlim(
        left=min(r.history["time"][0] for r in results), right=max(r.history["time"][-1] for r in results)
    )
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
