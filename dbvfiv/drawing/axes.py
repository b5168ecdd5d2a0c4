"""Axes, titles and colour bars that all figures share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axis import Axis
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

#: Decades of a logarithmic axis below which 2 and 5 of each decade are written too.
_SHORT, _SHORTEST = 2.6, 0.7

#: White about a text that may lie on a line.
HALO = (withStroke(linewidth=3.0, foreground="white"),)


def headline(figure: Figure, text: str) -> None:
    """The title of a figure of several panels, at the left as those of single panels are."""
    figure.suptitle(text, x=0.01, ha="left")


def log_axis(axis: Axis, low: float, high: float) -> None:
    """Make an axis from `low` to `high` logarithmic, with numbers at its ticks however short it is."""
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    decades = np.log10(high / low) if 0 < low < high else 1.0
    digits = np.arange(1.0, 10.0) if decades < _SHORTEST else (1.0, 2.0, 5.0) if decades < _SHORT else (1.0,)
    axis.set_major_locator(LogLocator(subs=digits, numticks=12))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def colour_bar(figure: Figure, drawn: Any, axes: Any, label: str, **options: Any) -> Colorbar:
    """A colour bar with its label, without a frame."""
    bar = figure.colorbar(drawn, ax=axes, **{"pad": 0.02, "aspect": 28} | options)
    bar.set_label(label)
    bar.outline.set_visible(False)
    return bar


def limits(values: Sequence[float], log: bool = False) -> tuple[float, float]:
    """Ends of an axis that holds these values, with room about a single one."""
    low, high = float(min(values)), float(max(values))
    if high > low:
        return low, high
    return (0.5 * low, 2.0 * low) if log else (low - 0.5 * (abs(low) or 1.0), low + 0.5 * (abs(low) or 1.0))
