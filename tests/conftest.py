"""Double precision, one thread and the compilation caches for every test; helpers for the command line."""

from __future__ import annotations

import re
from contextlib import contextmanager
from dataclasses import dataclass

import pytest
from hypothesis import HealthCheck, settings

from dbvfiv.api import Valve
from dbvfiv.studies.case import thesis_case

settings.register_profile(
    "dbvfiv", deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
settings.load_profile("dbvfiv")


def pytest_collection_modifyitems(items):
    """Put long tests first, so that no worker waits for one in the end."""
    items.sort(key=lambda item: not (item.get_closest_marker("long") or item.get_closest_marker("random")))


@dataclass(frozen=True)
class Outcome:
    """What one command line did."""

    status: int
    out: str
    err: str


@pytest.fixture
def command_line(capsys):
    """Run ``dbvfiv`` in this process and return an ``Outcome``."""
    from dbvfiv.cli import run

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        status = run([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Outcome(status, out, err)

    return call


def is_one_sentence(text: str) -> bool:
    """One line, a full stop at its end and none with a blank behind it before that; no traceback."""
    body = text.strip()
    return bool(body) and "\n" not in body and body.endswith(".") and ". " not in body and "Traceback" not in body


@pytest.fixture
def one_sentence():
    """The check that an error message is one sentence."""
    return is_one_sentence


@pytest.fixture
def refused():
    """Block that ends in an error whose message is one sentence, and matches."""

    @contextmanager
    def block(error, match=None):
        with pytest.raises(error, match=match) as caught:
            yield caught
        assert is_one_sentence(str(caught.value)), caught.value

    return block


@pytest.fixture
def misused(command_line):
    """Command line that is refused in one sentence, which has these words or matches, before anything is printed."""

    def call(words: str, *arguments: object) -> None:
        outcome = command_line(*arguments)
        assert outcome.status == 2 and outcome.out == "" and is_one_sentence(outcome.err), outcome
        assert words in outcome.err or re.search(words, outcome.err), outcome.err

    return call


COARSE = {"mesh.around": 8, "mesh.along": 16}


@pytest.fixture(scope="session")
def coarse_valve():
    """The 12-inch valve on a mesh on which a state takes a fraction of a second."""
    return Valve(thesis_case(COARSE), "dbv12")


@pytest.fixture(scope="session")
def coarse_run(coarse_valve, tmp_path_factory):
    """Three states of the coarse valve in memory; ``path`` is their result file."""
    path = tmp_path_factory.mktemp("coarse") / "coarse.h5"
    return coarse_valve.steady(pressure=[6e3, 18e3, 36e3], output=path)
