"""Bars of the relative derivatives of a mode: parameters that move it, and their direction."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import STABLE, UNSTABLE, headline, new_figure
from ..result import StudyResult
from ..stability.place import describe_fixed

#: Bars drawn at most, those that move the mode most.
MOST = 24


def draw_bars(result: StudyResult) -> Figure:
    """Change of growth rate and frequency of the mode for one percent more of each parameter, the largest on top."""
    known = [found for found in result.sensitivities if found.value]
    shown = sorted(known, key=lambda found: abs(found.relative), reverse=True)[:MOST]
    change = np.array([found.per_percent for found in shown])
    place = np.arange(len(shown))
    figure = new_figure(8.4, 1.9 + 0.27 * len(shown))
    growth, frequency = figure.subplots(1, 2, sharey=True)
    growth.barh(place, change.real, color=[UNSTABLE if c > 0 else STABLE for c in change.real], height=0.7)
    frequency.barh(place, change.imag / (2 * np.pi), color="#5f6a72", height=0.7)
    growth.set_yticks(place, [found.parameter for found in shown])
    growth.invert_yaxis()
    growth.set_xlabel("Change of growth rate, 1/s per percent")
    frequency.set_xlabel("Change of frequency, Hz per percent")
    for axes in (growth, frequency):
        axes.axvline(0.0, color="0.25", lw=1.0)
        axes.grid(axis="y", visible=False)
    mode = f"mode {result.number}, {result.growth_rate:.4g} 1/s at {result.frequency:.4g} Hz"
    headline(figure, f"{result.header.name}, {mode}")
    words = [describe_fixed(result.case)]
    if len(shown) < len(known):
        words.append(f"the {len(shown)} largest of {len(known)}")
    if len(known) < len(result.sensitivities):
        words.append("parameters that are zero have no percent")
    figure.supxlabel(" · ".join(words), x=0.01, ha="left", fontsize=8.5, color="0.35")
    return figure
