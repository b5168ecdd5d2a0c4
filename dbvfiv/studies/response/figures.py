"""Figures of a response: amplitude and phase over frequency, and what rises towards an onset."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import ACCENT, COMPUTED, headline, new_figure, parameter_label, some_of
from ..result import StudyResult
from ..stability.place import describe_fixed

_SHOWN = (("lip_displacement", 1e9, "Lip, um per kPa"), ("flow", 1e6, "Flow, L/s per kPa"))


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a response, each with its name."""
    if result.points:
        yield "response", lambda: response(result)
    if len(result.points) > 1:
        yield "precursors", lambda: precursors(result)


def _under(figure: Figure, result: StudyResult) -> None:
    words = f"{describe_fixed(result.case, result.parameter)} · {result.noise}"
    figure.supxlabel(words, x=0.01, ha="left", fontsize=8.5, color="0.35")


def response(result: StudyResult) -> Figure:
    """Amplitudes per pressure at the inlet and the phase of the lip, over frequency."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    for point in some_of(result.points):
        curve, label = result.curve(point["value"]), PARAMETERS[result.parameter].text(point["value"])
        for panel, (name, scale, _) in zip(axes, _SHOWN):
            panel.semilogy(curve["frequency"], scale * np.abs(curve[name]), lw=1.2, label=label)
        axes[2].plot(curve["frequency"], np.unwrap(np.angle(curve["lip_displacement"])) * 180 / np.pi, lw=1.2)
    for peak in result.peaks(result.points[-1]["value"]):
        axes[0].axvline(peak["frequency"], color="0.6", lw=0.7, ls=":")
    for panel, (_, _, label) in zip(axes, _SHOWN):
        panel.set_ylabel(label)
    axes[2].set(xlabel="Frequency, Hz", ylabel="Phase of the lip, deg", xlim=(0, result.case.response.max_frequency))
    axes[0].legend(fontsize=8)
    headline(figure, f"Response of {result.header.name} to the pressure at the inlet")
    _under(figure, result)
    return figure


def precursors(result: StudyResult) -> Figure:
    """Root mean square of the lip under the noise, its correlation time, and the least damping over the range."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    x = np.array([point["value"] for point in result.points]) / PARAMETERS[result.parameter].scale
    rows = (
        ("lip_displacement_rms", 1e6, "Lip rms, um", COMPUTED),
        ("correlation_time", 1.0, "Correlation time, s", COMPUTED),
        ("damping_ratio", 100.0, "Least damping, %", ACCENT),
    )
    for panel, (name, scale, label, colour) in zip(axes, rows):
        panel.plot(x, [scale * point[name] for point in result.points], "o-", color=colour)
        panel.set_ylabel(label)
    axis = result.case.response.axis
    if axis is not None and axis.log:
        axes[2].set_xscale("log")
    axes[2].set_xlabel(parameter_label(result.case, result.parameter))
    headline(figure, f"Towards the onset, {result.header.name}")
    _under(figure, result)
    return figure
