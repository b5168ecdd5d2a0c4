"""Tests of a rubber, the curves fitted to them, and what is left."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..materials.fit_report import FitReport
from .axes import headline
from .style import REST, branch_looks, new_figure

_NAMES = {"uniaxial": "tension", "planar": "planar tension", "biaxial": "equibiaxial tension"}


def fit_figure(report: FitReport) -> Figure:
    """One column a kind of test: stress over strain of every fit above, residuals of the one told in full below."""
    count = len(report.tests)
    figure = new_figure(3.4 * count + 1.2, 5.4)
    upper, lower = figure.subplots(2, count, sharex="col", squeeze=False, height_ratios=(2.4, 1))
    looks = branch_looks(len(report.fits))
    for i, test in enumerate(report.tests):
        axes, below = upper[i], lower[i]
        _stresses(axes, report, i, looks)
        axes.set_title(_NAMES[test.mode][0].upper() + _NAMES[test.mode][1:])
        left = report.chosen.by_test[i] / 1e6
        below.axhline(0.0, color=REST, lw=0.9)
        below.plot(100 * test.strain, left, color="black", ls="", marker="o", ms=3.5)
        below.set_xlabel("Engineering strain, %")
    upper[0].set_ylabel("Nominal stress, MPa")
    lower[0].set_ylabel("Measured less\nfitted, MPa")
    upper[0].legend(loc="upper left")
    headline(figure, f"Tests of a rubber and their fits; residuals of {report.chosen.form.title}")
    return figure


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
