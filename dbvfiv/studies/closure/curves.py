"""Curves over the back pressure: passage left, sealed length, contact force, stiffness."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import (
    ACCENT,
    COMPUTED,
    HALO,
    PUBLISHED,
    REST,
    headline,
    kilopascals,
    limits,
    log_axis,
    new_figure,
    pressure_colours,
    some_of,
)
from ...drawing.views import faces
from ..measured.figures import draw_curve
from .figures import supports_of

if TYPE_CHECKING:
    from .result import ClosureResult


#: Passage, mm2, below which a valve is shut for any purpose.
_SHUT = 0.01


def draw(result: ClosureResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a closure result, each with its name."""
    if result.walk:
        yield "closure-curve", lambda: closure_curve(result)
    yield "passage", lambda: passage(result)
    if result.measured.passage is not None:
        yield "measured-passage", lambda: measured_passage(result)
    if result.opened:
        yield "reversal", lambda: reversal(result)
    if result.closing is not None:
        yield "reversal-in-time", lambda: in_time(result)


def closure_curve(result: ClosureResult) -> Figure:
    """Sealed length, contact force, deepest displacement and lowest stiffness over the back pressure; dots are the
    states that were asked for.
    """
    figure = new_figure(9.4, 6.8)
    panels = figure.subplots(2, 2, sharex=True).ravel()
    length, force, moved, stiffness = panels
    _over_pressure(result, length, "contact_front", 1e3, label="front of contact on the centre line")
    _over_pressure(result, length, "sealed_length", 1e3, color=ACCENT, label="sealed length")
    _over_pressure(result, length, "lip_seal", 1e3, color=ACCENT, ls="--", label="of it from the lip on")
    length.axhline(result.case.valve.duckbill_length * 1e3, color=REST, lw=0.9, ls=":", label="duckbill")
    length.set_ylim(bottom=0)
    length.set_ylabel("Length along the axis, mm")
    length.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=8, borderaxespad=0.2)
    _over_pressure(result, force, "contact_force", 1.0)
    force.set_ylabel("Force between the walls, N")
    _over_pressure(result, moved, "max_displacement", 1e3)
    moved.set_ylabel("Largest displacement, mm")
    _over_pressure(result, stiffness, "lowest_eigenvalue", 1e-3)
    stiffness.axhline(0.0, color=REST, lw=0.9)
    stiffness.set_ylabel("Lowest stiffness eigenvalue, 10³ 1/s²")
    for b in result.buckling[:1]:
        for axes in panels:
            axes.axvline(b.pressure / 1e3, color=PUBLISHED, lw=1.0, ls="--")
        look = {"textcoords": "offset points", "color": PUBLISHED, "fontsize": 9, "path_effects": HALO}
        stiffness.annotate(f"{b.kind}, {kilopascals(b.pressure)}", (b.pressure / 1e3, 0), (6, 8), **look)
    for axes in panels:
        axes.set_xlabel("Back pressure, kPa")
        axes.tick_params(labelbottom=True)
        axes.set_xlim(*limits([0.0, *(point.pressure / 1e3 for point in result.walk)]))
    headline(figure, f"Closure, {supports_of(result)} (dots: states asked for)")
    return figure


def _over_pressure(result: ClosureResult, axes, name: str, factor: float, **look) -> None:
    """A column of the path over the back pressure, with dots at the states."""
    look = {"color": COMPUTED} | look
    p = np.array([point.pressure for point in result.walk])
    values = factor * np.array([getattr(point, name) for point in result.walk], float)
    axes.plot(p / 1e3, values, marker="." if len(p) == 1 else None, **look)
    asked = np.array([state.pressure for state in result.states])
    asked = asked[(asked >= p.min()) & (asked <= p.max())]
    order = np.argsort(p)
    axes.plot(asked / 1e3, np.interp(asked, p[order], values[order]), "o", color=look["color"], ms=4.5)


def passage(result: ClosureResult) -> Figure:
    """Passage left between the inner faces along the axis."""
    figure = new_figure(7.2, 4.4)
    axes = figure.add_subplot()
    states = some_of(sorted(result.states, key=lambda s: s.pressure))
    z = result.mesh.z * 1e3
    for state, colour in zip(states, pressure_colours([s.pressure for s in states])):
        axes.semilogy(
            z,
            np.maximum(4e6 * state.opening, _SHUT),
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
    axes.set_title(
        f"What stays open, whole valve, {supports_of(result)} ({_SHUT:g} mm² or less drawn there)",
        loc="left",
        fontweight="bold",
    )
    log_axis(axes.yaxis, _SHUT, 4e6 * max(float(state.opening.max()) for state in states))
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4)
    return figure


def measured_passage(result: ClosureResult) -> Figure:
    """Narrowest passage left over the back pressure, with what was measured."""
    figure = new_figure(6.4, 4.2)
    axes = figure.add_subplot()
    draw_curve(axes, [(p.pressure, p.least_opening) for p in result.walk], result.measured.passage, 1e6, "computed")
    axes.set_xlabel("Back pressure, kPa")
    axes.set_ylabel("Narrowest passage between the inner faces, mm²")
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_title(f"Passage left, {supports_of(result)}", loc="left", fontweight="bold")
    axes.legend()
    return figure


def reversal(result: ClosureResult) -> Figure:
    """From flow to back pressure as the drive turns round slowly: the flow area of the open valve, and the narrowest
    passage between the faces of the shut one, which are two measures and stand on two axes.
    """
    figure = new_figure(9.0, 4.6)
    left, right = figure.subplots(1, 2)
    opened = sorted(result.opened, key=lambda s: -s.pressure)
    left.plot([s.pressure / 1e3 for s in opened], [s.outlet_area * 1e4 for s in opened], "o-", color=COMPUTED, ms=4)
    left.set_ylabel("Flow area at the lip, whole valve, cm²")
    left.set_xlabel("Static inlet pressure, kPa")
    left.set_ylim(bottom=0)
    left.set_xlim(max([s.pressure / 1e3 for s in opened], default=1.0) * 1.03, 0)
    left.set_title("Fluid flowing", loc="left")
    p = np.array([0.0] + [point.pressure for point in result.walk]) / 1e3
    area = np.array([result.reference_opening] + [point.least_opening for point in result.walk]) * 1e6
    shut = area <= _SHUT
    right.semilogy(p, np.where(shut, np.nan, area), "o-", color=ACCENT, ms=4)
    right.plot(p[shut], np.full(shut.sum(), _SHUT), "v", color=ACCENT, ms=4.5, label=f"{_SHUT:g} mm² or less: shut")
    log_axis(right.yaxis, _SHUT, max(area.max(), 10 * _SHUT))
    right.set_ylabel("Narrowest passage between the inner faces, mm²")
    right.set_xlabel("Back pressure, kPa")
    right.set_xlim(left=0)
    right.set_title("Pressed from outside, no flow", loc="left")
    if shut.any():
        right.legend(loc="upper right")
    headline(figure, f"From open to shut, quasi-static, {supports_of(result)}")
    return figure


def in_time(result: ClosureResult) -> Figure:
    """Drive, lip, narrowest passage, flow and contact force while the drive turns round."""
    closing = result.closing
    figure = new_figure(8.4, 8.0)
    panels = figure.subplots(5, 1, sharex=True)

    def values(name, factor):
        return factor * np.array([getattr(sample, name) for sample in closing.samples])

    t = values("time", 1.0)
    curves = (
        ("inlet_pressure", 1e-3, "Static inlet\npressure, kPa"),
        ("lip_opening", 1e3, "Clear lip\nopening, mm"),
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
    passage_left = values("least_opening", 1e6)
    log_axis(panels[2].yaxis, 0.1, max(float(passage_left.max()), 1.0))
    panels[2].set_ylim(bottom=0.1)
    panels[2].axhline(closing.shut_below * 1e6, color=ACCENT, lw=1.0, ls=":")
    panels[-1].set_xlabel("Time, s (dotted: the drive changes sign; dashed: shut for good)")
    headline(figure, "The drive turns round")
    figure.align_ylabels(panels)
    return figure


def supports_compared(first: ClosureResult, second: ClosureResult) -> Figure:
    """Front of contact, displacement, stiffness and inner face at x = 0 with two kinds of supports."""
    figure = new_figure(9.6, 7.0)
    panels = figure.subplots(2, 2).ravel()
    front, moved, stiffness, line = panels
    for result, colour, dash in ((first, COMPUTED, "-"), (second, PUBLISHED, "--")):
        p = np.array([point.pressure for point in result.walk]) / 1e3
        name = supports_of(result)
        front.plot(p, [point.contact_front * 1e3 for point in result.walk], dash, color=colour, label=name)
        moved.plot(p, [point.max_displacement * 1e3 for point in result.walk], dash, color=colour)
        stiffness.plot(p, [point.lowest_eigenvalue / 1e3 for point in result.walk], dash, color=colour)
        centre = result.mesh.centre_line
        for state, shade in zip(result.states, np.linspace(0.35, 1.0, len(result.states))):
            at = faces(result.mesh, state.nodal)[0][centre] * 1e3
            line.plot(at[:, 2], at[:, 1], dash, color=colour, alpha=shade, lw=1.2)
    rest = faces(first.mesh)[0][first.mesh.centre_line] * 1e3
    line.plot(rest[:, 2], rest[:, 1], color=REST, lw=1.0, label="at rest")
    line.axhline(0.0, color=ACCENT, lw=1.0, label="inner faces meet")
    line.set_xlim(0.25 * rest[-1, 2], 0.9 * rest[-1, 2])
    line.set_ylim(-5, 0.75 * rest[:, 1].max())
    line.set_xlabel("Distance from the lip z, mm")
    line.set_ylabel("Inner face at x = 0, y, mm")
    for axes, label in (
        (front, "Contact front at x = 0, mm"),
        (moved, "Largest displacement, mm"),
        (stiffness, "Lowest stiffness eigenvalue, 10³ 1/s²"),
    ):
        axes.set_xlabel("Back pressure, kPa")
        axes.set_ylabel(label)
    front.axvline(21.0, color=REST, lw=0.9, ls=":", label="saddle touches, Th. 3.6")
    figure.legend(loc="outside lower center", ncols=3)
    pressures = ", ".join(f"{s.pressure / 1e3:g}" for s in first.states)
    headline(figure, f"Contact of the inner faces and the supports of Th. 3.6 (inner faces at {pressures} kPa)")
    return figure
