"""The winding of the determinant: evidence for the number of unstable modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from .modes_plane import STABLE, UNSTABLE, conditions
from .style import COMPUTED, new_figure

if TYPE_CHECKING:
    from ..studies.modes.result import ModesResult


def draw(result: ModesResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name."""
    yield "winding", lambda: winding(result)


def winding(result: ModesResult) -> Figure:
    """Winding of the determinant from zero frequency up: it ends at the number of eigenvalues to the right, and rises
    past those that are unstable.
    """
    certificate = result.certificate
    figure = new_figure(7.0, 4.4)
    axes = figure.add_subplot()
    number = certificate.unstable_count_independent
    turned = -(certificate.phase[1:] - certificate.phase[0]) / np.pi
    start = 0.5 * round(2 * (number - turned[-1]))  # half the degree of the determinant
    axes.semilogx(certificate.frequency[1:], start + turned, "o-", color=COMPUTED, ms=3.2, lw=1.3)
    axes.axhline(number, color="0.4", lw=1.0, ls="--")
    where = "the imaginary axis" if certificate.line == 0 else f"a growth rate of {certificate.line:.3g} 1/s"
    axes.annotate(f"{number} eigenvalues right of {where}", (0.01, number), (0, 4), **_TEXT)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -0.25), max(high, number + 0.25 * max(1.0, high - low)))
    _mark_modes(axes, result)
    if np.isfinite(certificate.counted_up_to):
        axes.axvspan(certificate.counted_up_to, axes.get_xlim()[1], color="0.93", lw=0, zorder=0)
        axes.text(
            certificate.counted_up_to,
            0.02,
            " to the right, at this frequency",
            transform=axes.get_xaxis_transform(),
            fontsize=8.5,
            color="0.35",
        )
    axes.set_xlabel("Frequency on the imaginary axis, Hz")
    axes.set_ylabel("Winding of the determinant, half turns")
    axes.set_title(f"Independent count {conditions(result)}", loc="left", fontweight="bold")
    beginning = f" The curve begins at {start:g}, half the degree of the determinant." if start else ""
    figure.supxlabel(
        f"{certificate.verdict}\nNumbers: modes found by the search.{beginning}", x=0.01, ha="left", fontsize=9
    )
    return figure


_TEXT = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "fontsize": 9, "color": "0.3"}


def _mark_modes(axes, result: ModesResult) -> None:
    """Lines at the frequencies of the modes, their numbers above, staggered where they are close."""
    step = np.diff(np.log10(axes.get_xlim()))[0] / 35
    last, level = -np.inf, 0
    for mode in sorted((m for m in result.modes if m.frequency > 0), key=lambda m: m.frequency):
        place = np.log10(mode.frequency)
        level = (level + 1) % 4 if place - last < step else 0
        last = place
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else STABLE
        height = 0.99 - 0.055 * level
        axes.axvline(mode.frequency, color=colour, lw=1.0, alpha=0.5, ymax=height - 0.055)
        axes.text(
            mode.frequency,
            height,
            str(mode.number),
            transform=axes.get_xaxis_transform(),
            ha="center",
            va="top",
            fontsize=9,
            color=colour,
        )
