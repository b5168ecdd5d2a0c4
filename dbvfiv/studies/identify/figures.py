"""Figures of an identification: inputs before and after, and the damping over the range."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import ACCENT, COMPUTED, REST, headline, new_figure, parameter_label
from ..result import StudyResult


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an identification, each with its name."""
    yield "inputs", lambda: inputs(result)
    if result.onset is not None:
        yield "onset", lambda: onset(result)


def inputs(result: StudyResult) -> Figure:
    """Intervals of the inputs over those of the prior, and their correlations."""
    figure = new_figure(10.4, 0.4 * len(result.inputs) + 2.6)
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    scores = result.plan.scores_of(result.scores)
    titles = [f"{number}  {one.title}" for number, one in enumerate(result.plan.inputs, 1)]
    low, middle, high = np.quantile(scores, (0.025, 0.5, 0.975), axis=0)
    rows = np.arange(len(titles))
    left.hlines(rows, -1.96, 1.96, color=REST, lw=7, alpha=0.4, label="before, 95 %")
    left.hlines(rows, low, high, color=COMPUTED, lw=3, label="after, 95 %")
    left.plot(middle, rows, "o", color=ACCENT, label="median")
    left.set_yticks(rows, titles)
    left.set(xlabel="Standard deviations of the prior", ylim=(len(rows) - 0.5, -0.5))
    left.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3)
    shown = right.imshow(np.corrcoef(scores.T).reshape(len(rows), -1), vmin=-1, vmax=1, cmap="RdBu_r")
    right.set_xticks(rows, [str(row + 1) for row in rows])
    right.set_yticks(rows, [str(row + 1) for row in rows])
    right.grid(False)
    figure.colorbar(shown, ax=right, label="Correlation after")
    headline(figure, f"What the records say of {result.header.name}")
    return figure


def onset(result: StudyResult) -> Figure:
    """Least damping ratio over the range with its interval, and where the records were taken."""
    figure = new_figure()
    axes = figure.add_subplot()
    name, damping = result.places.parameter, result.damping
    x = np.array(result.places.values) / PARAMETERS[name].scale
    low, middle, high = 100 * np.quantile(damping, (0.025, 0.5, 0.975), axis=0)
    axes.fill_between(x, low, high, color=COMPUTED, alpha=0.25, lw=0, label="95 %")
    axes.plot(x, middle, "o-", color=COMPUTED, label="median")
    axes.axhline(0.0, color="black", lw=0.8)
    for side in ("below", "above"):
        ends = [value for value in result.onset[side]["interval"] if value is not None]
        if len(ends) == 2:  # found by itself: between the values of the range damping is not straight
            axes.axvspan(*(np.array(ends) / PARAMETERS[name].scale), color=REST, alpha=0.5, label=f"onset {side}, 95 %")
    for number, match in enumerate(result.matches):
        value = result.places.value_at(match["record"]) / PARAMETERS[name].scale
        if match["damping_ratio"] is not None:
            label = "measured" if number == 0 else None
            axes.plot(value, 100 * match["damping_ratio"], "s", color=ACCENT, label=label)
    axes.set(xlabel=parameter_label(result.case, name), ylabel="Least damping ratio, %")
    axes.legend()
    headline(figure, f"Damping of {result.header.name} by its records")
    return figure
