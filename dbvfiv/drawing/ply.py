"""Strips of a ply: measured stress and the fitted one."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..materials.ply_fit import PlyFit
from .axes import headline
from .style import COMPUTED, new_figure

_NAMES = {"warp": "Along the fibre (warp)", "weft": "Across it (weft)", "bias": "At 45°"}


def ply_figure(fit: PlyFit) -> Figure:
    """One panel a strip."""
    figure = new_figure(3.6 * len(fit.tests) + 0.6, 3.6)
    for axes, strip in zip(figure.subplots(1, len(fit.tests), squeeze=False)[0], fit.tests):
        strain = np.linspace(min(0.0, strip.test.strain.min()), strip.test.strain.max(), 100)
        fitted = strip.modulus * strip.unit_stress(strain) / 1e6
        axes.plot(100 * strain, fitted, color=COMPUTED, label=f"E = {strip.modulus / 1e6:.4g} MPa")
        axes.plot(100 * strip.test.strain, strip.test.stress / 1e6, color="black", ls="", marker="o", mfc="white")
        axes.set(xlabel="Engineering strain, %", title=_NAMES[strip.direction])
        axes.legend(loc="upper left")
    figure.axes[0].set_ylabel("Nominal stress, MPa")
    headline(figure, "Strips of a ply: measured (circles) and fitted")
    return figure
