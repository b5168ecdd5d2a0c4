"""Figures of materials: loss factors over frequency, tests of a rubber and of a ply beside their fits."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..fit.cards import DampingReport, MaterialDamping
from ..fit.ply import PlyFit
from ..fit.report import FitReport
from .style import COMPUTED, DANGER, REST, branch_looks, headline, log_axis, new_figure

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
        lower.plot(frequency, report.stiffening(material, frequency), color=look["color"])
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
    return headline(figure, f"Loss factors{factor}: given (dashed, marks) and fitted over {low:g} to {high:g} Hz")


def _label(material: MaterialDamping) -> str:
    if material.fit is None:
        return f"{material.name}: series given"
    return f"{material.name}: fit within {100 * material.fit.largest_error:.2g} %"


_TESTS = {"uniaxial": "tension", "planar": "planar tension", "biaxial": "equibiaxial tension"}


def fit_figure(report: FitReport) -> Figure:
    """One column a kind of test: stress over strain of every fit above, residuals of the one told in full below."""
    count = len(report.tests)
    figure = new_figure(3.4 * count + 1.2, 5.4)
    upper, lower = figure.subplots(2, count, sharex="col", squeeze=False, height_ratios=(2.4, 1))
    looks = branch_looks(len(report.fits))
    for i, test in enumerate(report.tests):
        axes, below = upper[i], lower[i]
        _stresses(axes, report, i, looks)
        axes.set_title(_TESTS[test.mode][0].upper() + _TESTS[test.mode][1:])
        left = report.chosen.by_test[i] / 1e6
        below.axhline(0.0, color=REST, lw=0.9)
        below.plot(100 * test.strain, left, color="black", ls="", marker="o", ms=3.5)
        below.set_xlabel("Engineering strain, %")
    upper[0].set_ylabel("Nominal stress, MPa")
    lower[0].set_ylabel("Measured less\nfitted, MPa")
    upper[0].legend(loc="upper left")
    return headline(figure, f"Tests of a rubber and their fits; residuals of {report.chosen.form.title}")


def _stresses(axes, report: FitReport, number: int, looks: list) -> None:
    """Measured points and the curve of each form."""
    test = report.tests[number]
    axes.plot(100 * test.strain, test.stress / 1e6, color="black", ls="", marker="o", mfc="white", label="measured")
    strain = np.linspace(min(0.0, test.strain.min()), test.strain.max(), 200)
    for fit, look in zip(report.fits, looks):
        chosen = fit.form == report.chosen.form
        drawn = fit.stress(test.mode, strain) / 1e6
        axes.plot(100 * strain, drawn, color=look["color"], lw=2.6 if chosen else 1.2, label=fit.form.title)
    low, high = min(0.0, test.stress.min() / 1e6), test.stress.max() / 1e6
    axes.set_ylim(low - 0.08 * (high - low), high + 0.15 * (high - low))


_STRIPS = {"warp": "Along the fibre (warp)", "weft": "Across it (weft)", "bias": "At 45°"}


def ply_figure(fit: PlyFit) -> Figure:
    """One panel a strip."""
    figure = new_figure(3.6 * len(fit.tests) + 0.6, 3.6)
    for axes, strip in zip(figure.subplots(1, len(fit.tests), squeeze=False)[0], fit.tests):
        strain = np.linspace(min(0.0, strip.test.strain.min()), strip.test.strain.max(), 100)
        fitted = strip.modulus * strip.unit_stress(strain) / 1e6
        axes.plot(100 * strain, fitted, color=COMPUTED, label=f"E = {strip.modulus / 1e6:.4g} MPa")
        axes.plot(100 * strip.test.strain, strip.test.stress / 1e6, color="black", ls="", marker="o", mfc="white")
        axes.set(xlabel="Engineering strain, %", title=_STRIPS[strip.direction])
        axes.legend(loc="upper left")
    figure.axes[0].set_ylabel("Nominal stress, MPa")
    return headline(figure, "Strips of a ply: measured (circles) and fitted")
