"""Runs that are killed at random moments, and files that are read while they grow."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from dbvfiv.studies import KINDS


@pytest.fixture(scope="module")
def ask():
    """Requests to a process that starts and kills runs."""
    script = Path(__file__).with_name("killed_runs.py")
    with subprocess.Popen(
        [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:

        def call(**request):
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield call
        process.stdin.close()


def test_a_killed_run_loses_nothing_and_ends_with_the_same_numbers(tmp_path, ask):
    """Each kind's file is written by the same code; all kinds are killed below."""
    found = ask(kind="map", folder=str(tmp_path), kills=2, in_a_row=2, seed=KINDS.index("map"))
    assert not found["wrong"] and found["kills"] >= 2 and found["reads"] >= 5, found


@pytest.mark.slow
@pytest.mark.parametrize("kills, reads", [(3, 10), pytest.param(16, 40, marks=pytest.mark.random)])
@pytest.mark.parametrize("kind", KINDS)
def test_many_kills_and_reads(tmp_path, ask, kind, kills, reads):
    """Some 40 kills and 130 reads of all kinds together, or 200 and 500."""
    found = ask(kind=kind, folder=str(tmp_path), kills=kills, in_a_row=3, seed=100 + KINDS.index(kind))
    assert not found["wrong"] and found["kills"] >= kills, found
    seen = found["reads"]
    while seen < reads:
        folder = tmp_path / str(seen)
        folder.mkdir()
        found = ask(kind=kind, folder=str(folder), kills=0, in_a_row=1, seed=0)
        assert not found["wrong"] and found["reads"], found
        seen += found["reads"]
