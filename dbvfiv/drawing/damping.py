"""Loss factors of the materials of a case: what was given, what the series make of it, and the band it holds for."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..materials.damping import MaterialDamping
from ..materials.damping_report import DampingReport
from .axes import headline, log_axis
from .style import DANGER, REST, branch_looks, new_figure

#: How far the curves go beyond the band, in decades.
_BEYOND = 0.7


def damping_figure(report: DampingReport) -> Figure:
    """tan delta and storage modulus of each material over frequency, and Rayleigh damping where it is set."""
    low, high = report.case.damping.band
    frequency = np.logspace(np.log10(low) - _BEYOND, np.log10(high) + _BEYOND, 300)
    figure = new_figure(7.6, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for material, look in zip(report.materials, branch_looks(len(report.materials))):
        series = report.series(material)
        upper.plot(frequency, series.loss_factor(frequency), color=look["color"], label=_label(material))
        if material.data is not None:
            at, tan_delta = material.data
            marks = {"ls": "--", "lw": 0.9, "marker": ""} if len(at) == 2 else {"ls": "", "marker": look["marker"]}
            upper.plot(at, report.factor * tan_delta, color=look["color"], mfc="white", ms=4.5, **marks)
        lower.plot(frequency, series.modulus(2j * np.pi * frequency).real, color=look["color"])
    damping = report.case.damping
    if not damping.relaxes:
        words = f"Rayleigh, α = {damping.alpha:g} 1/s, β = {damping.beta:g} s"
        upper.plot(frequency, 2.0 * report.rayleigh(frequency), color="black", ls=":", label=words)
    for axes in (upper, lower):
        for start, end in ((frequency[0], low), (high, frequency[-1])):
            axes.axvspan(start, end, color=DANGER if damping.relaxes else "none", lw=0)
        for edge in (low, high):
            axes.axvline(edge, color=REST, lw=0.9, ls="--")
    given = [float(np.max(m.data[1])) * report.factor for m in report.materials if m.data is not None]
    top = 1.6 * max([*given, *(float(np.max(report.series(m).loss_factor(frequency))) for m in report.materials), 0.05])
    if not damping.relaxes:
        top = max(top, 4.0 * float(report.rayleigh(frequency).min()))
    upper.set(ylabel="Loss factor tan δ = 2 × damping ratio", ylim=(0.0, top), xlim=(frequency[0], frequency[-1]))
    upper.legend(loc="upper left", ncols=2)
    lower.set(xlabel="Frequency, Hz", ylabel="Storage over\nslow modulus")
    log_axis(lower.xaxis, frequency[0], frequency[-1])
    factor = "" if report.factor == 1.0 else f", times {report.factor:g}"
    headline(figure, f"Loss factors{factor}: given (dashed, marks) and fitted over {low:g} to {high:g} Hz")
    return figure


def _label(material: MaterialDamping) -> str:
    if material.fit is None:
        return f"{material.name}: series given"
    return f"{material.name}: fit within {100 * material.fit.largest_error:.2g} %"
