"""How figures look: fonts, colours, sizes; drawn without a display."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

#: Colours of things that recur.
COMPUTED, PUBLISHED, REST, ACCENT = "#1f4e79", "#c0392b", "#8c8c8c", "#d98200"
#: Colour map of magnitudes, readable in grey and by the colour-blind.
MAGNITUDE = "viridis"

_SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.8,
    "lines.markersize": 5.5,
    "savefig.dpi": 160,
    "savefig.bbox": "tight",
    "svg.fonttype": "none",
    "svg.hashsalt": "dbvfiv",
}


@contextmanager
def style() -> Iterator[None]:
    """Drawing with this package's settings."""
    with matplotlib.rc_context(_SETTINGS):
        yield


def new_figure(width: float = 6.4, height: float = 4.2) -> Figure:
    """An empty figure, inches, that is independent of any display."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def pressure_colours(pressures: np.ndarray) -> np.ndarray:
    """(n, 4) colours from low to high pressure, dark to light but never too pale for a line."""
    p = np.asarray(pressures, float)
    span = np.ptp(p)
    share = (p - p.min()) / span if span > 0 else np.full(len(p), 0.45)
    return matplotlib.colormaps[MAGNITUDE](0.02 + 0.83 * share)


def kilopascals(pressure: float) -> str:
    """A pressure as it stands in legends and titles."""
    return f"{pressure / 1e3:.4g} kPa"


def some_of(states: list, count: int = 8) -> list:
    """At most `count` of the states, spread evenly, the first and the last among them."""
    if len(states) <= count:
        return list(states)
    return [states[i] for i in np.unique(np.linspace(0, len(states) - 1, count).round().astype(int))]
