"""``dbvfiv steady``, ``plot``, ``export`` and ``info`` from the command line."""

import json
import os
import signal
import subprocess
import sys

import pytest

import dbvfiv
from dbvfiv.studies.session import Session
from tests.child import start
from tests.small_valves import THESIS_SET

COARSE = (*THESIS_SET, "--set", "mesh.around=8", "--set", "mesh.along=16")
KEYS = set(
    "pressure mass_flow outlet_area outlet_velocity max_displacement max_displacement_position lip_opening "
    "lip_displacement head volume_flow converged iterations residual".split()
)


def test_json(command_line):
    outcome = command_line("steady", "cases/dbv12.toml", *COARSE, "--pressure", "6 kPa", "-p", "18e3 Pa", "--json")
    assert outcome.status == 0 and "\r" not in outcome.err and "%|" not in outcome.err  # no bar without a terminal
    document = json.loads(outcome.out)
    points = document["points"]
    assert [point["pressure"] for point in points] == [6e3, 18e3]
    assert all(KEYS <= set(point) and point["converged"] and point["residual"] < 1e-7 for point in points)
    assert all(len(point["max_displacement_position"]) == 3 for point in points)
    flow = 1000 * points[1]["outlet_area"] * points[1]["outlet_velocity"]
    assert points[1]["mass_flow"] == pytest.approx(flow, rel=1e-6)  # whole valve in flow and area
    assert document["failures"] == [] and not document["interrupted"]


def test_table_and_file(command_line, tmp_path):
    outcome = command_line("steady", *COARSE, "-p", "6 kPa", "-o", tmp_path / "r.h5")
    assert outcome.status == 0
    assert "mass flow" in outcome.out and "kg/s" in outcome.out and "r.h5" in outcome.out
    assert outcome.err.startswith("Warning: ")  # the folded side edge of the reference valve
    result = dbvfiv.load_result(tmp_path / "r.h5")
    assert f"{result.states[0].mass_flow:.3f}" in outcome.out
    assert result.header.case.steady.pressures == (6e3,) and result.complete


@pytest.mark.parametrize(
    "toml, arguments, expected",
    [
        ("[drive]\npressure = 4e3\n[steady]\npressures = [1e3, 2e3]", [], [1e3, 2e3]),
        ("[steady]\npressures = [1e3, 2e3]", ["--set", "drive.pressure=3 kPa", "-p", "5 kPa"], [5e3]),
        ("", ["-p", "1 kPa:3 kPa:3", "-p", "4000 Pa"], [1e3, 2e3, 3e3, 4e3]),
        ("[fluid]\ndensity = 800", ["-p", "2 m", "-p", "1 mH2O:2 mH2O:2"], [15690.64, 9806.65, 19613.3]),
        ("[fluid]\ndensity = 800", ["-p", "1 m:2 m:2"], [7845.32, 15690.64]),
        ("", [], [2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3]),
    ],
)
def test_which_pressures(monkeypatch, tmp_path, command_line, toml, arguments, expected):
    asked = []
    monkeypatch.setattr(Session, "perform", lambda self, *_: asked.extend(self.case.steady.pressures) or sys.exit(0))
    (tmp_path / "a.toml").write_text(toml)
    with pytest.raises(SystemExit):
        command_line("steady", tmp_path / "a.toml", *COARSE, *arguments)
    assert asked == pytest.approx(expected)


@pytest.mark.parametrize(
    "keys, arguments, units",
    [
        ([], ["-p", "1 m", "--units", "gpm"], "m, gpm"),
        (["drive.pressure=2 m"], ["--units", "gpm"], "m, gpm"),
        ([], ["-p", "1 psi", "--units", "kPa, gpm"], "kPa, gpm"),
        (["project.units=psi, ft, gpm"], ["-p", "7 kPa"], "kPa, ft, gpm"),
        ([], ["--units", "gpm"], "gpm"),
    ],
)
def test_units_that_are_asked_for_go_together(monkeypatch, command_line, keys, arguments, units):
    seen = []
    monkeypatch.setattr(Session, "perform", lambda self, *_: seen.append(self.case.project.units) or sys.exit(0))
    with pytest.raises(SystemExit):
        command_line("steady", *COARSE, *(word for key in keys for word in ("--set", key)), *arguments)
    assert seen == [units]


def test_a_pressure_that_is_not_reached(command_line, one_sentence, tmp_path):
    hard = ("--set", "steady.max_iterations=4", "--set", "steady.min_step=1")
    outcome = command_line("steady", *COARSE, *hard, "-p", "50 Pa", "-p", "50 kPa", "-o", tmp_path / "r.h5", "--json")
    assert outcome.status == 1
    document = json.loads(outcome.out)
    assert [point["pressure"] for point in document["points"]] == [50.0] and len(document["failures"]) == 1
    last = outcome.err.strip().splitlines()[-1]
    assert one_sentence(last) and "1 of 2" in last and "Traceback" not in outcome.err
    assert "50000 Pa" in document["failures"][0]
    kept = dbvfiv.load_result(tmp_path / "r.h5")
    assert [state.pressure for state in kept.states] == [50.0] and kept.failures == tuple(document["failures"])


def test_info(command_line, coarse_run):
    outcome = command_line("info", coarse_run.path)
    assert outcome.status == 0 and "steady of dbv12, complete" in outcome.out and "8 around x 16 along" in outcome.out
    assert f"{coarse_run.states[2].mass_flow:.3f}" in outcome.out
    document = json.loads(command_line("info", coarse_run.path, "--json").out)
    assert document["kind"] == "steady" and document["points"] == coarse_run.summary()["points"]


def test_info_gives_the_case_back(command_line, coarse_run, tmp_path):
    (tmp_path / "again.toml").write_text(command_line("info", coarse_run.path, "--case").out)
    assert dbvfiv.load(tmp_path / "again.toml").case == coarse_run.header.case


def test_plot_and_export(command_line, coarse_run, tmp_path):
    outcome = command_line(
        "plot", coarse_run.path, "-o", tmp_path, "--only", "jet-velocity", "--format", "svg", "--json"
    )
    assert outcome.status == 0 and json.loads(outcome.out)["written"] == [str(tmp_path / "jet-velocity.svg")]
    outcome = command_line("export", coarse_run.path, "-o", tmp_path / "x.vtkhdf")
    assert outcome.status == 0 and (tmp_path / "x.vtkhdf").exists()
    assert command_line("export", coarse_run.path).status == 0 and coarse_run.path.with_suffix(".vtkhdf").exists()


@pytest.mark.parametrize("command", ["info", "plot", "export"])
def test_files_that_are_no_results(misused, tmp_path, command):
    (tmp_path / "a.h5").write_text("no")
    for path in (tmp_path / "a.h5", tmp_path / "none.h5", tmp_path):
        misused("", command, path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kill, status", [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow)]
)
def test_stopped_from_outside(tmp_path, one_sentence, kill, status):
    path = tmp_path / "r.h5"
    run = start("steady", *COARSE, "-p", "1 kPa:50 kPa:500", "-o", path)
    shown = [run.stdout.readline() for _ in range(5)][2:]  # head of the table, then three states
    os.kill(run.pid, kill)
    rest, err = run.communicate(timeout=60)
    rows = rest.splitlines()[:-1]
    # what is read off the states follows them
    shown += rows[: next((i for i, line in enumerate(rows) if "total head" in line), None)]
    assert run.returncode == status
    assert one_sentence(err.strip().splitlines()[-1]) and "has been kept" in err
    assert "Traceback" not in err and "MPI" not in err and "PETSC ERROR" not in err
    kept = dbvfiv.load_result(path)
    assert len(kept.states) >= 3 and not kept.complete
    assert len(kept.states) >= len([line for line in shown if line.strip()])  # what was shown has been kept


@pytest.mark.slow
def test_a_reader_that_leaves(tmp_path):
    arguments = ["steady", *COARSE, "-p", "1 kPa:50 kPa:500"]
    run = subprocess.Popen(
        [sys.executable, "-m", "dbvfiv", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    run.stdout.readline()
    run.stdout.close()
    run.wait(timeout=60)
    assert run.returncode == 1 and "MPI" not in run.stderr.read()
