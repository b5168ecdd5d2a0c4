"""Samples on a space that they share: outcomes are those of the full matrices for the same draws, growth rates theirs
within the errors that are allowed for; whoever works and however often the run is interrupted.
"""

import multiprocessing

import numpy as np
import pytest

import dbvfiv
from dbvfiv.observer import Observer
from dbvfiv.studies.session import load_result
from dbvfiv.studies.stability.verdict import OUTCOMES
from dbvfiv.studies.uncertainty.study import PAYS
from tests.studies.work import run_under_mpi

MESH = {"mesh.around": 6, "mesh.along": 8}
LINE = "cases/dbv12-in-line.toml"
SINGLY = PAYS - 8

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["quasi-steady", pytest.param("storage", marks=pytest.mark.random)])
def valve(request):
    return dbvfiv.load(LINE, {**MESH, "drive.pressure": "2 m", "fluid.continuity": request.param})


def test_outcomes_are_those_of_the_full_matrices(valve):
    """The first samples of a longer run are those of a shorter one, which makes no space."""
    point, growth, apart = compare(valve)
    assert 0.5 * PAYS < point["shared"] <= PAYS
    assert np.median(apart / growth) < 0.01


def test_a_wall_close_to_the_pipe_around_it():
    """The added mass changes fast with the shape: samples of which first order says too little are found apart."""
    compare(dbvfiv.load("cases/dbv18.toml", {**MESH, "outside.pipe_diameter": "500 mm", "drive.pressure": 10051.8}))


def compare(valve):
    """Samples on a space beside those without: the point of the run, the sizes of growth rates, their differences."""
    shared, singly = valve.uncertainty(samples=PAYS), valve.uncertainty(samples=SINGLY)
    (point,), (before,) = shared.points, singly.points
    assert before["shared"] == 0
    value = shared.plan.values[0]
    found, known = shared.at(value), singly.at(value)
    assert np.array_equal(found["inputs"][:SINGLY], known["inputs"])
    assert [OUTCOMES[i] for i in found["outcome"][:SINGLY]] == [OUTCOMES[i] for i in known["outcome"]]
    assert np.allclose(found["opening"][:SINGLY], known["opening"], rtol=1e-8)
    apart = np.abs(found["growth_rate"][:SINGLY] - known["growth_rate"])
    assert (apart <= 0.2 * np.abs(known["growth_rate"])).all()
    return point, np.abs(known["growth_rate"]), apart


class OnSample(Observer):
    """Does something once, when a sample half way is there."""

    def __init__(self, act):
        self.act = act

    def item(self, result):
        if result == PAYS // 2:
            self.act()


def numbers(found):
    """All that a run says but that a worker was lost, with the bits of the rows of its samples."""
    rows = {name: np.asarray(column).tobytes() for name, column in found.at(found.plan.values[0]).items()}
    return {key: value for key, value in found.summary().items() if key != "warnings"} | {"rows": rows}


def assert_same(found, whole):
    """Equal to the last digit."""
    assert numbers(found) == whole


@pytest.fixture(scope="module")
def whole(valve):
    return numbers(valve.uncertainty(samples=PAYS))


def test_interruptions_change_no_number(valve, whole, tmp_path):
    def interrupt():
        raise KeyboardInterrupt

    path = tmp_path / "samples.h5"
    assert valve.uncertainty(samples=PAYS, output=path, observer=OnSample(interrupt)).interrupted
    assert_same(dbvfiv.resume(path, workers=2), whole)


def test_a_process_killed_half_way_changes_no_number(valve, whole):
    kill = OnSample(lambda: multiprocessing.active_children()[0].kill())
    assert_same(valve.uncertainty(samples=PAYS, workers=2, observer=kill), whole)


def test_a_cluster_with_a_worker_killed_half_way_changes_no_number(valve, whole, cluster):
    address, processes = cluster
    found = valve.uncertainty(samples=PAYS, workers=address, observer=OnSample(processes[0].kill))
    assert processes[0].wait(10) != 0
    assert_same(found, whole)


def test_processes_of_mpiexec_change_no_number(valve, whole, tmp_path):
    path, law = tmp_path / "samples.h5", valve.case.fluid.continuity
    keys = [f"--set={key}={value}" for key, value in MESH.items()]
    asked = ["-p", "2 m", "--law", law, "-n", str(PAYS), "-o", str(path)]
    done = run_under_mpi(2, "dbvfiv", "uncertainty", LINE, *keys, *asked)
    assert done.returncode == 0, done.stderr
    assert_same(load_result(path), whole)
