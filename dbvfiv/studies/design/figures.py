"""Figures of designs: what they do over the head beside the case itself, and the front."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ...case.statement import QUANTITIES
from ...drawing.style import headline, new_figure
from ..result import StudyResult

#: Columns of verdicts that are drawn, their labels and factors.
_DRAWN = {
    "margin": ("Least damping ratio, %", 100.0),
    "loss_coefficient": ("Loss coefficient", 1.0),
    "opening": ("Opening, cm²", 1e4),
}


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures that the result has numbers for."""
    if result.best and len(result.verified(-1)["pressure"]):
        yield "heads", lambda: draw_heads(result)
    if len(result.best) > 1:
        yield "front", lambda: draw_front(result)


def draw_heads(result: StudyResult) -> Figure:
    """Margin, loss and opening over the inlet pressure, of the case and its designs."""
    figure = new_figure(9.6, 3.6)
    axes = figure.subplots(1, len(_DRAWN))
    several = len(result.best) > 1
    for number in (-1, *result.best):
        rows = result.verified(number)
        label = "the case" if number < 0 else f"design {number + 1}" if several else "the design"
        for place, (name, (_, factor)) in zip(axes, _DRAWN.items()):
            style = {"color": "0.45", "ls": "--"} if number < 0 else {}
            place.plot(rows["pressure"] / 1e3, factor * rows[name], marker="o", ms=3, label=label, **style)
    for place, (label, _) in zip(axes, _DRAWN.values()):
        place.set_xlabel("Static inlet pressure, kPa")
        place.set_ylabel(label)
        place.set_xscale("log")
    axes[0].axhline(0.0, color="0.25", lw=1.0)
    axes[0].legend(frameon=False, fontsize=8)
    headline(figure, f"{result.header.name}: {result.statements[0].text}")
    return figure


def draw_front(result: StudyResult) -> Figure:
    """Aim over the bound of the constraint that has several, designs that miss a constraint hollow."""
    aim, front = result.statements[0], max(result.statements[1:], key=lambda one: len(one.bounds))
    figure = new_figure(5.6, 4.2)
    axes = figure.add_subplot()
    scale = {"%": 100.0, "L/s": 1e3, "cm^2": 1e4}
    x_unit, y_unit = (QUANTITIES[one.quantity].shown for one in (front, aim))
    found = [(result.bounds[number], design.aim, design.holds) for number, design in result.best.items()]
    x, y, holds = (np.array(column) for column in zip(*found))
    x, y = x * scale.get(x_unit, 1.0), y * scale.get(y_unit, 1.0)
    axes.plot(x, y, color="0.6", lw=1.0)
    axes.plot(x[holds], y[holds], "o", color="#1f5f8b")
    axes.plot(x[~holds], y[~holds], "o", mfc="none", color="#1f5f8b", label="misses a constraint")
    axes.set_xlabel(f"{front.quantity.capitalize()}, bound, {x_unit}".rstrip(", "))
    axes.set_ylabel(f"{aim.quantity.capitalize()}, {y_unit}".rstrip(", "))
    if not holds.all():
        axes.legend(frameon=False)
    headline(figure, f"{result.header.name}: {aim.text}")
    return figure
