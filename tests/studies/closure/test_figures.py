"""Figures of the valve under back pressure: what they say is what the result holds."""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.studies.case import thesis_case


@pytest.fixture(scope="module")
def closure():
    changes = {"mesh.around": 6, "mesh.along": 10, "closure.max_step": "5 kPa", "closure.start": "open"}
    return dbvfiv.load(thesis_case(), changes | {"closure.eigenvalues": 2}).closure(["2 kPa", 9e3])


def test_the_contact_map_reaches_to_its_maximum_and_says_it(closure):
    figure = closure.figures(only=["contact-map"])["contact-map"]
    mesh = figure.axes[0].collections[0]
    largest = [s.contact_pressure.max() / s.pressure for s in closure.states if s.contact_nodes]
    assert mesh.norm.vmax == pytest.approx(max(largest))
    for ratio, axes in zip(largest, figure.axes):
        assert f"largest {ratio:.3g} times" in axes.get_title("left")


def test_the_closure_curve_has_no_lines_but_its_own(closure):
    figure = closure.figures(only=["closure-curve"])["closure-curve"]
    buckled = len(closure.buckling[:1])
    for axes in figure.axes:
        upright = [line for line in axes.lines if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2]
        assert len(upright) == buckled
        dots = [line for line in axes.lines if line.get_marker() == "o"]
        assert dots and np.allclose(dots[0].get_xdata(), [s.pressure / 1e3 for s in closure.states])


def test_two_measures_of_opening_stand_on_two_axes(closure):
    left, right = closure.figures(only=["reversal"])["reversal"].axes
    assert "Flow area" in left.get_ylabel() and "passage between the inner faces" in right.get_ylabel()
    assert np.nanmin(right.lines[0].get_ydata()) > 0


def test_side_views_show_the_faces(closure):
    figure = closure.figures(only=["side-views"])["side-views"]
    axes = figure.axes[0]
    wall = next(c for c in axes.collections if c.get_label() == "wall")
    upper, lower = (path.vertices for path in wall.get_paths())
    at_lip = upper[np.isclose(upper[:, 0], upper[:, 0].min(), atol=2.0), 1]
    assert at_lip.min() < 1.0 and at_lip.max() == pytest.approx(12, abs=1.0)  # no slot of 12 mm between the lips
    assert np.allclose(lower[:, 1], -upper[:, 1])
