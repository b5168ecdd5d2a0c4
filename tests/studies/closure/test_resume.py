"""A closure run that is stopped or killed goes on where it stood."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from dbvfiv.api import load
from dbvfiv.errors import CaseError
from dbvfiv.observer import Observer
from dbvfiv.results import load_result
from dbvfiv.resuming import resume

COARSE = {
    "mesh.around": 6,
    "mesh.along": 10,
    "closure.max_step": "3 kPa",
    "closure.start": "open",
    "closure.eigenvalues": 2,
}
PRESSURES = [4e3, 1.2e4, 2e4]


class StopAfter(Observer):
    """Interrupts as a user does: during the way to the state after `count` others."""

    def __init__(self, count: int):
        self.count = count

    def item(self, result):
        self.count -= 1

    def progress(self, text):
        if self.count == 0 and text.startswith("equilibrium"):
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def whole():
    return load(None, COARSE).closure(PRESSURES)


def agree(result, whole):
    assert result.complete and [s.pressure for s in result.states] == PRESSURES
    for a, b in zip(result.states, whole.states):
        assert np.array_equal(a.nodal, b.nodal)
        assert a.energy_balance == b.energy_balance
        assert (a.load_steps, a.iterations, a.multiplier_updates) == (b.load_steps, b.iterations, b.multiplier_updates)
    assert [vars(p) for p in result.walk] == [vars(p) for p in whole.walk]
    assert json.dumps(result.summary()) == json.dumps(whole.summary())
    assert result.warnings == whole.warnings and not result.failures


def test_an_interrupted_run_goes_on_as_if_it_had_not_been(whole, tmp_path):
    path = tmp_path / "run.h5"
    first = load(None, COARSE).closure(PRESSURES, output=path, observer=StopAfter(1))
    assert not first.complete and len(load_result(path).states) == 1
    assert len(load_result(path).walk) > len(
        [p for p in whole.walk if p.pressure <= PRESSURES[0]]
    )  # a part of the way to the next state too
    agree(resume(path), whole)
    with pytest.raises(CaseError, match="nothing to resume"):
        resume(path)


def test_a_run_interrupted_before_its_first_state_begins_anew(whole, tmp_path):
    path = tmp_path / "run.h5"
    load(None, COARSE).closure(PRESSURES, output=path, observer=StopAfter(0))
    assert not load_result(path).states
    agree(resume(path), whole)


@pytest.mark.slow
def test_a_killed_run_has_lost_no_finished_state(whole, tmp_path):
    path = tmp_path / "run.h5"
    words = [f"--set={key}={value}" for key, value in COARSE.items()]
    command = [
        sys.executable,
        "-m",
        "dbvfiv",
        "closure",
        *words,
        *(f"--pressure={p:g}" for p in PRESSURES),
        "-o",
        str(path),
    ]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    for line in run.stdout:
        if line.split()[:1] == ["4"]:
            break
    time.sleep(0.05)
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    kept = load_result(path)
    assert not kept.complete and len(kept.states) >= 1
    assert np.array_equal(kept.states[0].nodal, whole.states[0].nodal)
    agree(resume(path), whole)
