"""A valve with a flat bottom through the studies: what a half of a valve gives, keeps, draws and exports."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dbvfiv
from dbvfiv.cfd.foam import FlowCase
from dbvfiv.errors import CaseError
from dbvfiv.record.mesh import WholeValve
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.closure.figures import passage
from dbvfiv.studies.measured import WallSections, distances

FLAT = {
    "mesh.around": 6,
    "mesh.along": 10,
    "valve.lip_half_width": 0.2,
    "valve.bill_offset": 1.0,
    "damping.alpha": 0,
    "damping.beta": 1.2e-3,
    "fluid.density": 10,
}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Two states and their file."""
    path = tmp_path_factory.mktemp("flat") / "flat.h5"
    return dbvfiv.load(thesis_case(), FLAT).steady(pressure=[2e3, 4e3], output=path), path


@pytest.fixture(scope="module")
def modes(run):
    return run[0].states[1].modes(count=4, symmetry="all")


def test_flow_and_areas_are_those_of_the_whole_valve(run):
    for state in run[0].states:
        assert state.converged
        area = 2.0 * state.station_area
        assert state.outlet_area == pytest.approx(area[0], rel=1e-12)
        assert state.mass_flow == pytest.approx(10.0 * area[0] * state.outlet_velocity, rel=1e-9)


def test_a_result_file_knows_its_part(run):
    found, path = run
    again = dbvfiv.load_result(path)
    assert again.mesh.part.name == "half" and again.mesh.part is found.mesh.part
    assert [s.outlet_area for s in again.states] == [s.outlet_area for s in found.states]


def test_modes_are_those_of_two_classes(modes):
    said = json.loads(json.dumps(modes.summary()))
    assert [part["symmetry"] for part in said["classes"]] == ["S", "A"] and said["certificate"]["agrees"]
    assert {mode.symmetry for mode in modes.modes} == {"S", "A"}
    for mode in modes.modes:
        moved = np.abs(mode.area).max() + np.abs(mode.pressure).max()
        assert (moved > 0) == (mode.symmetry == "S")
    assert "sideways" in " ".join(modes.lines())


def test_fields_of_modes_have_the_parity_of_their_class(modes):
    valve = WholeValve.of(modes.mesh)
    lip = np.isclose(valve.points[:, 2], 0) & np.isclose(valve.points[:, 0], modes.case.valve.bill_shift)
    assert np.count_nonzero(lip) == 2
    for mode, step in zip(modes.modes, modes.steps(valve)):
        shape = step.point_data["mode_real"] + 1j * step.point_data["mode_imag"]
        up, down = (shape[lip & (side * valve.points[:, 1] > 0)][0] for side in (1, -1))
        sign = {"S": 1, "A": -1}[mode.symmetry]
        assert np.allclose(sign * up * [1, -1, 1], down)


def test_the_flow_in_three_dimensions_is_refused(run, refused):
    found, _ = run
    with refused(CaseError, match="half of the valve"):
        FlowCase("flat", found.mesh, found.states[0], 10.0).domain


def test_measured_points_of_either_lip_are_held_against_the_section(run):
    found, _ = run
    walls = WallSections(found.mesh, found.states)
    curve = walls.curve(4e3, None, "inner")
    assert curve[0, 1] == curve[-1, 1] == 0.0 and curve[0, 0] < 0 < curve[-1, 0]
    points = curve[3:-3] + [0.0, 1e-3]
    both = np.concatenate([points, points * [1.0, -1.0]])
    away = distances(both, curve, found.mesh.part)
    assert np.all(away < 0) and np.all(away > -1.001e-3)
    assert away[: len(points)] == pytest.approx(away[len(points) :], rel=1e-12)


@pytest.mark.slow
def test_all_figures_are_drawn(run, modes, tmp_path):
    assert len(run[0].plot(tmp_path / "steady")) > 5
    assert len(modes.plot(tmp_path / "modes")) > 3
    assert dbvfiv.load(thesis_case(), FLAT).plot(tmp_path / "valve")


@pytest.mark.slow
def test_the_energy_of_a_run_in_time_balances():
    keys = {"transient.step": 5e-4, "transient.start": "kick", "transient.kick_opening": 1e-3, "damping.beta": 0.0}
    run = dbvfiv.load(thesis_case(), FLAT | keys).transient(duration=0.05)
    h = run.history
    assert np.abs(h["balance"]).max() < 2e-3 * np.ptp(h["strain_energy"])


@pytest.mark.slow
def test_it_shuts_under_back_pressure():
    found = dbvfiv.load(thesis_case(), FLAT | {"closure.symmetry": "all"}).closure([1e3, 3e3])
    assert all(state.closed for state in found.states)
    said = json.loads(json.dumps(found.summary()))
    assert [part["symmetry"] for part in said["classes"]] == ["A"]
    for state in found.states:
        assert abs(state.force_balance) < 1e-6
    lines = passage(found).axes[0].get_lines()
    for state, line in zip(sorted(found.states, key=lambda state: state.pressure), lines):
        assert min(line.get_ydata()) == pytest.approx(max(1e6 * state.least_opening, 0.01), rel=1e-9)


@pytest.mark.slow
def test_the_onset_of_the_half_of_a_symmetric_valve_is_that_of_the_quarter():
    keys = {"mesh.around": 8, "mesh.along": 16, "onset.normal_form": False, "onset.coarse_mesh": 0}
    keys |= {"damping.alpha": 0, "damping.beta": 0.003, "drive.pressure": 6e3}
    found = [
        dbvfiv.load(thesis_case(), keys | {"mesh.part": part}).onset(over="density=10:200:4:log")
        for part in ("auto", "half")
    ]
    edges = [[point for point in one.summary()["points"] if point["edge"]] for one in found]
    assert len(edges[0]) == 1
    assert edges[1][0]["value"] == pytest.approx(edges[0][0]["value"], rel=1e-6)
    assert (edges[0][0]["symmetry"], edges[1][0]["symmetry"]) == ("SS", "S")
