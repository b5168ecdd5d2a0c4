"""Pressure, velocity and area along the passage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ...drawing.style import kilopascals, new_figure, pressure_colours, pressure_heading, some_of
from ...drawing.views import mark_pieces
from ..measured.figures import MEASURED
from .discharge import ordered

if TYPE_CHECKING:
    from .result import SteadyResult

#: What each panel shows of a state, in how many copies of the part that is computed.
_PANELS = (
    ("Static pressure, kPa", lambda state, copies: (state.station_pressure + state.outlet_pressure) / 1e3),
    ("Velocity, m/s", lambda state, copies: state.station_velocity),
    ("Flow area, cm²", lambda state, copies: copies * state.station_area * 1e4),
)


def draw(result: SteadyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name."""
    if result.case.drive.kind == "flow":
        yield "passage", lambda: passage(result)


def passage(result: SteadyResult) -> Figure:
    """Pressure over that of the surroundings, velocity and flow area over the distance from the lip, with pressures
    that were measured; the fluid flows from right to left.
    """
    figure = new_figure(7.2, 7.4)
    panels = figure.subplots(3, 1, sharex=True)
    states, taps = some_of(ordered(result)), result.measured.taps
    z = result.mesh.z * 1e3
    colours = pressure_colours([*(s.pressure for s in states), *([] if taps is None else taps.pressure)])
    for axes, (label, value) in zip(panels, _PANELS):
        for state, colour in zip(states, colours):
            axes.plot(z, value(state, result.mesh.part.copies), color=colour, label=kilopascals(state.pressure))
        axes.set_ylabel(label)
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.set_xlim(0, z[-1])
        axes.tick_params(labelbottom=True)
    if taps is not None:
        look = {"c": colours[len(states) :], "marker": MEASURED["marker"], "label": "measured"}
        panels[0].scatter(taps.z * 1e3, taps.measured / 1e3, zorder=3, **look)
    mark_pieces(result, *panels)
    panels[0].set_title("Along the passage (lip left, inlet right)", loc="left", fontweight="bold")
    panels[-1].set_xlabel("Distance from the lip z, mm")
    panels[0].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title=pressure_heading(result.case))
    return figure
