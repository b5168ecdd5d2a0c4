"""Curves over the back pressure: passage left, sealed length, contact force, stiffness."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .style import ACCENT, COMPUTED, PUBLISHED, REST, kilopascals, new_figure, pressure_colours, some_of

if TYPE_CHECKING:
    from ..results.closure import ClosureResults


def draw(result: ClosureResults) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a closure result, each with its name."""
    if result.walk:
        yield "closure-curve", lambda: closure_curve(result)
    yield "passage", lambda: passage(result)
    if result.opened:
        yield "reversal", lambda: reversal(result)
    if result.closing is not None:
        yield "reversal-in-time", lambda: in_time(result)


def closure_curve(result: ClosureResults) -> Figure:
    """Sealed length, contact force, deepest displacement and lowest stiffness over the back pressure."""
    figure = new_figure(9.0, 6.4)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    walk = result.walk
    p = np.array([point.pressure for point in walk]) / 1e3

    def values(name):
        return np.array([getattr(point, name) for point in walk])

    length, force, moved, stiffness = panels
    length.plot(p, values("contact_front") * 1e3, color=COMPUTED, label="front of contact on the centre line")
    length.plot(p, values("sealed_length") * 1e3, color=ACCENT, label="sealed length")
    length.plot(p, values("lip_seal") * 1e3, color=ACCENT, ls="--", label="of it from the lip on")
    length.axhline(result.case.valve.duckbill_length * 1e3, color=REST, lw=0.9, ls=":")
    length.set_ylabel("Length along the axis, mm")
    length.legend()
    force.plot(p, values("contact_force"), color=COMPUTED)
    force.set_ylabel("Force between the walls, N")
    moved.plot(p, values("max_displacement") * 1e3, color=COMPUTED)
    moved.set_ylabel("Largest displacement, mm")
    stiffness.plot(p, values("lowest_eigenvalue") / 1e3, color=COMPUTED)
    stiffness.axhline(0.0, color=REST, lw=0.9)
    stiffness.set_ylabel("Lowest stiffness eigenvalue, 10³ 1/s²")
    for b in result.buckling[:1]:
        for axes in panels:
            axes.axvline(b.pressure / 1e3, color=PUBLISHED, lw=1.0, ls="--")
        stiffness.annotate(
            f"{b.kind}, {kilopascals(b.pressure)}",
            (b.pressure / 1e3, 0),
            (6, 8),
            textcoords="offset points",
            color=PUBLISHED,
            fontsize=9,
        )
    for axes in panels:
        for state in result.states:
            axes.axvline(state.pressure / 1e3, color="0.85", lw=0.8, zorder=0)
    for axes in panels[2:]:
        axes.set_xlabel("Back pressure, kPa")
    figure.suptitle(f"Closure, {_supports(result)}", fontweight="bold", fontsize=11)
    return figure


def passage(result: ClosureResults) -> Figure:
    """Passage left between the inner faces along the axis."""
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    states = some_of(sorted(result.states, key=lambda s: s.pressure))
    z = result.mesh.z * 1e3
    least = 1e-8  # m2; below that a passage is shut for any purpose
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        axes.semilogy(
            z,
            np.maximum(4 * state.opening, least) * 1e6,
            color=colour,
            marker=".",
            ms=3,
            label=kilopascals(state.pressure),
        )
    axes.axhline(result.reference_opening * 1e6, color=REST, lw=1.0, ls="--", label="lip at rest")
    limit = result.case.closure.shut_fraction * result.reference_opening
    axes.axhline(limit * 1e6, color=ACCENT, lw=1.0, ls=":", label="counts as shut below")
    axes.axvline(result.case.valve.duckbill_length * 1e3, color=REST, lw=0.8, ls=":")
    axes.set_xlabel("Distance from the lip z, mm")
    axes.set_ylabel("Passage between the inner faces, mm²")
    axes.set_title(f"What stays open, whole valve, {_supports(result)}", loc="left", fontweight="bold")
    axes.legend(loc="lower right", ncols=2)
    return figure


def reversal(result: ClosureResults) -> Figure:
    """From flow to back pressure: opening of the lips and position of the saddle as the drive turns round slowly."""
    figure = new_figure(7.2, 4.6)
    axes = figure.add_subplot()
    opened = sorted(result.opened, key=lambda s: -s.pressure)
    through = np.array([s.pressure for s in opened] + [0.0]) / 1e3
    area = np.array([s.outlet_area for s in opened] + [np.nan]) * 1e6
    back = np.array([0.0] + [-p.pressure for p in result.walk]) / 1e3
    left = np.array([result.reference_opening] + [p.least_opening for p in result.walk]) * 1e6
    axes.semilogy(through, area, color=COMPUTED, label="flow area at the lip, water flowing")
    axes.semilogy(back, np.maximum(left, 1e-2), color=ACCENT, label="narrowest passage between the faces, no flow")
    axes.axvline(0.0, color=REST, lw=0.9)
    axes.set_xlabel("Pressure inside less pressure outside, kPa")
    axes.set_ylabel("Area, whole valve, mm²")
    axes.invert_xaxis()
    axes.set_title(f"From open to shut, quasi-static, {_supports(result)}", loc="left", fontweight="bold")
    axes.legend()
    return figure


def in_time(result: ClosureResults) -> Figure:
    """Drive, lip, narrowest passage, flow and contact force while the drive turns round."""
    closing = result.closing
    figure = new_figure(8.4, 8.0)
    panels = figure.subplots(5, 1, sharex=True)

    def values(name, factor):
        return factor * np.array([getattr(sample, name) for sample in closing.samples])

    t = values("time", 1.0)
    curves = (
        ("inlet_pressure", 1e-3, "Drive, kPa"),
        ("lip_opening", 1e3, "Lip, mm"),
        ("least_opening", 1e6, "Passage, mm²"),
        ("mass_flow", 1.0, "Flow, kg/s"),
        ("contact_force", 1.0, "Contact, N"),
    )
    for axes, (name, factor, label) in zip(panels, curves):
        axes.plot(t, values(name, factor), color=COMPUTED, lw=1.4)
        axes.set_ylabel(label)
        axes.axvline(closing.turn.zero, color=REST, lw=0.9, ls=":")
        if closing.closing_time is not None:
            axes.axvline(closing.turn.start + closing.closing_time, color=PUBLISHED, lw=1.0, ls="--")
    panels[2].set_yscale("log")
    panels[2].set_ylim(bottom=0.1)
    panels[2].axhline(closing.shut_below * 1e6, color=ACCENT, lw=1.0, ls=":")
    panels[-1].set_xlabel("Time, s (dotted: the drive changes sign; dashed: shut for good)")
    figure.suptitle("The drive turns round", fontweight="bold", fontsize=11)
    figure.align_ylabels(panels)
    return figure


def supports_compared(first: ClosureResults, second: ClosureResults) -> Figure:
    """Front of contact, displacement, stiffness and centre line with two kinds of supports."""
    figure = new_figure(9.6, 6.8)
    panels = figure.subplots(2, 2).ravel()
    front, moved, stiffness, line = panels
    for result, colour, dash in ((first, COMPUTED, "-"), (second, PUBLISHED, "--")):
        p = np.array([point.pressure for point in result.walk]) / 1e3
        name = _supports(result)
        front.plot(p, [point.contact_front * 1e3 for point in result.walk], dash, color=colour, label=name)
        moved.plot(p, [point.max_displacement * 1e3 for point in result.walk], dash, color=colour, label=name)
        stiffness.plot(p, [point.lowest_eigenvalue / 1e3 for point in result.walk], dash, color=colour, label=name)
        centre = result.mesh.rows[:, 0]
        for state, shade in zip(result.states, np.linspace(0.35, 1.0, len(result.states))):
            at = (result.mesh.nodes[centre] + state.nodal[centre, :3]) * 1e3
            line.plot(at[:, 2], at[:, 1], dash, color=colour, alpha=shade, lw=1.2)
    mesh = first.mesh
    rest = mesh.nodes[mesh.rows[:, 0]] * 1e3
    line.plot(rest[:, 2], rest[:, 1], color=REST, lw=1.0)
    half = 0.5e3 * np.repeat(mesh.thickness.reshape(mesh.shape[1], mesh.shape[0])[:, 0], 2)
    line.plot(np.repeat(mesh.z, 2)[1:-1] * 1e3, half, color=ACCENT, lw=1.0, label="half the wall: inner faces meet")
    line.set_xlim(0.15e3, 0.5e3)
    line.set_ylim(0, 110)
    line.legend(loc="upper left")
    line.set_xlabel("Distance from the lip z, mm")
    line.set_ylabel("Mid-surface on the centre line y, mm")
    for axes, label in (
        (front, "Front of contact on the centre line, mm"),
        (moved, "Largest displacement, mm"),
        (stiffness, "Lowest stiffness eigenvalue, 10³ 1/s²"),
    ):
        axes.set_xlabel("Back pressure, kPa")
        axes.set_ylabel(label)
    front.axvline(21.0, color=REST, lw=0.9, ls=":")
    front.annotate(
        "saddle touches, Th. 3.6",
        (21.0, front.get_ylim()[1]),
        (-4, -4),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=8.5,
        color="0.35",
    )
    front.legend(loc="center left")
    pressures = ", ".join(f"{s.pressure / 1e3:g}" for s in first.states)
    figure.suptitle(
        f"Contact of the inner faces and the supports of Th. 3.6 (centre lines at {pressures} kPa)",
        fontweight="bold",
        fontsize=11,
    )
    return figure


def _supports(result: ClosureResults) -> str:
    return "contact of the inner faces" if result.supports == "contact" else "supports of Th. 3.6"
