"""Eigenvalues in the complex plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import DANGER, STABLE, UNSTABLE, driven, new_figure
from ...model.symmetry import symmetry_named

if TYPE_CHECKING:
    from .result import ModesResult

_RATIOS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7)


def draw(result: ModesResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name."""
    if result.modes:
        yield "eigenvalues", lambda: eigenvalues(result)


def eigenvalues(result: ModesResult) -> Figure:
    """Growth rate and frequency of each mode, numbered as in the table; rays of constant damping ratio; where
    eigenvalues accumulate.
    """
    figure = new_figure(7.0, 4.8)
    axes = figure.add_subplot()
    growth = np.array([mode.growth_rate for mode in result.modes])
    frequency = np.array([mode.frequency for mode in result.modes])
    width = max(np.ptp(np.append(growth, 0.0)), 1.0)
    left, right = min(growth.min(), 0.0) - 0.1 * width, max(growth.max(), 0.0) + 0.12 * width
    top = max(frequency.max() * 1.15, width / (2 * np.pi) * 0.5)
    beta = result.case.damping.beta
    if beta > 0 and left > -1.25 / beta > left - 0.6 * width:
        left = -1.25 / beta
    axes.set_xlim(left, right)
    axes.set_ylim(-0.03 * top, top)
    axes.axvspan(0.0, right, color=DANGER, lw=0)
    axes.axvline(0.0, color="0.25", lw=1.1)
    axes.text(0.99, 0.02, "unstable", transform=axes.transAxes, ha="right", va="bottom", color=UNSTABLE, fontsize=9)
    _rays(axes, left, top)
    if beta > 0 and -1.0 / beta > left:
        axes.axvline(-1.0 / beta, color="0.45", lw=1.1, ls="--")
        axes.text(
            -1.0 / beta,
            top,
            r" $-1/\beta$: eigenvalues accumulate",
            rotation=90,
            ha="right",
            va="top",
            color="0.35",
            fontsize=8.5,
        )
    for mode in result.modes:
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else STABLE
        axes.plot(mode.growth_rate, mode.frequency, "o", color=colour, ms=7, clip_on=False, zorder=3)
        axes.annotate(
            str(mode.number) + class_of(mode),
            (mode.growth_rate, mode.frequency),
            (6, 5),
            textcoords="offset points",
            fontsize=9.5,
            color=colour,
        )
    axes.set_xlabel("Growth rate, 1/s")
    axes.set_ylabel("Frequency, Hz")
    axes.set_title(f"Leading modes {conditions(result)}", loc="left", fontweight="bold", pad=15)
    figure.supxlabel(result.verdict, x=0.01, ha="left", fontsize=9)
    return figure


def conditions(result: ModesResult) -> str:
    """Pressure and fluid as they stand in titles."""
    where = (
        "at rest"
        if result.state.pressure == result.case.rest_pressure
        else f"at {driven(result.case, result.state.pressure)}"
    )
    case = result.case
    fluid = f"{case.fluid.density:g} kg/m³"
    if in_vacuo(result):
        fluid = "no flow" if case.outside.is_there else "in vacuo"
    return f"{where}, {fluid} {case.outside.words}".rstrip()


def in_vacuo(result: ModesResult) -> bool:
    """True where the modes are those in vacuo, without the fluid."""
    return result.case.modes.in_vacuo or result.case.drive.kind != "flow"


def mode_title(mode) -> str:
    """Number, growth rate and frequency of a mode."""
    growth = f"{mode.growth_rate:+.4g} 1/s".replace("-", "\N{MINUS SIGN}")
    name = f"Mode {mode.number}{class_of(mode)}"
    if mode.frequency == 0:
        return f"{name}: {growth}, no oscillation"
    return f"{name}: {mode.frequency:.4g} Hz, {growth}"


def class_of(mode) -> str:
    """Class of motion as it stands behind the number of a mode; nothing for that of the equilibria."""
    return "" if symmetry_named(mode.symmetry).of_equilibria else f" {mode.symmetry}"


def _rays(axes, left: float, top: float) -> None:
    """Lines on which the damping ratio is the same."""
    last = 0.0
    for ratio in _RATIOS:
        slope = np.sqrt(1 / ratio**2 - 1) / (2 * np.pi)  # frequency over -growth rate
        end = min(-left, top / slope)
        if end - last < 0.055 * -left and end < -left:
            continue  # too close to the ray before for two labels
        last = end
        axes.plot([0, -end], [0, end * slope], color="0.8", lw=0.8, zorder=1)
        outside = end * slope >= 0.999 * top
        place = (-end, top) if outside else (left, end * slope)
        offset, align = ((0, 2), ("center", "bottom")) if outside else ((3, 1), ("left", "bottom"))
        axes.annotate(
            f"{100 * ratio:g} %",
            place,
            offset,
            textcoords="offset points",
            fontsize=7.5,
            color="0.55",
            ha=align[0],
            va=align[1],
        )
