"""Back-pressure results: what a file holds is what was computed; ParaView and figures take it."""

from __future__ import annotations

import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

import dbvfiv
from dbvfiv.api import load
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.closure.figures import closure_curve
from dbvfiv.studies.closure.study import SUMMARY
from dbvfiv.studies.session import Session, load_result
from tests.small_valves import SMALL

COARSE = SMALL | {"closure.max_step": "5 kPa", "closure.eigenvalues": 2}


@pytest.fixture(scope="module")
def figures(run):
    return run[0].figures()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A result in memory and the file it was written to."""
    path = tmp_path_factory.mktemp("closure") / "run.h5"
    return load(thesis_case(), COARSE).closure(["2 kPa", 9e3], output=path), path


def test_a_file_reads_back_as_the_result(run):
    result, path = run
    again = load_result(path)
    assert again.kind == "closure" and again.complete and again.supports == "contact"
    assert json.loads(json.dumps(again.summary())) == json.loads(json.dumps(result.summary()))
    assert again.lines() == result.lines()
    for a, b in zip(again.states, result.states):
        assert np.array_equal(a.nodal, b.nodal) and np.array_equal(a.contact_pressure, b.contact_pressure)
        assert np.array_equal(a.layers.von_mises, b.layers.von_mises)
    assert again.case.closure.pressures == (2e3, 9e3)


def test_a_copy_saves_the_same(run, tmp_path):
    result, path = run
    copy = load_result(path).save(tmp_path / "copy.h5")
    assert load_result(copy).summary() == result.summary()


def test_a_file_of_an_earlier_version_with_keys_that_are_gone_is_read(run, tmp_path):
    copy = tmp_path / "earlier.h5"
    copy.write_bytes(run[1].read_bytes())
    with h5py.File(copy, "a") as file:
        case = json.loads(file["case/json"].asstr()[()])
        case["closure"] |= {"contact_depth": 3e-6, "start": "rest", "reversal_time": 0.2}
        del file["case/json"]
        file["case/json"] = json.dumps(case)
    assert load_result(copy).summary() == run[0].summary()


def test_paraview_gets_contact_pressure_and_gap_on_all_four_quarters(run, tmp_path):
    result, _ = run
    written = result.export(tmp_path / "run.vtkhdf")
    with h5py.File(written) as file:
        root = file["VTKHDF"]
        assert list(root["Steps/Values"]) == [2e3, 9e3]
        points = len(root["Points"])
        fields = root["PointData"]
        assert {"displacement", "contact_pressure", "gap"} <= set(fields)
        assert len(fields["contact_pressure"]) == 2 * points
        assert fields["contact_pressure"][:].max() == pytest.approx(
            max(s.largest_contact_pressure for s in result.states)
        )


def test_figures(figures):
    assert set(figures) == {"side-views", "contact-map", "closure-curve", "passage", "layer-stress"}


@pytest.mark.parametrize(
    "given", ["2 kPa", 2000, 2e3, np.float64(2e3), np.array(2e3), np.array([2e3]), ["2 kPa"], (2e3,)]
)
def test_python_interface_takes_one_pressure_or_several(given, monkeypatch):
    asked = []
    monkeypatch.setattr(Session, "perform", lambda session, *_, **__: asked.append(session.case.closure.pressures))
    load(thesis_case(), COARSE).closure(given)
    assert asked == [(2e3,)]


def test_python_interface_refuses_what_is_no_pressure():
    with pytest.raises(dbvfiv.errors.CaseError, match="pressure"):
        load(thesis_case(), COARSE).closure(["7 mm"])


# -- figures


def test_the_contact_map_reaches_to_its_maximum_and_says_it(run, figures):
    figure = figures["contact-map"]
    mesh = figure.axes[0].collections[0]
    largest = [s.contact_pressure.max() / s.pressure for s in run[0].states if s.contact_nodes]
    assert mesh.norm.vmax == pytest.approx(max(largest))
    for ratio, axes in zip(largest, figure.axes):
        assert f"largest {ratio:.3g} times" in axes.get_title("left")


def test_the_closure_curve_has_no_lines_but_its_own(run, figures):
    figure = figures["closure-curve"]
    buckled = len(run[0].buckling[:1])
    for axes in figure.axes:
        upright = [line for line in axes.lines if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2]
        assert len(upright) == buckled
        dots = [line for line in axes.lines if line.get_marker() == "o"]
        assert dots and np.allclose(dots[0].get_xdata(), [s.pressure / 1e3 for s in run[0].states])


def test_dots_of_the_closure_curve_are_the_states(run):
    """A path that comes back to pressures of another branch leaves them where they are."""
    result, needed = run[0], ("case", "supports", "states", "buckling")
    folded = SimpleNamespace(**{name: getattr(result, name) for name in needed})
    back = {"pressure": 5.5e3, "max_displacement": 1.0}
    folded.walk = [*result.walk, SimpleNamespace(**vars(result.walk[-1]) | back)]
    figure = closure_curve(folded)
    (dots,) = (line for line in figure.axes[2].lines if line.get_marker() == "o")
    assert dots.get_ydata() == pytest.approx([1e3 * state.max_displacement for state in result.states], rel=1e-12)


def test_places_of_the_table_are_in_one_unit(run):
    """The largest displacement and the passage that is left have one each."""
    column = {c.shown.title: c for c in run[0].case.replace({"project.units": "in"}).units.columns(SUMMARY) if c.shown}
    state = run[0].states[0]
    assert column["at z"].shown.unit == "in"
    assert float(column["at z"].text(state)) == pytest.approx(state.least_opening_position / 0.0254, rel=0.02)
    at = float(column["displacement"].text(state).split()[-1])
    assert at == pytest.approx(state.max_displacement_position[2] / 0.0254, rel=0.02)


def test_side_views_show_the_faces(figures):
    axes = figures["side-views"].axes[0]
    wall = next(c for c in axes.collections if c.get_label() == "wall")
    upper, lower = (path.vertices for path in wall.get_paths())
    at_lip = upper[np.isclose(upper[:, 0], upper[:, 0].min(), atol=2.0), 1]
    assert at_lip.min() < 1.0 and at_lip.max() == pytest.approx(12, abs=1.0)  # no slot of 12 mm between the lips
    assert np.allclose(lower[:, 1], -upper[:, 1])
