"""Style of figures: fonts, colours, sizes; drawn without a display."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..case.model import Case
from ..case.parameters import PARAMETERS

#: Colours of things that recur.
COMPUTED, PUBLISHED, REST, ACCENT = "#1f4e79", "#c0392b", "#8c8c8c", "#d98200"
#: Of what is stable and unstable, and the ground of the unstable half-plane.
STABLE, UNSTABLE, DANGER = COMPUTED, PUBLISHED, "#c0392b14"
#: Colour maps of magnitudes, of motion and of what has a sign: even steps to the eye, readable in grey (but for the
#: sign) and by the colour-blind.
MAGNITUDE, MOTION, SIGNED = "viridis", "cividis", "RdBu_r"

_SETTINGS: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 11,
    "figure.titlesize": 11,
    "figure.titleweight": "bold",
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


def phase_looks(count: int) -> list[dict[str, Any]]:
    """Colours and dashes of `count` instants of a cycle: dark to light, the second half dashed."""
    shades = matplotlib.colormaps[MAGNITUDE](np.linspace(0.0, 0.85, count))
    return [{"color": shade, "ls": "-" if 2 * i < count else (0, (4, 1.5))} for i, shade in enumerate(shades)]


def branch_looks(count: int) -> list[dict[str, Any]]:
    """Colours and markers of `count` curves that are told apart by name (Okabe and Ito 2008: safe for the
    colour-blind).
    """
    return [{"color": _NAMED[i % len(_NAMED)], "marker": _MARKERS[i % len(_MARKERS)]} for i in range(count)]


_NAMED = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#000000")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">")


def pressure_colours(pressures: np.ndarray) -> np.ndarray:
    """(n, 4) colours from low to high pressure, dark to light but never too pale for a line."""
    p = np.asarray(pressures, float)
    span = np.ptp(p)
    share = (p - p.min()) / span if span > 0 else np.full(len(p), 0.45)
    return matplotlib.colormaps[MAGNITUDE](0.02 + 0.83 * share)


def kilopascals(pressure: float) -> str:
    """A pressure as it stands in legends and titles."""
    return f"{pressure / 1e3:.4g} kPa"


def driven(case: Case, pressure: float) -> str:
    """A pressure that drives the flow as it stands in titles, with the place where it is."""
    return f"{kilopascals(pressure)} {case.pressure_at}"


def pressure_name(case: Case) -> str:
    """Name of the driving pressure for an axis or legend, without a number."""
    if not case.has_line:
        return PARAMETERS["pressure"].title
    return "Pressure in the reservoir" if case.drive.at == "reservoir" else "Static pressure at the far end"


def pressure_heading(case: Case) -> str:
    """Name of the driving pressure over a narrow legend, on several lines."""
    return textwrap.fill(pressure_name(case).lower(), 15)


def parameter_label(case: Case, name: str) -> str:
    """Title, symbol and unit of a parameter, for an axis."""
    return f"{pressure_name(case)}, kPa" if name == "pressure" else PARAMETERS[name].label


def some_of(states: list, count: int = 8) -> list:
    """At most `count` of the states, spread evenly, the first and the last among them."""
    if len(states) <= count:
        return list(states)
    return [states[i] for i in np.unique(np.linspace(0, len(states) - 1, count).round().astype(int))]
