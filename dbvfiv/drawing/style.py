"""Style of figures: fonts, colours, sizes, axes; figures by name, drawn without a display and written as files."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, Locator, LogLocator, MaxNLocator, NullFormatter, NullLocator

from ..case.model import Case
from ..case.parameters import PARAMETERS
from ..case.units import Units
from ..errors import CaseError, as_path

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


def new_panel(width: float, height: float, title: str, xlabel: str, ylabel: str) -> tuple[Figure, Axes]:
    """An empty figure of one panel, inches, with its title and labels."""
    figure = new_figure(width, height)
    axes = figure.subplots()
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.set_title(title, loc="left", fontweight="bold")
    return figure, axes


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
    return f"{case.units.pressure(pressure)} {case.pressure_at}"


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


#: Digits that are written on a logarithmic axis of so many decades at most; of longer ones 1 alone.
_DIGITS = {0.35: np.arange(1.0, 10.0), 0.7: (1.0, 2.0, 3.0, 5.0, 7.0), 2.6: (1.0, 2.0, 5.0)}

#: White about a text that may lie on a line.
HALO = (withStroke(linewidth=3.0, foreground="white"),)


def headline(figure: Figure, text: str, *below: str) -> Figure:
    """A figure of several panels with its title, at the left as those of single panels are, and with words below it in
    grey.
    """
    figure.suptitle(text, x=0.01, ha="left")
    if words := " · ".join(filter(None, below)):
        figure.supxlabel(words, x=0.01, ha="left", fontsize=8.5, color="0.35")
    return figure


def log_axis(axis: Axis, low: float, high: float) -> None:
    """Make an axis from `low` to `high` logarithmic, with numbers at its ticks however short it is."""
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    axis.set_major_locator(_log_ticks(low, high))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _log_ticks(low: float, high: float) -> Locator:
    decades = np.log10(high / low) if 0 < low < high else 1.0
    return LogLocator(subs=next((digits for most, digits in _DIGITS.items() if decades < most), (1.0,)), numticks=12)


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


class _InUnit(Locator):
    """Ticks at round numbers of another unit than that of the data, `ratio` of it to one of theirs."""

    def __init__(self, ticks: Locator, ratio: float):
        self._ticks, self._ratio = ticks, ratio

    def __call__(self) -> np.ndarray:
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> np.ndarray:
        return np.asarray(self._ticks.tick_values(vmin * self._ratio, vmax * self._ratio)) / self._ratio


def put_in_units(figure: Figure, units: Units) -> Figure:
    """Let the axes and words of a figure, drawn in the units of tables, speak those of a case."""
    for text in figure.findobj(Text):
        text.set_text(units.say(text.get_text()))
    for axis in (axis for axes in figure.axes for axis in axes._axis_map.values()):
        label, ratio = units.label(axis.get_label_text())
        axis.set_label_text(label)
        if ratio != 1.0 and not isinstance(axis.get_major_locator(), _InUnit):
            even = MaxNLocator(7, steps=[1, 2, 2.5, 5, 10])
            ticks = even if axis.get_scale() == "linear" else _log_ticks(*axis.get_view_interval())
            axis.set_major_locator(_InUnit(ticks, ratio))
            axis.set_major_formatter(lambda value, _, ratio=ratio: f"{value * ratio:.4g}")
            axis.set_minor_locator(NullLocator())
    return figure


FORMATS = ("png", "svg")


def draw_figures(
    drawers: Mapping[str, Callable[[], Figure]], only: Sequence[str], whose: str, units: Units | None = None
) -> dict[str, Figure]:
    """Figures by name. Raises CaseError for a name that there is no figure of, or nothing to draw.

    Parameters
    ----------
    drawers : mapping of names to callables
    only : sequence of str
        Names of those wanted; all without it.
    whose : str
        For messages, "steady result of 'dbv12'".
    units : Units, optional
        That axes and words are to have.
    """
    if not drawers:
        raise CaseError(f"The {whose} holds nothing that could be drawn.")
    for name in only:
        if name not in drawers:
            raise CaseError(f"There is no figure {name!r} of this result; it has {', '.join(drawers)}.")
    with style():
        drawn = {name: drawer() for name, drawer in drawers.items() if not only or name in only}
        return drawn if units is None else {name: put_in_units(figure, units) for name, figure in drawn.items()}


def write_figures(figures: Mapping[str, Figure], folder: str | Path = ".", format: str = "png") -> list[Path]:
    """Write figures into files NAME.FORMAT of a folder and return their names. Raises CaseError for an unknown format
    or a folder that cannot be written.
    """
    if format not in FORMATS:
        raise CaseError(f"Figures are written as {' or '.join(FORMATS)}, not as {format!r}.")
    folder = as_path(folder, "A folder for figures")
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in figures.items():
            path = folder / f"{name}.{format}"
            with style():
                figure.savefig(path, metadata={"Date": None} if format == "svg" else None)
            written.append(path)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    return written
