"""Figures of an uncertainty: probability over a range, spread of the margin, and what decides."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import ACCENT, COMPUTED, REST, headline, limits, log_axis, new_figure, parameter_label
from ..result import RangeResult
from ..stability.place import describe_fixed
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, OUTCOMES, STABLE

#: Samples from which a fifth of them has a median, three each.
LEAST = 15
_LOOKS = {STABLE: COMPUTED, FLUTTERS: ACCENT, DIVERGES: "black"}


def draw(result: RangeResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an uncertainty, each with its name."""
    if not result.points:
        return
    if len(result.points) > 1:
        yield "probability", lambda: probability(result)
    yield "margin", lambda: margin(result)
    if (result.deciding or {}).get("decides") and result.deciding["decides"][0]["share"] is not None:
        yield "what-decides", lambda: what_decides(result)
    if result.deciding and _with_ratio(result.at(result.deciding["value"])).sum() >= LEAST:
        yield "tornado", lambda: tornado(result)


def _with_ratio(found: dict[str, np.ndarray]) -> np.ndarray:
    """True for samples of the inputs as they are that have a damping ratio."""
    return (found["stage"] == 0) & np.isfinite(found["damping_ratio"])


def _axis(axes, result: RangeResult) -> np.ndarray:
    """Label the range, and its values in the units shown."""
    axes.set_xlabel(parameter_label(result.case, result.parameter))
    values = np.array([point["value"] for point in result.points]) / PARAMETERS[result.parameter].scale
    if result.axis is not None and result.axis.log:
        log_axis(axes.xaxis, *limits(values, log=True))
    return values


def _finish(figure: Figure, result: RangeResult, title: str) -> Figure:
    fixed = describe_fixed(result.case, result.parameter, *(one.name for one in result.plan.inputs))
    return headline(figure, title, fixed, f"{result.points[0]['samples']} samples")


def probability(result: RangeResult) -> Figure:
    """Probability of flutter, and of other outcomes than stable, over the range, with their intervals."""
    figure = new_figure()
    axes = figure.add_subplot()
    x = _axis(axes, result)
    looks = _LOOKS | {NOT_VALID: REST}
    for name in (FLUTTERS, *result.others):
        found = [point["outcomes"][name] for point in result.points]
        value = np.array([np.nan if one["probability"] is None else one["probability"] for one in found])
        if name != FLUTTERS and not value.any():
            continue
        low, high = np.array([one["interval"] for one in found]).T
        axes.fill_between(x, 100 * low, 100 * high, color=looks[name], alpha=0.25, lw=0, label=f"{name}, 95 % interval")
        axes.plot(x, 100 * value, "o-", color=looks[name], label=name)
    axes.set(ylabel="Probability, %", ylim=(-2, 102))
    axes.legend()
    return _finish(figure, result, f"Probability of flutter of {result.header.name}")


def margin(result: RangeResult) -> Figure:
    """Least damping ratio: percentiles over the range, or its distribution at the one state."""
    figure = new_figure()
    axes = figure.add_subplot()
    if len(result.points) > 1:
        x = _axis(axes, result)
        low, middle, high = np.array(
            [[np.nan if v is None else 100 * v for v in p["percentiles"]["damping_ratio"]] for p in result.points]
        ).T
        axes.fill_between(x, low, high, color=COMPUTED, alpha=0.25, lw=0, label="95 % of the valves")
        axes.plot(x, middle, "o-", color=COMPUTED, label="median")
        axes.set_ylabel("Least damping ratio, %")
        axes.axhline(0.0, color="black", lw=0.8)
    else:
        found = result.at(result.points[0]["value"])
        plain = _with_ratio(found)
        ratio, outcome = 100 * found["damping_ratio"][plain], found["outcome"][plain]
        edges = np.histogram_bin_edges(ratio, max(1, round(len(ratio) ** 0.5)))
        for name, colour in _LOOKS.items():
            here = ratio[outcome == OUTCOMES.index(name)]
            if here.size:
                axes.hist(here, edges, color=colour, label=f"{name}, {here.size} samples")
        axes.set(xlabel="Least damping ratio, %", ylabel="Samples")
        axes.axvline(0.0, color="black", lw=0.8)
    if axes.get_legend_handles_labels()[0]:
        axes.legend()
    return _finish(figure, result, f"Margin of {result.header.name}")


def what_decides(result: RangeResult) -> Figure:
    """Shares of the inputs in the variance of the margin, and the margin over the first of them."""
    point = result.deciding
    rows = [row for row in point["decides"] if row["share"] is not None][::-1]
    titles = {one.name: one.title for one in result.plan.inputs}
    figure = new_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2)
    left.barh([titles[row["parameter"]] for row in rows], [100 * row["share"] for row in rows], color=COMPUTED)
    left.set(xlabel="Share of the variance of the least damping ratio, %", xlim=(0, 100))
    first = rows[-1]["parameter"]
    number = [one.name for one in result.plan.inputs].index(first)
    found = result.at(point["value"])
    plain = found["stage"] == 0
    row = PARAMETERS.get(first)
    scale, unit = (row.scale, row.shown_unit) if row else (1.0, result.plan.inputs[number].quantity.si)
    for name, colour in _LOOKS.items():
        here = plain & (found["outcome"] == OUTCOMES.index(name))
        if here.any():
            at = found["inputs"][here, number] / scale
            right.plot(at, 100 * found["damping_ratio"][here], ".", color=colour, label=name)
    right.axhline(0.0, color="black", lw=0.8)
    right.set(xlabel=f"{titles[first]}, {unit}".rstrip(", "), ylabel="Least damping ratio, %")
    right.legend()
    shown = PARAMETERS[result.parameter]
    return _finish(figure, result, f"What decides at {shown.amount(point['value'], 4)}")


def tornado(result: RangeResult) -> Figure:
    """Median of the least damping ratio over the samples in the lowest and in the highest fifth of each input, the
    input that moves it most on top.
    """
    point = result.deciding
    found = result.at(point["value"])
    plain = _with_ratio(found)
    ratio, values = 100 * found["damping_ratio"][plain], found["inputs"][plain]
    ends = np.quantile(values, [0.2, 0.8], axis=0)
    low, high = (
        np.array([np.median(ratio[mask]) for mask in masks.T]) for masks in (values <= ends[0], values >= ends[1])
    )
    order, middle = np.argsort(np.abs(high - low)), np.median(ratio)
    figure = new_figure()
    axes = figure.add_subplot()
    titles = [result.plan.inputs[i].title for i in order]
    for side, name, colour in ((low, "input in its lowest fifth", REST), (high, "in its highest fifth", COMPUTED)):
        axes.barh(titles, side[order] - middle, left=middle, color=colour, label=name)
    axes.axvline(middle, color="black", lw=0.8)
    axes.set_xlabel("Median of the least damping ratio, %")
    axes.legend()
    shown = PARAMETERS[result.parameter]
    return _finish(figure, result, f"Each input low and high at {shown.amount(point['value'], 4)}")
