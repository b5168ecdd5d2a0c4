"""The winding of the determinant: evidence for the number of unstable modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from ...drawing.style import COMPUTED, STABLE, UNSTABLE, log_axis, new_figure
from ...model.symmetry import symmetry_named
from .plane import conditions

if TYPE_CHECKING:
    from .certificate import Certificate
    from .result import ModesResult


def draw(result: ModesResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name."""
    for name, certificate in result.certificates.items():
        ending = "" if symmetry_named(name).of_equilibria else f"-{name}"
        yield f"winding{ending}", lambda name=name, certificate=certificate: winding(result, name, certificate)


def winding(result: ModesResult, symmetry: str, certificate: Certificate) -> Figure:
    """Winding of the determinant from zero frequency up: it ends at the number of eigenvalues to the right, and rises
    past those that are unstable; of one class of motion.
    """
    figure = new_figure(7.0, 4.4)
    axes = figure.add_subplot()
    number = certificate.unstable_count_independent
    turned = -(certificate.phase[1:] - certificate.phase[0]) / np.pi
    start = 0.5 * round(2 * (number - turned[-1]))  # half the degree of the determinant
    axes.semilogx(certificate.frequency[1:], start + turned, "o-", color=COMPUTED, ms=3.2, lw=1.3, label="winding")
    axes.axhline(number, color="0.4", lw=1.0, ls="--")
    where = "the imaginary axis" if certificate.line == 0 else f"a growth rate of {certificate.line:.3g} 1/s"
    label = f"{number} eigenvalues right of {where}"
    axes.axhline(number, color="0.4", lw=1.0, ls="--", label=label, zorder=1)
    log_axis(axes.xaxis, *certificate.frequency[[1, -1]])
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -0.25), max(high, number + 0.1 * max(1.0, high - low)))
    which = "" if symmetry_named(symmetry).of_equilibria else f" in class {symmetry}"
    levels = _mark_modes(axes, result, symmetry, certificate)
    if np.isfinite(certificate.counted_up_to):
        right = axes.get_xlim()[1]
        axes.axvspan(certificate.counted_up_to, right, color="0.93", lw=0, zorder=0, label="not counted")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=3)
    axes.set_xlabel("Frequency on the imaginary axis, Hz")
    axes.set_ylabel("Winding of the determinant, half turns")
    axes.set_title(f"Independent count{which} {conditions(result)}", loc="left", fontweight="bold", pad=6 + 11 * levels)
    verdict = f"{result.verdict.outcome.capitalize()} {result.law}: {certificate.statement}"
    beginning = f" The curve begins at {start:g}, half the degree of the determinant." if start else ""
    figure.supxlabel(f"{verdict}\nNumbers: modes found by the search.{beginning}", x=0.01, ha="left", fontsize=9)
    return figure


def _mark_modes(axes, result: ModesResult, symmetry: str, certificate: Certificate) -> int:
    """Lines at the frequencies of the modes, their numbers above the frame, staggered where they are close; how many
    rows of numbers that takes.
    """
    step = np.diff(np.log10(axes.get_xlim()))[0] / 35
    last, level, highest = -np.inf, 0, 0
    modes = [m for m in result.modes if m.frequency > 0 and m.symmetry == symmetry]
    for mode in sorted(modes, key=lambda m: m.frequency):
        place = np.log10(mode.frequency)
        level = (level + 1) % 4 if place - last < step else 0
        last, highest = place, max(highest, level)
        colour = UNSTABLE if mode.growth_rate > certificate.line else STABLE
        axes.axvline(mode.frequency, color=colour, lw=1.0, alpha=0.5, zorder=0)
        axes.annotate(
            str(mode.number),
            (mode.frequency, 1.0),
            (0, 2 + 11 * level),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=9,
            color=colour,
        )
    return highest + 1
