"""Interrupted and killed onset runs go on: nothing is solved twice, and the outcome is that of a run that was never
interrupted.
"""

import os
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from dbvfiv import resume
from dbvfiv.api import Valve
from dbvfiv.cli import run
from dbvfiv.errors import CaseError
from dbvfiv.observer import Observer
from dbvfiv.studies.case import THESIS
from dbvfiv.studies.onset.search import OnsetPoint
from dbvfiv.studies.session import load_result
from dbvfiv.studies.stability.samples import Sample
from tests.small_valves import FORMER


def onset(case, name="case", output=None, observer=None):
    return Valve(case, name).onset(output=output, observer=observer)


def resume_onset(path, observer=None):
    return resume(path, observer=observer)


RANGE = "pressure=4 kPa:12 kPa:5"


@pytest.fixture(scope="module")
def case(coarse_case):
    """On the mesh that the range was chosen on."""
    return coarse_case.replace({"onset.over": RANGE, "onset.normal_form": False, "fluid.density": 4.0, **FORMER})


class Watch(Observer):
    """Remembers what was found; stops the run after some of it."""

    def __init__(self, most=10**6):
        self.left, self.samples, self.points = most, [], []

    def item(self, result):
        if isinstance(result, Sample):
            self.samples.append((result.key.mesh, result.value))
        elif isinstance(result, OnsetPoint):
            self.points.append(result.key)
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def whole(case):
    watch = Watch()
    return onset(case, observer=watch), watch


def same(result, whole):
    """To the last digit."""
    assert result.complete and len(result.points) == len(whole.points) > 0
    assert all(point["confirmed"] for point in result.points)
    assert result.summary() == whole.summary()
    assert np.array_equal(result.values, whole.values) and np.array_equal(result.certified, whole.certified)
    assert np.array_equal(result.growth_rates, whole.growth_rates, equal_nan=True)
    assert np.array_equal(result.frequencies, whole.frequencies, equal_nan=True)


def test_the_run_meets_both_meshes(whole):
    result, watch = whole
    assert {mesh for mesh, _ in watch.samples} == {0, 1}
    assert all(p["uncertainty"] > 0 for p in result.points)


@pytest.mark.parametrize(
    "where", ["scan", *(pytest.param(w, marks=pytest.mark.slow) for w in ("location", "second mesh", "end"))]
)
def test_an_interrupted_run_goes_on(case, whole, tmp_path, where):
    complete, seen = whole
    fine = sum(mesh == 0 for mesh, _ in seen.samples)
    stop = {
        "scan": 2,
        "location": 8,
        "second mesh": fine + len(complete.points) + 3,
        "end": len(seen.samples) + len(seen.points) - 1,
    }[where]
    path = tmp_path / "onset.h5"
    first = Watch(stop)
    assert not onset(case, "valve", path, first).complete
    part = load_result(path)
    assert not part.complete
    assert part.points or "ended early" in part.lines()[-1]
    second = Watch()
    result = resume_onset(path, second)
    same(result, complete)
    same(load_result(path), complete)
    assert not set(first.samples) & set(second.samples)
    assert len(first.samples) + len(second.samples) == len(seen.samples)
    with pytest.raises(CaseError, match="nothing to resume"):
        resume_onset(path)


def test_a_located_point_is_in_the_file_before_its_normal_form(case, tmp_path):
    path = tmp_path / "onset.h5"
    case = case.replace({"onset.normal_form": True, "onset.coarse_mesh": 0.0})

    class Stop(Observer):
        def progress(self, text):
            if "normal form" in text:
                raise KeyboardInterrupt

    result = onset(case, "valve", path, Stop())
    assert not result.complete and len(result.points) == 1
    (point,) = load_result(path).points
    assert point["confirmed"] and point["criticality"] is None and point["first_lyapunov_coefficient"] is None


def test_failed_values_are_not_tried_again(case, tmp_path, monkeypatch):
    from dbvfiv.errors import SolveError
    from dbvfiv.model.equilibria import LoadPath

    honest, tried = LoadPath.go_to, []

    def go_to(self, target):
        if target == 12e3:
            tried.append(target)
            raise SolveError("No equilibrium was found at 12000 Pa.")
        return honest(self, target)

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    path = tmp_path / "onset.h5"
    case = case.replace({"onset.coarse_mesh": 0.0})
    assert not onset(case, "valve", path, Watch(6)).complete
    result = resume_onset(path)
    assert tried == [12e3] and result.complete and "12000 Pa" in result.failures[0]
    assert 12e3 not in result.values and len(result.points) == 1


def test_the_command_resumes(case, tmp_path, capsys):
    path = tmp_path / "onset.h5"
    onset(case.replace({"onset.coarse_mesh": 0.0}), "valve", path, Watch(3))
    assert run(["resume", str(path), "--animate", "x.gif"]) == 2
    assert "kind 'onset'" in capsys.readouterr().err
    assert run(["resume", str(path)]) == 0
    assert "stable above" in capsys.readouterr().out
    assert run(["resume", str(path)]) == 2


_RUN = """
import sys
from dbvfiv import resume
from dbvfiv.api import Valve
from dbvfiv.cli import run
if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
"""


@pytest.mark.slow
def test_a_killed_run_goes_on(whole, tmp_path):
    path, script = tmp_path / "onset.h5", tmp_path / "go.py"
    script.write_text(_RUN)
    settings = [
        *(f"{k}={v}" for k, v in (THESIS | FORMER).items()),
        "mesh.around=8",
        "mesh.along=16",
        "damping.alpha=0",
        "onset.normal_form=false",
        "fluid.density=4",
    ]
    process = subprocess.Popen(
        [sys.executable, str(script), "onset", "--over", RANGE, *(f"--set={s}" for s in settings), "-o", str(path)],
        cwd=os.getcwd(),
    )
    deadline = time.time() + 240
    while time.time() < deadline and process.poll() is None:
        time.sleep(0.02)
        try:
            with h5py.File(path, "r", swmr=True, locking=False) as file:
                if len(file["tables/samples/#"]) >= 4:
                    break
        except (OSError, KeyError, RuntimeError):
            continue
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = load_result(path)
    assert not kept.complete and len(kept.values) >= 4
    watch = Watch()
    same(resume_onset(path, watch), whole[0])
    assert not {value for mesh, value in watch.samples if mesh == 0} & set(kept.values)
