"""Stability maps on a coarse mesh: order of columns, certificates, gaps, resume, lost workers."""

import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from dbvfiv.cli import run
from dbvfiv.results.registry import load_result
from dbvfiv.stability import resume_map, stability_map
from dbvfiv.studies import map_pool
from dbvfiv.studies.map import run_map
from dbvfiv.studies.map_column import MapColumn, MapPlan
from dbvfiv.studies.map_curves import linked
from dbvfiv.studies.observer import Observer

AXES = {
    "map.x": "pressure=1000:12000:6",
    "map.y": "density=1:1000:10:log",
    "map.curve": False,
    "map.refine": 1,
    "map.checks": 3,
}


@pytest.fixture(scope="module")
def case(coarse_case):
    return coarse_case.replace(AXES)


@pytest.fixture(scope="module")
def whole(case):
    return run_map(case)


def test_every_cell_is_certified_and_checks_agree(whole):
    assert whole.grid("certified").all()
    assert len(whole.checks) == 3 and all(check.agrees for check in whole.checks)
    unstable = whole.grid("unstable")[0]
    assert set(np.unique(unstable)) == {0, 2} and (unstable == whole.grid("counted")[0]).all()
    assert ((whole.grid("growth_rate")[0] > 0) == (unstable > 0)).all()


def test_onsets_of_columns_lie_between_cells_of_opposite_sign(whole):
    y = np.array(whole.plan.y.values)
    for column in whole.columns:
        for _, along, frequency, direction, _ in column.onsets:
            below, above = column.cells["growth_rate"][0][y < along][-1], column.cells["growth_rate"][0][y > along][0]
            assert np.sign(above - below) == direction and below * above < 0 and frequency > 10


def test_columns_are_put_in_where_onsets_vanish(whole):
    assert any(column.level == 1 for column in whole.columns)
    numbers = [len(column.onsets) for column in whole.columns]
    assert numbers != sorted(set(numbers))


def test_transposed_map_gives_the_same_cells(case, whole):
    turned = case.replace({"map.x": AXES["map.y"], "map.y": AXES["map.x"], "map.refine": 0, "map.checks": 0})
    other = run_map(turned)
    assert other.plan.transposed
    assert other.grid("growth_rate")[0].T == pytest.approx(whole.grid("growth_rate")[0], rel=1e-6, abs=1e-6)


def test_linked_curves_go_through_all_onsets(whole):
    curves = linked(whole.plan, whole.columns)
    assert sum(len(curve.x) for curve in curves) == sum(len(column.onsets) for column in whole.columns)


def test_linked_tongue_is_one_curve(case):
    plan = MapPlan.of(case)
    width = {2000.0: 0.1, 3000.0: 0.15, 4000.0: 0.1}
    columns = []
    for value in (1000.0, 2000.0, 3000.0, 4000.0, 5000.0):
        half = width.get(value)
        middle = 0.5
        onsets = (
            []
            if half is None
            else [(0, plan.value(plan.y, middle - half), 30.0, 1), (0, plan.value(plan.y, middle + half), 31.0, -1)]
        )
        columns.append(MapColumn(value, 0, {}, np.array(onsets, float).reshape(-1, 4), 0.0))
    (curve,) = linked(plan, tuple(columns))
    assert len(curve.x) == 6 and not curve.exact


def test_both_laws_and_pairs_without_the_load(coarse_case):
    both = run_map(
        coarse_case.replace(
            AXES | {"map.x": "pressure=2000:6000:2", "map.continuity": "both", "map.refine": 0, "map.checks": 2}
        )
    )
    assert both.grid("growth_rate").shape == (2, 10, 2) and both.grid("certified").all()
    pair = coarse_case.replace(AXES | {"map.x": "beta=0.001:0.004:3", "map.y": "storage=0:1:5", "map.refine": 0})
    result = run_map(pair)
    assert result.grid("certified").all() and all(check.agrees for check in result.checks)


def test_two_structural_axes(coarse_case):
    result = run_map(
        coarse_case.replace(
            AXES | {"map.x": "pressure=3000:9000:2", "map.y": "thickness=0.9:1.1:2", "map.refine": 0, "map.checks": 1}
        )
    )
    assert result.grid("certified").all() and (result.grid("how") == 1).all()


def test_a_missing_state_is_a_marked_gap(case, monkeypatch):
    from dbvfiv.errors import SolveError
    from dbvfiv.studies.steady import LoadPath

    honest = LoadPath.go_to

    def go_to(self, target):
        if abs(target - 5400) < 1:
            raise SolveError("No equilibrium was found at 5400 Pa.")
        return honest(self, target)

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    result = run_map(case)
    (failure,) = result.failures
    assert "5400" in failure
    assert np.isnan(result.grid("growth_rate")[0][:, 2]).all() and (result.grid("unstable")[0][:, 2] == -1).all()
    assert np.isfinite(result.grid("growth_rate")[0][:, [0, 1, 3, 4, 5]]).all()


class _StopAfter(Observer):
    def __init__(self, number):
        self.left, self.seen = number, []

    def item(self, result):
        self.seen.append(result.value)
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def test_an_interrupted_map_resumes_to_the_same_numbers(case, whole, tmp_path):
    path = tmp_path / "map.h5"
    first = _StopAfter(3)
    assert not stability_map(case, "valve", path, first).complete
    second = _StopAfter(100)
    result = resume_map(path, second)
    assert result.complete and not set(first.seen) & set(second.seen)
    assert result.grid("growth_rate") == pytest.approx(whole.grid("growth_rate"), rel=1e-6, abs=1e-6)
    again = load_result(path)
    assert (again.grid("unstable") == whole.grid("unstable")).all()
    assert [c.points() for c in again.curves] == [c.points() for c in result.curves]
    assert run(["resume", str(path)]) == 2  # nothing left to do


def test_json_and_figures(case, tmp_path, capsys):
    arguments = [
        f"--set={key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in AXES.items()
    ]
    mesh = ["--set=mesh.around=8", "--set=mesh.along=16", "--set=damping.alpha=0"]
    assert (
        run(["map", *arguments, *mesh, "--x", "pressure=3 kPa:8 kPa:3", "--json", "--plots", str(tmp_path / "figures")])
        == 0
    )
    import json

    document = json.loads(capsys.readouterr().out)
    assert np.shape(document["growth_rate"]) == (10, 3) == np.shape(document["unstable_count"])
    assert document["x"]["parameter"] == "pressure" and document["onset_curves"]
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {"stability-map.png", "leading-frequency.png"}


_RUN = """
import sys
from dbvfiv.cli import run
if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
"""


@pytest.mark.slow
def test_killed_run_resumes(case, whole, tmp_path):
    path, script = tmp_path / "map.h5", tmp_path / "go.py"
    script.write_text(_RUN)
    settings = [
        f"--set={key}={str(value).lower() if isinstance(value, bool) else value}" for key, value in AXES.items()
    ]
    mesh = ["--set=mesh.around=8", "--set=mesh.along=16", "--set=damping.alpha=0"]
    process = subprocess.Popen([sys.executable, str(script), "map", *settings, *mesh, "-o", str(path)], cwd=os.getcwd())
    deadline = time.time() + 240
    while time.time() < deadline:
        time.sleep(0.2)
        try:
            with h5py.File(path, "r", locking=False) as file:
                if int(file["columns"].attrs["rows"]) >= 2:
                    break
        except (OSError, KeyError, RuntimeError):
            continue
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = len(load_result(path).columns)
    assert kept >= 2
    observer = _StopAfter(100)
    result = resume_map(path, observer)
    assert len(observer.seen) == len(result.columns) - kept
    assert (result.grid("unstable") == whole.grid("unstable")).all()
    assert result.grid("growth_rate") == pytest.approx(whole.grid("growth_rate"), rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_a_killed_worker_costs_only_the_columns_in_flight(case, whole):
    killed = []

    class Killer(Observer):
        def item(self, result):
            if not killed:
                import multiprocessing

                victim = multiprocessing.active_children()[0]
                os.kill(victim.pid, signal.SIGKILL)
                killed.append(victim.pid)

    said = []
    observer = Killer()
    observer.warn = said.append
    result = run_map(case, observer, workers=2)
    assert killed and any("worker was lost" in sentence for sentence in said)
    assert not result.failures and (result.grid("unstable") == whole.grid("unstable")).all()
    assert result.grid("growth_rate") == pytest.approx(whole.grid("growth_rate"), rel=1e-6, abs=1e-6)


def test_without_mpiexec_there_is_one_process(monkeypatch):
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"):
        monkeypatch.delenv(name, raising=False)
    assert map_pool.mpi_size() == 1
    monkeypatch.setenv("PMI_SIZE", "4")
    assert map_pool.mpi_size() == 4


def test_onsets_of_columns_merge_into_a_curve_in_order():
    from dbvfiv.studies.map_curves import merged

    def at(t):
        return np.column_stack([0.5 + 0.4 * np.cos(t), 0.5 + 0.4 * np.sin(t), 30 + t])

    points, distance = merged(at(np.linspace(0, 3, 13)), at(np.array([0.4, 1.9, 2.2])))
    assert len(points) == 16 and (np.diff(points[:, 2]) > 0).all()
    assert distance < 2e-4
    _, far = merged(at(np.linspace(0, 3, 13)), at(np.array([0.4])) + [[0.1, 0.0, 0.0]])
    assert far == pytest.approx(0.1 * np.cos(0.4), rel=0.1)


@pytest.mark.slow
def test_the_continued_curve_goes_through_the_onsets_of_all_columns(case):
    result = run_map(case.replace({"map.curve": True, "map.x": "pressure=5000:8000:4", "map.refine": 0}))
    (curve,) = result.curves
    assert curve.exact and curve.mismatch < 1e-3
