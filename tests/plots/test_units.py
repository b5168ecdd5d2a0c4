"""Figures in units of choice: labels, ticks and words of axes that were drawn in those of tables."""

import numpy as np
import pytest

from dbvfiv.case.units import Units
from dbvfiv.drawing.style import new_figure, put_in_units


def test_axes_speak_the_units_of_choice():
    figure = new_figure()
    axes = figure.add_subplot()
    axes.plot([0.0, 20.0], [0.0, 100.0], label="at 10 kPa")
    axes.set(xlabel="Back pressure, kPa", ylabel="Length, mm", title="No unit", xlim=(0.0, 20.0))
    axes.legend()
    put_in_units(figure, Units("ft, in", 1000.0))
    figure.canvas.draw()
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_title()) == ("Back pressure, ft", "Length, in", "No unit")
    assert axes.get_legend().get_texts()[0].get_text() == "at 3.35 ft"
    ticks = axes.xaxis.get_majorticklocs()
    named = [float(axes.xaxis.get_major_formatter()(tick, 0)) for tick in ticks]
    assert named == pytest.approx(np.array(ticks) * 1e3 / (1000.0 * 9.80665 * 0.3048), abs=1e-9)  # 1 ft of water
    assert all(name == round(name) for name in named)


def test_units_of_tables_leave_a_figure_as_it_is():
    figure = new_figure()
    axes = figure.add_subplot()
    axes.set(xlabel="Length of the pipe, m", ylabel="Opening, mm")
    before = axes.yaxis.get_major_locator()
    put_in_units(figure, Units("ft", 1000.0))
    assert axes.get_xlabel() == "Length of the pipe, m" and axes.yaxis.get_major_locator() is before
