"""What an installer reads off steady runs: cracking pressure, measured points, operating points, comparisons."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.measured import DISCHARGE, read_measured
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.measured import FLOW, MeasuredCurve
from dbvfiv.studies.steady.figures import draw_together, left_by_line
from dbvfiv.studies.steady.study import flow_at
from tests.small_valves import SMALL, load_small, make_valve, settings

OPTIONS = settings(SMALL)
PRESSURES = ["2 kPa", "6 kPa", "12 kPa", "18 kPa"]


def results(valve, pressures=PRESSURES):
    return valve.session.replace({"steady.pressures": pressures}).perform("steady")


def rest_area() -> float:
    mesh = make_valve().mesh
    return 4 * float(mesh.rest_area[0] - mesh.wall_deduction[0])


@pytest.mark.parametrize("back", [0.0, 3e3])
@pytest.mark.parametrize("ratio", [2.0, 5.0])
def test_the_valve_is_cracked_where_its_passage_has_grown_as_stated(ratio, back):
    valve = load_small({"steady.cracking_area": ratio, "downstream.pressure": back})
    found = results(valve, [back + 6e3, back + 2e3]).cracking
    state = valve.steady(pressure=back + found.pressure)
    assert state.outlet_area == pytest.approx(ratio * rest_area(), rel=1e-3)
    assert found.head == pytest.approx(found.pressure / (1000.0 * GRAVITY))


def test_how_far_the_valve_was_found_open_does_not_move_its_cracking_head():
    """A single step from wide open to nearly shut lets the lips cross, and the state there hides the one looked for."""
    valve = dbvfiv.load("cases/dbv12-in-line.toml", SMALL)
    heads = [results(valve, [head * 1000 * GRAVITY]).cracking.head for head in (0.04, 0.5)]
    assert heads[1] == pytest.approx(heads[0], rel=1e-4) and heads[0] < 0.04


def test_a_valve_that_stays_nearly_shut_is_not_cracked():
    found = results(load_small(), [10.0])
    assert found.cracking.pressure is None and found.summary()["cracking"]["pressure"] is None
    assert "Cracking: not up to 0.01 kPa" in "\n".join(found.lines())


def test_points_have_their_coefficients_beside_the_flow(command_line):
    document = json.loads(command_line("steady", *OPTIONS, "-p", "18 kPa", "--json").out)
    (point,) = document["points"]
    found = point["hydraulics"]
    for name in ("loss_coefficient", "discharge_coefficient", "kv"):
        assert point[name] == found[name] > 0
    assert point["head"] == pytest.approx(18e3 / (1000 * GRAVITY)) and point["volume_flow"] > 0
    assert found["jet_velocity"] == point["outlet_velocity"] and found["recovered_pressure"] == 0.0
    assert document["cracking"]["area_ratio"] == 2.0 and document["cracking"]["pressure"] > 0


def test_a_pipe_behind_is_in_the_table(command_line):
    pipe = ("--set=downstream.pipe_diameter=305 mm", "--set=downstream.pressure=1 m")
    out = command_line("steady", *OPTIONS, *pipe, "-p", "3 m").out
    assert "recovered" in out and "pipe loss" in out and "Borda and Carnot" in out and "Downstream are 1 m" in out
    out = command_line("steady", *OPTIONS, "--set=downstream.pressure=1 m", "-p", "3 m").out
    assert "Free discharge" in out and "recovered" not in out.replace("nothing is recovered", "")


# -- measured points


def test_measured_points_in_any_units(tmp_path):
    file = tmp_path / "points.csv"
    for text, points in {
        "pressure [kPa], flow [L/s]\n18, 47.88\n\n29, 75.52 # thesis\n": [(18e3, 47.88), (29e3, 75.52)],
        "Q (m3/h); head (m)\n180; 2\n": [(2 * 1000 * GRAVITY, 50.0)],
        "mass flow [kg/s]\thead [mH2O]\n50\t2\n": [(2 * 1000 * GRAVITY, 50.0)],
    }.items():
        file.write_text(text)
        assert rows_of(read_measured(file)) == [pytest.approx(point, rel=1e-9) for point in points]
    file.write_text("head [m] flow [L/s]\n2 50\n")
    assert rows_of(read_measured(file, 800.0)) == [pytest.approx((2 * 800 * GRAVITY, 40.0), rel=1e-9)]


def rows_of(table):
    assert table.holds == {DISCHARGE}
    return list(zip(table.columns["pressure"], table.columns["mass_flow"]))


def test_a_missing_file_of_points():
    with pytest.raises(CaseError, match=r"steady\.measured.*which does not exist"):
        thesis_case(["steady.measured=nowhere.csv"])


def test_measured_points_beside_computed_ones(tmp_path, command_line):
    curve = {state.pressure: state.mass_flow for state in results(load_small()).states}
    file, kept = tmp_path / "points.csv", tmp_path / "run.h5"
    rows = [f"{p}, {1.1 * q}" for p, q in list(curve.items())[1:]]
    file.write_text("\n".join(["pressure [Pa], flow [kg/s]", *rows, "9e3, 20", "90e3, 150"]))
    pressures = [part for p in PRESSURES for part in ("-p", p)]
    out = command_line("steady", *OPTIONS, *pressures, f"--set=steady.measured={file}", "-o", kept).out
    assert "Measured: 5 points" in out and "at the 4 within the pressures computed" in out
    file.unlink()  # the result holds them
    result = dbvfiv.load_result(kept)
    found = result.measured.discharge
    assert found.difference[:3] == pytest.approx(1 / 1.1 - 1, rel=1e-6)
    exact = load_small().steady(pressure=9e3).mass_flow
    assert found.computed[3] == pytest.approx(exact, rel=0.02)
    assert np.isnan(found.computed[4]) and result.summary()["measured"][4]["difference"] is None
    labels = [text.get_text() for text in result.figures(["head-discharge"])["head-discharge"].axes[0].legend_.texts]
    assert "measured" in labels


def test_measured_points_at_one_pressure():
    states = results(load_small(), ["6 kPa"]).states

    def against(pressure):
        pressure = np.array(pressure)
        return MeasuredCurve(FLOW, pressure, np.full(len(pressure), 2.0), flow_at(states, pressure, 0.0))

    found = against([6e3, 7e3])
    assert found.computed[0] == states[0].mass_flow and np.isnan(found.computed[1])
    assert "none within" in against([7e3]).sentence()


# -- the line's curve, and runs beside each other


def test_a_sealed_bill_has_no_operating_point():
    """It drew a curve of no states."""
    keys = {"mesh.around": 6, "mesh.along": 8, "materials.strain_level": 0.1, "outside.fluid": "none"}
    found = results(dbvfiv.load("cases/dbv6-moulded.toml", keys), [240.0])
    assert found.case.has_line and not found.states[0].volume_flow
    assert "operating-point" not in found.drawers() and "deflection" in found.drawers()


def test_line_and_valve_cross_at_the_operating_point():
    line = {"upstream.length": 50.0, "upstream.loss": 20.0, "upstream.friction": 0.02}
    found = results(load_small(line), ["6 kPa", "18 kPa"])
    (axes,) = found.figures(["operating-point"])["operating-point"].axes
    curves = {line.get_label(): line.get_xydata() for line in axes.lines}
    valve = curves["valve and what is behind it"]
    for state in found.states:
        line = curves[f"line, {state.pressure / 1e3:g} kPa"]
        there = np.interp(1e3 * state.volume_flow, *line.T)
        assert there == pytest.approx(np.interp(1e3 * state.volume_flow, *valve.T), rel=2e-3)
        assert line[0, 1] == pytest.approx(state.pressure / (1000 * GRAVITY), rel=1e-9)
    # what a pump leaves, as far as its table goes, and a static pressure without its velocity head
    state, numbers = found.states[0], found.states[0].hydraulics
    own, share = 1e3 * state.volume_flow, (1e3 * state.volume_flow / 30.0) ** -2
    pump = found.case.replace({"upstream.pump": [[0, 3.0], [0.03, 2.6], [0.06, 1.8], [0.1, 0.3]]})
    heads = left_by_line(pump, state, np.array([0.0, 30.0, own, 101.0]))
    assert heads[1] - heads[0] == pytest.approx(2.6 - 3.0 - share * numbers.line_loss, rel=1e-9)
    assert heads[2] == pytest.approx(numbers.total_head, rel=1e-9) and np.isnan(heads[3])
    more = {"hydraulics": replace(numbers, supply_head=numbers.supply_head + 0.5), "static_head": state.static_head}
    faster = SimpleNamespace(**vars(state) | more)
    heads = left_by_line(found.case.replace({"drive.at": "line"}), faster, np.array([0.0, own]))
    assert heads == pytest.approx([numbers.supply_head, numbers.total_head + 0.5], rel=1e-9)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    kept = []
    for name, changes in {"free": {}, "pipe": {"downstream.pipe_diameter": 0.305}, "coarse": {}}.items():
        pressures = ["4 kPa", "15 kPa"] if name == "coarse" else PRESSURES
        session = load_small(changes).session.replace({"steady.pressures": pressures})
        kept.append(session.perform("steady", folder / f"{name}.h5").path)
    return kept


@pytest.mark.slow
def test_steady_runs_side_by_side(runs, command_line, tmp_path):
    figure = tmp_path / "beside.png"
    document = json.loads(command_line("compare", *runs, "-o", figure, "--json").out)
    assert figure.stat().st_size > 1000 and document["figure"] == str(figure)
    assert document["runs"][1]["label"] == "pipe_diameter 0.305"
    rows = document["comparison"]
    assert [row["pressure"] for row in rows] == [2e3, 6e3, 12e3, 18e3]
    for row, free, pipe in zip(rows, document["runs"][0]["points"], document["runs"][1]["points"]):
        assert row["volume_flow"][:2] == [free["volume_flow"], pipe["volume_flow"]]
        assert row["difference"][:2] == pytest.approx([0.0, pipe["volume_flow"] / free["volume_flow"] - 1])
    # between the states of the third run, and not beyond them
    assert rows[1]["volume_flow"][2] == pytest.approx(rows[1]["volume_flow"][0], rel=0.1)
    assert rows[0]["volume_flow"][2] is None and rows[3]["difference"][2] is None
    out = command_line("compare", *runs, "-o", figure.with_suffix("")).out
    assert f"Wrote {figure}" in " ".join(out.split())
    assert "2: pipe_diameter 0.305" in out and "2, L/s" in out and "Wrote" in out


def test_axes_hold_the_widest_of_several_runs(runs):
    read = [dbvfiv.load_result(path) for path in reversed(runs)]  # the pipe behind takes the least
    axes = draw_together(read).axes[0]
    widest = max(line.get_xdata().max() for line in axes.lines)
    assert axes.get_xlim()[0] == 0 and axes.get_xlim()[1] > widest


def test_what_cannot_be_compared(runs, misused, tmp_path):
    other = load_small({"drive.pressure": "6 kPa"}).modes(count=2, output=tmp_path / "modes.h5").path
    for files, words in (((runs[0], other), "kind 'modes'"), ((other, runs[0]), "transient, steady and closure runs")):
        misused(words, "compare", *files, "-o", tmp_path / "no.png")
    still = load_small({"drive.kind": "uniform"}).session.replace({"steady.pressures": ["1 kPa"]})
    path = still.perform("steady", tmp_path / "still.h5").path
    misused("without flow", "compare", runs[0], path, "-o", tmp_path / "no.png")
